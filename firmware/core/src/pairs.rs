//! Sensors of one kind against each other.
//!
//! 1. Two samples are compared if they are of one moment, and each sample once. Their difference is smoothed as a
//!    vector, so that noise and the motion between the two samples cancel. One sample moves it by half of the limit
//!    at most, so that one wrong message raises no alarm.
//! 2. The length of that vector is the residual ([`crate::residual::PAIRS`]). Calibration, mounting and currents make
//!    its baseline.
//! 3. Of three sensors the one that is apart from both others is wrong. With two sensors it is open which is wrong:
//!    the second one is named. A sensor that stopped is not counted.

use crate::adaptive_baseline::AdaptiveBaseline;
use crate::gates::{self, Gates};
use crate::latest::Reading;
use crate::pressure::SCALE_HEIGHT_M;
use crate::residual::{PAIRS as ROWS, Residual, Row, smooth};
use crate::time::{BootMs, Millis, PAUSE, Stamp};
use crate::units::norm;

pub(crate) const SENSORS_MAX: usize = 3;
/// Pairs of them.
const PAIRS: [(usize, usize); SENSORS_MAX] = [(0, 1), (0, 2), (1, 2)];
/// After this time the difference is a mean of many samples, and is learnt.
const SETTLES_S: f32 = 1.5;
/// Scale difference of gyros; autopilots calibrate only their offsets (MPU-6000: 3 %, data sheet).
const GYRO_SCALE: f32 = 0.05;

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

    const fn row(self) -> &'static Row {
        &ROWS[self as usize]
    }

    /// Samples within this time are of one moment, if the vehicle turns slower than 40 degrees a second. `ArduPilot`
    /// sends its sensors within 20 ms, or at different rates if asked. A climb of 2.5 m/s makes 0.6 m. 0: no samples
    /// are compared.
    fn one_moment(self, gates: Gates) -> Millis {
        Millis::from_millis(match self {
            _ if !self.row().is_open(gates) => 0,
            // The turn of a vehicle makes no difference, even a fast one.
            Self::Gyro if !gates.are(gates::STILL) => 5,
            Self::Accelerometer | Self::Gyro => 25,
            Self::Compass => 100,
            Self::Barometer => 250,
        })
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

state! {
    struct Sample {
        at: Stamp,
        axes: [f32; 3],
    }

    struct Pair {
        difference: [f32; 3],
        residual: Residual = Residual::after(SETTLES_S),
    }
}

impl Pair {
    fn take(&mut self, at: BootMs, kind: Kind, difference: [f32; 3]) {
        if !difference.into_iter().all(AdaptiveBaseline::is_sane) {
            return;
        }
        let row = kind.row();
        let weight = self.residual.at.age(at).map_or(1.0, |step| row.weight(step));
        smooth(&mut self.difference, difference, weight, row.hold);
        self.residual.take(row, at, norm(self.difference), 0.0);
    }

    fn excess(&self, now: BootMs, kind: Kind) -> Option<Reading> {
        let at = self.residual.at.instant(now).filter(|at| now.since(*at) <= PAUSE)?;
        Some(Reading { at, value: self.residual.excess(kind.row())? })
    }
}

state! {
    pub(crate) struct Pairs {
        samples: [Sample; SENSORS_MAX] = [Sample::default(); SENSORS_MAX],
        pairs: [Pair; SENSORS_MAX] = [Pair::default(); SENSORS_MAX],
    }
}

impl Pairs {
    /// A sample, compared with the others' of the same moment.
    pub(crate) fn take(&mut self, at: BootMs, kind: Kind, sensor: usize, axes: [f32; 3], gates: Gates) {
        let Self { samples, pairs } = self;
        let moment = kind.one_moment(gates);
        if let Some(sample) = samples.get_mut(sensor) {
            *sample = Sample { at: Stamp::at(at), axes };
        }
        for ((one, other), pair) in PAIRS.into_iter().zip(pairs).filter(|_| moment > Millis::ZERO) {
            let partner = match (one == sensor, other == sensor) {
                (true, _) => other,
                (_, true) => one,
                _ => continue,
            };
            // Newer than when it was compared last.
            let is_new = |age: Millis| pair.residual.at.age(at).is_none_or(|before| age < before);
            if samples[partner].at.age(at).is_some_and(|age| age <= moment && is_new(age)) {
                pair.take(at, kind, kind.difference(samples[one].axes, samples[other].axes));
            }
        }
    }

    pub(crate) fn begin(&mut self) {
        self.pairs = [Pair::default(); SENSORS_MAX];
    }

    pub(crate) fn measures(&self, now: BootMs, sensor: usize) -> bool {
        let sample = self.samples.get(sensor);
        sample.is_some_and(|sample| sample.at.age(now).is_some_and(|age| age <= PAUSE))
    }

    /// How far a sensor is apart from all others, beyond what is usual; of two, for the second one. Measured when the first of its pairs
    /// was: one sample is one measurement.
    pub(crate) fn mismatch(&self, now: BootMs, kind: Kind, sensor: usize) -> Option<Reading> {
        let beyond = self.pairs.map(|pair| pair.excess(now, kind));
        let three = beyond.iter().all(Option::is_some);
        let is_mine = |(one, other): &(usize, usize)| *other == sensor || (three && *one == sensor);
        let mine = PAIRS.iter().zip(beyond).filter(|(pair, _)| is_mine(pair));
        mine.filter_map(|(_, beyond)| beyond)
            .reduce(|one, other| Reading { at: one.at.earlier(other.at), value: one.value.min(other.value) })
    }
}
