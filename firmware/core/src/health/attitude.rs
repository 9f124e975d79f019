//! Roll and pitch of what hangs on rotors. A plane banks as it needs to, and so does a VTOL while it flies on its wings.

use super::check::{Check, Side, When};
use super::common::STALE;
use super::finding::Subsystem;
use super::inputs::Inputs;
use crate::latest::Reading;
use crate::observation::{Attitude, VehicleKind};
use crate::params::Param;
use crate::time::Span;
use crate::units::Radians;

const ROLL: Check = Check {
    name: "roll",
    words: "roll",
    subsystem: Subsystem::Attitude,
    unit: "deg",
    side: Side::Above,
    warn: Some(Param::TiltWarn),
    critical: Some(Param::TiltCrit),
    hysteresis: 5.0,
    debounce_warn: Span::from_millis(500),
    // PX4's failure detector: FD_FAIL_R_TTRI, FD_FAIL_P_TTRI 0.3 s.
    debounce_critical: Span::from_millis(300),
    when: When::InFlight,
    stale_after: STALE,
    instances: 1,
    alarm_only: false,
    read: |inputs, _| degrees(inputs, |attitude| attitude.roll),
};

pub(super) const CHECKS: &[Check] = &[
    ROLL,
    Check {
        name: "pitch",
        words: "pitch",
        read: |inputs, _| degrees(inputs, |attitude| attitude.pitch),
        ..ROLL
    },
];

fn degrees(inputs: &Inputs<'_>, angle: fn(&Attitude) -> Radians) -> Option<Reading> {
    if !matches!(inputs.vehicle.kind(), VehicleKind::Rotorcraft | VehicleKind::Vtol) {
        return None;
    }
    // On wings, and between both, no angle is too much.
    let judged = inputs.vehicle.hovers(inputs.now) == Some(true);
    let slot = &inputs.vehicle.attitude;
    let degrees = |attitude: &Attitude| angle(attitude).0.to_degrees().abs();
    Reading::new(slot.at(), slot.get().map(|attitude| if judged { degrees(attitude) } else { 0.0 }))
}
