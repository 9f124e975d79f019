//! A flight on the page, bounded: series for the plots, the track, phases, modes, parameters, texts and
//! findings.
//!
//! It only grows at its end, so a page asks for the part after its last one ([`Cursor`]); a slow page needs no queue.
//! If older parts changed (joined intervals, a thinned track) the page takes everything again.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::fmt::Write as _;

use hums_core::clock::{Instant, Span};
use hums_core::flight::{Flight, Phase};
use hums_core::observation::{Autopilot, Observation, Source};
use hums_core::parameters::Params;
use hums_link::{Check, Frame};
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use super::frames::{Frames, Sign};
use super::modes;
use super::more::{self, RowValues};
use super::note::Note;
use super::parameters::{ParameterJson, Parameters};
use super::plots::{self, Line, Plot};
use super::samples::Samples;
use super::spans::{Rest, SentSpans, Spans};
use crate::reference::Reference;
use crate::series::{self, Store};
use crate::track::Point;

/// Notes kept at most; older ones go.
const NOTES_MAX: usize = 2_000;
/// Drawing period of a page's plots, and period of its updates.
const DRAWN_EVERY: Span = Span::from_millis(100);
const PHASE_MIN: Span = Span::from_secs(2);
const GAPS_MAX: usize = 2_000;

/// Everything that is kept.
#[derive(Clone, Debug, Default)]
pub struct History {
    samples: Samples,
    frames: Frames,
    notes: VecDeque<(Instant, Note)>,
    /// Dropped notes, so that the others keep their numbers.
    notes_gone: u64,
    phases: Spans,
    modes: Spans,
    parameters: Parameters,
    gaps: Vec<(Instant, Instant)>,
    autopilot: Autopilot,
    params: Option<Box<Params>>,
    cells: u8,
    /// Counts the changes of plots' names and limits.
    words: u64,
}

/// The part of a history that a page has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cursor {
    thinned: u64,
    /// The row of intervals.
    spacing_ms: Option<(u64, u64)>,
    /// The first interval that may be incomplete on the page, and the number of values when it was sent;
    /// `None` before the first part.
    interval: Option<(u16, u64)>,
    /// Lines and their words.
    described: (usize, u64),
    notes: u64,
    places: usize,
    phases: SentSpans,
    modes: SentSpans,
    gaps: usize,
    until: Option<Instant>,
    /// Time of its last update of series.
    drawn: Option<Instant>,
}

/// The part of a history that a page does not have yet.
#[derive(Debug, Default, Serialize)]
pub struct HistoryPart {
    pub(super) t: &'static str,
    pub(super) vehicle: u8,
    /// Drop all earlier data of it.
    pub(super) reset: bool,
    pub(super) start_s: f64,
    pub(super) step_s: f64,
    /// All plots, if there is a new one or a new name.
    pub(super) plots: Option<Vec<PlotJson>>,
    pub(super) series: Series,
    pub(super) notes: Vec<Note>,
    /// Notes that there was no room for: the oldest ones.
    pub(super) notes_gone: u64,
    pub(super) track: Vec<TrackPoint>,
    pub(super) phases: Option<Rest>,
    pub(super) modes: Option<Rest>,
    /// All gaps of the record, if there is a new one: from and to, seconds.
    pub(super) gaps: Option<Vec<(f64, f64)>>,
    pub(super) parameters: Vec<ParameterJson>,
    pub(super) parameters_left_out: u64,
    /// The log has defaults of parameters: a parameter without one is at its default.
    pub(super) tells_defaults: bool,
}

/// Seconds, degrees north, degrees east, height in metres.
pub type TrackPoint = (f64, f64, f64, Option<f32>);

/// A plot in words, as [`plots`] has them.
#[derive(Debug, Serialize)]
pub struct PlotJson {
    pub(super) id: String,
    pub(super) group: &'static str,
    pub(super) title: String,
    pub(super) unit: &'static str,
    pub(super) decimals: u8,
    /// See [`plots::limits`].
    pub(super) limits: Vec<plots::Limits>,
    /// Numbers and names. Lines of one number have one colour in all plots.
    pub(super) lines: Vec<(u8, String)>,
}

/// Each line's new intervals: `"Altitude:0": [numbers, values]`; numbers count from the one before, the first from 0.
#[derive(Debug, Default)]
pub(super) struct Series(pub(super) Vec<(String, u8, series::Part)>);

impl Serialize for Series {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (key, decimals, (numbers, values)) in &self.0 {
            let mut before = 0;
            let step = |number: &u16| number.wrapping_sub(std::mem::replace(&mut before, *number));
            let steps: Vec<u16> = numbers.iter().map(step).collect();
            let scale = 10_f64.powi(i32::from(*decimals));
            let values: Vec<f64> =
                values.iter().map(|value| (f64::from(*value) * scale).round() / scale).collect();
            map.serialize_entry(key, &(steps, values))?;
        }
        map.end()
    }
}

impl History {
    /// Keeps a text or a finding: once, if a HUMS on board and the checks here found the same.
    pub fn note(&mut self, at: Instant, note: Note) {
        /// Number of notes compared: a larger number is not a single event.
        const LOOKED_AT: usize = 64;
        if self.notes.iter().rev().take(LOOKED_AT).any(|(_, known)| known.is_again(&note)) {
            return;
        }
        if self.notes.len() >= NOTES_MAX {
            self.notes.pop_front();
            self.notes_gone += 1;
        }
        self.notes.push_back((at, note));
    }

    /// Marks of a time line: times and levels of findings, warning and worse.
    pub fn marks(&self) -> Vec<(f64, &'static str)> {
        let marks = self.notes.iter().filter(|(_, note)| {
            note.kind == "event" || (note.kind == "finding" && matches!(note.level, "warning" | "critical"))
        });
        marks.map(|(_, note)| (note.at_s, if note.kind == "event" { "event" } else { note.level })).collect()
    }

    /// Takes a frame of the vehicle's system: counts it, and takes values other than observations.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>, vehicle: Option<Source>) {
        if frame.check() != Check::Verified {
            return;
        }
        let sign = Sign { at, source: frame.source(), sequence: frame.sequence() };
        self.frames.take(&sign, vehicle, &mut self.samples.store);
        if more::is_of_use(frame.id()) && vehicle == Some(frame.source()) {
            self.samples.message(at, frame.id(), frame.payload());
        }
    }

    /// Takes values other than observations from a row of an autopilot's own log.
    pub fn more(&mut self, at: Instant, more: &RowValues) {
        match more {
            RowValues::Values(values) => self.samples.values(at, values),
            RowValues::Default(default) => self.parameters.learn_default(default),
        }
    }

    /// Time passes: to be called before a page is shown the time up to `now`.
    pub fn pass(&mut self, now: Instant) {
        self.frames.pass(now, &mut self.samples.store);
    }

    /// A gap of the recording: frame numbers start again after it. Some gaps have a beginning and an end.
    pub fn gap(&mut self, span: Option<(Instant, Instant)>) {
        self.frames.gap();
        if let Some(span) = span.filter(|_| self.gaps.len() < GAPS_MAX) {
            let place = self.gaps.partition_point(|known| *known < span);
            self.gaps.insert(place, span);
        }
    }

    /// Takes an observation, after `reference` has taken it.
    pub fn sample(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        if let Observation::Heartbeat(heartbeat) = observation {
            self.words += u64::from(heartbeat.autopilot != self.autopilot);
            self.autopilot = heartbeat.autopilot;
            self.modes.extend(at, modes::name(heartbeat), Span::ZERO);
        }
        self.samples.take(at, reference, observation);
    }

    /// Takes the vehicle's phase from its monitor.
    pub fn phase(&mut self, at: Instant, flight: &Flight, phase: Phase) {
        let phase = Cow::Borrowed(phase.name());
        if flight.airborne() && !flight.was_on_ground() {
            // It was so before that was seen.
            self.phases.begin_as(phase.clone());
        }
        self.phases.extend(at, phase, PHASE_MIN);
    }

    /// Takes the limit of the vibration, which follows the usual level of the flight.
    pub fn vibration_limit(&mut self, at: Instant, limit: Option<f32>) {
        if let Some(limit) = limit {
            self.samples.store.push(at, (Plot::Vibration, plots::RISE), limit);
        }
    }

    /// Takes a parameter of the autopilot.
    pub fn parameter(&mut self, at: Instant, name: &str, value: f64) {
        self.parameters.take(at, name, value);
    }

    /// Takes the limits that hold, and how many cells the one battery has, if that is known.
    pub fn judged_by(&mut self, params: &Params, cells: u8) {
        if self.params.as_deref() != Some(params) || self.cells != cells {
            self.params = Some(Box::new(*params));
            self.cells = cells;
            self.words += 1;
        }
    }

    pub(super) fn drawn(&self) -> (&Store<Plot>, Autopilot, Option<&Params>) {
        (&self.samples.store, self.autopilot, self.params.as_deref())
    }

    /// Last value of each parameter.
    pub fn last_parameters(&self) -> impl Iterator<Item = (&str, f64)> {
        self.parameters.last()
    }

    /// Its track.
    pub fn track(&self) -> &[Point] {
        self.samples.track.points()
    }

    /// The part up to `until` that a page with this cursor lacks; moves the cursor there. `None` without
    /// news.
    pub fn since(&self, vehicle: u8, cursor: &mut Cursor, until: Instant) -> Option<HistoryPart> {
        let Samples { store, track, thinned, .. } = &self.samples;
        let spacing_ms = store.spacing_ms();
        let same = (cursor.thinned, cursor.spacing_ms) == (*thinned, spacing_ms);
        let reset = cursor.interval.is_none() || !same;
        if reset {
            *cursor = Cursor { thinned: *thinned, spacing_ms, ..Cursor::default() };
        }
        let (start_ms, step_ms) = spacing_ms.unwrap_or((until.as_millis(), 1));
        let newest = until.as_millis().saturating_sub(start_ms) / step_ms.max(1);
        let newest = u16::try_from(newest).unwrap_or(u16::MAX - 1);
        let mut series = Vec::new();
        // While time stands still, the page gets no further values.
        let stands = cursor.until == Some(until);
        if stands || cursor.drawn.is_none_or(|drawn| until.since(drawn) >= DRAWN_EVERY) {
            cursor.drawn = Some(until);
            let (from, seen) = cursor.interval.unwrap_or((0, 0));
            let about = |plot| plots::about(plot, self.autopilot);
            let parts = store.news(from..=newest, seen);
            series.extend(parts.map(|(line, part)| (name(line), about(line.0).decimals, part)));
            // The newest interval may still change.
            cursor.interval = Some((newest.max(from), store.taken()));
        }

        let described = (store.lines().count(), self.words);
        let plots = (reset || cursor.described != described).then(|| self.plots());
        cursor.described = described;

        let known = self.notes.partition_point(|(at, _)| *at <= until);
        let skip = usize::try_from(cursor.notes.saturating_sub(self.notes_gone)).unwrap_or(usize::MAX);
        let notes: Vec<_> = self.notes.iter().take(known).skip(skip).map(|(_, note)| note.clone()).collect();
        cursor.notes = self.notes_gone + known as u64;

        let points = track.points();
        let places = points.partition_point(|place| place.at <= until);
        let new = points.get(cursor.places..places).unwrap_or_default();
        let track: Vec<_> = new.iter().map(|place| told(place, Instant::ZERO)).collect();
        cursor.places = places;

        let (phases, modes) =
            (self.phases.since(&mut cursor.phases, until), self.modes.since(&mut cursor.modes, until));
        let parameters = self.parameters.since(cursor.until, until);
        cursor.until = Some(until);
        let gaps = self.gaps.get(..self.gaps.partition_point(|(from, _)| *from <= until)).unwrap_or_default();
        let is_new = std::mem::replace(&mut cursor.gaps, gaps.len()) != gaps.len();
        let seconds = |(from, to): &(Instant, Instant)| (from.as_secs_f64(), to.as_secs_f64());
        let gaps = (reset || is_new).then(|| gaps.iter().map(seconds).collect());

        let something = reset
            || plots.is_some()
            || !(series.is_empty() && notes.is_empty() && track.is_empty() && parameters.is_empty())
            || phases.is_some()
            || modes.is_some()
            || gaps.is_some();
        something.then(|| HistoryPart {
            t: "history",
            vehicle,
            reset,
            start_s: start_ms as f64 / 1e3,
            step_s: step_ms as f64 / 1e3,
            plots,
            series: Series(series),
            notes,
            notes_gone: self.notes_gone,
            track,
            phases,
            modes,
            gaps,
            parameters,
            parameters_left_out: self.parameters.left_out(),
            tells_defaults: self.parameters.tells_defaults(),
        })
    }

    fn plots(&self) -> Vec<PlotJson> {
        let mut all: Vec<(Plot, PlotJson)> = Vec::new();
        for (plot, line) in self.samples.store.lines() {
            let about = plots::about(plot, self.autopilot);
            let named = (line, (about.name)(line));
            if let Some((_, json)) = all.last_mut().filter(|(last, _)| *last == plot) {
                json.lines.push(named);
                continue;
            }
            let params = self.params.as_deref();
            let limits = params
                .map(|params| plots::limits(plot, self.autopilot, params, self.cells))
                .unwrap_or_default();
            let plots::PlotProperties { group, title, unit, decimals, .. } = about;
            let (id, title) = (format!("{plot:?}"), title.to_owned());
            all.push((plot, PlotJson { id, group, title, unit, decimals, limits, lines: vec![named] }));
        }
        all.into_iter().map(|(_, json)| json).collect()
    }
}

fn name((plot, line): Line) -> String {
    // Room for the longest: it is made ten times a second for each line.
    let mut name = String::with_capacity(24);
    let _ = write!(name, "{plot:?}:{line}");
    name
}

pub(super) fn told(place: &Point, from: Instant) -> TrackPoint {
    let height_m = place.height_m.filter(|height_m| height_m.is_finite());
    (place.at.as_secs_f64() - from.as_secs_f64(), place.latitude_deg, place.longitude_deg, height_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    use hums_core::observation::Hud;
    use hums_core::units::MetresPerSecond;

    fn seconds(second: u64) -> Instant {
        Instant::from_millis(second * 1000)
    }

    fn note(at: Instant) -> Note {
        Note {
            at_s: at.as_secs_f64(),
            kind: "finding",
            level: "warning",
            from: "here".to_owned(),
            subsystem: "power",
            words: String::new(),
            found: None,
        }
    }

    fn tell(history: &mut History, second: u64) {
        history.sample(seconds(second), &Reference::default(), &airspeed());
    }

    fn airspeed() -> Observation {
        Observation::Hud(Hud { airspeed: Some(MetresPerSecond(1.0)), ..Hud::default() })
    }

    fn follow(cursor: &mut Cursor, history: &History, until: Instant) -> (bool, usize, usize) {
        let Some(part) = history.since(1, cursor, until) else { return (false, 0, 0) };
        let values = part.series.0.iter().map(|(_, _, (numbers, _))| numbers.len()).sum();
        (part.reset, values, part.notes.len())
    }

    #[test]
    fn a_page_gets_each_thing_once_and_only_the_open_interval_again() {
        let (mut history, mut cursor) = (History::default(), Cursor::default());
        for second in 0..10 {
            tell(&mut history, second);
            history.note(seconds(second), note(seconds(second)));
        }
        assert_eq!(follow(&mut cursor, &history, seconds(9)), (true, 10, 10));
        assert_eq!(follow(&mut cursor, &history, seconds(9)), (false, 0, 0), "nothing is new");
        tell(&mut history, 9);
        assert_eq!(follow(&mut cursor, &history, seconds(9)), (false, 1, 0), "the newest interval is open");
        tell(&mut history, 10);
        history.note(seconds(10), note(seconds(10)));
        assert_eq!(follow(&mut cursor, &history, seconds(10)), (false, 2, 1));
    }

    #[test]
    fn a_page_is_told_of_its_plots_as_often_as_it_draws_them_and_of_notes_at_once() {
        let (mut history, mut cursor) = (History::default(), Cursor::default());
        let at = |ms: u64| Instant::from_millis(10_000 + ms);
        tell(&mut history, 10);
        assert_eq!(follow(&mut cursor, &history, at(0)), (true, 1, 0));
        history.sample(at(60), &Reference::default(), &airspeed());
        history.note(at(60), note(at(60)));
        assert_eq!(follow(&mut cursor, &history, at(60)), (false, 0, 1));
        assert_eq!(
            follow(&mut cursor, &history, at(60)),
            (false, 2, 0),
            "a recording is paused: that is all"
        );
        history.sample(at(120), &Reference::default(), &airspeed());
        assert_eq!(follow(&mut cursor, &history, at(120)), (false, 0, 0));
        assert_eq!(follow(&mut cursor, &history, at(160)), (false, 2, 0));
    }

    #[test]
    fn numbers_count_from_the_one_before_and_values_are_as_fine_as_their_plot() {
        let series =
            Series(vec![("Speed:2".to_owned(), 2, (vec![3, 4, 9], vec![1.234_5, 2.0, 0.1, 0.1, -3.0, 5.0]))]);
        let json = serde_json::to_string(&series).expect("JSON");
        assert_eq!(json, r#"{"Speed:2":[[3,1,5],[1.23,2.0,0.1,0.1,-3.0,5.0]]}"#);
    }

    #[test]
    fn a_page_of_a_recording_sees_no_future() {
        let (mut history, mut cursor) = (History::default(), Cursor::default());
        for second in 0..100 {
            tell(&mut history, second);
            history.note(seconds(second), note(seconds(second)));
        }
        assert_eq!(follow(&mut cursor, &history, seconds(40)), (true, 41, 41));
        assert_eq!(follow(&mut cursor, &history, seconds(42)).2, 2);
    }

    #[test]
    fn joined_intervals_and_dropped_notes_are_told_as_a_new_beginning_and_never_twice() {
        let (mut history, mut cursor) = (History::default(), Cursor::default());
        tell(&mut history, 0);
        follow(&mut cursor, &history, seconds(0));
        tell(&mut history, 10_000);
        assert!(follow(&mut cursor, &history, seconds(10_000)).0, "the intervals are longer now");
        for second in 0..3_000 {
            history.note(seconds(10_000 + second), note(seconds(second)));
        }
        let told = follow(&mut cursor, &history, seconds(13_000));
        assert_eq!((told.0, told.2), (false, NOTES_MAX));
        assert_eq!(follow(&mut cursor, &history, seconds(13_000)).2, 0);
    }
}
