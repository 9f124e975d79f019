//! A card on pins that the processor moves itself ([`hums_stm32f4::pins`]).

use embassy_stm32::Peri;
use embassy_stm32::gpio::{self, Level, Output};
use hums_core::clock::Instant;
use hums_recorder::spi::{Clock, Port, PortFailure};
use hums_stm32f4::pins::{Bus, Pin};

use super::card::Pause;

/// The card's port.
pub(crate) struct PinPort {
    select: Output<'static>,
    bus: Bus,
    pause: Pause,
}

impl PinPort {
    #[expect(clippy::needless_pass_by_value, reason = "nothing else may use the pins")]
    pub(crate) fn new(
        sck: Peri<'static, impl gpio::Pin>,
        mosi: Peri<'static, impl gpio::Pin>,
        miso: Peri<'static, impl gpio::Pin>,
        select: Output<'static>,
    ) -> Self {
        let bus = Bus::new(pin(&*sck), pin(&*mosi), pin(&*miso));
        Self { select, bus, pause: Pause::new() }
    }
}

fn pin(pin: &impl gpio::Pin) -> Pin {
    Pin::new(pin.port(), pin.pin())
}

impl Port for PinPort {
    fn select(&mut self, selected: bool) {
        self.select.set_level(if selected { Level::Low } else { Level::High });
    }

    fn exchange(&mut self, bytes: &mut [u8]) -> Result<(), PortFailure> {
        self.pause.before();
        for byte in &mut *bytes {
            *byte = self.bus.byte(*byte);
        }
        self.pause.after(bytes);
        Ok(())
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortFailure> {
        for byte in bytes {
            self.bus.byte(*byte);
        }
        Ok(())
    }

    fn set_clock(&mut self, clock: Clock) {
        self.bus.is_slow = clock == Clock::Identification;
    }

    fn now(&self) -> Instant {
        crate::links::now()
    }
}
