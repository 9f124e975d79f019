//! The microSD card on an SPI bus: its port; the driver is `hums_recorder::spi`.
//!
//! DMA transfers a block while the processor sleeps. After a written block the card is busy for some milliseconds and holds the
//! line low: it sends zeros (SD specification, 7.2.4). While it fetches a block for reading, the line is high. The driver polls
//! the line. After several polls in a row the processor sleeps briefly before the next one.

use core::future::Future;
use core::pin::pin;
use core::task::{Context, Waker};

use embassy_stm32::gpio::{Level, Output};
use embassy_stm32::mode::Async;
use embassy_stm32::spi::{Error, Spi, mode::Master};
use embassy_stm32::time::Hertz;
use hums_core::clock::{Instant, Span};
use hums_recorder::WaitWork;
use hums_recorder::spi::{Clock, Port, PortFailure};

use super::time;
use crate::costs::{Stage, measure};

const LOOK_BYTES: usize = 4;
/// Unsuccessful polls before the processor sleeps: some 50 µs.
const LOOKS: u32 = 16;
/// Sleep before the next poll, microseconds.
const NAP_US: u32 = 100;
/// Shorter transfers go byte by byte: DMA setup takes as long as some tens of bytes.
const DMA_BYTES_MIN: usize = 128;
/// A block takes 13 ms at the slowest clock.
const TRANSFER_MAX: Span = Span::from_millis(20);
/// RAM begins here; below is core coupled memory, which DMA does not reach.
const RAM: usize = 0x2000_0000;

/// The card's port.
pub(crate) struct SpiPort {
    bus: Spi<'static, Async, Master>,
    select: Output<'static>,
    pause: Pause,
}

pub(crate) struct Pause {
    looks: u32,
}

impl Pause {
    pub(super) const fn new() -> Self {
        Self { looks: 0 }
    }

    pub(super) fn before(&self) {
        if self.looks > LOOKS {
            time::nap(NAP_US, cortex_m::asm::wfi);
        }
    }

    pub(super) fn after(&mut self, bytes: &[u8]) {
        let is_busy = bytes.len() <= LOOK_BYTES && bytes.iter().all(|byte| *byte == 0);
        self.looks = if is_busy || *bytes == [0xFF] { self.looks.saturating_add(1) } else { 0 };
    }
}

impl SpiPort {
    /// No more before a card is identified; the bus's slowest is 328 kHz, 84 MHz by 256.
    pub(crate) const IDENTIFICATION: Hertz = Hertz(400_000);
    /// Cards take 25 MHz; the next slower clock of these chips is 21: 84 MHz by 4, or 42 by 2.
    const TRANSFER: Hertz = Hertz(21_000_000);

    /// A port in mode 0, with its select pin high.
    pub(crate) const fn new(bus: Spi<'static, Async, Master>, select: Output<'static>) -> Self {
        Self { bus, select, pause: Pause::new() }
    }
}

impl Port for SpiPort {
    fn select(&mut self, selected: bool) {
        self.select.set_level(if selected { Level::Low } else { Level::High });
    }

    fn exchange(&mut self, bytes: &mut [u8]) -> Result<(), PortFailure> {
        self.pause.before();
        if by_dma(bytes) {
            wait(self.bus.transfer_in_place(bytes), &mut || true)?;
        } else {
            self.bus.blocking_transfer_in_place(bytes).map_err(|_| PortFailure)?;
        }
        self.pause.after(bytes);
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], meanwhile: WaitWork<'_>) -> Result<(), PortFailure> {
        bytes.fill(0xFF);
        if by_dma(bytes) { wait(self.bus.transfer_in_place(bytes), meanwhile) } else { self.exchange(bytes) }
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), PortFailure> {
        if by_dma(bytes) {
            wait(self.bus.write(bytes), &mut || true)
        } else {
            self.bus.blocking_write(bytes).map_err(|_| PortFailure)
        }
    }

    fn set_clock(&mut self, clock: Clock) {
        let mut config = self.bus.get_current_config();
        config.frequency = match clock {
            Clock::Identification => Self::IDENTIFICATION,
            Clock::Transfer => Self::TRANSFER,
        };
        // Cannot fail: the bus can divide down to both clocks.
        let _ = self.bus.set_config(&config);
    }

    fn now(&self) -> Instant {
        crate::links::now()
    }
}

fn by_dma(bytes: &[u8]) -> bool {
    bytes.len() >= DMA_BYTES_MIN && bytes.as_ptr().addr() >= RAM
}

fn wait(
    transfer: impl Future<Output = Result<(), Error>>,
    meanwhile: WaitWork<'_>,
) -> Result<(), PortFailure> {
    let mut transfer = pin!(transfer);
    let mut context = Context::from_waker(Waker::noop());
    let done =
        hums_onboard::wait::until(crate::links::now() + TRANSFER_MAX, crate::links::now, |may_sleep| {
            let may_sleep = meanwhile() && may_sleep;
            // Masked: an interrupt between the two still ends the sleep and is served right after it.
            cortex_m::interrupt::free(|_| {
                let polled = transfer.as_mut().poll(&mut context);
                if polled.is_pending() && may_sleep {
                    measure(Stage::Idle, cortex_m::asm::wfi);
                }
                polled
            })
        });
    done.and_then(Result::ok).ok_or(PortFailure)
}
