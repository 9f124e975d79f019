//! The first inertial sensor against the first receiver. The measured force, turned to north, east, down by the
//! attitude, less gravity, is the change of velocity.
//!
//! A difference means a wrong accelerometer, or an attitude that gyros led astray. An estimator with a gyro offset
//! leans further and further, and 10 degrees are 1.7 m/s2. Horizontally the velocity is the receiver's own, without
//! any accelerometer; vertically the estimator's climb, which follows height over some seconds. On wings the climb is
//! left out: a flare and a gust change it too fast.
//!
//! A receiver's velocity is late by about half of its interval (simulators, at 2 Hz and at 5 Hz), so forces wait for
//! that time. The delay may be longer, by up to [`LATE_S`]. The effect of that on a changing force is taken off; a
//! steady force has none. A leap of velocity counts for little ([`LEAP_MPS2`]). Vibration makes the force uncertain
//! ([`SHAKE_PART`]): samples are few, and fold vibration into an offset. A place that is repeated bit for bit is
//! skipped. So is a course: receivers hold it while they are slow (UBX-13003221, "Freezing the course over ground").
//!
//! A wrong heading turns a horizontal force without changing its length. If the lengths agree, the effect of 30
//! degrees on the change of velocity is taken off. So a compass that led the attitude astray hardly shows here.

use crate::gates::{self, Gates};
use crate::latest::Reading;
use crate::motion::climb_within;
use crate::observation::Gnss;
use crate::residual::{AT_ONCE, smooth};
use crate::rotation::to_earth;
use crate::time::{BootMs, Millis, PAUSE, Stamp};
use crate::units::{GRAVITY, MetresPerSecond2, Radians, norm};
use crate::vehicle::Vehicle;

const CLIMB_AGE: Millis = Millis::from_millis(500);
/// Time constant, s.
const SMOOTHING_S: f32 = 1.0;
/// Maximum delay of a receiver against the forces, s.
const LATE_S: f32 = 0.6;
/// Part of a force that a heading error of 30 degrees turns aside: 2 sin 15.
const HEADING_PART: f32 = 0.52;
/// A change of velocity without a force counts as this much at most, m/s2.
const LEAP_MPS2: f32 = 6.0;
/// Part of the force's steps from sample to sample that may be an offset.
const SHAKE_PART: f32 = 0.5;

state! {
    pub(crate) struct ImuGnssResidual {
        /// Sum of forces since the last step, their number, their mean, and its time.
        sum: [f32; 3],
        count: u16,
        mean: [f32; 3],
        mean_at: Stamp,
        /// Change of velocity by the forces since the receiver's last one, m/s, and mean force between the two before,
        /// m/s2.
        delta_v: [f32; 3],
        force_before: Option<[f32; 3]>,
        /// The last velocity, m/s, and its time if it is compared.
        velocity: [f32; 3],
        course: Option<Radians>,
        at: Stamp,
        /// The force, and the part that is missing in the velocity, both smoothed, m/s2.
        force: [f32; 3],
        missing: [f32; 3],
        residual: Option<f32>,
    }
}

impl ImuGnssResidual {
    pub(crate) fn take_force(&mut self, force: [f32; 3]) {
        if !force.iter().all(|axis| axis.abs() <= MetresPerSecond2::MAX) {
            return;
        }
        // On the ground no step takes them.
        let Some(count) = self.count.checked_add(1) else { return };
        self.count = count;
        for (sum, axis) in self.sum.iter_mut().zip(force) {
            *sum += axis;
        }
    }

    pub(crate) fn step(&mut self, now: BootMs, step_s: f32, vehicle: &Vehicle) {
        if self.count > 0 {
            self.mean = core::mem::take(&mut self.sum).map(|sum| sum / f32::from(self.count));
            (self.count, self.mean_at) = (0, Stamp::at(now));
        }
        // Turning forces is expensive, so it is skipped while velocities are not compared.
        if !self.at.is_set() {
            return;
        }
        let is_fresh = self.mean_at.age(now).is_some_and(|age| age <= AT_ONCE);
        let Some(attitude) = vehicle.attitude.within(now, AT_ONCE).filter(|_| is_fresh) else {
            self.at = Stamp::NONE;
            return;
        };
        let [north, east, down] = to_earth(attitude, self.mean);
        for (delta_v, axis) in self.delta_v.iter_mut().zip([north, east, down + GRAVITY]) {
            *delta_v += axis * step_s;
        }
    }

    pub(crate) fn take_gnss(&mut self, at: BootMs, gnss: &Gnss, vehicle: &Vehicle, gates: Gates) {
        let on_rotors = gates.are(gates::ROTORS);
        let judged = gnss.is_exact() && gates.are(gates::SETTLED | gates::CLEAR | gates::ONE_FRAME);
        let climb_mps = if on_rotors { climb_within(at, vehicle, CLIMB_AGE) } else { Some(0.0) };
        let is_held = core::mem::replace(&mut self.course, gnss.course) == gnss.course;
        let (Some(speed), Some(course), Some(climb_mps), true) = (gnss.speed, gnss.course, climb_mps, judged)
        else {
            (self.at, self.residual) = (Stamp::NONE, None);
            return;
        };
        if is_held && speed.0 > 0.0 {
            return;
        }
        let velocity = [speed.0 * libm::cosf(course.0), speed.0 * libm::sinf(course.0), -climb_mps];
        let step = self.at.age(at).filter(|step| *step > Millis::ZERO && *step <= PAUSE);
        self.at = Stamp::at(at);
        let missing = self.take_velocity(step, velocity, if on_rotors { 3 } else { 2 });
        if missing.is_some_and(|missing| !missing.is_finite()) {
            self.at = Stamp::NONE;
        }
        let shaken = SHAKE_PART * vehicle.inertial.step;
        let judged = missing.filter(|missing| missing.is_finite() && gates.are(gates::STILL));
        self.residual = judged.map(|missing| (missing - shaken).max(0.0));
    }

    /// Takes a velocity, with the time since the one before if the two are compared. Returns the missing force in the
    /// first `axes` of north, east, down, m/s2.
    fn take_velocity(&mut self, step: Option<Millis>, velocity: [f32; 3], axes: usize) -> Option<f32> {
        let before = core::mem::replace(&mut self.velocity, velocity);
        let delta_v = core::mem::take(&mut self.delta_v);
        let Some(step_s) = step.map(Millis::as_secs_f32) else {
            // The start of the earlier sum is unknown.
            (self.force_before, self.force, self.missing) = (None, [0.0; 3], [0.0; 3]);
            return None;
        };
        // Steps differ: messages are lost, and repetitions are skipped.
        let force_now = delta_v.map(|delta_v| delta_v / step_s);
        let Some(force_before) = self.force_before.replace(force_now) else {
            self.force = force_now;
            return None;
        };
        let weight = step_s / (SMOOTHING_S + step_s);
        let mut force = [0.0; 3];
        let mut missing = [0.0; 3];
        for axis in 0..axes {
            force[axis] = f32::midpoint(force_before[axis], force_now[axis]);
            let change = (velocity[axis] - before[axis]) / step_s;
            missing[axis] = (force[axis] - change).clamp(-LEAP_MPS2, LEAP_MPS2);
        }
        smooth(&mut self.missing, missing, weight, f32::INFINITY);
        smooth(&mut self.force, force, weight, f32::INFINITY);
        let changes = [0, 1, 2].map(|axis| (force[axis] - self.force[axis]) / SMOOTHING_S);
        let ([north, east, down], [force_north, force_east, _]) = (self.missing, self.force);
        let specific_force = norm([force_north, force_east]);
        let kinematic_acceleration = norm([force_north - north, force_east - east]);
        let level = (norm([north, east]) - HEADING_PART * kinematic_acceleration)
            .max((specific_force - kinematic_acceleration).abs());
        Some(norm([level, down]) - LATE_S * norm(changes))
    }

    pub(crate) fn residual(&self, now: BootMs) -> Option<Reading> {
        Reading::new(self.at.instant(now), self.residual)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f32 = 0.2;

    fn most(swings_mps2: f32, untrue_mps2: f32, late_s: f32) -> f32 {
        let turns = |time_s: f32| time_s * core::f32::consts::TAU / 5.0;
        let velocity = |time_s: f32| -swings_mps2 * 5.0 / core::f32::consts::TAU * libm::cosf(turns(time_s));
        let mut residual = ImuGnssResidual::default();
        let missing = (0_u16..100).filter_map(|step| {
            let time_s = f32::from(step) * STEP_S;
            residual.delta_v[0] += velocity(time_s) - velocity(time_s - STEP_S) + untrue_mps2 * STEP_S;
            let told = velocity(time_s - STEP_S / 2.0 - late_s);
            residual.take_velocity((step > 0).then_some(Millis::from_millis(200)), [told, 0.0, 0.0], 3)
        });
        missing.fold(0.0, f32::max)
    }

    #[test]
    fn a_heading_that_is_wrong_is_no_force() {
        let mut residual = ImuGnssResidual::default();
        let mut most = 0.0_f32;
        for step in 0..100 {
            let (time_s, velocity) = (f32::from(step as u8) * STEP_S, 2.5 * STEP_S);
            let told = velocity * f32::from(step as u8);
            residual.delta_v = [velocity * 0.766, velocity * 0.643, 0.0];
            let missing = residual.take_velocity(
                (time_s > 0.0).then_some(Millis::from_millis(200)),
                [told, 0.0, 0.0],
                3,
            );
            most = most.max(missing.unwrap_or(0.0));
        }
        assert!(most < 0.6, "{most}");
    }

    #[test]
    fn velocities_that_come_in_unequal_steps_show_as_much_as_others() {
        let missing = |untrue_mps2: f32| {
            let mut residual = ImuGnssResidual::default();
            let missing = (0..60_usize).map(|step| {
                let step_s = [0.2, 0.4, 0.2][step % 3];
                residual.delta_v = [(5.0 + untrue_mps2) * step_s, 0.0, 0.0];
                let told = residual.velocity[0] + 5.0 * step_s;
                let step = (step > 0).then_some(Millis::from_millis((step_s * 1_000.0) as u64));
                residual.take_velocity(step, [told, 0.0, 0.0], 3)
            });
            missing.skip(30).flatten().collect::<Vec<_>>()
        };
        assert!(missing(0.0).iter().all(|missing| *missing < 0.01), "{:?}", missing(0.0));
        assert!(missing(2.0).iter().all(|missing| (1.9..2.1).contains(missing)), "{:?}", missing(2.0));
    }

    #[test]
    fn forces_that_nothing_takes_for_hours_are_summed_no_more() {
        let mut residual = ImuGnssResidual::default();
        (0..200_000).for_each(|_| residual.take_force([0.0, 0.0, -9.8]));
        let mean = residual.sum[2] / f32::from(residual.count);
        assert!((-9.9..-9.7).contains(&mean), "{mean}");
    }

    #[test]
    fn a_receiver_that_is_late_is_no_force_and_one_that_lasts_is() {
        assert!(most(3.0, 0.0, 0.0) < 0.2);
        assert!(most(3.0, 0.0, 0.6) < 0.4, "late by what a receiver may be");
        assert!(most(0.0, 2.0, 0.0) > 1.9);
        assert!(most(0.0, 2.0, 0.6) > 1.9);
    }

    #[test]
    fn what_was_summed_before_the_first_velocity_is_of_no_step() {
        let mut residual =
            ImuGnssResidual { delta_v: [30.0; 3], missing: [5.0; 3], ..ImuGnssResidual::default() };
        let mut take = |step| residual.take_velocity(step, [3.0, 0.0, 0.0], 3);
        let step = Some(Millis::from_millis(200));
        assert_eq!([take(None), take(step), take(step)], [None, None, Some(0.0)]);
    }

    #[test]
    fn garbage_is_no_force() {
        let mut residual = ImuGnssResidual::default();
        for force in [f32::NAN, f32::INFINITY, 1e9, 3.0] {
            residual.take_force([force, 0.0, -9.8]);
        }
        assert_eq!((residual.count, residual.sum[0]), (1, 3.0));
    }
}
