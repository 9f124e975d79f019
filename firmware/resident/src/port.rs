//! The card's port, without interrupts and DMA: an SPI of the chip, or pins that the processor moves.

use hums_core::clock::Instant;
use hums_recorder::spi::{self, Clock, PortFailed};
use stm32_metapac::gpio::vals::Ospeedr;
use stm32_metapac::spi::Spi;
use stm32_metapac::spi::vals::Br;
use stm32_metapac::{RCC, SPI1, SPI2, SPI3};

use crate::board::{CARD_SPI, CS, MISO, MOSI, SCK};
use crate::chip;

/// Half a bit before a card is identified, cycles: 400 kHz at most.
const HALF_BIT_SLOW: u32 = 210;
/// Looks for a byte of the SPI, which takes 25 µs at its slowest.
const TRIES_MAX: u32 = 100_000;

pub(crate) struct Port {
    is_slow: bool,
}

impl Port {
    /// With its select pin high.
    pub(crate) fn new() -> Self {
        // Pins of the backup domain, which some boards select the card with, allow 2 MHz only (DS8626, table 7).
        CS.output(true, Ospeedr::LOW_SPEED);
        MISO.pull_up();
        match CARD_SPI {
            1 => RCC.apb2enr().modify(|w| w.set_spi1en(true)),
            2 => RCC.apb1enr().modify(|w| w.set_spi2en(true)),
            3 => RCC.apb1enr().modify(|w| w.set_spi3en(true)),
            _ => {
                SCK.output(false, Ospeedr::VERY_HIGH_SPEED);
                MOSI.output(true, Ospeedr::VERY_HIGH_SPEED);
                return Self { is_slow: true };
            }
        }
        // DS8626, table 9.
        let function = if CARD_SPI == 3 { 6 } else { 5 };
        for pin in [SCK, MOSI, MISO] {
            pin.alternate(function);
        }
        let mut port = Self { is_slow: true };
        spi::Port::set_clock(&mut port, Clock::Identification);
        port
    }

    fn byte(&self, sent: u8) -> Result<u8, PortFailed> {
        if let Some(spi) = registers() {
            spi.dr().write(|w| w.set_dr(u16::from(sent)));
            let came = (0..TRIES_MAX).any(|_| spi.sr().read().rxne());
            return if came { Ok(spi.dr().read().dr() as u8) } else { Err(PortFailed) };
        }
        Ok((0..8).rev().fold(0, |received, bit| {
            MOSI.set(sent >> bit & 1 == 1);
            // A card wants its bit 5 ns before the clock (SD specification, 6.6.6): a cycle is 6 ns.
            cortex_m::asm::nop();
            cortex_m::asm::nop();
            self.wait();
            SCK.set(true);
            self.wait();
            let is_high = MISO.is_high();
            SCK.set(false);
            received << 1 | u8::from(is_high)
        }))
    }

    fn wait(&self) {
        if self.is_slow {
            cortex_m::asm::delay(HALF_BIT_SLOW);
        }
    }
}

const fn registers() -> Option<Spi> {
    match CARD_SPI {
        1 => Some(SPI1),
        2 => Some(SPI2),
        3 => Some(SPI3),
        _ => None,
    }
}

impl spi::Port for Port {
    fn select(&mut self, selected: bool) {
        CS.set(!selected);
    }

    fn exchange(&mut self, bytes: &mut [u8]) -> Result<(), PortFailed> {
        bytes.iter_mut().try_for_each(|byte| {
            *byte = self.byte(*byte)?;
            Ok(())
        })
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortFailed> {
        bytes.iter().try_for_each(|byte| self.byte(*byte).map(drop))
    }

    fn set_clock(&mut self, clock: Clock) {
        self.is_slow = clock == Clock::Identification;
        let Some(spi) = registers() else { return };
        // 84 MHz by 256 or 4, or 42 MHz by 128 or 2: 328 kHz or 21 MHz.
        let divider = match (self.is_slow, CARD_SPI) {
            (true, 1) => Br::DIV256,
            (true, _) => Br::DIV128,
            (false, 1) => Br::DIV4,
            (false, _) => Br::DIV2,
        };
        spi.cr1().write(|_| {});
        spi.cr1().write(|w| {
            w.set_br(divider);
            w.set_mstr(stm32_metapac::spi::vals::Mstr::MASTER);
            w.set_ssm(true);
            w.set_ssi(true);
            w.set_spe(true);
        });
    }

    fn now(&self) -> Instant {
        chip::now()
    }
}
