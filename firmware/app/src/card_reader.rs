//! Card-reader mode: the card as a read-only USB disk. Nothing is recorded.
//!
//! A station's command ends the log, leaves a mark in memory that survives a reset, and resets the board. So
//! no task of a recording runs beside the disk, and its memory and stack are free. An armed vehicle, a fault, the
//! watchdog, an eject or ten minutes without a host end the mode by a reset. Only the start after an eject counts
//! as one by hand. A plugged cable never starts the mode: a charger in the field must not stop a recording.
//!
//! There is no executor. The disk's server polls the USB stack while it waits, also for a block of the card, and sleeps until the
//! next interrupt while it waits for a command. The identification of a card blocks it for 8 s at most; [`watch`] feeds the watchdog
//! meanwhile.

use core::future::{Future as _, poll_fn};
use core::pin::pin;
use core::sync::atomic::{AtomicU32, Ordering};
use core::task::{Context, Poll, Waker};

use embassy_futures::block_on;
use embassy_futures::select::select3;
use hums_core::clock::{Instant, Span};
use hums_onboard::{ArmingWatch, ResetCause};
use hums_recorder::Block;
use hums_update::message::Message;
use hums_usb::Builder;
use hums_usb::class::{Control, MassStorage};
use hums_usb::guard::Link;
use hums_usb::presence::Presence;
use hums_usb::scsi::Disk;
use hums_usb::server::{Chunk, Chunks, Lane, Server};

use crate::boards::board;
use crate::links::now;
use crate::usb::{self, Identity, Packets};
use crate::{fault, update, watch};

const HOST_MAX: Span = Span::from_secs(600);
/// Time after an eject, in which the host fetches its status.
const PARTING: Span = Span::from_secs(1);
/// `SysTick` feeds the watchdog for this many turns without the loop: 10 s, of which the card's driver has 8.
const LOOP_TURNS_MAX: u32 = 100;
/// How often the autopilot's port is looked at: its ring holds 22 ms. After a longer identification of a card its bytes are lost.
const LISTEN_EVERY: Span = Span::from_millis(1);
/// How often the bus is looked at and the LED's pin is set: a pin of the debug port is not the LED's at first.
const LOOK_EVERY: Span = Span::from_millis(100);

const IDENTITY: Identity = Identity { product: 1, name: "HUMS card reader" };

#[unsafe(link_section = ".uninit.card_reader")]
static MARK: AtomicU32 = AtomicU32::new(0);

pub(crate) fn restart() -> ! {
    restart_with(ResetCause::MARK_CARD_READER)
}

fn restart_with(mark: u32) -> ! {
    MARK.store(mark, Ordering::Relaxed);
    update::restart(Message::Planned)
}

/// The cause of this start, by its reset and the mark. Clears the mark: every start calls it once.
pub(crate) fn cause(reset: ResetCause) -> ResetCause {
    reset.with_mark(MARK.swap(0, Ordering::Relaxed))
}

pub(crate) struct Autopilot {
    pub(crate) port: (board::PortRx, board::PortTx),
    pub(crate) baud: u32,
}

/// The mode, until the board restarts. `buffer` is for blocks on their way.
#[inline(never)]
pub(crate) fn run(
    card: board::Card,
    plug: board::Usb,
    led: board::Led,
    autopilot: Autopilot,
    id: [u8; 12],
    buffer: &mut [Block],
) -> ! {
    watch::allow(LOOP_TURNS_MAX);
    fault::begin(true);
    let Autopilot { port: (autopilot, mut sender), baud } = autopilot;
    // Nothing was sent: it does not wait.
    block_on(sender.set_baud(baud));
    let link = Link::new();
    let serial = usb::digits(id);
    let mut disk = Disk::new(card, serial);
    let mut packets: Packets = [0; _];
    let driver = usb::driver(plug, &mut packets, &link);
    // Some hosts take the class from the interface only.
    let mut config = usb::config(IDENTITY, &serial);
    (config.device_class, config.device_sub_class, config.device_protocol) = (0, 0, 0);
    config.composite_with_iads = false;
    let (mut descriptor, mut bos, mut control_data) = ([0; 64], [0; 16], [0; 64]);
    let mut control = Control::new(&link);
    let mut builder = Builder::new(driver, config, &mut descriptor, &mut bos, &mut [], &mut control_data);
    let mut class = MassStorage::new(&mut builder, &mut control);
    let mut device = builder.build();
    let (lane, mut chunks) = (Lane::default(), Chunk::of(buffer));
    let mut chunks = Chunks::new(&mut chunks);
    let (to_bus, chunks) = chunks.split();
    let mut bus = pin!(select3(device.run(), class.run(&lane, chunks), supervise(led, autopilot, &link)));
    let mut context = Context::from_waker(Waker::noop());
    let mut meanwhile = || {
        if bus.as_mut().poll(&mut context).is_ready() {
            // Only an eject proves a cable. A vehicle without one may have been armed since the mode began.
            restart_with(0);
        }
        false
    };
    // Within half a millisecond the autopilot's port is looked at, and what a task of the bus told another one is done.
    let idle = || board::nap(500, cortex_m::asm::wfe);
    Server::new(to_bus, &lane, &link, idle).run(&mut disk, &mut meanwhile);
    let end = now() + PARTING;
    while now() < end {
        meanwhile();
    }
    restart_with(ResetCause::MARK_EJECT)
}

/// Until the mode ends by itself: the vehicle is armed, or no host is there.
async fn supervise(mut led: board::Led, mut autopilot: board::PortRx, link: &Link) {
    let (mut presence, mut looked) = (Presence::new(now()), Instant::ZERO);
    let (mut arming, mut listened) = (ArmingWatch::new(), Instant::ZERO);
    poll_fn(|_| {
        watch::fed();
        let now = now();
        if now.since(listened) >= LISTEN_EVERY {
            listened = now;
            match autopilot.look(arming.room()) {
                Ok(count) => arming.received(count),
                Err(_overrun) => arming.lost(),
            }
        }
        if now.since(looked) >= LOOK_EVERY {
            looked = now;
            led.set(true);
            fault::tick(now);
            presence.look(now, link.is_configured(), board::frame_number());
        }
        let is_over = arming.is_armed() || presence.absent(now) >= HOST_MAX;
        if is_over { Poll::Ready(()) } else { Poll::Pending }
    })
    .await;
}
