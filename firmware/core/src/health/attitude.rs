//! Roll and pitch of vehicles on rotors. A plane banks as it needs to, and so does a VTOL while it flies on its wings.
//!
//! Pilots bank a multicopter steeply, and the autopilot turns their sticks into a setpoint ([`crate::vehicle::Vehicle::wanted`]). So an angle
//! counts only if it is further than [`FOLLOWS_RAD`] from the setpoint. Without a setpoint it counts, except in modes that let the pilot bank
//! freely.

use super::prelude::*;
use crate::flight::overturned_deg;
use crate::modes::{is_banked_by_hand, is_made_to_turn};
use crate::observation::{Attitude, VehicleKind};
use crate::time::PAUSE;
use crate::units::Radians;

/// 25 degrees: an attitude follows the wanted one within this, but for moments that are shorter than the debounce. The thrust loss
/// and crash checks of `ArduCopter` take 30 degrees.
const FOLLOWS_RAD: f32 = 0.436;

const ROLL: Check = Check {
    name: "roll",
    subsystem: Subsystem::Attitude,
    unit: Unit::of("deg"),
    limits: Limits::above(Some(Param::TiltWarn), Some(Param::TiltCrit), 5.0),
    debounce_ms: [500, 300],
    // PX4's failure detector: FD_FAIL_R_TTRI, FD_FAIL_P_TTRI 0.3 s.
    when: CheckPhase::InFlight,
    stale_s: STALE,
    read: |inputs, _| degrees(inputs, |attitude| attitude.roll, 0),
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Other, DRIVE | GYROS | Group::RollRate.bit()), ..ROLL },
    row!("pitch" ROLL, role: Role::of(Group::Other, DRIVE | GYROS | Group::PitchRate.bit()),
        read: |inputs, _| degrees(inputs, |attitude| attitude.pitch, 1)),
    alert!(Attitude Attitude, Role::of(Group::Other, DRIVE | GYROS | RATES)),
];

fn degrees(inputs: &Inputs<'_>, angle: fn(&Attitude) -> Radians, axis: usize) -> Option<Reading> {
    let Inputs { now, vehicle, flight, .. } = *inputs;
    if !matches!(vehicle.kind(), VehicleKind::Rotorcraft | VehicleKind::Vtol) {
        return None;
    }
    let told = vehicle.wanted.within(now, PAUSE).map(|told| told[axis].0);
    let degrees = |attitude: &Attitude| {
        let is = angle(attitude).0;
        let asked = is_made_to_turn(vehicle)
            || told.map_or_else(|| is_banked_by_hand(vehicle), |told| apart(is, told) < FOLLOWS_RAD);
        let angle_deg = is.to_degrees().abs();
        // No angle is too much on wings or in transition, and none counts that the sensors contradict.
        let counts = vehicle.hovers(now) == Some(true) && !asked && flight.believes_attitude(now, vehicle);
        // Beyond it is overturned, which is a mishap.
        let judged = counts && angle_deg <= overturned_deg(inputs.params);
        if judged || !is.is_finite() { angle_deg } else { 0.0 }
    };
    Reading::new(vehicle.attitude.at(), vehicle.attitude.get().map(degrees))
}

/// Of angles of one turn.
fn apart(one: f32, other: f32) -> f32 {
    let apart = libm::fabsf(one - other);
    apart.min(core::f32::consts::TAU - apart)
}
