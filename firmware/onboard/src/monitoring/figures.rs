//! The pipeline's own figures: input, losses, and the state of recording.

use hums_blackbox::SECTOR_BYTES;
use hums_blackbox::record::{LossKind, Stats};
use hums_core::clock::{Instant, Span};
use hums_core::status::{RecorderStatus, Recording};
use hums_link::messages::{ComputerStatus, LinkStatus};
use hums_link::summary::OwnFigures;
use hums_recorder::status::{CardState, CardStatus};

use crate::companion::Companion;
use crate::journal::Logbook;
use crate::port::{PortReading, PortStatus};
use crate::queues::{FRAME_QUEUE_BYTES, GS_QUEUE_BYTES, SECTOR_QUEUE_BYTES, SECTOR_QUEUE_SECTORS};

const RATES: Span = Span::from_secs(5);

/// How long a card may take to be found before it counts as missing.
const START: Span = Span::from_secs(3);

/// Load of the processor; zeros if nothing measures it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Machine {
    /// Busy in the last second, thousandths.
    pub cpu_permille: u16,
    /// Busy in the worst second, thousandths.
    pub cpu_permille_max: u16,
    /// Deepest use, bytes.
    pub stack_bytes_max: u32,
    /// Size, bytes.
    pub stack_bytes: u32,
}

/// Counts since power-on.
pub(super) struct Figures<'a> {
    port: &'a PortStatus,
    port_before: PortReading,
    card_frames_lost_before: u32,
    pub(super) machine: Machine,
    rates: Rates,
}

/// Bytes a second, over [`RATES`].
#[derive(Clone, Copy, Debug, Default)]
struct Rates {
    /// Last count, milliseconds modulo 2^32, and the counts.
    at_ms: u32,
    counts: [u32; 2],
    a_second: [u32; 2],
}

impl Rates {
    fn count(&mut self, now: Instant, counts: [u32; 2]) {
        let now_ms = now.as_millis() as u32;
        let span_ms = now_ms.wrapping_sub(self.at_ms);
        if u64::from(span_ms) < RATES.as_millis() {
            return;
        }
        for (rate, (count, before)) in self.a_second.iter_mut().zip(counts.into_iter().zip(self.counts)) {
            *rate = (u64::from(count.wrapping_sub(before)) * 1_000 / u64::from(span_ms)) as u32;
        }
        (self.at_ms, self.counts) = (now_ms, counts);
    }
}

impl<'a> Figures<'a> {
    pub(super) fn new(port: &'a PortStatus, card: &CardStatus) -> Self {
        Self {
            port,
            port_before: PortReading::default(),
            card_frames_lost_before: card.read().frames_lost,
            machine: Machine::default(),
            rates: Rates::default(),
        }
    }

    /// Figures for the summary stream, in percent, with the worst of the queues and of the card.
    pub(super) fn own(&mut self, now: Instant, book: &Logbook<'_>, companion: &Companion<'_>) -> OwnFigures {
        let Machine { cpu_permille, stack_bytes_max, stack_bytes, .. } = self.machine;
        self.rates.count(now, [self.port_before.bytes as u32, companion.ways.queues.bytes() as u32]);
        let [from_autopilot, to_gs] = self.rates.a_second;
        let (ground, autopilot) = companion.bauds();
        OwnFigures {
            cpu_percent: f32::from(cpu_permille) / 10.0,
            stack_percent: 100.0 * stack_bytes_max as f32 / stack_bytes.max(1) as f32,
            queue_percent: 100.0 * book.journal.sectors().deepest() as f32 / SECTOR_QUEUE_SECTORS as f32,
            stall_s: book.card.read().stall_ms_max as f32 / 1_000.0,
            computer: ComputerStatus {
                cpu_percent: cpu_permille.div_ceil(10).min(100) as u8,
                storage_mib: book.card.read().storage_mib,
                links: [
                    LinkStatus { baud: autopilot, tx: None, rx: Some(from_autopilot) },
                    LinkStatus { baud: ground, tx: Some(to_gs), rx: None },
                ],
            },
        }
    }

    pub(super) fn stats(&self, book: &Logbook<'_>, companion: &Companion<'_>) -> Stats {
        let Logbook { journal, card, .. } = book;
        let (card, port, gs) = (card.read(), self.port.read(), &companion.ways.queues);
        let counters = journal.counters();
        let card_lost = u64::from(card.frames_lost);
        Stats {
            frames_in: port.frames,
            frames_logged: counters.frames.saturating_sub(card_lost),
            frames_lost: port.frames_lost + journal.refused() + card_lost,
            bytes_in: port.bytes,
            bytes_not_frames: port.bytes_not_frames,
            bytes_logged: counters.sectors * SECTOR_BYTES as u64,
            blocks_written: u64::from(card.blocks_written),
            queue_bytes_max: (journal.sectors().deepest() * SECTOR_BYTES) as u64,
            queue_bytes_capacity: SECTOR_QUEUE_BYTES as u64,
            sd_stall_ms_max: u64::from(card.stall_ms_max),
            gs_frames: gs.frames(),
            gs_bytes: gs.bytes(),
            frame_queue_bytes_max: u64::from(port.queue_bytes_max),
            frame_queue_bytes_capacity: FRAME_QUEUE_BYTES as u64,
            gs_queue_bytes_max: u64::from(gs.bytes_max()),
            gs_queue_bytes_capacity: GS_QUEUE_BYTES as u64,
            cpu_permille: u64::from(self.machine.cpu_permille),
            cpu_permille_max: u64::from(self.machine.cpu_permille_max),
            stack_bytes_max: u64::from(self.machine.stack_bytes_max),
            stack_bytes_capacity: u64::from(self.machine.stack_bytes),
            gs_frames_lost: gs.lost(),
            autopilot_frames_lost: gs.autopilot.lost(),
            passed_frames_lost: u64::from(companion.passed_lost()),
            requests_refused: u64::from(companion.requests_refused()),
        }
    }

    /// `stopped`: by command.
    pub(super) fn recorder(&self, now: Instant, stopped: bool, book: &Logbook<'_>) -> RecorderStatus {
        let Logbook { journal, card, .. } = book;
        let reading = card.read();
        let recording = match reading.state {
            _ if stopped => Recording::Stopped,
            CardState::Recording => Recording::Running,
            CardState::Unknown if now.since(Instant::ZERO) < START => Recording::Starting,
            CardState::Finished => Recording::Starting,
            _ => Recording::Stopped,
        };
        RecorderStatus {
            recording,
            queue: journal.sectors().len() as f32 / SECTOR_QUEUE_SECTORS as f32,
            frames_lost: self.port_before.frames_lost + journal.refused() + u64::from(reading.frames_lost),
            stall: card.stall(now).into(),
            write_errors: u64::from(reading.write_errors),
            room: reading.room_permille.map(|permille| permille as f32 / 1000.0),
        }
    }

    /// Counts since the last tick; passes losses on.
    pub(super) fn count(&mut self, now: Instant, book: &mut Logbook<'_>) {
        let Logbook { journal, card, .. } = book;
        let port = self.port.read();
        let before = core::mem::replace(&mut self.port_before, port);
        let blind_ms = port.blind_ms - before.blind_ms;
        let since = Instant::from_millis(now.as_millis().saturating_sub(blind_ms));
        journal.lose_since(since, now, LossKind::UartOverrun, port.overrun - before.overrun);
        journal.lose(now, LossKind::NotFrames, port.bytes_not_frames - before.bytes_not_frames);
        journal.lose(now, LossKind::DamagedFrames, port.damaged - before.damaged);
        journal.lose(now, LossKind::QueueFull, port.frames_lost - before.frames_lost);
        let frames_lost = card.read().frames_lost;
        let before = core::mem::replace(&mut self.card_frames_lost_before, frames_lost);
        journal.lose(now, LossKind::Card, u64::from(frames_lost.wrapping_sub(before)));
    }
}
