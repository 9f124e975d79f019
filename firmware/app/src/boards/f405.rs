//! STM32F405RG with an 8 MHz crystal: the Olimex STM32-H405 as it is, or any board with the same pins.
//!
//! | pin | what | remark |
//! |---|---|---|
//! | PA10 | USART1 RX, from the autopilot's TELEM TX | DMA2 stream 2, ring of [`RING_BYTES`] |
//! | PA9 | USART1 TX, to the autopilot's TELEM RX | DMA2 stream 7 |
//! | PA2 | USART2 TX, to the ground station's radio | DMA1 stream 6 |
//! | PA3 | USART2 RX, from the radio | DMA1 stream 5, ring of [`GS_RING_BYTES`] |
//! | PA4, PA5, PA6, PA7 | microSD CS, SCK, MISO, MOSI (SPI1) | DMA2 streams 0 and 3; 400 kHz, then 21 MHz; MISO pulled up |
//! | PC12 | LED, lit when low | |

use embassy_stm32::dma;
use embassy_stm32::gpio::{Level, Output, Pull, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::peripherals::{
    DMA1_CH5, DMA1_CH6, DMA2_CH0, DMA2_CH2, DMA2_CH3, DMA2_CH7, USART1, USART2,
};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::usart::Uart;
use embassy_stm32::{bind_interrupts, pac, rcc};
use static_cell::ConstStaticCell;

use super::machine::{Boot, Parts};
use super::stm32f4::{AUTOPILOT_BAUD, FETCH_EVERY, GS_BAUD, GS_FETCH_EVERY, GS_RING_BYTES, RING_BYTES};
pub(crate) use super::stm32f4::{
    Card, Idle, LATE_TURNS, Led, PortRx, PortTx, StoreFlash, Watchdog, crystal_failed, restart,
};
use super::stm32f4::{CardPort, halves, line, random_number, reset_cause, start};

/// The board's name.
pub(crate) const NAME: &str = "f405";

/// Interrupts of the ports and the card, more urgent than every task.
pub(crate) const PORT_INTERRUPTS: [interrupt::Interrupt; 6] = [
    interrupt::DMA2_STREAM2,
    interrupt::DMA2_STREAM7,
    interrupt::DMA1_STREAM5,
    interrupt::DMA1_STREAM6,
    interrupt::DMA2_STREAM0,
    interrupt::DMA2_STREAM3,
];

bind_interrupts!(struct Irqs {
    DMA2_STREAM2 => dma::InterruptHandler<DMA2_CH2>;
    DMA2_STREAM7 => dma::InterruptHandler<DMA2_CH7>;
    DMA2_STREAM0 => dma::InterruptHandler<DMA2_CH0>;
    DMA2_STREAM3 => dma::InterruptHandler<DMA2_CH3>;
    DMA1_STREAM5 => dma::InterruptHandler<DMA1_CH5>;
    DMA1_STREAM6 => dma::InterruptHandler<DMA1_CH6>;
});

static RING: ConstStaticCell<[u8; RING_BYTES]> = ConstStaticCell::new([0; RING_BYTES]);
static GS_RING: ConstStaticCell<[u8; GS_RING_BYTES]> = ConstStaticCell::new([0; GS_RING_BYTES]);

/// Starts clocks, watchdog, ports and card.
pub(crate) fn take() -> Parts {
    let (cause, cause_register) = reset_cause();
    let p = start(rcc::HseMode::Oscillator);

    let port = Uart::new_blocking(p.USART1, p.PA10, p.PA9, line(AUTOPILOT_BAUD));
    let (registers, channels) = (pac::USART1, (p.DMA2_CH2, p.DMA2_CH7));
    let autopilot = halves::<USART1, _, _>(port, registers, channels, Irqs, RING.take(), FETCH_EVERY);
    let port = Uart::new_blocking(p.USART2, p.PA3, p.PA2, line(GS_BAUD));
    let (registers, channels) = (pac::USART2, (p.DMA1_CH5, p.DMA1_CH6));
    let gs = halves::<USART2, _, _>(port, registers, channels, Irqs, GS_RING.take(), GS_FETCH_EVERY);

    let mut bus = spi::Config::default();
    bus.frequency = CardPort::IDENTIFICATION;
    bus.miso_pull = Pull::Up;
    let bus = Spi::new(p.SPI1, p.PA5, p.PA7, p.PA6, p.DMA2_CH3, p.DMA2_CH0, Irqs, bus);
    Parts {
        autopilot,
        gs,
        card: Card::new(CardPort::new(bus, Output::new(p.PA4, Level::High, Speed::VeryHigh))),
        store: Some(StoreFlash::new()),
        led: Led::new(Output::new(p.PC12, Level::High, Speed::Low), Level::Low),
        watchdog: Watchdog::new(),
        idle: Idle(()),
        boot: Boot { id: embassy_stm32::uid::uid(), cause, cause_register, entropy: random_number() },
    }
}
