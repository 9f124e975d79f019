//! End marks: when the vehicle comes to rest, a mark says that the log is whole up to there, and goes to the card at once.
//!
//! A mark is a record of some ten bytes, and costs one write of the sector in progress, in its place. At most one is
//! written in [`APART`], so that a vehicle that is armed and disarmed all the time makes less than a kilobyte a minute. That of a
//! mishap does not wait: there is one for each.

use hums_blackbox::SectorSink as _;
use hums_blackbox::record::Resting;
use hums_core::clock::{Instant, Span};

use crate::journal::Journal;
use crate::queues::SectorsIn;

/// From one mark to the next at least. One that comes sooner waits, and is dropped if the vehicle moves on meanwhile.
const APART: Span = Span::from_secs(1);

/// Which mark is to be written, and what of it is to be done.
#[derive(Clone, Copy, Debug)]
pub(super) struct Marks {
    due: Option<Resting>,
    at: Option<Instant>,
    /// The sector that holds the last one is not with storage yet.
    unsent: bool,
}

impl Marks {
    pub(super) const fn new() -> Self {
        Self { due: None, at: None, unsent: false }
    }

    /// The vehicle rests.
    pub(super) const fn rests(&mut self, why: Resting) {
        self.due = Some(why);
    }

    /// Something happened after which the next moment may be the last: what is known now goes to the card at once.
    pub(super) const fn at_once(&mut self, why: Resting) {
        (self.due, self.at) = (Some(why), None);
    }

    /// The vehicle is armed or takes off: a mark from before says nothing of what comes now.
    pub(super) const fn moves(&mut self) {
        self.due = None;
    }

    /// Writes the mark that is due, after all other records of the moment, and gives its sector to storage.
    pub(super) fn tick(&mut self, now: Instant, journal: &mut Journal<'_>, sectors: &mut SectorsIn) {
        if let Some(why) = self.due
            && self.at.is_none_or(|at| now.since(at) >= APART)
            && journal.mark(now, why, sectors)
        {
            *self = Self { due: None, at: Some(now), unsent: true };
        }
        if self.unsent && sectors.with_reserve(|sink| sink.room()) > 0 {
            self.unsent = false;
            journal.partial(sectors);
        }
    }
}
