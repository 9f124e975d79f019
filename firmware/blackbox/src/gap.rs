//! Unreadable parts of a log.

use hums_core::clock::Instant;

use crate::group::GroupError;

/// The reason that a part is unreadable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// Missing sectors: never written, overwritten or lost.
    Missing,
    /// Sectors with a wrong checksum.
    Damaged,
    /// The group uses message layouts of this unknown hash.
    UnknownLayouts(u32),
    /// Valid sectors with contents that no writer produces.
    Corrupt,
    /// Valid sectors with altered entries: the recorder's memory had changed.
    Altered,
    /// Nothing was written while the vehicle was disarmed: of other recorders.
    Disarmed,
}

impl Cause {
    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Damaged => "damaged",
            Self::UnknownLayouts(_) => "unknown_layouts",
            Self::Corrupt => "corrupt",
            Self::Altered => "altered",
            Self::Disarmed => "disarmed",
        }
    }
}

/// A part of the log that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The last entry before it; `None`: nothing was read before it.
    pub from: Option<Instant>,
    /// The first entry after it; `None`: nothing is readable after it.
    pub to: Option<Instant>,
    /// Why.
    pub cause: Cause,
    /// Sectors missing or damaged.
    pub sectors_lost: u32,
    /// Sound sectors of the same group that cannot be decoded without those.
    pub sectors_skipped: u32,
    /// Missing frames, if the counts on both sides are known; at a log's end only those of the skipped sectors.
    pub frames: Option<u32>,
}

impl From<GroupError> for Cause {
    fn from(error: GroupError) -> Self {
        match error {
            GroupError::OutOfOrder => Self::Missing,
            GroupError::UnknownLayouts(hash) => Self::UnknownLayouts(hash),
            GroupError::Corrupt => Self::Corrupt,
            GroupError::Altered => Self::Altered,
        }
    }
}
