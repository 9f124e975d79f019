//! End marks. When the vehicle comes to rest, a mark states that the log is whole up to there, and goes to the card
//! at once.
//!
//! A mark is a record of some ten bytes, and costs one write of the sector in progress, in its place. At most one is
//! written in [`APART`], so that frequent arming and disarming makes less than a kilobyte a minute. A mishap's mark
//! does not wait.

use hums_blackbox::record::MarkReason;
use hums_core::clock::{Instant, Span};

use crate::journal::Journal;

/// Minimum time between two marks. An earlier one waits, and is dropped if the vehicle moves meanwhile.
const APART: Span = Span::from_secs(1);

#[derive(Clone, Copy, Debug)]
pub(super) struct Marks {
    due: Option<MarkReason>,
    at: Option<Instant>,
    unsent: bool,
}

impl Marks {
    pub(super) const fn new() -> Self {
        Self { due: None, at: None, unsent: false }
    }

    /// The vehicle rests.
    pub(super) const fn rests(&mut self, why: MarkReason) {
        self.due = Some(why);
    }

    /// Power may fail in the next moment: all data goes to the card at once.
    pub(super) const fn at_once(&mut self, why: MarkReason) {
        (self.due, self.at) = (Some(why), None);
    }

    pub(super) const fn moves(&mut self) {
        self.due = None;
    }

    /// The mark after all other records of the moment; gives its sector to storage.
    pub(super) fn tick(&mut self, now: Instant, journal: &mut Journal<'_>) {
        if let Some(why) = self.due
            && self.at.is_none_or(|at| now.since(at) >= APART)
            && journal.mark(now, why)
        {
            *self = Self { due: None, at: Some(now), unsent: true };
        }
        if self.unsent && journal.has_room() {
            self.unsent = false;
            journal.partial();
        }
    }
}
