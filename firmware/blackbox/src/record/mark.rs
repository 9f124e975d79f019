//! End marks, written when no data is expected for a while.

use super::stored::{Fields, Sink};

/// The reason of a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkReason {
    /// The vehicle was disarmed on the ground.
    Disarmed = 1,
    /// The vehicle landed.
    Landed = 2,
    /// A mishap began, or ended with the vehicle down.
    Mishap = 3,
}

impl MarkReason {
    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Disarmed => "disarmed",
            Self::Landed => "landed",
            Self::Mishap => "mishap",
        }
    }

    /// A sentence.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Disarmed => "disarming",
            Self::Landed => "landing",
            Self::Mishap => "mishap",
        }
    }
}

/// Its sector is written to the card immediately. Without a gap, a log is complete up to it; the end behind the last
/// mark is unproven.
///
/// The sector that completes it has the check of all entries up to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mark {
    /// Why it was written.
    pub why: MarkReason,
    /// Sector in progress: the mark begins in it or in the next one.
    pub sector: u32,
    /// Frames of the session before the mark, modulo 2^32.
    pub frames: u32,
}

impl Mark {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(18).u32(self.sector).u32(self.frames).u8(self.why as u8);
    }

    /// `None` for an unknown reason.
    pub(super) fn read(fields: &mut Fields<'_>) -> Option<Self> {
        let why = match fields.u8() {
            1 => MarkReason::Disarmed,
            2 => MarkReason::Landed,
            3 => MarkReason::Mishap,
            _ => return None,
        };
        Some(Self { why, sector: fields.u32(), frames: fields.u32() })
    }
}
