//! A recording and its judgement.

use super::judged::Judgement;
use crate::ending::Ending;
use crate::outcome::Outcome;
use crate::soundness::Soundness;
use crate::source::item::Gap;
use crate::source::recording::Format;

/// A recording, judged.
pub struct Checked {
    /// Name of the recording for people.
    pub name: String,
    /// Format of the recording.
    pub format: Format,
    /// The judgement.
    pub judged: Judgement,
    /// The evidence of its end, for a HUMS log.
    pub ending: Option<Ending>,
}

impl Checked {
    /// Losses, damage, missing proof.
    pub fn soundness(&self) -> Soundness {
        let judged = &self.judged;
        let read = match () {
            () if judged.damages > 0 => Soundness::Damaged,
            () if judged.is_lossy() => Soundness::Lossy,
            () if judged.gaps.iter().any(Gap::is_noise) => Soundness::NotFrames,
            () => Soundness::Whole,
        };
        self.ending.as_ref().map_or(Soundness::Whole, Soundness::of).max(read)
    }

    pub(super) fn outcome(&self) -> Outcome {
        let wrong = !self.judged.problems.is_empty();
        // The verdict reports too little to judge; it is no damage.
        let damaged = self.aside().is_none() && self.judged.damages > 0;
        let lossy = damaged || !self.faults().is_empty();
        Outcome::lossy(lossy).and(if wrong { Outcome::Findings } else { Outcome::Done })
    }

    /// Parts of sentences: see [`Ending::faults`].
    pub fn faults(&self) -> Vec<String> {
        self.ending.as_ref().map_or_else(Vec::new, Ending::faults)
    }

    /// The kind of recording, if its losses do not count: see [`Ending::aside`].
    pub fn aside(&self) -> Option<String> {
        self.ending.as_ref().and_then(Ending::aside)
    }
}
