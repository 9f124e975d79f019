//! What the monitor knows and decides: observations in SI units, health checks and usage.
//! Knows no MAVLink, no card and no executor; time comes in as an argument.
#![cfg_attr(not(test), no_std)]

pub mod baseline;
pub mod component;
pub mod derived;
pub mod exceedance;
pub mod exposure;
pub mod flight;
pub mod health;
pub mod latest;
pub mod lifetime;
pub mod monitor;
pub mod observation;
pub mod params;
pub mod rainflow;
pub mod status;
pub mod time;
pub mod trend;
pub mod units;
pub mod usage;
pub mod vehicle;

pub use monitor::Monitor;
