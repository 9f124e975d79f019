//! Judgement by accelerometer and gyros alone, without an estimator: whether the vehicle is level and still, on its
//! side or on its back.
//!
//! An estimator with a gyro offset turns its attitude over while the vehicle stands. A vehicle that really turns over
//! turns fast; at a great tilt it is carried with more than its weight, or falls. An attitude far from level is
//! contradicted if for `LASTS` nothing turned and the force was one of these:
//!
//! - the force of a level vehicle at rest;
//! - far from the direction that the attitude demands.
//!
//! The contradiction ends when both agree again.
//!
//! Running motors shake a vehicle. The steps of the force from sample to sample are compared with those at rest.
//!
//! Forces are smoothed (`SMOOTHING_S`), because motors shake a vehicle that stands. Without both force and rates
//! nothing is judged.

use crate::motion::TILTED_RAD;
use crate::observation::{Attitude, Imu};
use crate::time::{BootMs, FRESH, Millis, PAUSE, Stamp};
use crate::units::{GRAVITY, MetresPerSecond2, RadiansPerSecond, norm};

/// Time constant of the force, of 0.53 Hz: a shock counts for little, a lasting turn fully.
const SMOOTHING_S: f32 = 0.3;
const LASTS: Millis = Millis::from_millis(1_500);
/// A fast turn is above 0.7 rad/s (40 degrees a second). A still vehicle turns slower than 0.5 rad/s (29 degrees a second) on the average: more
/// than the offset of a gyro that still flies.
const TURNS_RATE: f32 = 0.7;
const STILL_RATE: f32 = 0.5;
/// A rate within [`STEADY_RATE`] of its mean and below [`OFFSET_RATE`], rad/s, is an offset. No vehicle turns so
/// steadily while it is carried as at rest.
const STEADY_RATE: f32 = 0.15;
const OFFSET_RATE: f32 = 1.2;
/// An attitude that was contradicted is believed again within 20 degrees.
const AGREES_RAD: f32 = 0.35;
const TILTED: Millis = Millis::from_millis(500);
/// Load factor at rest, with the scale error and the offset of a sensor.
const REST_G: core::ops::Range<f32> = 0.75..1.25;
/// The cosines of 30 degrees, within which a vehicle is level, and of 60, beyond which it lies over.
const LEVEL: f32 = 0.866;
const OVER: f32 = 0.5;
/// Time constant of the steps from sample to sample.
const SHAKES_S: f32 = 0.5;
const STEPS_KNOWN: Millis = Millis::from_secs(2);
/// Carrying motors make the steps larger than at rest by this factor, and by this many m/s2, the change of a sensor's
/// noise.
const SHAKES: f32 = 2.5;
const SHAKES_MPS2: f32 = 0.01;
/// Rotors that carry a vehicle make the steps larger than this, m/s2. The least of real flights is 0.11 (5 % of 13
/// logs), the most of standing boards 0.09 (95 % of 6 logs, without handling). Simulators have no noise.
const CALM_MPS2: f32 = 0.1;
/// Time that it must lie over.
pub(crate) const LIES: Millis = Millis::from_millis(700);

state! {
    /// The state of accelerometer and gyros.
    pub struct Inertial {
        /// Specific force, smoothed, m/s2.
        pub(crate) force: [f32; 3],
        /// The last sample along the body's downward axis, and its smoothed step from sample to sample; m/s2.
        down: f32,
        pub(crate) step: f32,
        steps_since: BootMs,
        /// The least step at rest; 0 if unknown.
        step_at_rest: f32,
        at: Option<BootMs>,
        rate: [f32; 3],
        rates_at: Stamp,
        still: bool,
        turned_at: Stamp,
        /// Whether the estimator's attitude contradicts the sensors, and since when that attitude has been far from
        /// level.
        contradicts: bool,
        tilted_since: Stamp,
        /// Since when the vehicle has been carried by its weight and still, in any attitude; then also level.
        rests_since: Stamp,
        level_since: Stamp,
        over_since: Stamp,
    }
}

impl Inertial {
    pub(crate) fn take(&mut self, at: BootMs, imu: &Imu) {
        self.take_rates(at, imu.rate);
        if let Some(rates) = imu.rate {
            let weight = weight(self.rates_at.age(at), SMOOTHING_S);
            let (mut square, mut apart) = (0.0, 0.0);
            for (smooth, axis) in self.rate.iter_mut().zip(rates) {
                let off = axis.0 - *smooth;
                *smooth += weight * off;
                (square, apart) = (square + *smooth * *smooth, apart + off * off);
            }
            self.still = square < STILL_RATE * STILL_RATE
                || (square < OFFSET_RATE * OFFSET_RATE && apart < STEADY_RATE * STEADY_RATE);
            if !self.rate.iter().all(|axis| axis.is_finite()) {
                self.rate = [0.0; 3];
            }
            self.rates_at = Stamp::at(at);
        }
        if let Some(force) = imu.acceleration {
            self.take_force(at, force.map(|MetresPerSecond2(axis)| axis));
        }
    }

    pub(crate) fn take_rates(&mut self, at: BootMs, rates: Option<[RadiansPerSecond; 3]>) {
        // No root: this is done with each inertial sample.
        let square = |rates: [RadiansPerSecond; 3]| rates.iter().map(|rate| rate.0 * rate.0).sum::<f32>();
        if rates.is_some_and(|rates| square(rates) > TURNS_RATE * TURNS_RATE) {
            self.turned_at = Stamp::at(at);
        }
    }

    fn take_force(&mut self, at: BootMs, force: [f32; 3]) {
        let step_s = self.at.map_or(f32::INFINITY, |before| at.since(before).as_secs_f32());
        let [x, y, z] = force;
        let is_measured = x * x + y * y + z * z <= MetresPerSecond2::MAX * MetresPerSecond2::MAX;
        if step_s == 0.0 || !is_measured {
            return;
        }
        let weight = weight(self.at.map(|before| at.since(before)), SMOOTHING_S);
        self.at = Some(at);
        for (smooth, axis) in self.force.iter_mut().zip(force) {
            *smooth += weight * (axis - *smooth);
        }
        self.take_step(at, step_s, force[2]);
        let [x, y, z] = self.force;
        let square = x * x + y * y + z * z;
        let rests =
            (REST_G.start * REST_G.start..REST_G.end * REST_G.end).contains(&(square / (GRAVITY * GRAVITY)));
        // No root: squares of cosines, with the sign of z, which is negative for an upright vehicle.
        let level = rests && self.still && z < 0.0 && z * z > LEVEL * LEVEL * square;
        let over = rests && (z > 0.0 || z * z < OVER * OVER * square);
        if step_s >= PAUSE.as_secs_f32() {
            (self.rests_since, self.level_since, self.over_since) = (Stamp::NONE, Stamp::NONE, Stamp::NONE);
        }
        self.rests_since.run(rests && self.still, at, Millis::ZERO);
        self.level_since.run(level, at, Millis::ZERO);
        self.over_since.run(over, at, Millis::ZERO);
    }

    fn take_step(&mut self, at: BootMs, step_s: f32, down: f32) {
        let step = libm::fabsf(down - core::mem::replace(&mut self.down, down));
        if step_s < 1.0 && step.is_finite() {
            self.step += step_s / (SHAKES_S + step_s) * (step - self.step);
        } else {
            (self.step, self.steps_since) = (0.0, at);
        }
    }

    fn has_steps(&self, now: BootMs) -> bool {
        self.at.is_some_and(|at| now.since(at) <= FRESH && at.since(self.steps_since) >= STEPS_KNOWN)
    }

    pub(crate) fn rest(&mut self, now: BootMs) {
        if self.has_steps(now) && (self.step_at_rest == 0.0 || self.step < self.step_at_rest) {
            self.step_at_rest = self.step;
        }
    }

    /// Whether it shakes more than it did at rest; `None` if one of the two is unknown.
    pub(crate) fn shakes(&self, now: BootMs) -> Option<bool> {
        let known = self.has_steps(now) && self.step_at_rest > 0.0;
        known.then_some(self.step > SHAKES * self.step_at_rest + SHAKES_MPS2)
    }

    /// Whether it shakes less than on carrying rotors. Simulators have no noise: they are calm too.
    pub(crate) fn is_calm(&self, now: BootMs) -> bool {
        self.has_steps(now) && self.step < CALM_MPS2
    }

    fn is_fresh(&self, now: BootMs) -> bool {
        self.at.is_some_and(|at| now.since(at) <= FRESH)
            && self.rates_at.age(now).is_some_and(|age| age <= FRESH)
    }

    pub(crate) fn turns_little(&self, now: BootMs, span: Millis) -> bool {
        self.turned_at.age(now).is_none_or(|age| age > span)
    }

    /// Whether it has been level and still for a while, by the sensors alone.
    pub fn is_level(&self, now: BootMs) -> bool {
        self.is_level_for(now, LASTS)
    }

    pub(crate) fn is_level_for(&self, now: BootMs, span: Millis) -> bool {
        self.is_fresh(now) && self.level_since.age(now).is_some_and(|age| age >= span)
    }

    /// Whether it rests more than 30 degrees from upright by its weight: rotors pull along their axis.
    pub(crate) fn lies_askew(&self, now: BootMs) -> bool {
        let rests = self.is_fresh(now) && self.rests_since.age(now).is_some_and(|age| age >= LIES);
        rests && self.level_since.age(now).is_none()
    }

    /// The estimator's attitude.
    pub(crate) fn take_attitude(&mut self, at: BootMs, attitude: &Attitude) {
        let tilt = attitude.lean_rad();
        let tilted = self.tilted_since.run(tilt > TILTED_RAD, at, TILTED);
        let rests = self.is_fresh(at) && self.rests_since.age(at).is_some_and(|age| age >= LASTS);
        if rests && tilted && (self.is_level(at) || self.is_carried_elsewhere(attitude)) {
            self.contradicts = true;
        } else if rests && tilt < AGREES_RAD {
            self.contradicts = false;
        }
    }

    fn is_carried_elsewhere(&self, Attitude { roll, pitch, .. }: &Attitude) -> bool {
        const FAR: f32 = 0.707;
        let across = libm::cosf(pitch.0);
        let weight = [libm::sinf(pitch.0), -libm::sinf(roll.0) * across, -libm::cosf(roll.0) * across];
        let along: f32 = self.force.iter().zip(weight).map(|(force, weight)| force * weight).sum();
        along < FAR * norm(self.force)
    }

    /// Whether the sensors contradict the estimator's attitude.
    pub fn contradicts(&self, now: BootMs) -> bool {
        self.contradicts && self.is_fresh(now)
    }

    /// The angle from upright in radians, once it has lain over for a moment, by the direction of the force.
    pub fn lies_over(&self, now: BootMs) -> Option<f32> {
        let lasts = self.over_since.age(now).is_some_and(|age| age >= LIES) && self.is_fresh(now);
        let [x, y, z] = self.force;
        lasts.then(|| libm::atan2f(norm([x, y]), -z))
    }
}

fn weight(step: Option<Millis>, constant_s: f32) -> f32 {
    let step_s = step.map_or(f32::INFINITY, Millis::as_secs_f32);
    if step_s < 1.0 { step_s / (constant_s + step_s) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Radians;

    /// Whether a still vehicle, carried with this force for three seconds, contradicts an attitude rolled by
    /// `roll_deg`, and then a level one.
    fn contradicts(force: [f32; 3], roll_deg: f32) -> (bool, bool) {
        let mut inertial = Inertial::default();
        let mut now = BootMs::ZERO;
        let mut said = [false; 2];
        for (roll_deg, said) in [roll_deg, 0.0].into_iter().zip(&mut said) {
            for _ in 0..30 {
                now = now + Millis::from_millis(100);
                let imu = Imu {
                    acceleration: Some(force.map(MetresPerSecond2)),
                    rate: Some([0.01; 3].map(RadiansPerSecond)),
                    ..Imu::default()
                };
                inertial.take(now, &imu);
                let (roll, pitch) = (Radians(roll_deg.to_radians()), Radians(0.05));
                inertial.take_attitude(now, &Attitude { roll, pitch, ..Attitude::default() });
            }
            *said = inertial.contradicts(now);
        }
        (said[0], said[1])
    }

    #[test]
    fn an_attitude_is_contradicted_by_what_carries_the_vehicle_from_elsewhere() {
        assert_eq!(contradicts([0.1, 0.3, -9.8], -70.0), (true, false), "level");
        assert_eq!(
            contradicts([0.1, 0.3, 10.0], -70.0),
            (true, false),
            "its sensor says that it lies on its back"
        );
        assert_eq!(contradicts([0.1, 9.5, -1.0], -80.0), (false, false), "it lies on its side");
        assert_eq!(contradicts([0.1, -9.5, -1.0], -80.0), (true, false), "on the other one");
        assert_eq!(contradicts([0.1, 0.3, 9.8], 178.0), (false, false), "on its back");
        assert_eq!(contradicts([0.1, 0.3, 14.0], -70.0), (false, false), "it does not rest");
    }
}
