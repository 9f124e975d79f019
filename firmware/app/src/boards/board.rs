//! The board of this image, from its file in `boards/`: the build script makes a call of [`board!`] from it.
//!
//! The compiler checks each pin and DMA stream by the traits of `embassy_stm32`: a pin without the wanted function, a stream
//! that does not serve a port, and a part that is used twice are errors.

use embassy_stm32::gpio::{Flex, Level, Output, Pin, Pull, Speed};
use embassy_stm32::usart::Uart;
use embassy_stm32::{Peri, bind_interrupts, dma, interrupt, pac, peripherals, rcc, spi};
use static_cell::ConstStaticCell;

use super::machine::{Boot, Parts};
use super::stm32f4::{
    AUTOPILOT_BAUD, CardPort, Crystal, FETCH_EVERY, GS_BAUD, GS_FETCH_EVERY, GS_RING_BYTES, RING_BYTES,
    halves, line, random_number, reset_cause, start,
};
pub(crate) use super::stm32f4::{
    Card, Idle, LATE_TURNS, Led, PortRx, PortTx, StoreFlash, Watchdog, chip_is_wrong, crystal_failed,
    crystal_is_wrong, restart,
};

static RING: ConstStaticCell<[u8; RING_BYTES]> = ConstStaticCell::new([0; RING_BYTES]);
static GS_RING: ConstStaticCell<[u8; GS_RING_BYTES]> = ConstStaticCell::new([0; GS_RING_BYTES]);

/// A port's halves: `port!(parts, USART1 { rx pin, tx pin } { rx stream, tx stream } ...)`.
macro_rules! port {
    ($p:ident, $usart:ident { $rx:ident $tx:ident } { $rx_dma:ident $tx_dma:ident }, $baud:expr, $ring:expr, $every:expr) => {{
        let port = Uart::new_blocking($p.$usart, $p.$rx, $p.$tx, line($baud));
        let (registers, channels) = (pac::$usart, ($p.$rx_dma, $p.$tx_dma));
        halves::<peripherals::$usart, _, _>(port, registers, channels, Irqs, $ring, $every)
    }};
}

/// The board's name, interrupts and parts.
macro_rules! board {
    (
        tag $tag:literal $skip:literal $end:literal;
        crystal $hz:literal $divider:ident;
        autopilot $autopilot:ident $autopilot_pins:tt $autopilot_dma:tt;
        gs $gs:ident $gs_pins:tt $gs_dma:tt;
        card $spi:ident { $sck:ident $mosi:ident $miso:ident $cs:ident } { $tx_dma:ident $rx_dma:ident };
        led $led:ident $lit:ident $waits:literal;
        high { $($high:ident)* } low { $($low:ident)* }
        streams { $($stream:ident $channel:ident)* }
    ) => {
        /// The board's name. It stands behind a mark in the image, so that tools know the image's board.
        pub(crate) const NAME: &str = $tag.split_at($end).0.split_at($skip).1;

        /// Interrupts of the ports and the card, more urgent than every task.
        pub(crate) const PORT_INTERRUPTS: [interrupt::Interrupt; 6] = [$(interrupt::$stream),*];

        bind_interrupts!(struct Irqs { $($stream => dma::InterruptHandler<peripherals::$channel>;)* });

        /// Starts clocks, watchdog, ports and card.
        pub(crate) fn take() -> Parts {
            let (cause, cause_register) = reset_cause();
            let p = start(Crystal { hz: $hz, divider: rcc::PllPreDiv::$divider });
            // Before the first clock to the card: a selected part on its bus would answer for it.
            $(hold(p.$high, Level::High);)*
            $(hold(p.$low, Level::Low);)*

            let autopilot = port!(p, $autopilot $autopilot_pins $autopilot_dma, AUTOPILOT_BAUD, RING.take(), FETCH_EVERY);
            let gs = port!(p, $gs $gs_pins $gs_dma, GS_BAUD, GS_RING.take(), GS_FETCH_EVERY);
            let mut bus = spi::Config::default();
            bus.frequency = CardPort::IDENTIFICATION;
            bus.miso_pull = Pull::Up;
            let select = Output::new(p.$cs, Level::High, CardPort::SELECT_SPEED);
            let bus = spi::Spi::new(p.$spi, p.$sck, p.$mosi, p.$miso, p.$tx_dma, p.$rx_dma, Irqs, bus);
            Parts {
                autopilot,
                gs,
                card: Card::new(CardPort::new(bus, select)),
                store: Some(StoreFlash::new()),
                led: Led::new(Flex::new(p.$led), Level::$lit, $waits),
                watchdog: Watchdog::new(),
                idle: Idle(()),
                boot: Boot { id: embassy_stm32::uid::uid(), cause, cause_register, entropy: random_number() },
            }
        }
    };
}

/// Drives a pin to this level for ever.
#[allow(dead_code, reason = "not every board holds pins")]
fn hold(pin: Peri<'static, impl Pin>, level: Level) {
    core::mem::forget(Output::new(pin, level, Speed::Low));
}

include!(concat!(env!("OUT_DIR"), "/board.rs"));
