//! The board of this image, from its file in `boards/`: the build script makes a call of [`board!`] from it.
//!
//! The compiler checks each pin and DMA stream by the traits of `embassy_stm32`: a pin without the wanted function, a stream
//! that does not serve a port, and a part that is used twice are errors.

use embassy_stm32::gpio::{self, Flex, Level, Output, Pin, Speed};
use embassy_stm32::usart::Uart;
use embassy_stm32::usb;
use embassy_stm32::{Peri, bind_interrupts, dma, interrupt, pac, peripherals, rcc};
use hums_recorder::SpiCard;
use static_cell::ConstStaticCell;

use super::machine::Boot;
use super::stm32f4;
use super::stm32f4::{
    AUTOPILOT_BAUD, Crystal, FETCH_EVERY, GS_BAUD, GS_FETCH_EVERY, GS_RING_BYTES, RING_BYTES, halves, line,
    random_number, reset_cause, start,
};
pub(crate) use super::stm32f4::{
    LATE_TURNS, Led, PortRx, PortTx, StoreFlash, begin_with_data0, chip_is_wrong, crystal_failed,
    crystal_is_wrong, drop_control_packet, feed_watchdog, frame_number, has_bus_event, idle, restart,
    time::nap,
};

static RING: ConstStaticCell<[u8; RING_BYTES]> = ConstStaticCell::new([0; RING_BYTES]);
static GS_RING: ConstStaticCell<[u8; GS_RING_BYTES]> = ConstStaticCell::new([0; GS_RING_BYTES]);

/// Pins of the backup domain, which some boards select the card with, allow 2 MHz only (DS8626, table 7).
const SELECT_SPEED: Speed = Speed::Low;

/// A pull-up or pull-down of the chip charges a wire in this time: 1 ms.
#[allow(dead_code, reason = "not every board has a button")]
const PULL_CYCLES: u32 = 168_000;

pub(crate) type UsbDriver<'d> = usb::Driver<'d, peripherals::USB_OTG_FS>;

pub(crate) struct Usb {
    port: Peri<'static, peripherals::USB_OTG_FS>,
    plus: Peri<'static, peripherals::PA12>,
    minus: Peri<'static, peripherals::PA11>,
}

impl Usb {
    /// The port's driver. `packets` is for one received packet of each endpoint.
    pub(crate) fn driver(self, packets: &mut [u8]) -> UsbDriver<'_> {
        // Without the bus's voltage at PA9, which is a port's pin on most boards.
        let config = usb::Config::default();
        usb::Driver::new_fs(self.port, Irqs, self.plus, self.minus, packets, config)
    }
}

/// A port's halves: `port!(parts, USART1 { rx pin, tx pin } { rx stream, tx stream } ...)`.
macro_rules! port {
    ($p:ident, $usart:ident { $rx:ident $tx:ident } { $rx_dma:ident $tx_dma:ident }, $baud:expr, $ring:expr, $every:expr) => {{
        let port = Uart::new_blocking($p.$usart, $p.$rx, $p.$tx, line($baud));
        let (registers, channels) = (pac::$usart, ($p.$rx_dma, $p.$tx_dma));
        halves::<peripherals::$usart, _, _>(port, registers, channels, Irqs, $ring, $every)
    }};
}

macro_rules! card {
    (type pins $pins:tt) => {
        stm32f4::PinPort
    };
    (type $spi:ident $pins:tt $dma:tt) => {
        stm32f4::SpiPort
    };
    ($p:ident pins { $sck:ident $mosi:ident $miso:ident $cs:ident }) => {
        stm32f4::PinPort::new($p.$sck, $p.$mosi, $p.$miso, Output::new($p.$cs, Level::High, SELECT_SPEED))
    };
    ($p:ident $spi:ident { $sck:ident $mosi:ident $miso:ident $cs:ident } { $tx_dma:ident $rx_dma:ident }) => {{
        let mut bus = embassy_stm32::spi::Config::default();
        bus.frequency = stm32f4::SpiPort::IDENTIFICATION;
        bus.miso_pull = gpio::Pull::Up;
        let bus = embassy_stm32::spi::Spi::new(
            $p.$spi, $p.$sck, $p.$mosi, $p.$miso, $p.$tx_dma, $p.$rx_dma, Irqs, bus,
        );
        stm32f4::SpiPort::new(bus, Output::new($p.$cs, Level::High, SELECT_SPEED))
    }};
}

macro_rules! button {
    ($p:ident) => {
        false
    };
    ($p:ident $pin:ident $pressed:ident) => {{
        let idle = if bool::from(Level::$pressed) { gpio::Pull::Down } else { gpio::Pull::Up };
        let pin = gpio::Input::new($p.$pin, idle);
        cortex_m::asm::delay(PULL_CYCLES);
        pin.get_level() == Level::$pressed
    }};
}

macro_rules! board {
    (
        tag $tag:literal $skip:literal $end:literal;
        crystal $hz:literal $divider:ident;
        autopilot $autopilot:ident $autopilot_pins:tt $autopilot_dma:tt;
        gs $gs:ident $gs_pins:tt $gs_dma:tt;
        card { $($card:tt)* };
        led $led:ident $lit:ident $waits:literal;
        button { $($button:tt)* };
        high { $($high:ident)* } low { $($low:ident)* } pull { $($pull:ident)* }
        streams { $($stream:ident $channel:ident)* }
    ) => {
        /// A mark before it in the image tells tools the image's board.
        pub(crate) const NAME: &str = $tag.split_at($end).0.split_at($skip).1;

        /// Interrupts of the ports and the card, more urgent than every task.
        pub(crate) const PORT_INTERRUPTS: &[interrupt::Interrupt] = &[$(interrupt::$stream),*];

        /// The microSD card. Nothing less urgent runs while its driver waits for the card: only the least urgent task may use it.
        pub(crate) type Card = SpiCard<card!(type $($card)*)>;

        bind_interrupts!(struct Irqs { $($stream => dma::InterruptHandler<peripherals::$channel>;)* OTG_FS => usb::InterruptHandler<peripherals::USB_OTG_FS>; });

        pub(crate) struct Parts {
            pub(crate) autopilot: (PortRx, PortTx),
            pub(crate) gs: (PortRx, PortTx),
            pub(crate) card: Card,
            /// Two sectors.
            pub(crate) store: StoreFlash,
            pub(crate) usb: Usb,
            pub(crate) led: Led,
            pub(crate) button: bool,
            pub(crate) boot: Boot,
        }

        pub(crate) fn take() -> Parts {
            let (cause, cause_register) = reset_cause();
            let p = start(Crystal { hz: $hz, divider: rcc::PllPreDiv::$divider });
            // Before the first clock to the card: a selected part on its bus would answer for it.
            $(hold(p.$high, Level::High);)*
            $(hold(p.$low, Level::Low);)*
            $(core::mem::forget(gpio::Input::new(p.$pull, gpio::Pull::Up));)*

            let autopilot = port!(p, $autopilot $autopilot_pins $autopilot_dma, AUTOPILOT_BAUD, RING.take(), FETCH_EVERY);
            let gs = port!(p, $gs $gs_pins $gs_dma, GS_BAUD, GS_RING.take(), GS_FETCH_EVERY);
            Parts {
                autopilot,
                gs,
                card: Card::new(card!(p $($card)*)),
                store: StoreFlash::new(),
                usb: Usb { port: p.USB_OTG_FS, plus: p.PA12, minus: p.PA11 },
                button: button!(p $($button)*),
                led: Led::new(Flex::new(p.$led), Level::$lit, $waits),
                boot: Boot { id: embassy_stm32::uid::uid(), cause, cause_register, entropy: random_number() },
            }
        }
    };
}

#[allow(dead_code, reason = "not every board holds pins")]
fn hold(pin: Peri<'static, impl Pin>, level: Level) {
    core::mem::forget(Output::new(pin, level, Speed::Low));
}

include!(concat!(env!("OUT_DIR"), "/board.rs"));
