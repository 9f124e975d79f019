//! A card on pins that the processor moves itself, for a slot that is wired for SDIO: no SPI of the chip has its pins.
//!
//! The card is in SPI mode: DAT3 is its select, CMD its input, CLK its clock, DAT0 its output (SD specification, 7.1). A bit takes
//! some 20 cycles of the processor, which is below the 25 MHz of a card. An interrupt only makes a bit longer.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Input, Level, Output, Pin, Pull, Speed};
use embassy_stm32::pac::{self, gpio::Gpio};
use hums_core::clock::Instant;
use hums_recorder::spi::{Clock, Port, PortFailed};

use super::card::Pause;

/// Half a bit before a card is identified, cycles: 400 kHz at most.
const HALF_BIT_SLOW: u32 = 210;

/// From the registers of one port to those of the next (RM0090, table 1).
const PORT_BYTES: usize = 0x400;

/// The card's port.
pub(crate) struct PinPort {
    select: Output<'static>,
    clock: Line,
    to_card: Line,
    from_card: Line,
    is_slow: bool,
    pause: Pause,
}

/// A pin by its registers: two of them change within a bit.
#[derive(Clone, Copy)]
struct Line {
    port: Gpio,
    bit: u32,
}

impl Line {
    fn of(pin: &impl Pin) -> Self {
        let registers = pac::GPIOA.as_ptr().wrapping_byte_add(PORT_BYTES * usize::from(pin.port()));
        // SAFETY: the registers of the pin's own port.
        Self { port: unsafe { Gpio::from_ptr(registers) }, bit: 1 << pin.pin() }
    }

    fn set(self, high: bool) {
        self.port.bsrr().write(|w| w.0 = if high { self.bit } else { self.bit << 16 });
    }
}

impl PinPort {
    /// A port in mode 0, with its select pin high.
    pub(crate) fn new(
        sck: Peri<'static, impl Pin>,
        mosi: Peri<'static, impl Pin>,
        miso: Peri<'static, impl Pin>,
        select: Output<'static>,
    ) -> Self {
        let (clock, to_card, from_card) = (Line::of(&*sck), Line::of(&*mosi), Line::of(&*miso));
        core::mem::forget(Output::new(sck, Level::Low, Speed::VeryHigh));
        core::mem::forget(Output::new(mosi, Level::High, Speed::VeryHigh));
        core::mem::forget(Input::new(miso, Pull::Up));
        Self { select, clock, to_card, from_card, is_slow: true, pause: Pause::new() }
    }

    fn byte(&self, sent: u8) -> u8 {
        (0..8).rev().fold(0, |received, bit| {
            self.to_card.set(sent >> bit & 1 == 1);
            // A card wants its bit 5 ns before the clock (SD specification, 6.6.6): a cycle is 6 ns.
            cortex_m::asm::nop();
            cortex_m::asm::nop();
            self.wait();
            self.clock.set(true);
            self.wait();
            let is_high = self.from_card.port.idr().read().0 & self.from_card.bit != 0;
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

impl Port for PinPort {
    fn select(&mut self, selected: bool) {
        self.select.set_level(if selected { Level::Low } else { Level::High });
    }

    fn exchange(&mut self, bytes: &mut [u8]) -> Result<(), PortFailed> {
        self.pause.before();
        for byte in &mut *bytes {
            *byte = self.byte(*byte);
        }
        self.pause.after(bytes);
        Ok(())
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortFailed> {
        for byte in bytes {
            self.byte(*byte);
        }
        Ok(())
    }

    fn set_clock(&mut self, clock: Clock) {
        self.is_slow = clock == Clock::Identification;
    }

    fn now(&self) -> Instant {
        crate::links::now()
    }
}
