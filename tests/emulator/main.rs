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

/// Said past the test harness, which would keep it to itself: what was not tested is no success.
#[cfg(not(feature = "emulator"))]
#[test]
fn notice_that_the_emulators_tests_are_left_out() {
    use std::io::Write as _;
    writeln!(
        std::io::stderr(),
        "LEFT OUT: all tests of the firmware in the emulator; `cargo xtask test` runs them"
    )
    .unwrap();
}
