//! Whether a log is whole, in the same words everywhere.

use crate::ending::Ending;
use crate::source::item::{Cause, Gap};

/// The least first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Soundness {
    /// Nothing.
    #[default]
    Whole,
    /// Rebuilt from parity: nothing.
    Repaired,
    /// Nothing but parity.
    Unprotected,
    /// Perhaps its end, or an order that is proved.
    NotProved,
    /// Nothing; bytes outside frames.
    NotFrames,
    /// Something that its recorder did not write.
    Lossy,
    /// Was in it.
    Damaged,
}

impl Soundness {
    /// The soundness of a HUMS log.
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

    /// The soundness of another program's recording with this gap.
    pub fn of_gap(gap: &Gap) -> Self {
        match gap.cause {
            cause if cause.is_damage() => Self::Damaged,
            Cause::Lost if gap.is_noise() => Self::NotFrames,
            Cause::Lost => Self::Lossy,
            _ => Self::Whole,
        }
    }

    /// The name in JSON: `whole`, `repaired` (nothing is lost), `not_proved`, `lacks`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::Repaired | Self::Unprotected => "repaired",
            Self::NotProved => "not_proved",
            Self::NotFrames | Self::Lossy | Self::Damaged => "lacks",
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
