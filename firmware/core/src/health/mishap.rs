//! Mishaps: the signs that [`crate::flight`] saw. No gate holds them back, and they stay critical until the vehicle is armed again or flies
//! on.

use super::prelude::*;
use crate::mishap::MishapKind;

pub(super) const CHECKS: &[Check] = &[
    sign(MishapKind::FreeFall, "s", |inputs, _| reading(inputs, MishapKind::FreeFall)),
    sign(MishapKind::Impact, "g", |inputs, _| reading(inputs, MishapKind::Impact)),
    sign(MishapKind::Tumbling, "deg/s", |inputs, _| reading(inputs, MishapKind::Tumbling)),
    Check {
        alarm_only: true,
        ..sign(MishapKind::Disarmed, "m", |inputs, _| reading(inputs, MishapKind::Disarmed))
    },
    sign(MishapKind::Sinking, "m/s", |inputs, _| reading(inputs, MishapKind::Sinking)),
    sign(MishapKind::Overturned, "deg", |inputs, _| reading(inputs, MishapKind::Overturned)),
    alert!(Crash Mishap, Role::NONE),
];

const fn sign(kind: MishapKind, unit: &str, read: ValueReader) -> Check {
    let limits = Limits::above(None, Some(kind.limit()), 0.0);
    let (subsystem, unit) = (Subsystem::Mishap, Unit::of(unit));
    Check { name: kind.name(), subsystem, unit, limits, stale_s: STALE, read, ..PLAIN }
}

fn reading(inputs: &Inputs<'_>, kind: MishapKind) -> Option<Reading> {
    inputs.flight.reading(kind, inputs.now, inputs.vehicle)
}

/// The order in the text of a check:
/// * WATCH IT if all ESCs are silent: it is their telemetry;
/// * DISARM IF DOWN only while it is armed;
/// * FLY FORWARD, CLIMB of a sinking vehicle on rotors only if it is upright, has lost no motor and did not sink at
///   full throttle;
/// * none of a sinking vehicle on wings, which glides.
pub(super) fn orders(check: &Check, inputs: &Inputs<'_>, has_lost_drive: impl FnOnce() -> bool) -> Orders {
    let Inputs { now, vehicle, derived, flight, .. } = *inputs;
    if check.name == "esc_silent" && derived.motors.are_silent(now) {
        return Orders::Watch;
    }
    // It comes down or lies on the ground, even if it reports otherwise.
    if check.name == "autopilot_state" && vehicle.terminated_since.is_some() {
        return Orders::Disarm;
    }
    if check.name == MishapKind::Sinking.name() {
        let in_vain = derived.crosschecks.thrust.in_vain().is_some_and(|full| full.value > 0.0);
        return match vehicle.hovers(now) {
            Some(true) if !flight.has_tilted(now) && !in_vain && !has_lost_drive() => Orders::Own,
            Some(true) => Orders::Disarm,
            _ => Orders::Nothing,
        };
    }
    let of_any = matches!(check.name, "free_fall" | "tumbling" | "disarmed_in_air");
    if check.subsystem != Subsystem::Mishap || vehicle.armed() || of_any {
        Orders::Own
    } else {
        Orders::Nothing
    }
}
