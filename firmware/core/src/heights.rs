//! The first barometer against the height of GPS, and its noise.
//!
//! The height that a pressure means and that of GPS are apart by what weather and site make of it; that is learnt in each flight
//! ([`crate::departure`]). What comes to it in flight is told, less what air does to a healthy barometer: a scale that is wrong by the
//! air's temperature, [`SCALE_PART`] of what it is above or below its usual height, and the wind of the flight on its housing, a half of
//! what the dynamic pressure is above or below its usual one.
//!
//! Noise is how far the height steps from sample to sample, less the climb, and less what a late message makes of that ([`LATE_S`]) and a
//! climb that changed.
//!
//! Which of the two is wrong where they come apart at once: the climb of the estimator, which is that of its accelerometer over so short a
//! time, is the third that votes. What a height moves within [`VOTE_S`] that the climb does not have is no height. Where the receiver has
//! done so and the barometer by less than half as much, the receiver is the one that is wrong. A slow drift leads the estimator with it,
//! and nobody knows whose it is.
//!
//! The estimator's climb against that of the barometer: vibration that an accelerometer folds into an offset lets an estimator fall
//! while the vehicle climbs, and height control gives full throttle. On rotors only, whose climb is told by `VFR_HUD`. What wind makes
//! of it, the change of the whole dynamic pressure, is taken off.

use crate::departure::Departure;
use crate::flight::Flight;
use crate::latest::Reading;
use crate::motion::{climb_mps, ground_speed_mps};
use crate::observation::Gnss;
use crate::steady::{TURNED, is_clear};
use crate::time::{Instant, Span, Stamp};
use crate::units::{GRAVITY, Hectopascals};
use crate::vehicle::Vehicle;

/// Metres of height for a relative change of pressure: the scale height of air at 15 degrees, R T / (M g).
pub(crate) const SCALE_HEIGHT_M: f32 = 8_430.0;
/// A standard atmosphere is wrong by so much of a climb where the air is 28 K warmer or colder than it says.
const SCALE_PART: f32 = 0.1;
/// Messages on a link are late by so much: a step takes that much longer or shorter.
const LATE_S: f32 = 0.3;
/// Receivers are some tenths of a second late: faster than this, m/s, the two heights are not of the same moment.
const CLIMB_MPS: f32 = 2.0;
/// A receiver's height is so old, s: 1 of those of 2013.
const RECEIVER_LATE_S: f32 = 1.0;
/// Heights and climb are summed over this time, s, when they vote.
const VOTE_S: f32 = 4.0;
/// Time constants of noise and the difference of heights, of climbs, and of usual height and speed, s.
const SMOOTHING_S: f32 = 0.5;
const CLIMBS_S: f32 = 1.0;
const AIR_S: f32 = 30.0;
/// Beyond half of the default limits nothing is learnt.
const APART_HOLD_M: f32 = 4.0;
const NOISE_HOLD_M: f32 = 1.0;
/// No rotors climb or fall faster, m/s: garbage.
const CLIMB_MAX_MPS: f32 = 200.0;
/// Samples further apart are not compared.
const PAUSE: Span = Span::from_secs(2);
/// A sample that leaps by more is one wrong message unless the next one leaps too: what no vehicle climbs, m/s, and more noise, m, than
/// the default limits tell of.
const LEAPS_MPS: f32 = 50.0;
const LEAPS_M: f32 = 5.0;

/// What a height has moved of late that the climb does not have.
#[derive(Clone, Copy, Debug)]
struct Leap {
    /// The last height, m, and when it was measured.
    height_m: f32,
    at: Stamp,
    leapt_m: f32,
    /// What a height that is late may make of the climb, m.
    late_m: f32,
}

impl Leap {
    const NONE: Self = Self { height_m: 0.0, at: Stamp::NONE, leapt_m: 0.0, late_m: 0.0 };

    /// `None`: it is not known how it climbs.
    fn take(&mut self, at: Instant, height_m: f32, climb_mps: Option<f32>) {
        let step = self.at.age(at).filter(|step| *step <= PAUSE);
        let risen_m = height_m - self.height_m;
        (self.at, self.height_m) = (Stamp::at(at), height_m);
        let (Some(step), Some(climb_mps)) = (step, climb_mps) else {
            (self.leapt_m, self.late_m) = (0.0, 0.0);
            return;
        };
        let step_s = step.as_secs_f32();
        let kept = VOTE_S / (VOTE_S + step_s);
        let leapt_m = kept * (self.leapt_m + risen_m - climb_mps * step_s);
        self.leapt_m = if leapt_m.is_finite() { leapt_m } else { 0.0 };
        self.late_m = (kept * self.late_m).max(RECEIVER_LATE_S * libm::fabsf(climb_mps));
    }

    /// How far, m, either way.
    fn far_m(&self) -> f32 {
        (libm::fabsf(self.leapt_m) - self.late_m).max(0.0)
    }
}

/// The memory of both.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heights {
    /// The first pressure of the flight, hPa; 0 before it.
    first_hpa: f32,
    /// Height above that, the dynamic pressure of the speed over ground as a height, both in m; the climb, m/s; and when they were
    /// measured.
    height: (Stamp, f32, f32, f32),
    /// The last sample leapt, and was passed over.
    doubted: bool,
    noise: Departure,
    /// The climb that is missing in the estimator's, smoothed, m/s.
    climbs_mps: Option<f32>,
    apart: Departure,
    /// When they were compared last.
    apart_at: Stamp,
    /// Height and a half of the dynamic pressure, both in m; the means of the last minute; and what they explain.
    air: [f32; 2],
    taken_off_m: f32,
    /// The leaps of barometer and receiver.
    leaps: [Leap; 2],
}

impl Heights {
    /// Nothing seen.
    pub(crate) const fn new() -> Self {
        Self {
            first_hpa: 0.0,
            height: (Stamp::NONE, 0.0, 0.0, 0.0),
            doubted: false,
            noise: Departure::NEW,
            climbs_mps: None,
            apart: Departure::NEW,
            apart_at: Stamp::NONE,
            air: [0.0; 2],
            taken_off_m: 0.0,
            leaps: [Leap::NONE; 2],
        }
    }

    pub(crate) fn take_pressure(
        &mut self,
        at: Instant,
        pressure: Hectopascals,
        vehicle: &Vehicle,
        flight: &Flight,
    ) {
        if !flight.is_settled(at) || !pressure.0.is_finite() || pressure.0 <= 0.0 {
            return;
        }
        if self.first_hpa == 0.0 {
            self.first_hpa = pressure.0;
        }
        let height_m = SCALE_HEIGHT_M * libm::logf(self.first_hpa / pressure.0);
        let (before, before_m, wind_before_m, climbed_mps) = self.height;
        let step = before.age(at).filter(|step| *step <= PAUSE);
        let leaps = step
            .is_some_and(|step| libm::fabsf(height_m - before_m) > LEAPS_M + LEAPS_MPS * step.as_secs_f32());
        self.doubted = leaps && !self.doubted;
        if self.doubted {
            return;
        }
        let speed_mps = ground_speed_mps(at, vehicle).unwrap_or(0.0);
        let wind_m = speed_mps * speed_mps / (2.0 * GRAVITY);
        let climb = climb_mps(at, vehicle);
        self.leaps[0].take(at, height_m, climb);
        self.height = (Stamp::at(at), height_m, wind_m, climb.unwrap_or(0.0));
        // One that leaps like the one before it is a step of the barometer, and no climb.
        let Some(step) = step.filter(|step| *step > Span::ZERO && !leaps) else { return };
        let step_s = step.as_secs_f32();
        self.take_climb(at, step_s, height_m - before_m, libm::fabsf(wind_m - wind_before_m), vehicle);
        let calm = is_clear(at, vehicle) && vehicle.inertial.turns_little(at, TURNED);
        if let Some(climb_mps) = climb.filter(|_| calm) {
            let off_m = libm::fabsf(height_m - before_m - climb_mps * step_s);
            let late_m = LATE_S * libm::fabsf(climb_mps) + step_s * libm::fabsf(climb_mps - climbed_mps);
            self.noise.take((off_m - late_m).max(0.0), step_s, SMOOTHING_S, NOISE_HOLD_M);
        }
    }

    /// Takes how far it climbed by the barometer in a step, and what the wind may have made of it.
    fn take_climb(&mut self, at: Instant, step_s: f32, climbed_m: f32, by_wind_m: f32, vehicle: &Vehicle) {
        let told = vehicle.hud.within(at, PAUSE).and_then(|hud| hud.climb).map(|climb| climb.0);
        // Nothing but zeros is what is sent where no climb is known.
        let told = told.filter(|climb| climb.abs() > 0.0 && climb.abs() <= CLIMB_MAX_MPS);
        let Some(climb_mps) = told.filter(|_| vehicle.hovers(at) == Some(true)) else { return };
        let missing_m = climbed_m - step_s * climb_mps;
        let beyond_m = libm::copysignf((libm::fabsf(missing_m) - by_wind_m).max(0.0), missing_m);
        let climbs_mps = self.climbs_mps.get_or_insert(0.0);
        *climbs_mps += (beyond_m - step_s * *climbs_mps) / (CLIMBS_S + step_s);
    }

    /// How far the estimator's climb is from that of the barometer, m/s.
    pub(crate) fn climbs_apart(&self, now: Instant) -> Option<Reading> {
        Reading::new(self.height.0.instant(now), self.climbs_mps.map(libm::fabsf))
    }

    pub(crate) fn take_gnss(&mut self, at: Instant, gnss: &Gnss, vehicle: &Vehicle, flight: &Flight) {
        let (measured, height_m, ..) = self.height;
        let known = measured.age(at).is_some_and(|age| age <= PAUSE);
        let good = gnss.is_exact();
        if let Some(altitude) = gnss.altitude.filter(|_| good && flight.is_settled(at)) {
            self.leaps[1].take(at, altitude.0, climb_mps(at, vehicle));
        }
        let climbs = climb_mps(at, vehicle).is_none_or(|climb| libm::fabsf(climb) > CLIMB_MPS);
        let Some(altitude) = gnss.altitude.filter(|_| known) else { return };
        if !good || climbs || !is_clear(at, vehicle) || !flight.airborne() {
            return;
        }
        let before = core::mem::replace(&mut self.apart_at, Stamp::at(at)).age(at);
        let step_s = before.map_or(0.0, |step| step.min(PAUSE).as_secs_f32());
        let airspeed = vehicle.hud.get().and_then(|hud| hud.airspeed).map_or(0.0, |speed| speed.0);
        let speed_mps = ground_speed_mps(at, vehicle).unwrap_or(0.0).max(airspeed);
        let air = [height_m, speed_mps * speed_mps / (4.0 * GRAVITY)];
        if before.is_none() {
            self.air = air;
        }
        let [up_m, faster_m] = [0, 1].map(|part| libm::fabsf(air[part] - self.air[part]));
        self.taken_off_m = SCALE_PART * up_m + faster_m;
        self.apart.follow(height_m - altitude.0, step_s, SMOOTHING_S);
        // Its usual level, and not its range: a slow drift would widen that as it goes.
        if !self.apart.is_known() || self.apart_m() <= APART_HOLD_M {
            self.apart.learn(step_s);
            for (mean, now) in self.air.iter_mut().zip(air) {
                *mean += step_s / (AIR_S + step_s) * (now - *mean);
            }
        }
    }

    fn apart_m(&self) -> f32 {
        (libm::fabsf(self.apart.departed()) - self.taken_off_m).max(0.0)
    }

    /// How far the barometer is apart from GPS, beyond what is usual, m.
    pub(crate) fn apart(&self, now: Instant) -> Option<Reading> {
        Reading::new(self.apart_at.instant(now), self.apart.is_known().then(|| self.apart_m()))
    }

    /// How far the receiver's height has leapt alone, m.
    pub(crate) fn receiver_leapt(&self, now: Instant) -> Option<Reading> {
        let [barometer_m, receiver_m] = [0, 1].map(|of| self.leaps[of].far_m());
        let alone_m = if receiver_m > 2.0 * barometer_m { receiver_m } else { 0.0 };
        Reading::new(self.leaps[1].at.instant(now), Some(alone_m))
    }

    /// How far the barometer's height steps, beyond what is usual, m.
    pub(crate) fn noise(&self, now: Instant) -> Option<Reading> {
        Reading::new(self.height.0.instant(now), self.noise.beyond())
    }
}
