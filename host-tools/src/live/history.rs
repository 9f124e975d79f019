//! What is kept of a vehicle's whole flight, bounded: series for the plots, the track, and what was said and found.
//!
//! It only grows at its end, so a page that has seen it up to some point asks for what came since ([`Cursor`]); however
//! slow the page is, nothing queues for it. Where older parts changed (intervals were joined, the track was thinned) the
//! generation counts up, and the page takes everything anew.
//!
//! Of a recording it is made whole at the start; a page is then shown what is not later than the moment played.

use std::collections::VecDeque;

use hums_core::observation::{Esc, Observation};
use hums_core::time::Instant;
use hums_core::units::Position;
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use super::note::Note;
use super::plots::{Line, Plot, line_of};
use crate::decode::reference::Reference;
use crate::series::{self, Store};
use crate::track::{Point, Track};

/// Sayings kept at most; older ones go.
const NOTES_MAX: usize = 2_000;

/// Everything that is kept.
#[derive(Clone, Debug, Default)]
pub struct History {
    store: Store<Plot>,
    notes: VecDeque<(Instant, Note)>,
    /// Notes that went, so that the others keep their numbers.
    notes_gone: u64,
    track: Track,
    generation: u64,
}

/// How much of a history a page has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cursor {
    generation: u64,
    /// The interval from which on it may miss something; `None` before the first part.
    interval: Option<u16>,
    notes: u64,
    places: usize,
}

/// The part of a history that a page does not have yet.
#[derive(Debug, Serialize)]
pub struct Part {
    t: &'static str,
    vehicle: u8,
    /// Forget what you have of it.
    reset: bool,
    start_s: f64,
    step_s: f64,
    series: Series,
    notes: Vec<Note>,
    /// Seconds, degrees north, degrees east, height in metres.
    track: Vec<(f64, f64, f64, Option<f32>)>,
}

/// Each line's new intervals: `"altitude:0": [numbers, values]`.
#[derive(Debug)]
struct Series(Vec<(Line, series::Part)>);

impl Serialize for Series {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for ((plot, line), part) in &self.0 {
            map.serialize_entry(&format!("{}:{line}", plot.name()), part)?;
        }
        map.end()
    }
}

impl History {
    /// Keeps something said or found.
    pub fn note(&mut self, at: Instant, note: Note) {
        if self.notes.len() >= NOTES_MAX {
            self.notes.pop_front();
            self.notes_gone += 1;
        }
        self.notes.push_back((at, note));
    }

    /// What stands on a time line: times and levels of findings, warning and worse.
    pub fn marks(&self) -> Vec<(f64, &'static str)> {
        let marks = self.notes.iter().filter(|(_, note)| {
            note.kind == "event" || (note.kind == "finding" && matches!(note.level, "warning" | "critical"))
        });
        marks.map(|(_, note)| (note.at_s, if note.kind == "event" { "event" } else { note.level })).collect()
    }

    /// Takes a value.
    pub fn push(&mut self, at: Instant, line: Line, value: f32) {
        let spacing = self.store.spacing_ms();
        self.store.push(at, line, value);
        if spacing.is_some() && spacing != self.store.spacing_ms() {
            self.generation += 1;
        }
    }

    /// Takes what an observation told, in the terms of the reference system.
    pub fn sample(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        for (_, quantities) in reference.told_by(observation) {
            for quantity in quantities {
                let value = || reference.value(at, quantity).map(|value| value.as_f64() as f32);
                if let Some((line, value)) = line_of(quantity).and_then(|line| Some((line, value()?))) {
                    self.push(at, line, value);
                }
            }
        }
        self.sample_rest(at, reference, observation);
    }

    /// What the reference system does not show.
    fn sample_rest(&mut self, at: Instant, reference: &Reference, observation: &Observation) {
        match observation {
            Observation::GlobalPosition(global) => {
                if let Some(place) = global.position {
                    self.place(at, place, Some(global.relative_altitude.0));
                }
            }
            Observation::Gnss(gnss) if gnss.instance == 0 => {
                if let Some(satellites) = gnss.satellites {
                    self.push(at, (Plot::Satellites, 0), f32::from(satellites));
                }
                let alone = reference.vehicle().global.get().is_none();
                if let Some(place) = gnss.position.filter(|_| alone) {
                    self.place(at, place, None);
                }
            }
            Observation::Battery(battery) if battery.id == 0 => {
                if let Some(current) = battery.current {
                    self.push(at, (Plot::BatteryAmperes, 0), current.0);
                }
            }
            Observation::SystemStatus(system) if reference.vehicle().batteries[0].get().is_none() => {
                if let Some(current) = system.current {
                    self.push(at, (Plot::BatteryAmperes, 0), current.0);
                }
            }
            Observation::Vibration(vibration) => {
                for (axis, level) in (0..).zip(vibration.levels) {
                    if let Some(level) = level {
                        self.push(at, (Plot::Vibration, axis), level);
                    }
                }
            }
            Observation::Estimator(estimator) => {
                let figures = [
                    estimator.velocity,
                    estimator.position_horizontal,
                    estimator.position_vertical,
                    estimator.compass,
                ];
                for (line, figure) in (0..).zip(figures) {
                    if let Some(figure) = figure {
                        self.push(at, (Plot::Estimator, line), figure);
                    }
                }
            }
            Observation::Escs(group) => {
                for (place, esc) in (0..).zip(group.escs) {
                    if let Some(Esc { temperature: Some(celsius), .. }) = esc {
                        self.push(at, (Plot::EscCelsius, group.first.saturating_add(place)), celsius.0);
                    }
                }
            }
            _ => {}
        }
    }

    fn place(&mut self, at: Instant, position: Position, height_m: Option<f32>) {
        if self.track.push(at, position, height_m) {
            self.generation += 1;
        }
    }

    /// What a page that has this much does not have yet of the time up to `until`; moves the cursor there. `None` where
    /// there is nothing new.
    pub fn since(&self, vehicle: u8, cursor: &mut Cursor, until: Instant) -> Option<Part> {
        let reset = cursor.interval.is_none() || cursor.generation != self.generation;
        if reset {
            *cursor = Cursor { generation: self.generation, ..Cursor::default() };
        }
        let (start_ms, step_ms) = self.store.spacing_ms().unwrap_or((until.as_millis(), 1));
        let newest = until.as_millis().saturating_sub(start_ms) / step_ms.max(1);
        let newest = u16::try_from(newest).unwrap_or(u16::MAX - 1);
        let from = cursor.interval.unwrap_or(0);
        let series: Vec<_> = self.store.part(from..=newest).collect();
        // The newest interval may still change.
        cursor.interval = Some(newest.max(from));

        let known = self.notes.partition_point(|(at, _)| *at <= until);
        let skip = usize::try_from(cursor.notes.saturating_sub(self.notes_gone)).unwrap_or(usize::MAX);
        let notes: Vec<_> = self.notes.iter().take(known).skip(skip).map(|(_, note)| note.clone()).collect();
        cursor.notes = self.notes_gone + known as u64;

        let points = self.track.points();
        let places = points.partition_point(|place| place.at <= until);
        let new = points.get(cursor.places..places).unwrap_or_default();
        let track: Vec<_> = new.iter().map(told).collect();
        cursor.places = places;

        let something = reset || !series.is_empty() || !notes.is_empty() || !track.is_empty();
        something.then(|| Part {
            t: "history",
            vehicle,
            reset,
            start_s: start_ms as f64 / 1e3,
            step_s: step_ms as f64 / 1e3,
            series: Series(series),
            notes,
            track,
        })
    }
}

fn told(place: &Point) -> (f64, f64, f64, Option<f32>) {
    let height_m = place.height_m.filter(|height_m| height_m.is_finite());
    (place.at.as_secs_f64(), place.latitude_deg, place.longitude_deg, height_m)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: Line = (Plot::Altitude, 0);

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
        }
    }

    /// All values that the parts of a history told, the newest of each interval.
    fn follow(cursor: &mut Cursor, history: &History, until: Instant) -> (bool, usize, usize) {
        let Some(part) = history.since(1, cursor, until) else { return (false, 0, 0) };
        let values = part.series.0.iter().map(|(_, (numbers, _))| numbers.len()).sum();
        (part.reset, values, part.notes.len())
    }

    #[test]
    fn a_page_gets_each_thing_once_and_only_the_open_interval_again() {
        let (mut history, mut cursor) = (History::default(), Cursor::default());
        for second in 0..10 {
            history.push(seconds(second), LINE, 1.0);
            history.note(seconds(second), note(seconds(second)));
        }
        assert_eq!(follow(&mut cursor, &history, seconds(9)), (true, 10, 10));
        assert_eq!(follow(&mut cursor, &history, seconds(9)), (false, 1, 0), "the newest interval is open");
        history.push(seconds(10), LINE, 1.0);
        history.note(seconds(10), note(seconds(10)));
        assert_eq!(follow(&mut cursor, &history, seconds(10)), (false, 2, 1));
    }

    #[test]
    fn a_page_of_a_recording_sees_no_future() {
        let (mut history, mut cursor) = (History::default(), Cursor::default());
        for second in 0..100 {
            history.push(seconds(second), LINE, 1.0);
            history.note(seconds(second), note(seconds(second)));
        }
        assert_eq!(follow(&mut cursor, &history, seconds(40)), (true, 41, 41));
        assert_eq!(follow(&mut cursor, &history, seconds(42)).2, 2);
    }

    #[test]
    fn joined_intervals_and_dropped_notes_are_told_as_a_new_beginning_and_never_twice() {
        let (mut history, mut cursor) = (History::default(), Cursor::default());
        history.push(seconds(0), LINE, 1.0);
        follow(&mut cursor, &history, seconds(0));
        history.push(seconds(10_000), LINE, 2.0);
        assert!(follow(&mut cursor, &history, seconds(10_000)).0, "the intervals are longer now");
        for second in 0..3_000 {
            history.note(seconds(10_000 + second), note(seconds(second)));
        }
        let told = follow(&mut cursor, &history, seconds(13_000));
        assert_eq!((told.0, told.2), (false, NOTES_MAX));
        assert_eq!(follow(&mut cursor, &history, seconds(13_000)).2, 0);
    }
}
