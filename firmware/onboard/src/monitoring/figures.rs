//! The pipeline's own figures: what came in, what was lost, and how the recording goes.

use hums_blackbox::record::{Lost, Stats};
use hums_core::status::{RecorderStatus, Recording};
use hums_core::time::{Instant, Span};
use hums_link::summary::OwnFigures;
use hums_recorder::status::CardState;

use super::Monitoring;
use crate::queues::{
    FRAME_QUEUE_BYTES, GS_QUEUE_BYTES, GsIn, SECTOR_QUEUE_BYTES, SECTOR_QUEUE_SECTORS, SectorsIn,
};

/// How long a card may take to be found before it counts as missing.
const START: Span = Span::from_secs(3);

/// Sums in 64 bits of what the port counts in 32.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    pub(super) bytes: u64,
    pub(super) bytes_not_frames: u64,
    pub(super) frames: u64,
    pub(super) frames_lost: u64,
}

/// What the machine has to give for all this; zeros where nobody counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Machine {
    /// What the processor was busy in the last second, thousandths.
    pub cpu_permille: u16,
    /// The same in the worst second.
    pub cpu_permille_max: u16,
    /// The deepest the stack was, bytes.
    pub stack_bytes_max: u32,
    /// What the stack holds, bytes.
    pub stack_bytes: u32,
}

impl Monitoring<'_> {
    /// The machine's figures, as they are now: recorded with the others, and told to the ground station.
    pub fn set_machine(&mut self, machine: Machine) {
        self.machine = machine;
    }

    /// The same in percent, with the worst of the queues and of the card, for the summary stream.
    pub(super) fn own_figures(&self) -> OwnFigures {
        let Machine { cpu_permille, stack_bytes_max, stack_bytes, .. } = self.machine;
        OwnFigures {
            cpu_percent: f32::from(cpu_permille) / 10.0,
            stack_percent: 100.0 * stack_bytes_max as f32 / stack_bytes.max(1) as f32,
            queue_percent: 100.0 * self.queue_sectors_max as f32 / SECTOR_QUEUE_SECTORS as f32,
            stall_s: self.card.read().stall_ms_max as f32 / 1_000.0,
        }
    }

    /// The pipeline's figures since power-on.
    pub fn stats(&self, gs: &GsIn) -> Stats {
        let card = self.card.read();
        let counters = self.writer.counters();
        let card_lost = u64::from(card.frames_lost);
        Stats {
            frames_in: self.sums.frames,
            frames_logged: counters.frames.saturating_sub(card_lost),
            frames_lost: self.sums.frames_lost + self.refused + card_lost,
            bytes_in: self.sums.bytes,
            bytes_not_frames: self.sums.bytes_not_frames,
            bytes_logged: counters.sectors * hums_blackbox::SECTOR_BYTES as u64,
            blocks_written: u64::from(card.blocks_written),
            queue_bytes_max: (self.queue_sectors_max * hums_blackbox::SECTOR_BYTES) as u64,
            queue_bytes_capacity: SECTOR_QUEUE_BYTES as u64,
            sd_stall_ms_max: u64::from(card.stall_ms_max),
            gs_frames: gs.frames(),
            gs_bytes: gs.bytes(),
            frame_queue_bytes_max: u64::from(self.port.queue_bytes_max()),
            frame_queue_bytes_capacity: FRAME_QUEUE_BYTES as u64,
            gs_queue_bytes_max: u64::from(gs.bytes_max()),
            gs_queue_bytes_capacity: GS_QUEUE_BYTES as u64,
            cpu_permille: u64::from(self.machine.cpu_permille),
            cpu_permille_max: u64::from(self.machine.cpu_permille_max),
            stack_bytes_max: u64::from(self.machine.stack_bytes_max),
            stack_bytes_capacity: u64::from(self.machine.stack_bytes),
        }
    }

    pub(super) fn recorder_status(&self, now: Instant, sectors: &SectorsIn) -> RecorderStatus {
        let card = self.card.read();
        let recording = match card.state {
            _ if self.companion.stopped => Recording::Stopped,
            CardState::Recording => Recording::Running,
            CardState::Unknown if now.since(Instant::ZERO) < START => Recording::Starting,
            CardState::Finished => Recording::Starting,
            _ => Recording::Stopped,
        };
        RecorderStatus {
            recording,
            queue: sectors.len() as f32 / SECTOR_QUEUE_SECTORS as f32,
            frames_lost: self.sums.frames_lost + self.refused + u64::from(card.frames_lost),
            stall: self.card.stall(now),
            write_errors: u64::from(card.write_errors),
            room: card.room_permille.map(|permille| permille as f32 / 1000.0),
        }
    }

    pub(super) fn count_losses(&mut self, now: Instant, sectors: &SectorsIn) {
        let port = self.port.read();
        let new = port.since(self.port_before);
        self.port_before = port;
        self.sums.bytes += u64::from(new.bytes);
        self.sums.bytes_not_frames += u64::from(new.bytes_not_frames);
        self.sums.frames += u64::from(new.frames);
        self.sums.frames_lost += u64::from(new.frames_lost);
        self.losses.count(now, Lost::UartOverrun, u64::from(new.overrun));
        self.losses.count(now, Lost::NotFrames, u64::from(new.bytes_not_frames));
        self.losses.count(now, Lost::DamagedFrames, u64::from(new.damaged));
        self.losses.count(now, Lost::QueueFull, u64::from(new.frames_lost));
        let card = self.card.read();
        self.losses.count(
            now,
            Lost::Card,
            u64::from(card.frames_lost.wrapping_sub(self.card_before.frames_lost)),
        );
        self.card_before = card;
        self.queue_sectors_max = self.queue_sectors_max.max(sectors.deepest());
    }
}
