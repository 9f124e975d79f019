//! Sensors of one kind against each other.
//!
//! Two samples are compared where they are of one moment, and each sample once: how far they are apart is smoothed as a vector, so that
//! noise and what the vehicle does between the two cancel. How long that vector is has a usual level in each flight
//! ([`crate::departure`]): calibration, mounting and currents make one, and it is no fault. What comes to it in flight is. One sample moves
//! it by half of the limit at most: one wrong message is no fault.
//!
//! Of three sensors the one is told that is apart from both others; of two nobody knows which of them is wrong, and the second one is
//! told. One that says nothing any more is not counted.

use crate::departure::Departure;
use crate::heights::SCALE_HEIGHT_M;
use crate::latest::Reading;
use crate::time::{Instant, Span, Stamp};
use crate::units::norm;

/// Sensors of one kind that are compared.
pub(crate) const SENSORS_MAX: usize = 3;
/// Pairs of them.
const PAIRS: [(usize, usize); SENSORS_MAX] = [(0, 1), (0, 2), (1, 2)];
/// Older samples, and older comparisons, say nothing.
const FRESH: Span = Span::from_secs(2);
/// A slow stream is smoothed over as many samples as one of 4 Hz, and its usual level is known after as many as that of one of 2 Hz.
const STEP_MAX_S: f32 = 0.25;
const LEARNT_MAX: Span = Span::from_millis(500);
/// So long after the first comparison the difference is that of many samples, and learnt.
const SETTLES_S: f32 = 2.0;
/// No sensor measures so much, in any of the units.
const GARBAGE: f32 = 1e6;
/// Gyros differ so in scale, and autopilots calibrate their offsets only (MPU-6000: 3 %, data sheet).
const GYRO_SCALE: f32 = 0.05;
/// Before what is usual is known, one sample moves the difference by so many times what it may later.
const UNKNOWN_TIMES: f32 = 4.0;

/// A kind of sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Accelerometers: apart in m/s2.
    Accelerometer,
    /// Gyros: apart in rad/s.
    Gyro,
    /// Compasses: apart in percent of the field, by direction and length.
    Compass,
    /// Barometers: apart in metres of height.
    Barometer,
}

impl Kind {
    pub(crate) const ALL: [Self; 4] = [Self::Accelerometer, Self::Gyro, Self::Compass, Self::Barometer];
    pub(crate) const COUNT: usize = Self::ALL.len();

    /// What one sample moves the difference by at most, and further beyond their usual range they teach nothing: half of the default limits.
    const fn hold(self) -> f32 {
        match self {
            Self::Accelerometer => 0.5,
            Self::Gyro => 0.05,
            Self::Compass => 20.0,
            Self::Barometer => 4.0,
        }
    }

    /// Time constant of the difference, and of its length. Motors shake accelerometers most.
    const fn smoothing_s(self) -> f32 {
        match self {
            Self::Gyro | Self::Compass => 0.25,
            Self::Accelerometer | Self::Barometer => 0.5,
        }
    }

    /// Samples that come within so many milliseconds are of one moment, where the vehicle turns slower than 40 degrees a second: `ArduPilot`
    /// tells of its sensors within 20 ms, and at different rates where it is asked so; and what climbs with 2.5 m/s does so by 0.6 m.
    pub(crate) const fn one_moment_ms(self) -> u8 {
        match self {
            Self::Accelerometer | Self::Gyro => 25,
            Self::Compass => 100,
            Self::Barometer => 250,
        }
    }

    fn difference(self, one: [f32; 3], other: [f32; 3]) -> [f32; 3] {
        let scale = match self {
            Self::Accelerometer | Self::Gyro => 1.0,
            Self::Compass => 200.0 / (norm(one) + norm(other)),
            Self::Barometer => SCALE_HEIGHT_M / one[0].max(other[0]),
        };
        let difference = [0, 1, 2].map(|axis| (one[axis] - other[axis]) * scale);
        if self != Self::Gyro {
            return difference;
        }
        let (apart, scales) = (norm(difference), GYRO_SCALE * norm(one).max(norm(other)));
        let beyond = if apart > scales { (apart - scales) / apart } else { 0.0 };
        difference.map(|axis| axis * beyond)
    }
}

/// The last sample of a sensor.
#[derive(Clone, Copy, Debug)]
struct Sample {
    at: Stamp,
    axes: [f32; 3],
}

/// Two sensors of a kind.
#[derive(Clone, Copy, Debug)]
struct Pair {
    /// When they were compared last.
    at: Stamp,
    /// How far they are apart, smoothed.
    difference: [f32; 3],
    usual: Departure,
}

impl Pair {
    const NEW: Self = Self { at: Stamp::NONE, difference: [0.0; 3], usual: Departure::after(SETTLES_S) };

    fn take(&mut self, at: Instant, kind: Kind, difference: [f32; 3]) {
        if !difference.iter().all(|axis| axis.abs() <= GARBAGE) {
            return;
        }
        let learnt_s = self.at.age(at).unwrap_or(LEARNT_MAX).min(LEARNT_MAX).as_secs_f32();
        let step_s = learnt_s.min(STEP_MAX_S);
        let weight = if self.at.is_set() { step_s / (kind.smoothing_s() + step_s) } else { 1.0 };
        let most = match (self.usual.is_known(), self.at.is_set()) {
            (true, _) => kind.hold(),
            (false, true) => UNKNOWN_TIMES * kind.hold(),
            (false, false) => f32::INFINITY,
        };
        for (smooth, axis) in self.difference.iter_mut().zip(difference) {
            *smooth += (weight * (axis - *smooth)).clamp(-most, most);
        }
        self.at = Stamp::at(at);
        self.usual.follow(norm(self.difference), step_s, kind.smoothing_s());
        if self.usual.beyond().is_none_or(|beyond| beyond <= kind.hold()) {
            self.usual.learn(learnt_s);
        }
    }

    /// How far they are apart beyond what is usual, where that is known and fresh.
    fn beyond(&self, now: Instant) -> Option<Reading> {
        let at = self.at.instant(now).filter(|at| now.since(*at) <= FRESH);
        Reading::new(at, self.usual.beyond())
    }
}

/// All sensors of one kind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pairs {
    samples: [Sample; SENSORS_MAX],
    pairs: [Pair; SENSORS_MAX],
}

impl Pairs {
    /// Nothing seen.
    pub(crate) const NEW: Self = Self {
        samples: [Sample { at: Stamp::NONE, axes: [0.0; 3] }; SENSORS_MAX],
        pairs: [Pair::NEW; SENSORS_MAX],
    };

    /// Takes a sample, and compares it with those of the others that came within so many milliseconds; with none where that is 0.
    pub(crate) fn take(&mut self, at: Instant, kind: Kind, sensor: usize, axes: [f32; 3], moment_ms: u8) {
        let Self { samples, pairs } = self;
        if let Some(sample) = samples.get_mut(sensor) {
            *sample = Sample { at: Stamp::at(at), axes };
        }
        for ((one, other), pair) in PAIRS.into_iter().zip(pairs).filter(|_| moment_ms > 0) {
            let partner = match (one == sensor, other == sensor) {
                (true, _) => other,
                (_, true) => one,
                _ => continue,
            };
            // Newer than when it was compared last.
            let is_new = |age: Span| pair.at.age(at).is_none_or(|before| age < before);
            if samples[partner]
                .at
                .age(at)
                .is_some_and(|age| age <= Span::from_millis(moment_ms.into()) && is_new(age))
            {
                pair.take(at, kind, kind.difference(samples[one].axes, samples[other].axes));
            }
        }
    }

    /// A flight begins: nothing is usual yet.
    pub(crate) fn begin(&mut self) {
        self.pairs = [Pair::NEW; SENSORS_MAX];
    }

    /// Whether a sensor has measured, and does so still.
    pub(crate) fn has_measured(&self, sensor: usize) -> bool {
        self.samples.get(sensor).is_some_and(|sample| sample.at.is_set())
    }

    pub(crate) fn measures(&self, now: Instant, sensor: usize) -> bool {
        let sample = self.samples.get(sensor);
        sample.is_some_and(|sample| sample.at.age(now).is_some_and(|age| age <= FRESH))
    }

    /// Whether any two were compared in this flight.
    pub(crate) fn are_compared(&self) -> bool {
        self.pairs.iter().any(|pair| pair.at.is_set())
    }

    /// How far a sensor is apart from all others, beyond what is usual; of two, for the second one. Measured when the first of its pairs
    /// was: one sample is one measurement.
    pub(crate) fn mismatch(&self, now: Instant, sensor: usize) -> Option<Reading> {
        let beyond = self.pairs.map(|pair| pair.beyond(now));
        let three = beyond.iter().all(Option::is_some);
        let mine = PAIRS
            .iter()
            .zip(beyond)
            .filter(|((one, other), _)| *other == sensor || (three && *one == sensor));
        mine.filter_map(|(_, beyond)| beyond)
            .reduce(|one, other| Reading { at: one.at.earlier(other.at), value: one.value.min(other.value) })
    }
}
