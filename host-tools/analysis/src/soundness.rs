//! Whether a log has all that it should, in the same words for every command.

use crate::ending::Ending;

/// What a log lacks, the least first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Soundness {
    /// Nothing.
    Whole,
    /// Nothing: lost sectors were rebuilt from parity.
    Repaired,
    /// Nothing but parity.
    Unprotected,
    /// Perhaps its end, or an order that is proved.
    NotProved,
    /// Nothing: bytes of no frame are in it.
    NotFrames,
    /// Something that its recorder did not write.
    Lossy,
    /// Something that was in it.
    Damaged,
}

impl Soundness {
    /// Of a log of ours.
    pub fn of(ending: &Ending) -> Self {
        let (summary, is_counted) = (&ending.summary, ending.aside().is_none());
        match () {
            () if is_counted && summary.gaps + summary.blocks.damaged > 0 => Self::Damaged,
            () if is_counted && summary.marks.lost > 0 => Self::Lossy,
            () if !ending.unproved().is_empty() => Self::NotProved,
            () if ending.unprotected() > 0 => Self::Unprotected,
            () if ending.made_again() > 0 => Self::Repaired,
            () => Self::Whole,
        }
    }

    /// As a part of a sentence about the log; empty if it is whole.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Whole => "",
            Self::Repaired => "repaired from its parity, nothing is lost",
            Self::Unprotected => "whole, without all of its parity",
            Self::NotProved => "not proved to be whole",
            Self::NotFrames => "bytes of no frame are in it",
            Self::Lossy => "part of it was not recorded",
            Self::Damaged => "part of it is missing or damaged",
        }
    }
}
