//! Scripted vehicles against the monitor, and what the tables say against the documents.
//!
//! One program, in a package of its own: it is compiled without optimisation, the monitor that it tests with it.

mod attitude;
mod cells;
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
