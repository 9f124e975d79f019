//! One true random number, if the generator works.

use embassy_stm32::pac::RNG;
use embassy_stm32::{peripherals, rcc};

/// Looks for a number, which takes 40 clocks of 48 MHz (RM0090, 24.3): some hundred times as many.
const TRIES_MAX: u32 = 2_000;

pub(crate) fn number() -> Option<u32> {
    rcc::enable_and_reset::<peripherals::RNG>();
    RNG.cr().write(|w| w.set_rngen(true));
    // The first is to be dropped (RM0090, 24.3.1).
    let _ = next();
    let number = next();
    RNG.cr().write(|w| w.set_rngen(false));
    number
}

fn next() -> Option<u32> {
    let done = (0..TRIES_MAX).any(|_| {
        let status = RNG.sr().read();
        status.drdy() && !status.seis() && !status.ceis()
    });
    done.then(|| RNG.dr().read())
}
