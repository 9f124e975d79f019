//! The board's pins, from its file in `boards/`.

use core::sync::atomic::{AtomicBool, Ordering};

use hums_core::clock::Instant;
use hums_stm32f4::pins::{Pin, Speed};
use stm32_metapac::RCC;

use crate::chip;

include!(concat!(env!("OUT_DIR"), "/board.rs"));

/// Number of the card's SPI; 0: the processor moves its pins.
pub(crate) const CARD_SPI: u8 = SPI;

/// A pin of the debug port becomes the LED's so long after the start, so that a probe can connect before.
const PROBE_MS: u64 = 1_000;
/// A turn of the pattern without an application: three blinks and a pause.
const PATTERN_MS: u64 = 3_000;

/// Before the first clock to the card: a selected part on its bus would answer for it.
pub(crate) fn hold() {
    RCC.ahb1enr().modify(|w| {
        w.set_gpioaen(true);
        w.set_gpioben(true);
        w.set_gpiocen(true);
        w.set_gpioden(true);
    });
    for pin in HIGH {
        pin.output(true, Speed::LOW_SPEED);
    }
    for pin in LOW {
        pin.output(false, Speed::LOW_SPEED);
    }
    for pin in PULLED {
        pin.pull_up();
    }
}

/// While it works, the LED flickers.
pub(crate) fn show_progress() {
    static LIT: AtomicBool = AtomicBool::new(false);
    let lit = !LIT.load(Ordering::Relaxed);
    LIT.store(lit, Ordering::Relaxed);
    show(lit);
}

/// Without an application: three blinks, then a pause.
pub(crate) fn show_waiting() {
    let part = chip::now().as_millis() % PATTERN_MS / 250;
    show(matches!(part, 0 | 2 | 4));
}

fn show(lit: bool) {
    if !LED_WAITS || chip::now() >= Instant::from_millis(PROBE_MS) {
        LED.output(lit == LED_LIT, Speed::LOW_SPEED);
    }
}
