//! Flight modes, by who flies: the numbers are `HEARTBEAT.custom_mode` of `ArduPilot` and PX4.

use crate::observation::Autopilot;
use crate::vehicle::Vehicle;

/// Thrown or dropped into the air to start: `ArduCopter`'s THROW.
pub(crate) fn is_thrown(vehicle: &Vehicle) -> bool {
    vehicle.heartbeat.get().is_some_and(|heartbeat| {
        heartbeat.autopilot == Autopilot::ArduPilot && !vehicle.has_wings() && heartbeat.mode == 18
    })
}

/// Modes in which the pilot himself has the throttle, or which are made for falling: `ArduCopter`'s STABILIZE, ACRO, DRIFT,
/// FLIP, THROW, AUTOROTATE; `ArduPlane`'s MANUAL, STABILIZE, TRAINING, ACRO, FBWA, AUTOTUNE, QSTABILIZE, QACRO, THERMAL; PX4's
/// MANUAL, ACRO, STABILIZED.
pub fn has_pilots_throttle(vehicle: &Vehicle) -> bool {
    let Some(heartbeat) = vehicle.heartbeat.get() else { return true };
    match heartbeat.autopilot {
        Autopilot::ArduPilot if vehicle.has_wings() => {
            matches!(heartbeat.mode, 0 | 2 | 3 | 4 | 5 | 8 | 17 | 23 | 24)
        }
        Autopilot::ArduPilot => matches!(heartbeat.mode, 0 | 1 | 11 | 14 | 18 | 26),
        Autopilot::Px4 => matches!(heartbeat.mode >> 16 & 0xFF, 1 | 5 | 7),
        Autopilot::Other => true,
    }
}

/// Modes that are made for turning over: `ArduCopter`'s ACRO, FLIP and TURTLE, `ArduPlane`'s MANUAL, TRAINING and ACRO, PX4's
/// MANUAL and ACRO.
pub(crate) fn is_made_to_turn(vehicle: &Vehicle) -> bool {
    let Some(heartbeat) = vehicle.heartbeat.get() else { return true };
    let wings = vehicle.has_wings();
    match heartbeat.autopilot {
        Autopilot::ArduPilot if wings => matches!(heartbeat.mode, 0 | 3 | 4 | 23),
        Autopilot::ArduPilot => matches!(heartbeat.mode, 1 | 14 | 28),
        Autopilot::Px4 => {
            matches!(heartbeat.mode >> 16 & 0xFF, 5) || (wings && heartbeat.mode >> 16 & 0xFF == 1)
        }
        Autopilot::Other => false,
    }
}

/// Modes in which the sticks command rates of roll and pitch, so that the pilot banks freely. They are those made for
/// turning over, `ArduCopter`'s DRIFT and SPORT, PX4's RATTITUDE.
pub(crate) fn is_banked_by_hand(vehicle: &Vehicle) -> bool {
    is_made_to_turn(vehicle)
        || vehicle.heartbeat.get().is_some_and(|heartbeat| match heartbeat.autopilot {
            Autopilot::ArduPilot => !vehicle.has_wings() && matches!(heartbeat.mode, 11 | 13),
            Autopilot::Px4 => heartbeat.mode >> 16 & 0xFF == 8,
            Autopilot::Other => false,
        })
}
