//! The board's pins, from its file in `boards/`.

use core::sync::atomic::{AtomicBool, Ordering};

use hums_core::clock::Instant;
use stm32_metapac::gpio::{Gpio, vals};
use stm32_metapac::{GPIOA, RCC};

use crate::chip;

include!(concat!(env!("OUT_DIR"), "/board.rs"));

/// Number of the card's SPI; 0: the processor moves its pins.
pub(crate) const CARD_SPI: u8 = SPI;

/// From the registers of one port to those of the next (RM0090, table 1).
const PORT_BYTES: usize = 0x400;
/// A pin of the debug port becomes the LED's so long after the start, so that a probe can connect before.
const PROBE_MS: u64 = 1_000;
/// A turn of the pattern without an application: three blinks and a pause.
const PATTERN_MS: u64 = 3_000;

/// A pin.
#[derive(Clone, Copy)]
pub(crate) struct Pin {
    port: u8,
    number: u8,
}

impl Pin {
    pub(crate) fn port(self) -> Gpio {
        let registers = GPIOA.as_ptr().wrapping_byte_add(PORT_BYTES * usize::from(self.port));
        // SAFETY: the registers of the pin's own port.
        unsafe { Gpio::from_ptr(registers) }
    }

    pub(crate) fn set(self, high: bool) {
        self.port().bsrr().write(|w| w.0 = 1 << if high { self.number } else { self.number + 16 });
    }

    pub(crate) fn is_high(self) -> bool {
        self.port().idr().read().0 >> self.number & 1 == 1
    }

    pub(crate) fn output(self, high: bool, speed: vals::Ospeedr) {
        self.set(high);
        self.port().ospeedr().modify(|w| w.set_ospeedr(usize::from(self.number), speed));
        self.port().moder().modify(|w| w.set_moder(usize::from(self.number), vals::Moder::OUTPUT));
    }

    pub(crate) fn pull_up(self) {
        self.port().pupdr().modify(|w| w.set_pupdr(usize::from(self.number), vals::Pupdr::PULL_UP));
    }

    pub(crate) fn alternate(self, function: u8) {
        let (number, port) = (usize::from(self.number), self.port());
        port.ospeedr().modify(|w| w.set_ospeedr(number, vals::Ospeedr::VERY_HIGH_SPEED));
        port.afr(number / 8).modify(|w| w.set_afr(number % 8, function));
        port.moder().modify(|w| w.set_moder(number, vals::Moder::ALTERNATE));
    }
}

/// Before the first clock to the card: a selected part on its bus would answer for it.
pub(crate) fn hold() {
    RCC.ahb1enr().modify(|w| {
        w.set_gpioaen(true);
        w.set_gpioben(true);
        w.set_gpiocen(true);
        w.set_gpioden(true);
    });
    for pin in HIGH {
        pin.output(true, vals::Ospeedr::LOW_SPEED);
    }
    for pin in LOW {
        pin.output(false, vals::Ospeedr::LOW_SPEED);
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
        LED.output(lit == LED_LIT, vals::Ospeedr::LOW_SPEED);
    }
}
