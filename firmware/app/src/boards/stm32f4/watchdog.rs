//! The watchdog of a recording. It starts early, so it also ends a hanging start. Its second is 0.68 s at its fastest oscillator
//! (47 kHz, DS8626, table 36), and the monitor feeds it every 50 ms. An erase of flash stops all code for at most 0.5 s and begins
//! with the full time.

use hums_stm32f4::watchdog::{self, Divider};

pub(super) fn start() {
    // A second of 32 kHz.
    watchdog::start(Divider::DIVIDE_BY8, 4_000);
}
