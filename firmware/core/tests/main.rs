//! Scripted vehicles against the monitor, and the tables against the documents.
//!
//! One program in a package of its own, compiled without optimisation together with the monitor.

mod attitude;
mod battery_cells;
mod common;
mod crosscheck;
mod docs;
mod every_check;
mod lifetime;
mod mishap;
mod motors;
mod protect;
mod scripted_faults;
mod standing;
mod vehicles;
