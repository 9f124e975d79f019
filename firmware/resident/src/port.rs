//! The card's port, without interrupts and DMA: an SPI of the chip, or pins that the processor moves.

use hums_core::clock::Instant;
use hums_recorder::spi::{self, Clock, PortFailure};
use hums_stm32f4::pins::{Bus, Speed};
use stm32_metapac::spi::Spi;
use stm32_metapac::spi::vals::Br;
use stm32_metapac::{RCC, SPI1, SPI2, SPI3};

use crate::board::{CARD_SPI, CS, MISO, MOSI, SCK};
use crate::chip;

/// Looks for a byte of the SPI, which takes 25 µs at its slowest.
const TRIES_MAX: u32 = 100_000;

pub(crate) struct Port {
    /// Without an SPI.
    bus: Option<Bus>,
}

impl Port {
    /// With its select pin high.
    pub(crate) fn new() -> Self {
        // Pins of the backup domain, which some boards select the card with, allow 2 MHz only (DS8626, table 7).
        CS.output(true, Speed::LOW_SPEED);
        match CARD_SPI {
            1 => RCC.apb2enr().modify(|w| w.set_spi1en(true)),
            2 => RCC.apb1enr().modify(|w| w.set_spi2en(true)),
            3 => RCC.apb1enr().modify(|w| w.set_spi3en(true)),
            _ => return Self { bus: Some(Bus::new(SCK, MOSI, MISO)) },
        }
        MISO.pull_up();
        // DS8626, table 9.
        let function = if CARD_SPI == 3 { 6 } else { 5 };
        for pin in [SCK, MOSI, MISO] {
            pin.alternate(function);
        }
        let mut port = Self { bus: None };
        spi::Port::set_clock(&mut port, Clock::Identification);
        port
    }

    fn byte(&self, sent: u8) -> Result<u8, PortFailure> {
        if let Some(bus) = &self.bus {
            return Ok(bus.byte(sent));
        }
        let spi = registers().ok_or(PortFailure)?;
        spi.dr().write(|w| w.set_dr(u16::from(sent)));
        let came = (0..TRIES_MAX).any(|_| spi.sr().read().rxne());
        if came { Ok(spi.dr().read().dr() as u8) } else { Err(PortFailure) }
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

    fn exchange(&mut self, bytes: &mut [u8]) -> Result<(), PortFailure> {
        bytes.iter_mut().try_for_each(|byte| {
            *byte = self.byte(*byte)?;
            Ok(())
        })
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortFailure> {
        bytes.iter().try_for_each(|byte| self.byte(*byte).map(drop))
    }

    fn set_clock(&mut self, clock: Clock) {
        let is_slow = clock == Clock::Identification;
        if let Some(bus) = &mut self.bus {
            bus.is_slow = is_slow;
        }
        let Some(spi) = registers() else { return };
        // 84 MHz by 256 or 4, or 42 MHz by 128 or 2: 328 kHz or 21 MHz.
        let divider = match (is_slow, CARD_SPI) {
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
