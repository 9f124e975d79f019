//! A recording and what came of it.

use super::judged::Judged;
use crate::ending::Ending;
use crate::outcome::Outcome;
use crate::source::recording::Format;

/// A recording, judged.
pub struct Checked {
    /// What people call it.
    pub name: String,
    /// What it is.
    pub format: Format,
    /// What came of it.
    pub judged: Judged,
    /// Whether it is whole, of a log of ours.
    pub ending: Option<Ending>,
}

impl Checked {
    /// How the run ended for this one.
    pub(super) fn outcome(&self) -> Outcome {
        let wrong = !self.judged.problems.is_empty();
        // Too little to judge, or nothing, is no damage: the verdict says so.
        let damaged = self.aside().is_none() && self.judged.damages > 0;
        let lossy = damaged || !self.faults().is_empty();
        Outcome::lossy(lossy).and(if wrong { Outcome::Findings } else { Outcome::Done })
    }

    /// What is wrong with a log of ours, as parts of sentences: see [`Ending::faults`].
    pub fn faults(&self) -> Vec<String> {
        self.ending.as_ref().map_or_else(Vec::new, Ending::faults)
    }

    /// What it is, where its losses do not count: see [`Ending::aside`].
    pub fn aside(&self) -> Option<String> {
        self.ending.as_ref().and_then(Ending::aside)
    }
}
