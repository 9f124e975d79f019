//! What came of a recording that was judged.

use std::collections::BTreeMap;

use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::health::{Level, Scope, vocabulary};
use hums_core::vehicle::Vehicle;

use super::flights::{Flight, begin_in_air};
use super::problem::{LISTED_MAX, Problem};
use crate::source::epochs::Epochs;
use crate::source::item::{About, Cause, Gap};
use crate::source::told::Finding;
use crate::summary::{EndsInAir, JudgedChecks};

/// The verdict where few checks had something to judge.
pub const TOO_LITTLE: &str = "too_little";

/// Who judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JudgedBy {
    /// The monitor on board: its findings are in the log.
    Board,
    /// This program.
    Here,
}

/// Where a recording has nothing of the vehicle, from and to: up to [`LISTED_MAX`].
#[derive(Clone, Debug, Default)]
pub struct Holes {
    pauses: Vec<(Instant, Instant)>,
    silences: Vec<(Instant, Instant)>,
}

impl Holes {
    /// The recording says so: time stands still over it.
    pub(super) fn pause(&mut self, from: Instant, to: Instant) {
        if self.pauses.len() < LISTED_MAX {
            self.pauses.push((from, to));
        }
    }

    /// The vehicle was silent, as far as is known.
    pub(super) fn silence(&mut self, from: Instant, to: Instant) {
        if self.silences.len() < LISTED_MAX {
            self.silences.push((from, to));
        }
    }

    /// Whether it has nothing just there: a gap that is none of these is a place, or a count over much of it.
    pub fn is_one(&self, span: &(Instant, Instant)) -> bool {
        self.pauses.contains(span) || self.silences.contains(span)
    }

    /// How much of this it does not have.
    pub fn within(&self, from: Instant, to: Instant) -> Span {
        let parts = self.pauses.iter().map(|(begin, end)| (*end).min(to).since((*begin).max(from)));
        parts.fold(Span::ZERO, |sum, part| sum + part)
    }
}

/// What came of a recording.
#[derive(Clone, Debug)]
pub struct Judged {
    /// Who judged.
    pub by: JudgedBy,
    /// The monitor as it was at the end: the vehicle, its usage, what it exceeded.
    pub monitor: Box<Monitor>,
    /// Facts besides, the last of each kind.
    pub facts: BTreeMap<About, String>,
    /// UTC of each part of the recording.
    pub epochs: Epochs,
    /// The first and the last time.
    pub span: Option<(Instant, Instant)>,
    /// How long it was armed.
    pub armed: Span,
    /// Flights, in order.
    pub flights: Vec<Flight>,
    /// The last of them goes on at the recording's end.
    pub ends_in_air: Option<EndsInAir>,
    /// Changes of level, in order, up to [`super::problem::LISTED_MAX`].
    pub findings: Vec<Finding>,
    /// How many there are.
    pub findings_count: u64,
    /// What was wrong, worst first.
    pub problems: Vec<Problem>,
    /// Checks that had something to judge.
    pub judged: Vec<&'static str>,
    /// Checks that had not, with the reason. Checks that are made for another autopilot are in neither list.
    pub not_judged: Vec<(&'static str, String)>,
    /// What else the monitor has not judged, as sentences.
    pub remarks: Vec<String>,
    /// Since when in the air nothing told how many cells its battery has, so that no voltage raised an alarm.
    pub cells_unknown: Option<Instant>,
    /// What is missing, in order, up to [`super::problem::LISTED_MAX`].
    pub gaps: Vec<Gap>,
    /// Where it has nothing from here to there.
    pub holes: Holes,
    /// How many gaps are damage.
    pub damages: u64,
    /// How many gaps are what the recorder lost while it recorded.
    pub losses: u64,
    /// How often the recording's clock began again.
    pub restarts: u64,
    /// It has no times, from its beginning on: nothing was judged.
    pub is_timeless: bool,
}

impl Judged {
    /// The vehicle, as it was known at the end.
    pub fn vehicle(&self) -> &Vehicle {
        self.monitor.vehicle()
    }

    /// Whether the vehicle was in the air when it was heard first.
    pub fn begins_in_air(&self) -> bool {
        begin_in_air(&self.flights)
    }

    /// Whether the recorder says itself, or it is seen, that it did not write all.
    pub fn is_lossy(&self) -> bool {
        self.gaps.iter().any(|gap| gap.cause == Cause::Lost && !gap.is_noise())
    }

    /// How long it was in the air, in all flights together.
    pub fn flown(&self) -> Span {
        self.flights.iter().fold(Span::ZERO, |sum, flight| sum + flight.air)
    }

    /// Why nothing is known of the vehicle, as words in its place; `None` where an autopilot was heard.
    pub fn unheard(&self) -> Option<String> {
        match (self.vehicle().source, self.vehicle().heartbeat.get()) {
            (None, _) => Some("none was heard".to_owned()),
            (Some(source), None) => Some(format!(
                "system {}, of which no heartbeat was heard while it was the vehicle",
                source.system
            )),
            (Some(_), Some(_)) => None,
        }
    }

    /// How many checks had something to judge.
    pub fn checks(&self) -> JudgedChecks {
        let is_of_box = |check: &&&str| {
            vocabulary(check)
                .is_some_and(|words| matches!(words.scope, Scope::Wire | Scope::Recorder | Scope::Stored))
        };
        let (judged, of_box) = (self.judged.len(), self.judged.iter().filter(is_of_box).count());
        JudgedChecks { judged, of_box, all: judged + self.not_judged.len() }
    }

    /// Whether so few had that nothing found is no good news.
    pub fn is_little(&self) -> bool {
        self.checks().is_little()
    }

    /// The verdict in a word, for scripts and tables: the worst level; what says that there was too little, or nothing, to
    /// judge is not `ok`.
    pub fn verdict(&self) -> &'static str {
        match self.worst() {
            None => "unknown",
            Some(Level::Ok) if self.is_little() => TOO_LITTLE,
            Some(level) => level.name(),
        }
    }

    /// The worst level that was found; `None` where nothing could be judged.
    pub fn worst(&self) -> Option<Level> {
        match self.problems.first() {
            Some(problem) => Some(problem.level),
            None if self.unheard().is_some() || self.is_timeless => None,
            None => Some(Level::Ok),
        }
    }
}
