//! The estimator that flies against the second one ([`SecondEstimate`]).
//!
//! An `ArduPilot` runs two: where an EKF flies, DCM stands by. DCM takes its attitude from gyros held by accelerometers, its height from the
//! barometer and its place from the receiver as they are (`AP_AHRS_DCM`). So a main estimator that leaves its sensors is seen. Headings come
//! apart by 40 degrees if a healthy vehicle is yawed fast, and are not compared.
//!
//! DCM takes accelerations off by the receiver's velocity: without an exact receiver nothing is compared. Even with one its attitude is off
//! by 20 degrees in hard manoeuvres. Heights have an offset, which is learnt.

use crate::motion::ground_speed_mps;
use crate::observation::SecondEstimate;
use crate::residual::{AT_ONCE, Comparison, Residuals};
use crate::time::{BootMs, Millis};
use crate::units::{DEGREE_M, Position, norm};
use crate::vehicle::Vehicle;

/// A receiver's place, and a message, are so old, s.
const LATE_S: f32 = 0.5;
/// `EKF_POS_HORIZ_ABS`
const POS_HORIZ_ABS: u16 = 16;

pub(crate) fn take(residuals: &mut Residuals, at: BootMs, second: &SecondEstimate, vehicle: &Vehicle) {
    if !residuals.is_due(Comparison::Ahrs2Tilt, at, Millis::ZERO) {
        return;
    }
    if let (Some(attitude), Some([roll, pitch, _])) = (vehicle.attitude.within(at, AT_ONCE), second.attitude)
    {
        let one = down([attitude.roll.0, attitude.pitch.0]);
        let other = down([roll.0, pitch.0]);
        let chord = norm([0, 1, 2].map(|axis| one[axis] - other[axis]));
        let tilt_deg = (2.0 * libm::asinf((chord / 2.0).clamp(0.0, 1.0))).to_degrees();
        residuals.take(Comparison::Ahrs2Tilt, at, tilt_deg, 0.0);
    }
    let Some(global) = vehicle.global.within(at, AT_ONCE) else { return };
    if let Some(altitude) = second.altitude {
        residuals.take(Comparison::Ahrs2Height, at, global.altitude.0 - altitude.0, 0.0);
    }
    // A vehicle that flies by optical flow has its place from elsewhere.
    let absolute = vehicle.estimator.get().is_none_or(|estimator| estimator.flags & POS_HORIZ_ABS != 0);
    if let (Some(one), Some(other), true) = (global.position, second.position, absolute) {
        let late_m = LATE_S * ground_speed_mps(at, vehicle).unwrap_or(0.0);
        let apart_m = (distance_m(one, other) - late_m).max(0.0);
        residuals.take(Comparison::Ahrs2Position, at, apart_m, 0.0);
    }
}

fn down([roll, pitch]: [f32; 2]) -> [f32; 3] {
    let level = libm::cosf(pitch);
    [-libm::sinf(pitch), libm::sinf(roll) * level, libm::cosf(roll) * level]
}

fn distance_m(one: Position, other: Position) -> f32 {
    let north_m = ((one.latitude_deg - other.latitude_deg) * DEGREE_M) as f32;
    let turns_deg = one.longitude_deg - other.longitude_deg;
    let east_m = (turns_deg * DEGREE_M) as f32 * libm::cosf((one.latitude_deg as f32).to_radians());
    norm([north_m, east_m])
}
