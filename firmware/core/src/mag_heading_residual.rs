//! The first compass's heading against the estimator's yaw, and whether the estimator stopped using its compass.
//!
//! The residual includes the declination, which the baseline takes up. An estimator follows a wrong compass by gyros, and only slowly.

use crate::gates::Gates;
use crate::latest::Reading;
use crate::observation::{Estimator, EstimatorScale};
use crate::residual::{Comparison, Residuals};
use crate::time::{Instant, Span, Stamp};
use crate::units::RadiansPerSecond;
use crate::vehicle::Vehicle;

/// The field is compared with an attitude that is so old at most, and turns slower about each axis, rad/s: the two are not of one moment.
const ATTITUDE_AGE: Span = Span::from_millis(200);
const TURNS_RAD_S: f32 = 0.2;
/// Samples that come sooner are passed over: angles are dear.
const EVERY: Span = Span::from_millis(80);
/// The heading of an unused compass has moved away at least so far, degrees, if something is wrong with the compass.
const MOVES_DEG: f32 = 2.0;
/// Ratios that the estimator sent of its compass in flight, before their end means that it does not use it any more: at 1 Hz or more.
const RATIOS_KNOWN: u8 = 20;

/// Takes the field by the attitude's roll and pitch.
pub(crate) fn take(
    residuals: &mut Residuals,
    at: Instant,
    [x, y, z]: [f32; 3],
    vehicle: &Vehicle,
    gates: Gates,
) {
    if !residuals.is_due(Comparison::MagHeading, at, gates, EVERY) {
        return;
    }
    let Some(attitude) = vehicle.attitude.within(at, ATTITUDE_AGE) else { return };
    let turns = |rates: [RadiansPerSecond; 3]| rates.iter().any(|rate| rate.0.abs() > TURNS_RAD_S);
    if attitude.rates.is_none_or(turns) {
        return;
    }
    let (sin_roll, cos_roll) = (libm::sinf(attitude.roll.0), libm::cosf(attitude.roll.0));
    let across = y * cos_roll - z * sin_roll;
    let down = y * sin_roll + z * cos_roll;
    let ahead = x * libm::cosf(attitude.pitch.0) + down * libm::sinf(attitude.pitch.0);
    let off_deg = (attitude.yaw.0 - libm::atan2f(-across, ahead)).to_degrees();
    residuals.take(Comparison::MagHeading, at, gates, off_deg, 0.0);
}

/// Whether the estimator uses its compass.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompassUse {
    /// Ratios of the compass in this flight, and whether the last message had none.
    ratios: u8,
    unused: (Stamp, bool),
}

impl CompassUse {
    pub(crate) const UNKNOWN: Self = Self { ratios: 0, unused: (Stamp::NONE, false) };

    /// PX4 sends no ratio of a compass that it does not fuse.
    pub(crate) fn take(&mut self, at: Instant, estimator: &Estimator, airborne: bool, residuals: &Residuals) {
        if estimator.scale != EstimatorScale::TestRatio || !airborne {
            return;
        }
        self.ratios = self.ratios.saturating_add(u8::from(estimator.compass.is_some()));
        // An estimator that sends no ratio at all says nothing about its compass.
        let sends = estimator.velocity.is_some() || estimator.position_horizontal.is_some();
        if sends && self.ratios >= RATIOS_KNOWN {
            // It pauses the use of a sound one too, for half a minute at a time (in 7 of 20 healthy flights of PX4's simulator).
            let moved = residuals.excess(Comparison::MagHeading).is_some_and(|excess| excess > MOVES_DEG);
            self.unused = (Stamp::at(at), estimator.compass.is_none() && moved);
        }
    }

    /// Whether the estimator stopped using a compass that it used in this flight, and whose heading moved away from its own.
    pub(crate) fn unused(&self, now: Instant) -> Option<Reading> {
        let (at, unused) = self.unused;
        Reading::new(at.instant(now), Some(f32::from(u8::from(unused))))
    }
}
