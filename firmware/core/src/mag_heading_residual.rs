//! The first compass's heading against the estimator's yaw, and whether the estimator stopped using its compass.
//!
//! The residual includes the declination, which the baseline takes up. An estimator follows a wrong compass slowly,
//! by its gyros.

use crate::gates;
use crate::latest::Reading;
use crate::observation::{Estimator, EstimatorScale};
use crate::residual::{AT_ONCE, Comparison, KNOWN_SAMPLES, Residuals};
use crate::time::{BootMs, Millis, Stamp};
use crate::units::RadiansPerSecond;
use crate::vehicle::Vehicle;

/// The maximum rate about each axis, rad/s: field and attitude are not quite of one moment.
const TURNS_RAD_S: f32 = 0.2;
/// Samples that come sooner are skipped: angles are expensive.
const EVERY: Millis = Millis::from_millis(80);
/// Least change of the heading, degrees, of an unused compass that is faulty.
const MOVES_DEG: f32 = 2.0;

pub(crate) fn take(residuals: &mut Residuals, at: BootMs, [x, y, z]: [f32; 3], vehicle: &Vehicle) {
    if !residuals.is_due(Comparison::MagHeading, at, EVERY) {
        return;
    }
    let Some(attitude) = vehicle.attitude.within(at, AT_ONCE) else { return };
    let turns = |rates: [RadiansPerSecond; 3]| rates.iter().any(|rate| rate.0.abs() > TURNS_RAD_S);
    if attitude.rates.is_none_or(turns) {
        return;
    }
    let (sin_roll, cos_roll) = (libm::sinf(attitude.roll.0), libm::cosf(attitude.roll.0));
    let across = y * cos_roll - z * sin_roll;
    let down = y * sin_roll + z * cos_roll;
    let ahead = x * libm::cosf(attitude.pitch.0) + down * libm::sinf(attitude.pitch.0);
    let off_deg = (attitude.yaw.0 - libm::atan2f(-across, ahead)).to_degrees();
    residuals.take(Comparison::MagHeading, at, off_deg, 0.0);
}

state! {
    pub(crate) struct CompassUse {
        ratios: u8,
        unused: (Stamp, bool),
    }
}

impl CompassUse {
    /// PX4 sends no ratio of a compass that it does not fuse.
    pub(crate) fn take(&mut self, at: BootMs, estimator: &Estimator, residuals: &Residuals) {
        if estimator.scale != EstimatorScale::TestRatio || !residuals.gates.are(gates::AIRBORNE) {
            return;
        }
        self.ratios = self.ratios.saturating_add(u8::from(estimator.compass.is_some()));
        // An estimator that sends no ratio at all says nothing about its compass.
        let sends = estimator.velocity.is_some() || estimator.position_horizontal.is_some();
        if sends && self.ratios >= KNOWN_SAMPLES {
            // PX4 also pauses the use of a sound compass, for half a minute at a time (in 7 of 20 healthy flights of
            // its simulator).
            let moved = residuals.excess(Comparison::MagHeading).is_some_and(|excess| excess > MOVES_DEG);
            self.unused = (Stamp::at(at), estimator.compass.is_none() && moved);
        }
    }

    pub(crate) fn unused(&self, now: BootMs) -> Option<Reading> {
        let (at, unused) = self.unused;
        Reading::new(at.instant(now), Some(f32::from(u8::from(unused))))
    }
}
