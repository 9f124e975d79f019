//! Vibration against its own baseline in this flight.

use crate::observation::VibrationScale;
use crate::residual::Comparison;
use crate::vehicle::Vehicle;

/// The comparison that vibration is taken by, on the scale that the vehicle knows.
pub(crate) fn comparison(vehicle: &Vehicle) -> Comparison {
    match vehicle.vibration.get().map(|vibration| vibration.scale) {
        Some(VibrationScale::Px4Metrics) => Comparison::VibrationPx4,
        _ => Comparison::Vibration,
    }
}

/// The last message's level, m/s2.
pub(crate) fn level_mps2(vehicle: &Vehicle) -> Option<f32> {
    let vibration = vehicle.vibration.get()?;
    match vibration.scale {
        VibrationScale::PerAxis => vibration.levels.into_iter().flatten().reduce(f32::max),
        VibrationScale::Px4Metrics => vibration.levels[2],
    }
}
