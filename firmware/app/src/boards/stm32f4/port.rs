//! A port: reception into a DMA ring, transmission by DMA.
//!
//! Reception is copied by DMA and fetched every millisecond: no interrupt a byte, none on a line error (a damaged byte
//! is for the checksum to find), so that not one good byte is thrown away with a bad one.
//!
//! While the processor stands still for an erase of flash, DMA goes round in the ring, and what counts its rounds is an interrupt
//! that comes once for all of them. So a ring that nobody looked into for longer than it holds is lost as soon as anything came.

use embassy_stm32::dma::{self, ReadableRingBuffer, Request, TransferOptions};
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac;
use embassy_stm32::usart::{UartRx, UartTx};
use embassy_time::{Duration, Instant, Timer};

use crate::boards::machine::{Overrun, Receive, Transmit};

/// A port's reception: a DMA ring.
pub(crate) struct PortRx {
    /// Keeps the pin and the port's clock.
    _port: UartRx<'static, Blocking>,
    ring: ReadableRingBuffer<'static, u8>,
    registers: pac::usart::Usart,
    /// What the port's rate is divided from, in Hz.
    clock: u64,
    fetch_every: Duration,
    looked: Instant,
    /// The last look took as much as it could: there may be more.
    is_behind: bool,
}

impl PortRx {
    /// `channel` must be the one that serves the reception of `registers`, which must be `port`'s own and set to `baud`, by this
    /// `request`.
    pub(crate) fn new(
        port: UartRx<'static, Blocking>,
        (registers, baud): (pac::usart::Usart, u32),
        channel: dma::Channel<'static>,
        buffer: &'static mut [u8],
        fetch_every: Duration,
        request: Request,
    ) -> Self {
        let from = registers.dr().as_ptr().cast::<u8>();
        // SAFETY: `from` is the port's data register, `buffer` is a static in RAM that DMA reaches and that nobody else
        // has, and the channel is owned by the ring from here on.
        let mut ring =
            unsafe { ReadableRingBuffer::new(channel, request, from, buffer, TransferOptions::default()) };
        ring.start();
        registers.cr3().modify(|w| w.set_dmar(true));
        let clock = u64::from(baud) * u64::from(registers.brr().read().0);
        Self { _port: port, ring, registers, clock, fetch_every, looked: Instant::now(), is_behind: false }
    }

    /// How long it takes to fill the ring at the port's rate of now: ten bits a byte.
    fn holds(&self) -> Duration {
        let clocks = 10 * self.ring.capacity() as u64 * u64::from(self.registers.brr().read().0);
        Duration::from_micros(clocks * 1_000_000 / self.clock.max(1))
    }
}

impl Receive for PortRx {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Overrun> {
        loop {
            // Also after a look that found something: as soon as what is done with a byte takes longer than the next one needs to
            // come, whoever looks again at once finds something each time, and nobody less urgent ever runs again.
            if !self.is_behind {
                Timer::at(self.looked + self.fetch_every).await;
            }
            let now = Instant::now();
            let blind = now - self.looked;
            self.looked = now;
            let read = self.ring.read(buffer);
            self.is_behind = read.as_ref().is_ok_and(|(count, _)| *count == buffer.len());
            match read {
                Ok((0, _)) => {}
                Ok((count, _)) if blind < self.holds() => return Ok(count),
                Ok(_) | Err(_) => {
                    self.ring.clear();
                    return Err(Overrun { blind_ms: blind.as_millis() as u32 });
                }
            }
        }
    }
}

/// A port's transmission, by DMA.
pub(crate) struct PortTx {
    port: UartTx<'static, Blocking>,
    registers: pac::usart::Usart,
    channel: dma::Channel<'static>,
    request: Request,
    baud: u32,
}

impl PortTx {
    /// `channel` must be the one that serves the transmission of `registers`, which must be `port`'s own and set to `baud`, by this
    /// `request`.
    pub(crate) fn new(
        port: UartTx<'static, Blocking>,
        (registers, baud): (pac::usart::Usart, u32),
        channel: dma::Channel<'static>,
        request: Request,
    ) -> Self {
        registers.cr3().modify(|w| w.set_dmat(true));
        Self { port, registers, channel, request, baud }
    }
}

impl Transmit for PortTx {
    async fn transmit(&mut self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        let to = self.registers.dr().as_ptr().cast::<u8>();
        // SAFETY: `to` is the port's data register. The transfer borrows `bytes`, which lie in a task's memory, in RAM
        // that DMA reaches, and stops when it is dropped.
        unsafe { self.channel.write(self.request, bytes, to, TransferOptions::default()) }.await;
    }

    fn restart(&mut self) {
        self.registers.cr1().modify(|w| w.set_te(false));
        self.registers.cr1().modify(|w| w.set_te(true));
    }

    fn set_baud(&mut self, baud: u32) {
        // Both halves share the divider, and a byte that comes while it is set is lost. A rate that the clock cannot give changes nothing.
        if baud != self.baud && self.port.set_baudrate(baud).is_err() {
            defmt::warn!("a port cannot run at {=u32} baud", baud);
        }
        self.baud = baud;
    }
}
