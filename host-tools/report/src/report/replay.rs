//! A recording read in order: the vehicle's reports become the history of its flight, and flights.

use std::sync::LazyLock;

use anyhow::Result;
use hums_core::clock::Instant;
use hums_core::happening::Happening;
use hums_core::health::Level;
use hums_core::observation::{Observation, Source};
use serde::Serialize;

use super::flights::{Extents, Flight};
use crate::check::causes::causes;
use crate::check::judge::{Judge, Limits};
use crate::check::judged::Judgement;
use crate::check::text::verdict;
use crate::counters::tells_flight;
use crate::page::history::History;
use crate::page::more::{NAMES as MORE, RowValues};
use crate::page::note::Note;
use crate::page::parameters::Parameters;
use crate::page::spectrum::{ROWS, Spectra, SpectrumJson};
use crate::reference::Reference;
use crate::source::item::{Cause, Item, Needs, Rows, Text};
use crate::source::recording::LogPlace;
use crate::statustext;
use crate::summary::{EndsInAir, JudgedChecks, Overview};

static NAMES: LazyLock<Vec<String>> =
    LazyLock::new(|| MORE.iter().chain(&ROWS).map(|name| (*name).to_owned()).collect());

/// Texts kept at most; beyond this they are only counted.
const TEXTS_MAX: usize = 1_000;

/// A part of the flight that is not in the record.
#[derive(Debug, Serialize)]
pub struct MissingPart {
    /// Start, if known.
    from_s: Option<f64>,
    /// The content and its reason.
    words: String,
}

/// Result of reading a log.
#[derive(Debug, Default)]
pub struct Replay {
    /// Its flight.
    pub history: History,
    /// Flights, as `hums check` finds them.
    pub flights: Vec<Flight>,
    /// Number of texts of the vehicle.
    pub texts_count: u64,
    /// Number of checks with data; `None` if nothing was judged.
    pub judged: Option<JudgedChecks>,
    /// The flight state is known.
    pub tells_flight: bool,
    /// The vehicle's last state, if its last flight goes on at the end.
    pub ends_in_air: Option<EndsInAir>,
    /// The gaps, with their places.
    pub missing: Vec<MissingPart>,
    /// Number of checks with a critical problem, and with a warning.
    pub found: (usize, usize),
    /// Spectra of its inertial sensor.
    pub spectra: Vec<SpectrumJson>,
    /// The verdict of `hums check`, as a sentence.
    pub verdict: String,
    /// Its texts.
    notes: Vec<(Instant, Note)>,
    reference: Reference,
    extents: Extents,
}

/// The autopilot's parameters as they were at the end of a recording.
pub fn parameters(place: &LogPlace) -> Result<Vec<(String, f64)>> {
    let mut parameters = Parameters::default();
    place.open()?.read(Needs::default(), &mut |at, item| {
        if let Item::Parameter(parameter) = item {
            parameters.take(at, parameter.name, parameter.value);
        }
        Ok(())
    })?;
    Ok(parameters.last().map(|(name, value)| (name.to_owned(), value)).collect())
}

impl Replay {
    /// Reads a recording with this overview.
    pub fn of(place: &LogPlace, overview: &Overview) -> Result<Self> {
        let mut replay = Self::default();
        let want = Needs { frames: true, observations: true, rows: Rows::Named(&NAMES), ..Needs::default() };
        let mut spectra = Spectra::default();
        let recording = place.open()?;
        let mut judge = Judge::new(&Limits::default(), recording.format);
        recording.read(want, &mut |at, item| {
            judge.item(at, item);
            if let Item::Row(row) = &item {
                spectra.row(at, row);
            }
            replay.item(at, item, &judge);
            Ok(())
        })?;
        replay.history.judged_by(judge.params(), judge.cell_count());
        replay.spectra = spectra.end();
        let judged = judge.end();
        replay.flights = replay.extents.flights(&judged.flights);
        replay.judged = judged.worst().map(|_| judged.checks());
        replay.tells_flight = tells_flight(judged.vehicle());
        replay.ends_in_air = judged.ends_in_air;
        replay.gaps(&judged);
        let count = |level| judged.problems.iter().filter(|problem| problem.level == level).count();
        replay.found = (count(Level::Critical), count(Level::Warning));
        replay.verdict = verdict(&judged);
        let findings = &overview.contents.findings;
        let causes = causes(findings);
        let found = findings.iter().zip(&causes);
        let found = found.map(|(finding, cause)| {
            let note = Note::found(finding, cause.as_deref());
            (finding.at, note.of_part(overview.contents.due(finding).as_ref()))
        });
        replay.notes.extend(found);
        if let Some(at) = judged.cells_unknown {
            replay.notes.extend(Note::event(at, Happening::CellsUnknown, false).map(|note| (at, note)));
        }
        replay.notes.sort_by_key(|(at, _)| *at);
        for (at, note) in replay.notes.drain(..) {
            replay.history.note(at, note);
        }
        Ok(replay)
    }

    fn gaps(&mut self, judged: &Judgement) {
        for gap in &judged.gaps {
            let span = gap.from.or(gap.to).zip(gap.to.or(gap.from));
            // A gap of unknown length is a place, and so is a count over much of the recording. A gap without
            // any time is only in the table.
            let is_empty = span.is_some_and(|span| judged.holes.is_one(&span));
            self.history.gap(span.map(|(from, to)| (from, if is_empty { to } else { from })));
            if gap.cause != Cause::NotKept && !gap.is_noise() {
                let from_s = gap.from.map(Instant::as_secs_f64);
                self.missing.push(MissingPart { from_s, words: gap.words.clone() });
            }
        }
    }

    fn item(&mut self, at: Instant, item: Item<'_>, judge: &Judge) {
        match item {
            Item::Frame(frame) => self.history.frame(at, frame, self.reference.vehicle().source),
            Item::Observation(source, observation) => self.observe(at, source, observation, judge),
            Item::Text(text) => self.keep(at, text),
            Item::Parameter(parameter) => self.history.parameter(at, parameter.name, parameter.value),
            Item::Row(row) => {
                if let Some(more) = RowValues::of(&row) {
                    self.history.more(at, &more);
                }
            }
            Item::Gap(_) => self.history.gap(None),
            _ => {}
        }
    }

    fn observe(&mut self, at: Instant, source: Source, observation: &Observation, judge: &Judge) {
        if self.reference.observe(at, source, observation) {
            self.history.sample(at, &self.reference, observation);
            let (flight, phase) = judge.phase();
            self.history.phase(at, flight, phase);
            self.extents.take(at, judge.flight(), &self.reference);
            if let Observation::Vibration(_) = observation {
                self.history.vibration_limit(at, judge.vibration_limit());
            }
        }
    }

    fn keep(&mut self, at: Instant, text: Text<'_>) {
        self.texts_count += 1;
        if self.notes.len() < TEXTS_MAX {
            let text = statustext::StatusText::whole(at, text.source, text.severity, text.words);
            self.notes.push((at, Note::text(text)));
        }
    }
}
