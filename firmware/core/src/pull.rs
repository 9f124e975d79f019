//! The first inertial sensor against the first receiver: the force that the accelerometers measure, turned to north, east, down by the
//! attitude, less gravity, is the change of velocity.
//!
//! Where it is not, the accelerometers are wrong, or the attitude is, which gyros led astray: an estimator that is fed by a gyro with an
//! offset leans further and further, and 10 degrees are 1.7 m/s2. Horizontally the velocity is the receiver's own, which no accelerometer
//! has a part in; vertically it is the climb of the estimator, which height holds over some seconds. On wings that is left out: a flare and
//! a gust change it too fast.
//!
//! Velocities of a receiver are late by about half of the time between two of them (of simulators; at 2 Hz and at 5 Hz): forces wait for so
//! long. A leap of them counts for little ([`LEAP_MPS2`]), and of what shakes the force is known the less: samples are few, and fold
//! vibration into an offset.

use crate::flight::Flight;
use crate::latest::Reading;
use crate::motion::climb_mps;
use crate::observation::{Gnss, VehicleKind};
use crate::rotation::to_earth;
use crate::steady::{TURNED, is_clear};
use crate::time::{Instant, Span, Stamp};
use crate::units::{GRAVITY, norm};
use crate::vehicle::Vehicle;

/// An attitude, and forces, that are older are not of one moment.
const FRESH: Span = Span::from_millis(300);
/// Velocities further apart are not compared.
const PAUSE: Span = Span::from_secs(1);
/// Time constant, s.
const SMOOTHING_S: f32 = 1.5;
/// A change of velocity without a force counts as this much at most, m/s2.
const LEAP_MPS2: f32 = 6.0;
/// Of the steps of the force from sample to sample so much may be an offset.
const SHAKE_PART: f32 = 0.5;

/// The memory of the comparison.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pull {
    /// Forces since the last step, their number, their mean, and when there was one.
    sum: [f32; 3],
    count: u16,
    mean: [f32; 3],
    mean_at: Stamp,
    /// What they made of the velocity since the receiver's last one, and between the two before, m/s.
    gained: [[f32; 3]; 2],
    /// The last velocity, m/s.
    velocity: [f32; 3],
    at: Stamp,
    /// What is missing, smoothed, m/s2.
    missing: [f32; 3],
    apart: Option<f32>,
}

impl Pull {
    /// Nothing seen.
    pub(crate) const NEW: Self = Self {
        sum: [0.0; 3],
        count: 0,
        mean: [0.0; 3],
        mean_at: Stamp::NONE,
        gained: [[0.0; 3]; 2],
        velocity: [0.0; 3],
        at: Stamp::NONE,
        missing: [0.0; 3],
        apart: None,
    };

    pub(crate) fn take_force(&mut self, force: [f32; 3]) {
        for (sum, axis) in self.sum.iter_mut().zip(force) {
            *sum += axis;
        }
        self.count = self.count.saturating_add(1);
    }

    pub(crate) fn step(&mut self, now: Instant, step_s: f32, vehicle: &Vehicle) {
        if self.count > 0 {
            self.mean = core::mem::take(&mut self.sum).map(|sum| sum / f32::from(self.count));
            (self.count, self.mean_at) = (0, Stamp::at(now));
        }
        let is_fresh = self.mean_at.age(now).is_some_and(|age| age <= FRESH);
        let Some(attitude) = vehicle.attitude.within(now, FRESH).filter(|_| is_fresh) else {
            (self.at, self.missing) = (Stamp::NONE, [0.0; 3]);
            return;
        };
        let [north, east, down] = to_earth(attitude, self.mean);
        for (gained, axis) in self.gained[0].iter_mut().zip([north, east, down + GRAVITY]) {
            *gained += axis * step_s;
        }
    }

    pub(crate) fn take_gnss(&mut self, at: Instant, gnss: &Gnss, vehicle: &Vehicle, flight: &Flight) {
        let on_rotors = vehicle.kind() == VehicleKind::Rotorcraft;
        let judged = gnss.is_exact()
            && (on_rotors || vehicle.kind() == VehicleKind::Plane)
            && flight.is_settled(at)
            && is_clear(at, vehicle);
        let (Some(speed), Some(course), Some(climb_mps), true) =
            (gnss.speed, gnss.course, climb_mps(at, vehicle), judged)
        else {
            (self.at, self.gained, self.missing, self.apart) = (Stamp::NONE, [[0.0; 3]; 2], [0.0; 3], None);
            return;
        };
        let velocity = [speed.0 * libm::cosf(course.0), speed.0 * libm::sinf(course.0), -climb_mps];
        let before = core::mem::replace(&mut self.velocity, velocity);
        let gained_now = self.gained[0];
        let gained = core::mem::replace(&mut self.gained, [[0.0; 3], gained_now]);
        let step = self.at.age(at).filter(|step| *step > Span::ZERO && *step <= PAUSE);
        self.at = Stamp::at(at);
        let Some(step_s) = step.map(Span::as_secs_f32) else {
            self.missing = [0.0; 3];
            return;
        };
        for axis in 0..3 {
            let gained = f32::midpoint(gained[0][axis], gained[1][axis]);
            let missing = (gained - (velocity[axis] - before[axis])) / step_s;
            let missing = missing.clamp(-LEAP_MPS2, LEAP_MPS2) - self.missing[axis];
            self.missing[axis] += step_s / (SMOOTHING_S + step_s) * missing;
        }
        if !on_rotors {
            self.missing[2] = 0.0;
        }
        let missing = norm(self.missing);
        if !missing.is_finite() {
            (self.at, self.gained, self.missing, self.apart) = (Stamp::NONE, [[0.0; 3]; 2], [0.0; 3], None);
            return;
        }
        let apart = (missing - SHAKE_PART * vehicle.inertial.shakes_mps2()).max(0.0);
        self.apart = Some(apart).filter(|_| vehicle.inertial.turns_little(at, TURNED));
    }

    /// How far the force is from the change of velocity, m/s2.
    pub(crate) fn apart(&self, now: Instant) -> Option<Reading> {
        Reading::new(self.at.instant(now), self.apart)
    }
}
