//! Trials of images and their ends: records in one sector of flash, appended until it is full.
//!
//! A record has 16 bytes: kind, id of the image, value, CRC-32. Power may go in any word of it; a record with a wrong CRC counts
//! as none, and the next one goes behind it. Without a record an image counts as confirmed: a cable loaded it.

use crate::crc32;
use crate::header::Version;

/// Bytes of a record.
pub const RECORD_BYTES: usize = 16;
/// A record.
pub type Bytes = [u8; RECORD_BYTES];

const NONE: (u32, Status) = (0, Status::Confirmed);
const BLANK: Bytes = [0xFF; RECORD_BYTES];
const ENDED_MAX: usize = 8;

/// An event in the life of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Record {
    /// It will be on trial as soon as it is complete.
    Trial,
    /// It was started on trial; whether its last start ended by a reset of its own.
    Start {
        /// By watchdog, fault or request.
        crashed: bool,
    },
    /// It recorded for a minute. Older versions than this one are refused from now on.
    Confirmed(Version),
    /// It did not survive its trial.
    Failed,
}

impl Record {
    /// The bytes of a record about the image `id`.
    pub fn bytes(self, id: u32) -> Bytes {
        let (kind, value) = match self {
            Self::Trial => (0x5452_4941, 0),
            Self::Start { crashed } => (0x5354_5254, u32::from(crashed)),
            Self::Confirmed(floor) => (0x434F_4E46, floor.0),
            Self::Failed => (0x4641_494C, 0),
        };
        let mut bytes = BLANK;
        for (to, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip([kind, id, value]) {
            *to = u32::to_le_bytes(word);
        }
        let crc = crc32(0, &bytes[..12]);
        bytes[12..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    fn read(bytes: &Bytes) -> Option<(u32, Self)> {
        let [kind, id, value, crc] = [0, 4, 8, 12]
            .map(|at| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]));
        if crc != crc32(0, &bytes[..12]) {
            return None;
        }
        let record = match kind {
            0x5452_4941 => Self::Trial,
            0x5354_5254 => Self::Start { crashed: value != 0 },
            0x434F_4E46 => Self::Confirmed(Version(value)),
            0x4641_494C => Self::Failed,
            _ => return None,
        };
        Some((id, record))
    }
}

/// The part of an image's life that counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It may run for ever.
    Confirmed,
    /// It must show itself.
    Trial {
        /// Starts so far.
        starts: u32,
        /// Those that followed a reset of its own.
        crashes: u32,
    },
    /// It did not survive its trial.
    Failed,
}

/// All records together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    last: (u32, Status),
    /// The newest one first; the id 0 is none.
    ended: [(u32, Status); ENDED_MAX],
    /// Older versions are refused.
    pub floor: Version,
    /// Offset of the first record behind all others.
    pub free: usize,
}

impl State {
    /// Reads the sector's bytes.
    pub fn read(sector: &[u8]) -> Self {
        let mut state = Self { last: NONE, ended: [NONE; ENDED_MAX], floor: Version(0), free: 0 };
        for (index, bytes) in sector.as_chunks::<RECORD_BYTES>().0.iter().enumerate() {
            // As a number: this is most of the time of a start.
            if u128::from_le_bytes(*bytes) == u128::MAX {
                continue;
            }
            state.free = (index + 1) * RECORD_BYTES;
            if let Some((id, record)) = Record::read(bytes) {
                state.take(id, record);
            }
        }
        state
    }

    fn take(&mut self, id: u32, record: Record) {
        let before = self.status(id);
        let status = match (record, before) {
            (Record::Trial, _) => Status::Trial { starts: 0, crashes: 0 },
            (Record::Start { crashed }, Status::Trial { starts, crashes }) => {
                Status::Trial { starts: starts + 1, crashes: crashes + u32::from(crashed) }
            }
            (Record::Start { .. }, before) => before,
            (Record::Confirmed(floor), _) => {
                self.floor = self.floor.max(floor);
                self.end(id, Status::Confirmed)
            }
            (Record::Failed, _) => self.end(id, Status::Failed),
        };
        self.last = (id, status);
    }

    fn end(&mut self, id: u32, status: Status) -> Status {
        let place = self.ended.iter().position(|(ended, _)| *ended == id).unwrap_or(ENDED_MAX - 1);
        self.ended[..=place].rotate_right(1);
        self.ended[0] = (id, status);
        status
    }

    /// The status of an image.
    pub fn status(&self, id: u32) -> Status {
        let (last, status) = self.last;
        match () {
            () if last == id => status,
            () if self.has_failed(id) => Status::Failed,
            () => Status::Confirmed,
        }
    }

    /// Whether an image failed on trial, and was not confirmed afterwards.
    pub fn has_failed(&self, id: u32) -> bool {
        id != 0 && self.ended.contains(&(id, Status::Failed))
    }

    /// Whether an image was confirmed.
    pub fn was_confirmed(&self, id: u32) -> bool {
        id != 0 && self.ended.contains(&(id, Status::Confirmed))
    }
}
