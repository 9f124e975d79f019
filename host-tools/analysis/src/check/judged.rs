//! A recording's judgement.

use std::collections::{BTreeMap, BTreeSet};

use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::health::{Level, Subsystem, check_named};
use hums_core::vehicle::Vehicle;
use hums_link::vocabulary::Scope;

use super::coverage::OFF;
use super::flights::{Flight, begin_in_air};
use super::problem::{LISTED_MAX, Problem, Problems, rank, worst_first};
use super::radio::Told;
use super::trends::{Baselines, Episode, because};
use crate::names::vocabulary;
use crate::source::epochs::Epochs;
use crate::source::item::{Cause, FactKind, Gap};
use crate::source::told::Finding;
use crate::summary::{EndsInAir, JudgedChecks};

/// Verdict: little data.
pub const TOO_LITTLE: &str = "too_little";

/// The judge of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JudgedBy {
    /// Findings are in the log.
    Board,
    /// This program.
    Here,
}

/// A box's counts of the time in the air since power-on.
#[derive(Clone, Copy, Debug)]
pub struct BoxAir {
    /// The first count, s.
    pub first_s: f64,
    /// The last count, s.
    pub last_s: f64,
    /// The time of the last count.
    pub at: Instant,
}

/// Times without data of the vehicle, from and to: up to [`LISTED_MAX`].
#[derive(Clone, Debug, Default)]
pub struct Holes {
    pauses: Vec<(Instant, Instant)>,
    silences: Vec<(Instant, Instant)>,
}

impl Holes {
    /// Reported: time stops.
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

    /// Exactly one of the holes; other gaps are moments or counts.
    pub fn is_one(&self, span: &(Instant, Instant)) -> bool {
        self.pauses.contains(span) || self.silences.contains(span)
    }

    /// Missing part.
    pub fn within(&self, from: Instant, to: Instant) -> Span {
        let parts = self.pauses.iter().map(|(begin, end)| (*end).min(to).since((*begin).max(from)));
        parts.fold(Span::ZERO, |sum, part| sum + part)
    }
}

/// The judgement of a recording.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// Who judged.
    pub by: JudgedBy,
    /// Vehicle, usage, exceedances at the end.
    pub monitor: Box<Monitor>,
    /// The last of each kind.
    pub facts: BTreeMap<FactKind, String>,
    /// UTC of each part of the recording.
    pub epochs: Epochs,
    /// First and last time.
    pub span: Option<(Instant, Instant)>,
    /// Time armed.
    pub armed: Span,
    /// Flights, in order.
    pub flights: Vec<Flight>,
    /// Time in the air as a box counts it.
    pub box_air: Option<BoxAir>,
    /// The last of them goes on at the recording's end.
    pub ends_in_air: Option<EndsInAir>,
    /// Changes of level in order, up to [`super::problem::LISTED_MAX`].
    pub findings: Vec<Finding>,
    /// Texts to the pilot, in order; none without [`super::judge::Judge::telling`].
    pub told: Vec<Told>,
    /// Number of findings.
    pub findings_count: u64,
    /// Worst first.
    pub problems: Vec<Problem>,
    /// Checks that had something to judge.
    pub judged: Vec<&'static str>,
    /// With the reason; checks for another autopilot are in neither list.
    pub not_judged: Vec<(&'static str, String)>,
    /// Flights and changes of parts, for trends.
    pub episodes: Vec<Episode>,
    /// Systems by heartbeats, in order of ids.
    pub systems: Vec<u8>,
    /// Remarks, as sentences.
    pub remarks: Vec<String>,
    /// Start of unknown cells in the air: no voltage alarm.
    pub cells_unknown: Option<Instant>,
    /// Gaps in order, up to [`super::problem::LISTED_MAX`].
    pub gaps: Vec<Gap>,
    /// The times without data.
    pub holes: Holes,
    /// Damage.
    pub damages: u64,
    /// Lost by the recorder.
    pub losses: u64,
    /// Number of restarts of the recording's clock.
    pub restarts: u64,
    /// No times at all: nothing judged.
    pub is_timeless: bool,
}

impl Judgement {
    /// The vehicle, as it was known at the end.
    pub fn vehicle(&self) -> &Vehicle {
        self.monitor.vehicle()
    }

    /// First received in the air.
    pub fn begins_in_air(&self) -> bool {
        begin_in_air(&self.flights)
    }

    /// Reported, or shown by the recording.
    pub fn is_lossy(&self) -> bool {
        self.gaps.iter().any(|gap| gap.cause == Cause::Lost && !gap.is_noise())
    }

    /// Time in the air, in all flights together.
    pub fn flown(&self) -> Span {
        self.flights.iter().fold(Span::ZERO, |sum, flight| sum + flight.air)
    }

    /// Judges flights against earlier flights; learns from them.
    pub fn judge_trends(&mut self, past: &mut Baselines) {
        if self.is_timeless {
            return;
        }
        let mut trends = Problems::default();
        for episode in &self.episodes {
            let Episode::Flown(flown) = episode else {
                *past = Baselines::default();
                continue;
            };
            let (found, judged) = past.judge(flown, self.monitor.params());
            for finding in &found {
                trends.take(finding, Span::ZERO);
            }
            let is_judged = |check: &str| judged.contains(&check);
            self.not_judged.retain(|(check, _)| !is_judged(check));
            let new = judged.iter().filter(|check| !self.judged.contains(check)).copied();
            self.judged.extend(new.collect::<BTreeSet<_>>());
        }
        let (count, mut findings, trends) = trends.all();
        self.findings_count += count;
        self.findings.append(&mut findings);
        self.findings.sort_by_key(|finding| finding.at);
        for problem in &trends {
            // The box's check that is a trend too has the worse level.
            let is_same = |of: &Problem| (&of.check, of.instance) == (&problem.check, problem.instance);
            let is_worse = |of: &Problem| rank(of.level) >= rank(problem.level);
            if !self.problems.iter().any(|of| is_same(of) && is_worse(of)) {
                self.problems.retain(|of| !is_same(of));
                self.problems.push(Problem { because: because(problem, &trends), ..problem.clone() });
            }
        }
        worst_first(&mut self.problems);
    }

    /// Words in its place; `None` with an autopilot.
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

    /// Number of checks with data.
    pub fn checks(&self) -> JudgedChecks {
        let is_of_box = |check: &&&str| {
            vocabulary(check)
                .is_some_and(|words| matches!(words.scope, Scope::Wire | Scope::Recorder | Scope::Stored))
        };
        let (judged, of_box) = (self.judged.len(), self.judged.iter().filter(is_of_box).count());
        let lacking = self.not_judged.iter().filter(|(check, why)| self.could_apply(check, why));
        JudgedChecks { judged, of_box, all: judged + lacking.count() }
    }

    fn could_apply(&self, check: &str, why: &str) -> bool {
        let is_of_engine =
            |check: &str| check_named(check).is_some_and(|check| check.subsystem == Subsystem::Engine);
        let is_of_box = vocabulary(check)
            .is_none_or(|words| matches!(words.scope, Scope::Wire | Scope::Recorder | Scope::Stored));
        let has_engine = || self.judged.iter().any(|check| is_of_engine(check));
        !is_of_box && why != OFF && (!is_of_engine(check) || has_engine())
    }

    /// Too little for a clean result.
    pub fn is_little(&self) -> bool {
        self.checks().is_little()
    }

    /// The worst level, for scripts; too little is not `ok`.
    pub fn verdict(&self) -> &'static str {
        match self.worst() {
            None => "unknown",
            Some(Level::Ok) if self.is_little() => TOO_LITTLE,
            Some(level) => level.name(),
        }
    }

    /// `None` if nothing could be judged.
    pub fn worst(&self) -> Option<Level> {
        match self.problems.first() {
            Some(problem) => Some(problem.level),
            None if self.unheard().is_some() || self.is_timeless => None,
            None => Some(Level::Ok),
        }
    }
}
