//! Pins by their registers, and a bus of three pins that the processor moves itself: for a slot that is wired for SDIO, as no
//! SPI of the chip has its pins.

use stm32_metapac::GPIOA;
use stm32_metapac::gpio::{Gpio, vals};

pub use vals::Ospeedr as Speed;

/// From the registers of one port to those of the next (RM0090, table 1).
const PORT_BYTES: usize = 0x400;
/// Half a bit of a slow bus, cycles: 400 kHz at most.
const HALF_BIT_SLOW: u32 = 210;

/// A pin.
#[derive(Clone, Copy)]
pub struct Pin {
    port: Gpio,
    number: u8,
}

impl Pin {
    /// Pin `number` of a port; 0 is port A.
    pub const fn new(port: u8, number: u8) -> Self {
        let registers = GPIOA.as_ptr().wrapping_byte_add(PORT_BYTES * port as usize);
        // SAFETY: the registers of the pin's own port.
        Self { port: unsafe { Gpio::from_ptr(registers) }, number }
    }

    /// Level of an output.
    pub fn set(self, high: bool) {
        self.port.bsrr().write(|w| w.0 = 1 << if high { self.number } else { self.number + 16 });
    }

    /// Level of an input.
    pub fn is_high(self) -> bool {
        self.port.idr().read().0 >> self.number & 1 == 1
    }

    /// Makes it an output.
    pub fn output(self, high: bool, speed: Speed) {
        self.set(high);
        self.port.ospeedr().modify(|w| w.set_ospeedr(usize::from(self.number), speed));
        self.port.moder().modify(|w| w.set_moder(usize::from(self.number), vals::Moder::OUTPUT));
    }

    /// Pulls an input up.
    pub fn pull_up(self) {
        self.port.pupdr().modify(|w| w.set_pupdr(usize::from(self.number), vals::Pupdr::PULL_UP));
    }

    /// Gives it to a part of the chip (DS8626, table 9).
    pub fn alternate(self, function: u8) {
        let (number, port) = (usize::from(self.number), self.port);
        port.ospeedr().modify(|w| w.set_ospeedr(number, Speed::VERY_HIGH_SPEED));
        port.afr(number / 8).modify(|w| w.set_afr(number % 8, function));
        port.moder().modify(|w| w.set_moder(number, vals::Moder::ALTERNATE));
    }
}

/// The bus, in mode 0: DAT3 of the card is its select, CMD its input, CLK its clock, DAT0 its output (SD specification, 7.1).
///
/// A bit takes some 20 cycles of the processor, which is below the 25 MHz of a card. An interrupt only makes a bit longer.
pub struct Bus {
    clock: Pin,
    to_card: Pin,
    from_card: Pin,
    /// At most 400 kHz.
    pub is_slow: bool,
}

impl Bus {
    /// A slow one. The pins are as after a reset.
    pub fn new(clock: Pin, to_card: Pin, from_card: Pin) -> Self {
        clock.output(false, Speed::VERY_HIGH_SPEED);
        to_card.output(true, Speed::VERY_HIGH_SPEED);
        from_card.pull_up();
        Self { clock, to_card, from_card, is_slow: true }
    }

    /// Exchanges a byte.
    pub fn byte(&self, sent: u8) -> u8 {
        (0..8).rev().fold(0, |received, bit| {
            self.to_card.set(sent >> bit & 1 == 1);
            // A card wants its bit 5 ns before the clock (SD specification, 6.6.6): a cycle is 6 ns.
            cortex_m::asm::nop();
            cortex_m::asm::nop();
            self.wait();
            self.clock.set(true);
            self.wait();
            let is_high = self.from_card.is_high();
            self.clock.set(false);
            received << 1 | u8::from(is_high)
        })
    }

    fn wait(&self) {
        if self.is_slow {
            cortex_m::asm::delay(HALF_BIT_SLOW);
        }
    }
}
