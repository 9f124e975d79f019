//! End to end with the real firmware image on the emulated STM32F405: the same promises as on this PC, and both machines
//! leave the same log.
//!
//! The emulated UART takes some 180 kB/s on an idle core, so a flight takes five to twenty seconds. Without the feature `emulator` nothing of
//! this is built: `cargo xtask test` turns it on.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[cfg(feature = "emulator")]
mod faults;
#[cfg(feature = "emulator")]
mod flights;
#[cfg(feature = "emulator")]
mod persistence;

/// In the list of what was ignored: what was not tested is no success.
#[cfg(not(feature = "emulator"))]
#[test]
#[ignore = "the firmware in the emulator: `cargo xtask test` runs it"]
fn the_firmware_in_the_emulator() {}
