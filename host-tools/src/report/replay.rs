//! A log read in order: what the vehicle told becomes series, flights, phases and a track.

use anyhow::Result;
use hums_blackbox::{Entry, Gap};
use hums_core::observation::{Autopilot, Observation};
use hums_link::{Check, Frame, observe};
use serde::Serialize;

use super::flights::Flights;
use super::frames::{Frames, Sign};
use super::samples::Samples;
use crate::decode::reference::{Observed, Reference};
use crate::logs::Log;
use crate::logs::reader::{Collect, Deliver, read};
use crate::mavlink::ids::STATUSTEXT;
use crate::statustext::{Text, Texts};
use crate::track::Point;

/// Texts kept at most; beyond this they are only counted.
const TEXTS_MAX: usize = 1_000;

/// What a log told, sampled.
#[derive(Debug, Default)]
pub struct Replay {
    /// Series and track.
    pub samples: Samples,
    /// Who speaks, as far as scales depend on it.
    pub autopilot: Autopilot,
    /// Flights and phases.
    pub flights: Flights,
    /// What the vehicle said in words.
    pub texts: Vec<Said>,
    /// How many there were.
    pub texts_count: u64,
    reference: Reference,
    frames: Frames,
    open: Texts,
}

/// A place on the track, as the page takes it.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Place {
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
    text: String,
}

impl Replay {
    /// Reads a log.
    pub fn of(log: &Log) -> Result<Self> {
        let mut replay = Self::default();
        read(log, Told::default, &mut replay, |_| ())?;
        let Self { open, texts, texts_count, .. } = &mut replay;
        open.end(&mut |text| keep(texts, texts_count, text));
        if let Some(end) = replay.reference.heard() {
            replay.flights.end(end, &replay.reference);
        }
        Ok(replay)
    }

    /// Where it was, in order.
    pub fn track(&self) -> Vec<Place> {
        let place = |point: &Point| Place {
            at_s: point.at.as_secs_f64(),
            latitude: point.latitude_deg,
            longitude: point.longitude_deg,
            height_m: point.height_m,
        };
        self.samples.track.points().iter().map(place).collect()
    }

    fn observe(&mut self, observed: &Observed) {
        let Observed { at, source, observation } = *observed;
        let airborne = self.reference.flight().airborne();
        if !self.reference.observe(at, source, &observation) {
            return;
        }
        if let Observation::Heartbeat(heartbeat) = observation {
            self.autopilot = heartbeat.autopilot;
        }
        self.samples.take(at, &self.reference, &observation);
        self.flights.follow(at, airborne, &self.reference);
    }
}

fn keep(texts: &mut Vec<Said>, count: &mut u64, text: Text) {
    *count += 1;
    if texts.len() < TEXTS_MAX {
        texts.push(Said { at_s: text.at.as_secs_f64(), severity: text.severity, text: text.words });
    }
}

/// What one group told.
#[derive(Debug, Default)]
struct Told {
    observed: Vec<Observed>,
    signs: Vec<Sign>,
    texts: Vec<Text>,
}

impl Collect for Told {
    fn entry(&mut self, entry: &Entry<'_>) {
        let Entry::Frame { at, bytes, verified: true, .. } = *entry else { return };
        let Some(frame) = Frame::again(bytes, Check::Verified) else { return };
        let source = frame.source();
        self.signs.push(Sign { at, source, sequence: frame.sequence() });
        if frame.id() == STATUSTEXT {
            self.texts.extend(Text::of(at, source, frame.payload()));
        } else if let Some((source, observation)) = observe(&frame) {
            self.observed.push(Observed { at, source, observation });
        }
    }
}

impl Deliver<Told> for Replay {
    fn gap(&mut self, _: &Gap) -> Result<()> {
        self.frames.gap();
        Ok(())
    }

    fn group(&mut self, told: Told) -> Result<()> {
        told.observed.iter().for_each(|observed| self.observe(observed));
        let vehicle = self.reference.vehicle().source;
        told.signs.iter().for_each(|sign| self.frames.take(sign, vehicle, &mut self.samples.store));
        let Self { open, texts, texts_count, .. } = self;
        told.texts.into_iter().for_each(|text| open.take(text, &mut |text| keep(texts, texts_count, text)));
        Ok(())
    }
}
