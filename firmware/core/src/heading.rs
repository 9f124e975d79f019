//! The first compass's heading against that of the estimator, and the estimator's word on whether it uses its compass.
//!
//! How far the two are apart includes the declination, and is usual in a flight ([`crate::departure`]). What comes to it is told: an
//! estimator follows a wrong compass by gyros, and only slowly. One sample turns it by [`SAMPLE_DEG`] at most: one wrong message is no
//! fault.

use crate::departure::Departure;
use crate::flight::Flight;
use crate::latest::Reading;
use crate::observation::{Estimator, EstimatorScale, VehicleKind};
use crate::steady::is_clear;
use crate::time::{Instant, Span, Stamp};
use crate::units::RadiansPerSecond;
use crate::vehicle::Vehicle;

/// The field is compared with an attitude that is so old at most, and turns slower about each axis, rad/s: the two are not of one moment.
const ATTITUDE_AGE: Span = Span::from_millis(200);
const TURNS_RAD_S: f32 = 0.2;
const SMOOTHING_S: f32 = 0.5;
/// Samples that come sooner are passed over: angles are dear. A slow stream is smoothed over as many as one of 4 Hz.
const EVERY: Span = Span::from_millis(80);
const STEP_MAX: Span = Span::from_millis(250);
/// What a sample counts for at most, degrees: smoothed, less than the default limit.
const SAMPLE_DEG: f32 = 30.0;
/// Beyond half of the default limit, degrees, nothing is learnt.
const HOLD_DEG: f32 = 6.0;
/// What a compass that is not used has moved away at least, where something is wrong with it.
const MOVES_DEG: f32 = 2.0;
/// Ratios that the estimator told of its compass in flight, before their end says that it does not use it any more: at 1 Hz or more.
const RATIOS_KNOWN: u8 = 20;

/// The memory of both.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heading {
    /// The estimator's less that of the first compass, degrees.
    apart: Departure,
    at: Stamp,
    /// Ratios of the compass that the estimator told in this flight, and whether the last one was none.
    ratios: u8,
    unused: (Stamp, bool),
}

impl Heading {
    /// Nothing seen.
    pub(crate) const NEW: Self =
        Self { apart: Departure::NEW, at: Stamp::NONE, ratios: 0, unused: (Stamp::NONE, false) };

    /// Takes the field by the attitude's roll and pitch.
    pub(crate) fn take(&mut self, at: Instant, [x, y, z]: [f32; 3], vehicle: &Vehicle, flight: &Flight) {
        let judged = self.at.age(at).is_none_or(|age| age >= EVERY)
            && matches!(vehicle.kind(), VehicleKind::Rotorcraft | VehicleKind::Plane)
            && flight.is_settled(at)
            && is_clear(at, vehicle);
        let Some(attitude) = vehicle.attitude.within(at, ATTITUDE_AGE).filter(|_| judged) else { return };
        let turns = |rates: [RadiansPerSecond; 3]| rates.iter().any(|rate| rate.0.abs() > TURNS_RAD_S);
        if attitude.rates.is_none_or(turns) {
            return;
        }
        let (sin_roll, cos_roll) = (libm::sinf(attitude.roll.0), libm::cosf(attitude.roll.0));
        let across = y * cos_roll - z * sin_roll;
        let down = y * sin_roll + z * cos_roll;
        let ahead = x * libm::cosf(attitude.pitch.0) + down * libm::sinf(attitude.pitch.0);
        let off_deg = (attitude.yaw.0 - libm::atan2f(-across, ahead)).to_degrees();
        // The short way round from what it was.
        let before_deg = self.apart.figure();
        let turned_deg = off_deg - before_deg;
        let turned_deg = turned_deg - 360.0 * libm::roundf(turned_deg / 360.0);
        let known = self.at.is_set();
        let most_deg = if known { SAMPLE_DEG } else { f32::INFINITY };
        let step_s = self.at.age(at).map_or(0.0, |step| step.min(STEP_MAX).as_secs_f32());
        self.at = Stamp::at(at);
        self.apart.follow(before_deg + turned_deg.clamp(-most_deg, most_deg), step_s, SMOOTHING_S);
        self.apart.wrap(360.0);
        if self.apart.beyond_either_way().is_none_or(|beyond_deg| beyond_deg <= HOLD_DEG) {
            self.apart.learn(step_s);
        }
    }

    /// PX4 tells no ratio of what it does not fuse.
    pub(crate) fn take_estimator(&mut self, at: Instant, estimator: &Estimator, flight: &Flight) {
        if estimator.scale != EstimatorScale::TestRatio || !flight.airborne() {
            return;
        }
        self.ratios = self.ratios.saturating_add(u8::from(estimator.compass.is_some()));
        // An estimator that tells nothing at all says nothing about its compass.
        let tells = estimator.velocity.is_some() || estimator.position_horizontal.is_some();
        if tells && self.ratios >= RATIOS_KNOWN {
            // It pauses the use of a sound one too, for half a minute at a time (in 7 of 20 healthy flights of PX4's simulator).
            let moved = self.apart.beyond_either_way().is_some_and(|beyond_deg| beyond_deg > MOVES_DEG);
            self.unused = (Stamp::at(at), estimator.compass.is_none() && moved);
        }
    }

    /// How far the compass's heading is from the estimator's, beyond what is usual, degrees.
    pub(crate) fn apart(&self, now: Instant) -> Option<Reading> {
        Reading::new(self.at.instant(now), self.apart.beyond_either_way())
    }

    /// Whether the estimator stopped using a compass that it used in this flight, and whose heading moved away from its own.
    pub(crate) fn unused(&self, now: Instant) -> Option<Reading> {
        let (at, unused) = self.unused;
        Reading::new(at.instant(now), Some(f32::from(u8::from(unused))))
    }
}
