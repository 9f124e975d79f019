//! The first barometer against the height of GNSS, its noise, and the climb of the estimator.
//!
//! 1. Barometer and GNSS ([`Comparison::BaroGnss`]): weather and site make an offset, which is learnt. Two effects on a healthy
//!    barometer are allowed for. Air that is warmer or colder than standard makes a scale error: [`SCALE_PART`] of the change
//!    of height. The wind of the flight presses on the housing: half of the change of the dynamic pressure.
//! 2. Noise ([`Comparison::BaroNoise`]): the step of the height from sample to sample, less the climb. The errors of
//!    a late message ([`LATE_S`]) and of a changing climb are taken off.
//! 3. Climb ([`Comparison::BaroClimb`]): an accelerometer that folds vibration into an offset lets an estimator fall while the
//!    vehicle climbs, and height control gives full throttle. On rotors only, by the climb of `VFR_HUD`; the change of the
//!    whole dynamic pressure is taken off.
//! 4. The wrong height after a leap ([`Heights::receiver_leapt`]): the estimator's climb decides, which over so short
//!    a time is its accelerometer's. If the receiver's height moved within [`RECEIVER_S`] without that climb, and the
//!    barometer's by less than half as much, the receiver is wrong. A slow drift takes the estimator along and is
//!    blamed on neither.

use crate::gates;
use crate::latest::Reading;
use crate::motion::{climb_mps, ground_speed_mps};
use crate::observation::Gnss;
use crate::pressure::SCALE_HEIGHT_M;
use crate::residual::{Comparison, LATE_S, RECEIVER_S, Residuals, smooth};
use crate::time::{BootMs, Millis, PAUSE, Stamp};
use crate::units::GRAVITY;
use crate::vehicle::Vehicle;

/// Error of the standard atmosphere as a part of the climb, in air that is 28 K warmer or colder.
const SCALE_PART: f32 = 0.1;
/// Delay of a receiver's height, s: 1 for those of 2013.
const RECEIVER_LATE_S: f32 = 1.0;
/// Time constant of the usual height and speed, s.
const AIR_S: f32 = 30.0;
/// A sample with a greater leap is one wrong message, unless the next one leaps too. No vehicle climbs so fast, m/s,
/// and the noise, m, is above the default limit.
const LEAPS_MPS: f32 = 50.0;
const LEAPS_M: f32 = 5.0;

state! {
    /// Movement of a height without a climb, within [`RECEIVER_S`].
    struct Leap {
        height_m: f32,
        at: Stamp,
        leapt_m: f32,
        late_m: f32,
    }
}

impl Leap {
    fn take(&mut self, at: BootMs, height_m: f32, climb_mps: Option<f32>) {
        let step = self.at.age(at).filter(|step| *step <= PAUSE);
        let risen_m = height_m - self.height_m;
        (self.at, self.height_m) = (Stamp::at(at), height_m);
        let (Some(step), Some(climb_mps)) = (step, climb_mps) else {
            (self.leapt_m, self.late_m) = (0.0, 0.0);
            return;
        };
        let step_s = step.as_secs_f32();
        let kept = RECEIVER_S / (RECEIVER_S + step_s);
        let leapt_m = kept * (self.leapt_m + risen_m - climb_mps * step_s);
        self.leapt_m = if leapt_m.is_finite() { leapt_m } else { 0.0 };
        self.late_m = (kept * self.late_m).max(RECEIVER_LATE_S * libm::fabsf(climb_mps));
    }

    fn far_m(&self) -> f32 {
        (libm::fabsf(self.leapt_m) - self.late_m).max(0.0)
    }
}

state! {
    /// The last sample of the barometer: height above the first one, m; dynamic pressure of the ground speed as a height,
    /// m; climb, m/s.
    struct Sample {
        at: Stamp,
        height_m: f32,
        wind_m: f32,
        climb_mps: f32,
    }

    pub(crate) struct Heights {
        /// The first pressure of the flight, hPa; 0 before it.
        first_hpa: f32,
        sample: Sample,
        /// The last sample leapt and was skipped.
        is_doubted: bool,
        /// Usual height and half of the usual dynamic pressure, both in m.
        air: Option<[f32; 2]>,
        leaps: [Leap; 2],
    }
}

impl Heights {
    pub(crate) fn take_pressure(&mut self, to: &mut Residuals, at: BootMs, hpa: f32, vehicle: &Vehicle) {
        if !to.gates.are(gates::SETTLED) || !hpa.is_finite() || hpa <= 0.0 {
            return;
        }
        if self.first_hpa == 0.0 {
            self.first_hpa = hpa;
        }
        let height_m = SCALE_HEIGHT_M * libm::logf(self.first_hpa / hpa);
        let before = self.sample;
        let step = before.at.age(at).filter(|step| *step <= PAUSE);
        let risen_m = height_m - before.height_m;
        let leaps = step.is_some_and(|step| libm::fabsf(risen_m) > LEAPS_M + LEAPS_MPS * step.as_secs_f32());
        self.is_doubted = leaps && !self.is_doubted;
        if self.is_doubted {
            return;
        }
        let speed_mps = ground_speed_mps(at, vehicle).unwrap_or(0.0);
        let wind_m = speed_mps * speed_mps / (2.0 * GRAVITY);
        let climb = climb_mps(at, vehicle);
        self.leaps[0].take(at, height_m, climb);
        self.sample = Sample { at: Stamp::at(at), height_m, wind_m, climb_mps: climb.unwrap_or(0.0) };
        // A second leap is a step of the barometer, and no climb.
        let Some(step) = step.filter(|step| *step > Millis::ZERO && !leaps) else { return };
        let step_s = step.as_secs_f32();
        if let Some(climb_mps) = climb {
            let off_m = libm::fabsf(risen_m - climb_mps * step_s);
            let changed_mps = libm::fabsf(climb_mps - before.climb_mps);
            let late_m = LATE_S * libm::fabsf(climb_mps) + step_s * changed_mps;
            to.take(Comparison::BaroNoise, at, (off_m - late_m).max(0.0), 0.0);
        }
        let display = vehicle.hud.within(at, PAUSE).and_then(|hud| hud.climb?.sane());
        // Zero is sent if no climb is known.
        if let Some(climb_mps) = display.filter(|climb| climb.abs() > 0.0) {
            let missing_m = risen_m - step_s * climb_mps;
            let by_wind_m = libm::fabsf(wind_m - before.wind_m);
            let beyond_m = libm::copysignf((libm::fabsf(missing_m) - by_wind_m).max(0.0), missing_m);
            to.take(Comparison::BaroClimb, at, beyond_m / step_s, 0.0);
        }
    }

    pub(crate) fn take_gnss(&mut self, to: &mut Residuals, at: BootMs, gnss: &Gnss, vehicle: &Vehicle) {
        let Some(altitude) = gnss.altitude.filter(|_| gnss.is_exact()) else { return };
        let climb = climb_mps(at, vehicle);
        if to.gates.are(gates::SETTLED) {
            self.leaps[1].take(at, altitude.0, climb);
        }
        let Sample { at: measured, height_m, .. } = self.sample;
        // Receivers are some tenths of a second late: in a climb the two heights are not of one moment.
        let climbs = climb.is_none_or(|climb| libm::fabsf(climb) > gates::LEVEL_MPS);
        let is_old = measured.age(at).is_none_or(|age| age > PAUSE);
        if climbs || is_old || !to.is_due(Comparison::BaroGnss, at, Millis::ZERO) {
            return;
        }
        let airspeed = vehicle.hud.get().and_then(|hud| hud.airspeed).map_or(0.0, |speed| speed.0);
        let speed_mps = ground_speed_mps(at, vehicle).unwrap_or(0.0).max(airspeed);
        let air = [height_m, speed_mps * speed_mps / (4.0 * GRAVITY)];
        let usual = self.air.get_or_insert(air);
        let [up_m, faster_m] = [0, 1].map(|part| libm::fabsf(air[part] - usual[part]));
        let allowance_m = SCALE_PART * up_m + faster_m;
        let off_m = height_m - altitude.0;
        let learnt_s = to.take(Comparison::BaroGnss, at, off_m, allowance_m);
        smooth(usual, air, learnt_s / (AIR_S + learnt_s), f32::INFINITY);
    }

    pub(crate) fn receiver_leapt(&self, now: BootMs) -> Option<Reading> {
        let [barometer_m, receiver_m] = self.leaps.map(|leap| leap.far_m());
        let alone_m = if receiver_m > 2.0 * barometer_m { receiver_m } else { 0.0 };
        Reading::new(self.leaps[1].at.instant(now), Some(alone_m))
    }
}
