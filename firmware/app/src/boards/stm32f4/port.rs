//! A port: reception into a DMA ring, transmission by DMA.
//!
//! DMA copies received bytes to a ring, which is read every millisecond. No interrupt comes per byte or on a line
//! error: the checksum detects a damaged byte, and no good byte is dropped with it.
//!
//! During an erase of flash the processor stops and DMA continues around the ring. The interrupt that counts rounds
//! then fires once for several rounds. So if bytes arrived and the ring was not read for longer than its capacity,
//! its contents count as lost.

use embassy_stm32::dma::{self, ReadableRingBuffer, Request, TransferOptions};
use embassy_stm32::interrupt::typelevel::Binding;
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac;
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{ConfigError, Instance, RxDma, TxDma, Uart, UartRx, UartTx};
use embassy_stm32::{Peri, rcc};
use embassy_time::{Duration, Instant, Timer};

use crate::boards::machine::Overrun;

/// The last two bytes of a frame take 2.1 ms at 9,600 baud, the slowest rate.
const LAST_LOOK: Duration = Duration::from_micros(100);
const LAST_LOOKS: u32 = 30;

/// Both halves of a port: reception into this ring, which is read at this interval, and transmission. `registers` must be those
/// of `T`. The channels are its own.
///
/// # Panics
/// If the clocks do not allow the port's baud rate.
pub(crate) fn halves<T: Instance, R: RxDma<T>, S: TxDma<T>>(
    port: Result<Uart<'static, Blocking>, ConfigError>,
    registers: pac::usart::Usart,
    (rx, tx): (Peri<'static, R>, Peri<'static, S>),
    irqs: impl Binding<R::Interrupt, dma::InterruptHandler<R>>
    + Binding<S::Interrupt, dma::InterruptHandler<S>>
    + 'static,
    ring: &'static mut [u8],
    fetch_every: Duration,
) -> (PortRx, PortTx) {
    let (tx_half, rx_half) = port.expect("the clocks allow this baud rate").split();
    let clock = rcc::frequency::<T>();
    let (rx_request, tx_request) = (rx.request(), tx.request());
    let (rx, tx) = (dma::Channel::new(rx, irqs), dma::Channel::new(tx, irqs));
    (
        PortRx::new(rx_half, (registers, clock), rx, ring, fetch_every, rx_request),
        PortTx::new(tx_half, (registers, clock), tx, tx_request),
    )
}

pub(crate) struct PortRx {
    /// Keeps the pin and the port's clock.
    _port: UartRx<'static, Blocking>,
    ring: ReadableRingBuffer<'static, u8>,
    registers: pac::usart::Usart,
    clock: Hertz,
    fetch_every: Duration,
    looked: Instant,
    /// The last read was full, so there may be more bytes.
    is_behind: bool,
}

impl PortRx {
    /// `channel` must serve the reception of `registers` by this `request`. `registers` must be `port`'s own, whose rate is divided from
    /// `clock`.
    fn new(
        port: UartRx<'static, Blocking>,
        (registers, clock): (pac::usart::Usart, Hertz),
        channel: dma::Channel<'static>,
        buffer: &'static mut [u8],
        fetch_every: Duration,
        request: Request,
    ) -> Self {
        let from = registers.dr().as_ptr().cast::<u8>();
        // SAFETY: `from` is the port's data register. `buffer` is a static in RAM that DMA reaches and no other code
        // uses. The ring owns the channel from here on.
        let mut ring =
            unsafe { ReadableRingBuffer::new(channel, request, from, buffer, TransferOptions::default()) };
        ring.start();
        registers.cr3().modify(|w| w.set_dmar(true));
        Self { _port: port, ring, registers, clock, fetch_every, looked: Instant::now(), is_behind: false }
    }

    /// Time to fill the ring at the current rate, ten bits a byte.
    fn holds(&self) -> Duration {
        let clocks = 10 * self.ring.capacity() as u64 * u64::from(self.registers.brr().read().0);
        Duration::from_micros(clocks * 1_000_000 / u64::from(self.clock.0))
    }
}

impl PortRx {
    /// Waits for bytes and returns at least one, at most as many as fit. Damaged bytes are included: the frame's checksum detects
    /// them.
    pub(crate) async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Overrun> {
        loop {
            // Wait also after a successful read. If a byte takes longer than a byte time, an immediate read would
            // always find another one, and less urgent tasks would never run.
            if !self.is_behind {
                Timer::at(self.looked + self.fetch_every).await;
            }
            match self.look(buffer) {
                Ok(0) => {}
                received => return received,
            }
        }
    }

    /// The bytes that have come, at most as many as fit, without waiting for one. To be called once in the ring's time.
    pub(crate) fn look(&mut self, buffer: &mut [u8]) -> Result<usize, Overrun> {
        let now = Instant::now();
        let blind = now - self.looked;
        self.looked = now;
        let read = self.ring.read(buffer);
        self.is_behind = read.as_ref().is_ok_and(|(count, _)| *count == buffer.len());
        match read {
            Ok((0, _)) => Ok(0),
            Ok((count, _)) if blind < self.holds() => Ok(count),
            Ok(_) | Err(_) => {
                self.ring.clear();
                Err(Overrun { blind_ms: blind.as_millis() as u32 })
            }
        }
    }
}

pub(crate) struct PortTx {
    /// Keeps the pin and the port's clock.
    _port: UartTx<'static, Blocking>,
    registers: pac::usart::Usart,
    clock: Hertz,
    channel: dma::Channel<'static>,
    request: Request,
}

impl PortTx {
    /// `channel` must serve the transmission of `registers` by this `request`. `registers` must be `port`'s own, whose rate is divided
    /// from `clock`.
    fn new(
        port: UartTx<'static, Blocking>,
        (registers, clock): (pac::usart::Usart, Hertz),
        channel: dma::Channel<'static>,
        request: Request,
    ) -> Self {
        registers.cr3().modify(|w| w.set_dmat(true));
        Self { _port: port, registers, clock, channel, request }
    }
}

impl PortTx {
    pub(crate) async fn transmit(&mut self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        // The end of this frame sets the bit again; as DMA does not read it, its bytes do not clear it.
        self.registers.sr().write(|w| {
            w.0 = u32::MAX;
            w.set_tc(false);
        });
        let to = self.registers.dr().as_ptr().cast::<u8>();
        // SAFETY: `to` is the port's data register. The transfer borrows `bytes`, which lie in a queue, in RAM
        // that DMA reaches, and stops when it is dropped.
        unsafe { self.channel.write(self.request, bytes, to, TransferOptions::default()) }.await;
    }

    pub(crate) fn restart(&mut self) {
        self.registers.cr1().modify(|w| w.set_te(false));
        self.registers.cr1().modify(|w| w.set_te(true));
    }

    /// Sets the port's baud rate, both ways, once the last frame has gone out.
    pub(crate) async fn set_baud(&mut self, baud: u32) {
        // 16 samples a bit; the divider has 16 bits, and is 16 at least.
        let divider = ((self.clock.0 + baud / 2) / baud.max(1)).clamp(16, u32::from(u16::MAX));
        if divider == self.registers.brr().read().0 {
            return;
        }
        // DMA is done when the port has taken the last byte of a frame. The last two bytes are then still unsent.
        for _ in 0..LAST_LOOKS {
            if self.registers.sr().read().tc() {
                break;
            }
            Timer::after(LAST_LOOK).await;
        }
        // Both halves share the divider; a byte received during the change is lost.
        self.registers.brr().write(|w| w.0 = divider);
    }
}
