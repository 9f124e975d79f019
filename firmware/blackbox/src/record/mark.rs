//! End marks, written when no data is expected for a while.

use super::stored::{Field, Fields, Sink, numbered, record};

numbered! {
    /// The reason of a mark.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    MarkReason {
        /// The vehicle was disarmed on the ground.
        Disarmed = 1 "disarmed",
        /// The vehicle landed.
        Landed = 2 "landed",
        /// A mishap began, or ended with the vehicle down.
        Mishap = 3 "mishap",
    }
}

impl MarkReason {
    /// A sentence.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Disarmed => "disarming",
            Self::Landed => "landing",
            Self::Mishap => "mishap",
        }
    }
}

record! {
    /// Its sector is written to the card immediately. Without a gap, a log is complete up to it; the end behind the last
    /// mark is unproven.
    ///
    /// The sector that completes it has the check of all entries up to it.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    Mark {
        /// Why it was written.
        why: MarkReason,
        /// Sector in progress: the mark begins in it or in the next one.
        sector: u32,
        /// Frames of the session before the mark, modulo 2^32.
        frames: u32,
    }
}
