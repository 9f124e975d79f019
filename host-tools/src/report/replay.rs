//! A recording read in order: what the vehicle told becomes series, flights, phases and a track.

use anyhow::Result;
use hums_core::observation::{Autopilot, Observation, Source};
use hums_core::time::Instant;
use serde::Serialize;

use super::flights::{Extents, Flight, Phases};
use super::frames::{Frames, Sign};
use super::samples::Samples;
use crate::check::judge::{Judge, Limits};
use crate::decode::reference::Reference;
use crate::source::item::{Item, Text, Want};
use crate::source::recording::Place;
use crate::statustext;
use crate::track;

/// Texts kept at most; beyond this they are only counted.
const TEXTS_MAX: usize = 1_000;

/// What a log told, sampled.
#[derive(Debug, Default)]
pub struct Replay {
    /// Series and track.
    pub samples: Samples,
    /// Who speaks, as far as scales depend on it.
    pub autopilot: Autopilot,
    /// Flights, as `hums check` finds them.
    pub flights: Vec<Flight>,
    /// Phases of all of it.
    pub phases: Phases,
    /// What the vehicle said in words.
    pub texts: Vec<Said>,
    /// How many there were.
    pub texts_count: u64,
    reference: Reference,
    frames: Frames,
    extents: Extents,
}

/// A place on the track, as the page takes it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Point {
    at_s: f64,
    latitude: f64,
    longitude: f64,
    height_m: Option<f32>,
}

/// Words of the vehicle, as the page takes them.
#[derive(Clone, Debug, Serialize)]
pub struct Said {
    at_s: f64,
    severity: u8,
    level: &'static str,
    text: String,
}

impl Replay {
    /// Reads a recording.
    pub fn of(place: &Place) -> Result<Self> {
        let mut replay = Self::default();
        let want = Want { frames: true, observations: true, ..Want::default() };
        let recording = place.open()?;
        let mut judge = Judge::new(&Limits::default(), recording.format);
        recording.read(want, &mut |at, item| {
            judge.item(at, item);
            replay.item(at, item, judge.flight());
            Ok(())
        })?;
        if let Some(end) = replay.reference.heard() {
            replay.phases.extend(end, &replay.reference);
        }
        replay.flights = replay.extents.flights(&judge.end().flights);
        Ok(replay)
    }

    /// Takes the next item, while the vehicle is in this flight.
    fn item(&mut self, at: Instant, item: Item<'_>, flight: Option<usize>) {
        match item {
            Item::Frame(frame) => {
                let sign = Sign { at, source: frame.source(), sequence: frame.sequence() };
                let vehicle = self.reference.vehicle().source;
                if frame.check() == hums_link::Check::Verified {
                    self.frames.take(&sign, vehicle, &mut self.samples.store);
                }
            }
            Item::Observation(source, observation) => self.observe(at, source, observation, flight),
            Item::Text(text) => self.keep(at, text),
            Item::Gap(_) => self.frames.gap(),
            _ => {}
        }
    }

    /// Where it was, in order.
    pub fn track(&self) -> Vec<Point> {
        let place = |point: &track::Point| Point {
            at_s: point.at.as_secs_f64(),
            latitude: point.latitude_deg,
            longitude: point.longitude_deg,
            height_m: point.height_m,
        };
        self.samples.track.points().iter().map(place).collect()
    }

    fn observe(&mut self, at: Instant, source: Source, observation: &Observation, flight: Option<usize>) {
        if !self.reference.observe(at, source, observation) {
            return;
        }
        if let Observation::Heartbeat(heartbeat) = observation {
            self.autopilot = heartbeat.autopilot;
        }
        self.samples.take(at, &self.reference, observation);
        self.extents.take(at, flight, &self.reference);
        self.phases.extend(at, &self.reference);
    }

    fn keep(&mut self, at: Instant, text: Text<'_>) {
        self.texts_count += 1;
        if self.texts.len() < TEXTS_MAX {
            self.texts.push(Said {
                at_s: at.as_secs_f64(),
                severity: text.severity,
                level: statustext::level(text.severity),
                text: text.words.to_owned(),
            });
        }
    }
}
