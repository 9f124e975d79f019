//! Whether the cell count was known: without it the voltage raises no alarm.

use hums_core::clock::{Instant, Span};

use super::judged::JudgedBy;
use crate::utc::moment;

/// The cell count comes within this time after a recording's beginning in the air.
const CELLS_COME: Span = Span::from_secs(2);

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cells {
    unknown: Option<(Instant, Instant)>,
    unknown_on_board: bool,
    /// No count of the last flight.
    nothing_stored: bool,
}

impl Cells {
    pub(super) const fn told_unknown(&mut self) {
        self.unknown_on_board = true;
    }

    pub(super) const fn nothing_stored(&mut self) {
        self.nothing_stored = true;
    }

    pub(super) fn lack(&mut self, now: Instant) {
        let (from, _) = *self.unknown.get_or_insert((now, now));
        self.unknown = Some((from, now));
    }

    pub(super) fn unknown_since(&self, by: JudgedBy) -> Option<Instant> {
        self.unknown.filter(|_| self.are_unknown(by)).map(|(from, _)| from)
    }

    /// No voltage alarm for that reason.
    pub(super) fn are_unknown(&self, by: JudgedBy) -> bool {
        let lasts = || self.unknown.is_some_and(|(from, to)| to.since(from) >= CELLS_COME);
        match by {
            // The board waits before its report; a log may end before.
            JudgedBy::Board => self.unknown_on_board || (self.nothing_stored && lasts()),
            JudgedBy::Here => lasts(),
        }
    }

    /// A sentence; `None` without one.
    pub(super) fn words(&self, by: JudgedBy, begins_in_air: bool) -> Option<String> {
        if self.are_unknown(by) {
            let when = self
                .unknown
                .map_or_else(String::new, |(from, to)| format!(" from {} to {}", moment(from), moment(to)));
            return Some(format!(
                "cells not known{when}: the battery's voltage raised no alarm; the parameter BAT_CELLS tells how many"
            ));
        }
        let is_guess =
            by == JudgedBy::Board && begins_in_air && self.unknown.is_some() && !self.nothing_stored;
        is_guess.then(|| {
            "the box was started in the air, and took the number of cells from its last flight: a guess; BAT_CELLS makes it sure"
                .to_owned()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_without_a_store_guesses_no_cells() {
        let mut cells = Cells::default();
        for at_s in [70, 90] {
            cells.lack(Instant::from_millis(at_s * 1000));
        }
        let words = |cells: Cells| cells.words(JudgedBy::Board, true).unwrap_or_default();
        assert!(!cells.are_unknown(JudgedBy::Board));
        assert!(words(cells).contains("from its last flight: a guess"), "{}", words(cells));
        cells.nothing_stored();
        assert!(cells.are_unknown(JudgedBy::Board), "the log ends before the box says so");
        assert!(words(cells).starts_with("cells not known from 1:10.0 to 1:30.0"), "{}", words(cells));
    }
}
