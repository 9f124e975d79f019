//! A receiver's speed against how far its position moves: both come from the same signals, by different measurements.
//!
//! The way is the sum of the steps between positions, and the speed is summed over the same time; both are forgotten with [`MEMORY_S`]. What
//! repeats a position bit for bit is the same measurement again.
//!
//! How long a step took is the receiver's word ([`Gnss::measured_ms`]): messages wait on a link and then come all at once, and
//! a clock that is slow makes each way a fast one. Where that is not known nothing is said.

use crate::latest::Reading;
use crate::observation::Gnss;
use crate::time::Instant;

/// Ways and speeds are forgotten with this time constant, s; before it has passed nothing is said.
const MEMORY_S: f32 = 4.0;
/// Positions further apart are not of one way, ms.
const PAUSE_MS: u32 = 2_000;
/// Less exact positions are not compared: accuracy in metres, dilution of precision.
const ACCURACY_M: f32 = 3.0;
const HDOP: f32 = 2.5;
/// Degrees of latitude, in metres.
const DEGREE_M: f32 = 111_320.0;
/// No vehicle here is faster, m/s: garbage.
const SPEED_MAX_MPS: f32 = 200.0;

/// The memory of one receiver.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Travel {
    /// Latitude and longitude, degrees; the speed there, m/s; when that was measured, ms; and when it came.
    before: Option<([f64; 2], f32, u32, Instant)>,
    /// How much further it went by its speed than by its positions, m, and in what time, s.
    further_m: f32,
    time_s: f32,
}

impl Travel {
    /// Nothing seen.
    pub(crate) const NEW: Self = Self { before: None, further_m: 0.0, time_s: 0.0 };

    /// Takes what a receiver says in flight.
    pub(crate) fn take(&mut self, at: Instant, gnss: &Gnss, airborne: bool) {
        let good = gnss.fix >= 3
            && airborne
            && gnss.accuracy.is_none_or(|accuracy| accuracy.0 <= ACCURACY_M)
            && gnss.hdop.is_none_or(|hdop| hdop <= HDOP);
        let speed_mps = gnss.speed.map(|speed| speed.0).filter(|speed| (0.0..=SPEED_MAX_MPS).contains(speed));
        let (Some(position), Some(speed_mps), Some(measured_ms), true) =
            (gnss.position, speed_mps, gnss.measured_ms, good)
        else {
            *self = Self::NEW;
            return;
        };
        let place = [position.latitude_deg, position.longitude_deg];
        let told = Some((place, speed_mps, measured_ms.get(), at));
        let Some((was, speed_before_mps, before_ms, _)) = self.before else {
            self.before = told;
            return;
        };
        let step_ms = measured_ms.get().wrapping_sub(before_ms);
        let is_same = place.map(f64::to_bits) == was.map(f64::to_bits);
        // A time that stands still, or goes back, is none.
        if step_ms > PAUSE_MS || (step_ms == 0 && !is_same) {
            *self = Self { before: told, ..Self::NEW };
            return;
        }
        if is_same {
            return;
        }
        let north_m = (place[0] - was[0]) as f32 * DEGREE_M;
        let east_m = (place[1] - was[1]) as f32 * DEGREE_M * libm::cosf((place[0] as f32).to_radians());
        let step_s = step_ms as f32 / 1e3;
        let further_m = f32::midpoint(speed_mps, speed_before_mps) * step_s - libm::hypotf(north_m, east_m);
        let kept = MEMORY_S / (MEMORY_S + step_s);
        self.further_m = kept * (self.further_m + further_m);
        self.time_s = kept * (self.time_s + step_s);
        self.before = told;
    }

    /// How far the speed is from that of the positions, m/s.
    pub(crate) fn speed_apart(&self) -> Option<Reading> {
        let (.., at) = self.before?;
        // Of a whole memory two thirds are there after its time constant.
        let apart_mps = libm::fabsf(self.further_m) / MEMORY_S;
        (self.time_s > 0.6 * MEMORY_S).then_some(Reading { at, value: apart_mps })
    }
}

#[cfg(test)]
mod tests {
    use core::num::NonZeroU32;

    use super::*;
    use crate::units::{Metres, MetresPerSecond, Position};

    /// Flies north with one speed by its positions and another one by what it tells, each position twice. `came` is when a step's
    /// message comes, and `measured` when it was measured, both in ms.
    fn heard(
        (moves_mps, told_mps): (f64, f32),
        came: fn(u64) -> u64,
        measured: fn(u64) -> u32,
    ) -> Option<f32> {
        let mut travel = Travel::NEW;
        for step in 0_u64..200 {
            let gnss = Gnss {
                fix: 3,
                accuracy: Some(Metres(0.5)),
                position: Some(Position {
                    latitude_deg: 47.0 + moves_mps * (step / 2) as f64 * 0.2 / 111_320.0,
                    longitude_deg: 8.0,
                }),
                speed: Some(MetresPerSecond(told_mps)),
                measured_ms: NonZeroU32::new(measured(step)),
                ..Gnss::default()
            };
            travel.take(Instant::from_millis(came(step)), &gnss, true);
        }
        travel.speed_apart().map(|reading| reading.value)
    }

    fn flown(moves_mps: f64, told_mps: f32) -> Option<f32> {
        heard((moves_mps, told_mps), |step| step * 100, |step| 7 + (step / 2) as u32 * 200)
    }

    #[test]
    fn a_speed_that_is_not_that_of_the_positions_is_told() {
        let apart = |moves, told| flown(moves, told).expect("known");
        assert!(apart(5.0, 5.0) < 0.2);
        assert!((apart(5.0, 7.0) - 2.0).abs() < 0.3);
        assert!((apart(5.0, 3.0) - 2.0).abs() < 0.3);
        assert_eq!(flown(0.0, 2.0), None, "one position, bit for bit, is another check's");
    }

    #[test]
    fn the_receivers_time_counts_and_not_when_its_messages_come() {
        let measured = |step: u64| (u32::MAX - 9_998).wrapping_add((step / 2) as u32 * 200);
        let at_once = |step: u64| step / 20 * 2_000 + step % 20;
        let slow_clock = |step: u64| step * 60;
        for came in [at_once, slow_clock] {
            assert!(heard((15.0, 15.0), came, measured).expect("known") < 0.2);
            assert!((heard((15.0, 12.0), came, measured).expect("known") - 3.0).abs() < 0.4);
        }
        assert_eq!(heard((15.0, 12.0), |step| step * 100, |_| 0), None, "not known");
        assert_eq!(heard((15.0, 12.0), |step| step * 100, |_| 7), None, "stands still");
    }
}
