//! A receiver's velocity against how far its position moves: both come from the same signals, by different measurements.
//!
//! The way is the sum of the steps between positions, and the velocity is summed over the same time; both are forgotten with [`MEMORY_S`].
//! They are vectors, so that an error in one direction does not hide behind a course that changes. What repeats a position bit for bit is
//! the same measurement again. A receiver's filters may be late by [`LATE_S`] with one of the two: that part of what the velocity has
//! changed by is taken off.
//!
//! How long a step took is the receiver's word ([`Gnss::measured_ms`]): messages wait on a link and then come all at once, and
//! a clock that is slow makes each way a fast one. Where that is not known nothing is said.

use core::num::NonZeroU32;

use crate::observation::Gnss;
use crate::units::Position;

/// Ways and velocities are forgotten with this time constant, s; before it has passed nothing is said.
const MEMORY_S: f32 = 4.0;
/// Positions further apart are not of one way, ms.
const PAUSE_MS: u32 = 2_000;
/// One of the two may be older by so much, s.
const LATE_S: f32 = 0.3;
/// Positions are compared in units of 1e-7 degrees of latitude, in metres.
const UNIT_M: f32 = 0.011_132;
/// Nothing jumps further, m: garbage, or the date line.
const JUMP_MAX_M: f32 = 100_000.0;
/// No vehicle here is faster, m/s: garbage.
const SPEED_MAX_MPS: f32 = 200.0;

/// One measurement of a receiver.
#[derive(Clone, Copy, Debug)]
struct Fix {
    /// Latitude and longitude, 1e-7 degrees.
    place: [i32; 2],
    /// North and east, m/s.
    velocity: [f32; 2],
    measured_ms: NonZeroU32,
}

/// The memory of one receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Travel {
    before: Option<Fix>,
    /// How much further it went by its velocity than by its positions, m, and in what time, s.
    further_m: [f32; 2],
    time_s: f32,
    /// The mean velocity of that time, m/s.
    mean: [f32; 2],
}

impl Travel {
    /// Nothing seen.
    pub(crate) const NEW: Self = Self { before: None, further_m: [0.0; 2], time_s: 0.0, mean: [0.0; 2] };

    /// Takes what a receiver says in flight.
    pub(crate) fn take(&mut self, gnss: &Gnss, airborne: bool) {
        let Some(told) = fix(gnss).filter(|_| airborne) else {
            *self = Self::NEW;
            return;
        };
        let Some(was) = self.before else {
            *self = Self { before: Some(told), mean: told.velocity, ..Self::NEW };
            return;
        };
        let step_ms = told.measured_ms.get().wrapping_sub(was.measured_ms.get());
        let is_same = told.place == was.place;
        // A time that stands still, or goes back, is none.
        if step_ms > PAUSE_MS || (step_ms == 0 && !is_same) {
            *self = Self { before: Some(told), mean: told.velocity, ..Self::NEW };
            return;
        }
        if is_same {
            return;
        }
        let [north, east] = [0, 1].map(|axis| told.place[axis].wrapping_sub(was.place[axis]) as f32 * UNIT_M);
        let latitude = told.place[0] as f32 * 1e-7;
        let moved_m = [north, east * libm::cosf(latitude.to_radians())];
        if moved_m.iter().any(|moved_m| libm::fabsf(*moved_m) > JUMP_MAX_M) {
            *self = Self { before: Some(told), mean: told.velocity, ..Self::NEW };
            return;
        }
        let step_s = step_ms as f32 / 1e3;
        let kept = MEMORY_S / (MEMORY_S + step_s);
        for (axis, moved_m) in moved_m.iter().enumerate() {
            let further_m = f32::midpoint(told.velocity[axis], was.velocity[axis]) * step_s - moved_m;
            self.further_m[axis] = kept * (self.further_m[axis] + further_m);
            self.mean[axis] = told.velocity[axis] + kept * (self.mean[axis] - told.velocity[axis]);
        }
        self.time_s = kept * (self.time_s + step_s);
        self.before = Some(told);
    }

    /// How far the velocity is from that of the positions, m/s.
    pub(crate) fn speed_apart(&self) -> Option<f32> {
        let now = self.before?.velocity;
        let late_m = LATE_S * length([0, 1].map(|axis| now[axis] - self.mean[axis]));
        let apart_mps = (length(self.further_m) - late_m).max(0.0) / MEMORY_S;
        // Of a whole memory two thirds are there after its time constant.
        (self.time_s > 0.6 * MEMORY_S).then_some(apart_mps)
    }
}

fn length([north, east]: [f32; 2]) -> f32 {
    libm::sqrtf(north * north + east * east)
}

/// What is said of where it is and how it moves, where that is exact.
fn fix(gnss: &Gnss) -> Option<Fix> {
    let speed_mps = gnss.speed.map(|speed| speed.0).filter(|speed| (0.0..=SPEED_MAX_MPS).contains(speed))?;
    let course = gnss.course.map(|course| course.0).filter(|course| course.is_finite() && gnss.is_exact())?;
    let Position { latitude_deg, longitude_deg } = gnss.position?;
    Some(Fix {
        place: [latitude_deg, longitude_deg].map(|degrees| (degrees * 1e7) as i32),
        velocity: [speed_mps * libm::cosf(course), speed_mps * libm::sinf(course)],
        measured_ms: gnss.measured_ms?,
    })
}
#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::{Metres, MetresPerSecond, Radians};

    /// Flies with a velocity that turns once in so many seconds, and tells one that is off by an error, both north and east in m/s; each
    /// position twice. `measured` is when a step was measured, ms.
    fn heard((speed_mps, turn_s): (f32, f32), error_mps: [f32; 2], measured: fn(u64) -> u32) -> Option<f32> {
        let mut travel = Travel::NEW;
        let mut place = [47.0, 8.0];
        for step in 0_u64..100 {
            let course = step as f32 * 0.2 / turn_s * core::f32::consts::TAU;
            let velocity = [speed_mps * course.cos(), speed_mps * course.sin()];
            let [north, east] = [0, 1].map(|axis| velocity[axis] + error_mps[axis]);
            let gnss = Gnss {
                fix: 3,
                accuracy: Some(Metres(0.5)),
                position: Some(Position { latitude_deg: place[0], longitude_deg: place[1] }),
                speed: Some(MetresPerSecond(north.hypot(east))),
                course: Some(Radians(east.atan2(north))),
                measured_ms: NonZeroU32::new(measured(step)),
                ..Gnss::default()
            };
            travel.take(&gnss, true);
            travel.take(&gnss, true);
            place[0] += f64::from(velocity[0]) * 0.2 / 111_320.0;
            place[1] += f64::from(velocity[1]) * 0.2 / (111_320.0 * 47.0_f64.to_radians().cos());
        }
        travel.speed_apart()
    }

    const STRAIGHT_S: f32 = 1e6;

    fn flown(speed_mps: f32, turn_s: f32, error_mps: [f32; 2]) -> f32 {
        heard((speed_mps, turn_s), error_mps, |step| 7 + step as u32 * 200).expect("known")
    }

    #[test]
    fn a_velocity_that_is_not_that_of_the_positions_is_told() {
        assert!(flown(5.0, STRAIGHT_S, [0.0; 2]) < 0.1);
        assert!((flown(5.0, STRAIGHT_S, [2.0, 0.0]) - 2.0).abs() < 0.3);
        assert!((flown(5.0, STRAIGHT_S, [-2.0, 0.0]) - 2.0).abs() < 0.3);
        assert_eq!(
            heard((0.0, STRAIGHT_S), [2.0, 0.0], |step| 7 + step as u32 * 200),
            None,
            "one position, bit for bit, is another check's"
        );
    }

    #[test]
    fn an_error_does_not_hide_behind_a_turn_and_a_turn_is_none() {
        assert!(flown(10.0, 20.0, [0.0; 2]) < 0.1);
        assert!(flown(10.0, 6.0, [0.0; 2]) < 0.1);
        assert!(flown(3.0, 6.0, [2.0, 0.0]) > 1.4);
        assert!(flown(3.0, 6.0, [0.0, -2.0]) > 1.4);
    }

    #[test]
    fn the_receivers_time_counts() {
        let wraps = |step: u64| (u32::MAX - 9_998).wrapping_add(step as u32 * 200);
        assert!(heard((15.0, STRAIGHT_S), [0.0; 2], wraps).expect("known") < 0.2);
        assert!((heard((15.0, STRAIGHT_S), [3.0, 0.0], wraps).expect("known") - 3.0).abs() < 0.4);
        assert_eq!(heard((15.0, STRAIGHT_S), [3.0, 0.0], |_| 0), None, "not known");
        assert_eq!(heard((15.0, STRAIGHT_S), [3.0, 0.0], |_| 7), None, "stands still");
    }
}
