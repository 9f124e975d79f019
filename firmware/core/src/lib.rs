//! What the monitor knows and decides: observations in SI units, health checks and usage.
//! Knows no MAVLink, no card and no executor; time comes in as an argument.
#![cfg_attr(not(test), no_std)]

pub mod alert;
mod apart;
pub mod baseline;
mod bytes;
pub mod cause;
pub mod cells;
mod charge;
pub mod clock;
pub mod component;
mod crosscheck;
mod currents;
mod departure;
pub mod derived;
mod drawn;
pub mod election;
pub mod exposure;
pub mod flight;
mod geometry;
pub mod half;
pub mod happening;
mod heading;
pub mod health;
mod heights;
mod imu_gnss;
pub mod inertial;
mod latest;
pub mod lifetime;
pub mod mishap;
mod modes;
pub mod monitor;
pub mod motion;
pub mod observation;
mod outputs;
mod pairs;
pub mod param_words;
pub mod params;
pub mod protect;
mod rainflow;
mod response;
mod rotation;
mod second;
mod shaking;
pub mod snapshot;
pub mod status;
mod steady;
mod stuck;
pub mod time;
mod travel;
mod trend;
mod trends;
pub mod units;
pub mod usage;
pub mod vehicle;

pub use monitor::Monitor;
