//! End to end on this PC: the `hums` command as a user runs it, with recorded flights at the UART.
//!
//! Each module is one promise: what comes out of the card, what the ground station gets, what noise, hostile files, a
//! failing card and power cuts may do and may not.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

mod any_log;
mod board;
mod budget;
mod card_trouble;
mod companion;
mod downlink;
mod ending;
mod file_dates;
mod folders;
mod hostile_input;
mod live_server;
mod memory;
mod metadata;
mod noise;
mod persistence;
mod power_cut;
mod protection;
mod pull;
mod raw_device;
mod round_trip;
mod salvage;
mod second_decoder;
mod texts;
mod usage;

/// In the list of what was ignored: what was not tested is no success.
#[cfg(not(feature = "oracle"))]
#[test]
#[ignore = "comparisons with pymavlink: `cargo xtask test` runs them"]
fn comparisons_with_pymavlink() {}
