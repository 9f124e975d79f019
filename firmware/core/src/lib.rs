//! The monitor's knowledge and decisions: observations in SI units, health checks and usage. Without MAVLink, card or
//! executor; time comes in as an argument.
#![cfg_attr(not(test), no_std)]

#[macro_use]
mod initial;
#[macro_use]
mod numbered;

mod adaptive_baseline;
mod ahrs2_residual;
pub mod alert;
mod apart;
mod baro_gnss;
pub mod battery_cells;
mod battery_charge;
mod bytes;
pub mod cause;
pub mod clock;
pub mod component;
mod crosscheck;
pub mod derived;
pub mod election;
pub mod exposure;
pub mod figures;
pub mod flight;
mod gates;
mod gnss_constellation;
mod gnss_velocity_residual;
pub mod happening;
pub mod health;
mod imu_gnss;
pub mod inertial;
pub mod latest;
pub mod lifetime;
mod mag_heading_residual;
pub mod mishap;
pub mod modes;
pub mod monitor;
pub mod motion;
mod motors;
pub mod observation;
mod outputs;
mod pairs;
pub mod parameters;
mod power_draw;
mod pressure;
pub mod protect;
mod rainflow;
mod rate_tracking;
mod residual;
mod rotation;
pub mod status;
mod stuck;
mod thrust;
pub mod time;
mod trend;
pub mod units;
pub mod usage;
pub mod vehicle;

pub use bytes::fnv1a;
pub use monitor::Monitor;
