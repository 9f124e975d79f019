//! STM32F405RG with an 8 MHz crystal: the Olimex STM32-H405 as it is, or any board with the same pins.
//!
//! | pin | what | remark |
//! |---|---|---|
//! | PA10 | USART1 RX, from the autopilot's TELEM TX | DMA2 stream 2, ring of [`RING_BYTES`] |
//! | PA9 | USART1 TX, to the autopilot's TELEM RX | DMA2 stream 7 |
//! | PA2 | USART2 TX, to the ground station's radio | DMA1 stream 6 |
//! | PA3 | USART2 RX, from the radio | DMA1 stream 5, ring of [`GS_RING_BYTES`] |
//! | PA4, PA5, PA6, PA7 | microSD CS, SCK, MISO, MOSI (SPI1) | 400 kHz, then 21 MHz; MISO pulled up |
//! | PC12 | LED, lit when low | |
//!
//! Reception is copied by DMA and fetched every millisecond: no interrupt a byte, none on a line error (a damaged byte
//! is for the checksum to find), so that not one good byte is thrown away with a bad one.

#[path = "stm32f4/card.rs"]
mod card;
mod flash;

use cortex_m::peripheral::DWT;
use embassy_stm32::dma::{self, ReadableRingBuffer, Request, TransferOptions};
use embassy_stm32::flash::Flash;
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::mode::Blocking;
use embassy_stm32::peripherals::{DMA1_CH5, DMA1_CH6, DMA2_CH2, DMA2_CH7, IWDG, RNG};
use embassy_stm32::rng::{self, Rng};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::usart::{self, Uart, UartRx, UartTx};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{bind_interrupts, pac, rcc};
use embassy_time::{Duration, Timer};
use static_cell::ConstStaticCell;

use super::{Boot, Overrun, Receive, ResetCause, Transmit};
use crate::costs::Stage;
use crate::report::Report;

pub(crate) use card::Card;
use card::CardPort;
pub(crate) use flash::StoreFlash;

use defmt_rtt as _;

/// The board's name.
pub(crate) const NAME: &str = "f405";

/// The crystal.
const HSE: Hertz = Hertz(8_000_000);
/// Baud rate of the autopilot's port until a parameter sets it.
const AUTOPILOT_BAUD: u32 = 921_600;
/// Baud rate of the ground station's port: the radios' usual one.
const GS_BAUD: u32 = 57_600;
/// 44 ms at 921,600 baud, where reception comes every millisecond: it may be kept away 40 times as long.
const RING_BYTES: usize = 4_096;
/// How often reception looks into the ring: the resolution of arrival times in the log.
const FETCH_EVERY: Duration = Duration::from_millis(1);
/// 88 ms at 57,600 baud.
const GS_RING_BYTES: usize = 512;
/// How often the uplink looks into its ring: nobody there is in a hurry.
const GS_FETCH_EVERY: Duration = Duration::from_millis(10);
/// The watchdog's time. The monitor feeds it every 50 ms.
const WATCHDOG_US: u32 = 1_000_000;

bind_interrupts!(struct Irqs {
    DMA2_STREAM2 => dma::InterruptHandler<DMA2_CH2>;
    DMA2_STREAM7 => dma::InterruptHandler<DMA2_CH7>;
    DMA1_STREAM5 => dma::InterruptHandler<DMA1_CH5>;
    DMA1_STREAM6 => dma::InterruptHandler<DMA1_CH6>;
    RNG => rng::InterruptHandler<RNG>;
});

static RING: ConstStaticCell<[u8; RING_BYTES]> = ConstStaticCell::new([0; RING_BYTES]);
static GS_RING: ConstStaticCell<[u8; GS_RING_BYTES]> = ConstStaticCell::new([0; GS_RING_BYTES]);

/// What both ports' channels are called on all four streams (RM0090, tables 42 and 43).
const USART_REQUEST: Request = 4;

/// Reception from the autopilot.
pub(crate) type AutopilotRx = PortRx;
/// Transmission to the autopilot.
pub(crate) type AutopilotTx = PortTx;
/// Reception from the ground station.
pub(crate) type GsRx = PortRx;
/// Transmission to the ground station.
pub(crate) type GsTx = PortTx;

/// What the app gets.
pub(crate) struct Parts {
    pub(crate) autopilot: (AutopilotRx, AutopilotTx),
    pub(crate) gs: (GsRx, GsTx),
    pub(crate) card: Card,
    pub(crate) store: Option<StoreFlash>,
    pub(crate) led: Led,
    pub(crate) watchdog: Watchdog,
    pub(crate) idle: Idle,
    pub(crate) boot: Boot,
}

/// RAM survives a reset by itself.
pub(crate) const fn remember() {}

/// Starts clocks, ports and card. The watchdog runs from its first feeding on.
pub(crate) fn take() -> Parts {
    let (cause, cause_register) = reset_cause();
    let p = embassy_stm32::init(clocks());
    if let Some(mut core) = cortex_m::Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }

    let mut line = usart::Config::default();
    line.baudrate = AUTOPILOT_BAUD;
    let port =
        Uart::new_blocking(p.USART1, p.PA10, p.PA9, line).expect("the clocks allow this baud rate").split();
    let autopilot = (
        PortRx::new(port.1, pac::USART1, dma::Channel::new(p.DMA2_CH2, Irqs), RING.take(), FETCH_EVERY),
        PortTx::new(port.0, pac::USART1, dma::Channel::new(p.DMA2_CH7, Irqs)),
    );
    line.baudrate = GS_BAUD;
    let port =
        Uart::new_blocking(p.USART2, p.PA3, p.PA2, line).expect("the clocks allow this baud rate").split();
    let gs = (
        PortRx::new(port.1, pac::USART2, dma::Channel::new(p.DMA1_CH5, Irqs), GS_RING.take(), GS_FETCH_EVERY),
        PortTx::new(port.0, pac::USART2, dma::Channel::new(p.DMA1_CH6, Irqs)),
    );

    let mut bus = spi::Config::default();
    bus.frequency = CardPort::IDENTIFICATION;
    bus.miso_pull = Pull::Up;
    let bus = Spi::new_blocking(p.SPI1, p.PA5, p.PA7, p.PA6, bus);
    let select = Output::new(p.PA4, Level::High, Speed::VeryHigh);

    Parts {
        autopilot,
        gs,
        card: Card::new(CardPort::new(bus, select)),
        store: Some(StoreFlash::new(Flash::new_blocking(p.FLASH))),
        led: Led(Output::new(p.PC12, Level::High, Speed::Low)),
        watchdog: Watchdog { timer: IndependentWatchdog::new(p.IWDG, WATCHDOG_US), running: false },
        idle: Idle(()),
        boot: Boot {
            id: embassy_stm32::uid::uid(),
            cause,
            cause_register,
            entropy: Rng::new(p.RNG, Irqs).next_u32(),
        },
    }
}

/// 168 MHz from the crystal: 8 / 4 * 168 / 2; the peripheral buses at 42 and 84 MHz.
fn clocks() -> embassy_stm32::Config {
    let mut config = embassy_stm32::Config::default();
    config.rcc.hse = Some(rcc::Hse { freq: HSE, mode: rcc::HseMode::Oscillator });
    config.rcc.pll_src = rcc::PllSource::HSE;
    config.rcc.pll = Some(rcc::Pll {
        prediv: rcc::PllPreDiv::DIV4,
        mul: rcc::PllMul::MUL168,
        divp: Some(rcc::PllPDiv::DIV2),
        divq: Some(rcc::PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = rcc::Sysclk::PLL1_P;
    config.rcc.ahb_pre = rcc::AHBPrescaler::DIV1;
    config.rcc.apb1_pre = rcc::APBPrescaler::DIV4;
    config.rcc.apb2_pre = rcc::APBPrescaler::DIV2;
    config
}

/// Reads why the machine started, and clears it for the next time.
fn reset_cause() -> (ResetCause, u32) {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    // Several flags are set together; the most telling one first.
    let cause = if flags.wdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.porrstf() {
        ResetCause::PowerOn
    } else if flags.borrstf() || flags.lpwrrstf() {
        ResetCause::BrownOut
    } else {
        ResetCause::Pin
    };
    (cause, flags.0)
}

/// A port's reception: a DMA ring.
pub(crate) struct PortRx {
    /// Keeps the pin and the port's clock.
    _port: UartRx<'static, Blocking>,
    ring: ReadableRingBuffer<'static, u8>,
    fetch_every: Duration,
}

impl PortRx {
    /// `channel` must be the one that serves the reception of `registers`, which must be `port`'s own.
    fn new(
        port: UartRx<'static, Blocking>,
        registers: pac::usart::Usart,
        channel: dma::Channel<'static>,
        buffer: &'static mut [u8],
        fetch_every: Duration,
    ) -> Self {
        let from = registers.dr().as_ptr().cast::<u8>();
        // SAFETY: `from` is the port's data register, `buffer` is a static in RAM that DMA reaches and that nobody else
        // has, and the channel is owned by the ring from here on.
        let mut ring = unsafe {
            ReadableRingBuffer::new(channel, USART_REQUEST, from, buffer, TransferOptions::default())
        };
        ring.start();
        registers.cr3().modify(|w| w.set_dmar(true));
        Self { _port: port, ring, fetch_every }
    }
}

impl Receive for PortRx {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Overrun> {
        loop {
            match self.ring.read(buffer) {
                Ok((0, _)) => Timer::after(self.fetch_every).await,
                Ok((count, _)) => return Ok(count),
                Err(_) => {
                    self.ring.clear();
                    return Err(Overrun);
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
    baud: u32,
}

impl PortTx {
    /// `channel` must be the one that serves the transmission of `registers`, which must be `port`'s own.
    fn new(
        port: UartTx<'static, Blocking>,
        registers: pac::usart::Usart,
        channel: dma::Channel<'static>,
    ) -> Self {
        registers.cr3().modify(|w| w.set_dmat(true));
        Self { port, registers, channel, baud: 0 }
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
        unsafe { self.channel.write(USART_REQUEST, bytes, to, TransferOptions::default()) }.await;
    }

    fn set_baud(&mut self, baud: u32) {
        // Both halves share the divider. A rate that the clock cannot give changes nothing.
        if baud != self.baud && self.port.set_baudrate(baud).is_err() {
            defmt::warn!("a port cannot run at {=u32} baud", baud);
        }
        self.baud = baud;
    }
}

/// The LED.
pub(crate) struct Led(Output<'static>);

impl Led {
    pub(crate) fn set(&mut self, lit: bool) {
        self.0.set_level(Level::from(!lit));
    }
}

/// The independent watchdog: its own oscillator, and once it runs nothing stops it.
pub(crate) struct Watchdog {
    timer: IndependentWatchdog<'static, IWDG>,
    running: bool,
}

impl Watchdog {
    pub(crate) fn feed(&mut self) {
        if self.running {
            self.timer.pet();
        } else {
            self.timer.unleash();
            self.running = true;
        }
    }
}

/// Sleeps between interrupts.
pub(crate) struct Idle(());

impl Idle {
    #[expect(clippy::unused_self, reason = "on the emulated board idle reads the feed")]
    pub(crate) fn run(&mut self) -> ! {
        loop {
            cortex_m::asm::wfi();
        }
    }
}

/// A vehicle's input has no end: the power goes.
pub(crate) async fn ended() {
    core::future::pending::<()>().await;
}

/// Processor cycles.
pub(crate) fn cycles() -> u32 {
    DWT::cycle_count()
}

/// The log is closed: the card can be pulled.
pub(crate) fn done(report: &Report) {
    let Report { stats, frames_left, costs, stack } = report;
    defmt::info!("log closed: {=u64} frames in, {=u64} without a card", stats.frames_in, frames_left);
    for ((_, name), cycles) in Stage::NAMES.iter().zip(costs) {
        defmt::info!("{=str}: {=u64} cycles", name, cycles);
    }
    defmt::info!("stack: {=usize} of {=usize} bytes", stack.0, stack.1);
}

/// Starts anew.
pub(crate) fn restart() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}
