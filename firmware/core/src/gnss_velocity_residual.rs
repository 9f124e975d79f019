//! A receiver's velocity against the movement of its position: both come from the same signals, by different
//! measurements.
//!
//! The difference is smoothed with [`RECEIVER_S`], as a vector, so that an error in one direction does not hide in
//! turns. A position that is repeated bit for bit is the same measurement. A receiver's filters may delay one of the
//! two by [`LATE_S`]: that part of the change of velocity is taken off.
//!
//! The receiver itself reports the time of a step ([`Gnss::measured_ms`]), because messages wait on a link and then
//! come all at once. Without that time nothing is judged.

use core::num::NonZeroU32;

use crate::latest::Reading;
use crate::observation::Gnss;
use crate::residual::{LATE_S, RECEIVER_S, smooth};
use crate::time::{BootMs, Millis, PAUSE, Stamp};
use crate::units::{DEGREE_M, Metres, Position, norm};

/// Positions are compared in units of 1e-7 degrees of latitude, in metres.
const UNIT_M: f32 = (DEGREE_M * 1e-7) as f32;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Fix {
    /// Latitude and longitude, 1e-7 degrees.
    place: [i32; 2],
    /// North and east, m/s.
    velocity: [f32; 2],
    measured_ms: NonZeroU32,
}

state! {
    pub(crate) struct GnssVelocity {
        before: Option<Fix>,
        /// Velocity less the movement of the positions, and velocity, both smoothed, m/s; seconds known; time of
        /// measurement.
        off: [f32; 2],
        mean: [f32; 2],
        known_s: f32,
        at: Stamp,
    }
}

impl GnssVelocity {
    pub(crate) fn take(&mut self, at: BootMs, gnss: &Gnss, airborne: bool) {
        let Some(fix) = fix(gnss).filter(|_| airborne) else {
            *self = Self::default();
            return;
        };
        let begun = Self { before: Some(fix), mean: fix.velocity, ..Self::default() };
        let Some(before) = self.before.replace(fix) else {
            *self = begun;
            return;
        };
        let step_ms = fix.measured_ms.get().wrapping_sub(before.measured_ms.get());
        let step = Millis::from_millis(step_ms.into());
        let is_same = fix.place == before.place;
        if is_same && step <= PAUSE {
            self.before = Some(before);
            return;
        }
        let units = [0, 1].map(|axis| fix.place[axis].wrapping_sub(before.place[axis]) as f32 * UNIT_M);
        let latitude = fix.place[0] as f32 * 1e-7;
        let moved_m = [units[0], units[1] * libm::cosf(latitude.to_radians())];
        // A step without time is skipped, and garbage, and the date line.
        let is_leap = moved_m.iter().any(|moved_m| Metres(*moved_m).sane().is_none());
        if step_ms == 0 || step > PAUSE || is_leap {
            *self = begun;
            return;
        }
        let step_s = step.as_secs_f32();
        let weight = step_s / (RECEIVER_S + step_s);
        let off = [0, 1]
            .map(|axis| f32::midpoint(fix.velocity[axis], before.velocity[axis]) - moved_m[axis] / step_s);
        smooth(&mut self.off, off, weight, f32::INFINITY);
        smooth(&mut self.mean, fix.velocity, weight, f32::INFINITY);
        (self.known_s, self.at) = (self.known_s + step_s, Stamp::at(at));
    }

    pub(crate) fn residual(&self, now: BootMs) -> Option<Reading> {
        let velocity = self.before?.velocity;
        let changed_mps = norm([0, 1].map(|axis| velocity[axis] - self.mean[axis]));
        let off_mps = (norm(self.off) - LATE_S / RECEIVER_S * changed_mps).max(0.0);
        Reading::new(self.at.instant(now).filter(|_| self.known_s >= RECEIVER_S), Some(off_mps))
    }
}

fn fix(gnss: &Gnss) -> Option<Fix> {
    let speed_mps = gnss.speed?.sane().filter(|speed| *speed >= 0.0)?;
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
    use crate::units::{MetresPerSecond, Radians};

    /// The residual of a flight whose velocity turns once in `turn_s` and is reported with `error_mps`, north and
    /// east. Each position comes twice. `measured` is the time of a step, ms.
    fn heard((speed_mps, turn_s): (f32, f32), error_mps: [f32; 2], measured: fn(u64) -> u32) -> Option<f32> {
        let mut velocity_residual = GnssVelocity::default();
        let mut place = [47.0, 8.0];
        for step in 0_u64..100 {
            let now = BootMs::from_millis(step * 200);
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
            velocity_residual.take(now, &gnss, true);
            velocity_residual.take(now, &gnss, true);
            place[0] += f64::from(velocity[0]) * 0.2 / DEGREE_M;
            place[1] += f64::from(velocity[1]) * 0.2 / (DEGREE_M * 47.0_f64.to_radians().cos());
        }
        velocity_residual.residual(BootMs::from_millis(20_000)).map(|reading| reading.value)
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
