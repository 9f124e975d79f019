//! A recording and what came of it.

use super::judged::Judged;
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
}

impl Checked {
    /// How the run ended for this one.
    pub(super) fn outcome(&self) -> Outcome {
        let damaged = self.judged.damages > 0 || (self.format == Format::Hums && self.judged.losses > 0);
        let wrong = !self.judged.problems.is_empty();
        Outcome::lossy(damaged).and(if wrong { Outcome::Findings } else { Outcome::Done })
    }
}
