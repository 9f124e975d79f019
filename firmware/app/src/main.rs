//! The firmware: puts the board's ports and the bodies of `hums_onboard` together.
//!
//! ```text
//! autopilot -> reception -> monitor -> storage -> card
//!        gs -> uplink    -/       \\-> downlink -> gs
//!       usb -> usb       -/        |\-> usb -> usb
//!                                  \-> requests -> autopilot
//! ```
//! Everything is allocated here and once: queues, the codec, the tasks. The logic of the tasks is in `hums_onboard` and tested on
//! a PC; the hardware is in `boards`.
#![no_std]
#![no_main]

mod boards;
mod card_reader;
mod costs;
mod exceptions;
mod executors;
mod fault;
mod links;
mod log;
mod memory;
mod registers;
mod status;
mod tasks;
mod trap;
mod update;
mod usb;
mod watch;

use hums_blackbox::Writer;
use hums_blackbox::record::{Boot, LastSession};
use hums_core::Monitor;
use hums_core::parameters::{Param, Params};
use hums_onboard::persist::mailbox::MailboxOut;
use hums_onboard::queues::{MonitorEnds, Queues, UplinkIn};
use hums_onboard::{Handover, Mailbox, Monitoring, ResetCause, StoreWriter};
use static_cell::{ConstStaticCell, StaticCell};

use boards::board;
use tasks::{monitor, storage};

static QUEUES: ConstStaticCell<Queues> = ConstStaticCell::new(Queues::new());
/// In CCM: the hottest data there is, and no DMA reads it (see `memory.x`).
#[unsafe(link_section = ".bss.ccm.writer")]
static WRITER: ConstStaticCell<Writer> = ConstStaticCell::new(Writer::new());
static MONITOR: StaticCell<Monitor> = StaticCell::new();
static MONITORING: StaticCell<Monitoring<'static>> = StaticCell::new();
/// Of uplink and USB, which are as urgent as each other.
static UPLINK_IN: StaticCell<UplinkIn<'static>> = StaticCell::new();
static STORE_WRITER: StaticCell<StoreWriter<'static, board::StoreFlash>> = StaticCell::new();
/// In CCM too: no DMA reads it.
#[unsafe(link_section = ".bss.ccm.mailbox")]
static MAILBOX: ConstStaticCell<Mailbox> = ConstStaticCell::new(Mailbox::new());
static HANDOVER: StaticCell<Handover<'static>> = StaticCell::new();

const ONCE: &str = "each task is spawned once";

#[cortex_m_rt::entry]
fn main() -> ! {
    start();
    board::idle()
}

// Own stack frame (ARCHITECTURE.md, Memory).
#[inline(never)]
fn start() {
    // SAFETY: this is the program's first statement: CCM is untouched and no interrupt is unmasked.
    unsafe { memory::init() };
    let boots = fault::count_start();
    let mut parts = board::take();
    let (cause, message) = update::take(card_reader::cause(parts.boot.cause));
    parts.boot.cause = cause;
    log::log!(info, "start {=u32}, {=str}, id {=[u8]:02x}", boots, parts.boot.cause.name(), parts.boot.id);

    let (out, ends) = QUEUES.take().split();
    let identity = Boot {
        version: env!("CARGO_PKG_VERSION"),
        git: env!("HUMS_GIT"),
        board: board::NAME,
        reset: parts.boot.cause_register,
        reset_name: parts.boot.cause.name(),
        uid: parts.boot.id,
        boots,
        before: LastSession::default(),
    };
    let monitor = Monitor::begin(MONITOR.uninit(), &Params::defaults());
    let (items_in, items_out) = MAILBOX.take().split();
    let store_writer = restore(parts.store, items_out, parts.boot.cause, monitor);
    let is_button = parts.button && !parts.boot.cause.may_be_in_flight();
    if parts.boot.cause == ResetCause::CardReader || is_button {
        // Nothing reads the radio's port.
        core::mem::forget(parts.gs);
        let autopilot = card_reader::Autopilot {
            port: parts.autopilot,
            baud: monitor.params().get(Param::ApBaud) as u32,
        };
        card_reader::run(
            parts.card,
            parts.usb,
            parts.led,
            autopilot,
            parts.boot.id,
            tasks::storage::BUFFERS.take().blocks(),
        );
    }
    let entropy = parts.boot.entropy.unwrap_or_else(|| counted(store_writer.mounts(), &identity));
    let handover = HANDOVER.init_with(|| Handover::new(items_in, &status::STORE_STATUS, monitor));
    let monitoring = monitoring(monitor, identity, parts.boot.cause, out);
    monitoring.restore_signing(store_writer);

    let plug = tasks::usb::plug(parts.usb, parts.boot.id);
    let on = executors::start();
    let (autopilot_rx, autopilot_tx) = parts.autopilot;
    let (gs_rx, gs_tx) = parts.gs;
    on.reception.spawn(tasks::reception::run(autopilot_rx, ends.frames_in).expect(ONCE));
    let (frames, requests) = (ends.frames_out, ends.uplink_out);
    let monitor = monitor::run(monitoring, frames, requests, handover, parts.boot, message, parts.led);
    on.monitor.spawn(monitor.expect(ONCE));
    on.downlink.spawn(tasks::downlink::run(gs_tx, ends.gs_out).expect(ONCE));
    on.downlink.spawn(tasks::downlink::requests(autopilot_tx, ends.autopilot_out).expect(ONCE));
    let uplink = &*UPLINK_IN.init(ends.uplink_in);
    on.downlink.spawn(tasks::uplink::run(gs_rx, uplink).expect(ONCE));
    on.downlink.spawn(tasks::usb::run(plug, ends.usb_out, uplink).expect(ONCE));
    let storage = storage::body(parts.card, entropy, ends.sectors_out, ends.shelf, store_writer);
    on.storage.spawn(storage::run(storage).expect(ONCE));
}

/// Substitute for a random number: the start counts of the store and of the surviving memory, and the chip's unique id.
fn counted(mounts: u32, identity: &Boot<'_>) -> u32 {
    let words = identity.uid.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word));
    words
        .chain([mounts, identity.boots])
        .fold(0, |sum, word| (sum ^ word).wrapping_mul(0x9E37_79B1).rotate_left(15))
}

// Own stack frame (ARCHITECTURE.md, Memory). As all that follow.

#[inline(never)]
fn restore(
    store: board::StoreFlash,
    items: MailboxOut<'static>,
    cause: ResetCause,
    monitor: &mut Monitor,
) -> &'static mut StoreWriter<'static, board::StoreFlash> {
    let store_writer = STORE_WRITER.init_with(|| StoreWriter::mount(store, items, &status::STORE_STATUS));
    if !cause.may_be_in_flight() {
        store_writer.turn_ahead();
    }
    store_writer.load(monitor);
    store_writer
}

#[inline(never)]
fn monitoring(
    monitor: &'static mut Monitor,
    identity: Boot<'static>,
    cause: ResetCause,
    out: MonitorEnds<'static>,
) -> &'static mut Monitoring<'static> {
    let (card, port) = (&status::CARD_STATUS, &status::PORT_STATUS);
    MONITORING.init_with(|| Monitoring::new(monitor, WRITER.take(), identity, cause, card, port, out))
}
