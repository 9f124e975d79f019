//! Mishaps: the signs that [`crate::flight`] saw. No gate holds them back, and they stay critical until the vehicle is armed again or flies
//! on.

use super::check::{Check, Debounce, InstanceOf, Limits, Unit, When};
use super::common::{STALE, alert};
use super::finding::{Orders, Subsystem};
use super::inputs::Inputs;
use super::suppression::Role;
use crate::cause::Cause;
use crate::mishap::Kind;
use crate::params::Param;

const FREE_FALL: Check = Check {
    name: Kind::FreeFall.name(),
    subsystem: Subsystem::Mishap,
    unit: Unit::of("s"),
    limits: Limits::above(None, Some(Param::MisFallTime), 0.0),
    debounce: [Debounce::NONE; 2],
    when: When::Always,
    stale_s: STALE,
    instances: 1,
    alarm_only: false,
    is_flag: false,
    role: Role::NONE,
    of: InstanceOf::Vehicle,
    read: |inputs, _| inputs.flight.reading(Kind::FreeFall, inputs.now, inputs.vehicle),
};

pub(super) const CHECKS: &[Check] = &[
    FREE_FALL,
    Check {
        name: Kind::Impact.name(),
        unit: Unit::of("g"),
        limits: Limits::above(None, Some(Param::MisImpact), 0.0),
        read: |inputs, _| inputs.flight.reading(Kind::Impact, inputs.now, inputs.vehicle),
        ..FREE_FALL
    },
    Check {
        name: Kind::Tumbling.name(),
        unit: Unit::of("deg/s"),
        limits: Limits::above(None, Some(Param::MisTumble), 0.0),
        read: |inputs, _| inputs.flight.reading(Kind::Tumbling, inputs.now, inputs.vehicle),
        ..FREE_FALL
    },
    Check {
        name: Kind::Disarmed.name(),
        unit: Unit::of("m"),
        alarm_only: true,
        limits: Limits::above(None, Some(Param::MisDisarm), 0.0),
        read: |inputs, _| inputs.flight.reading(Kind::Disarmed, inputs.now, inputs.vehicle),
        ..FREE_FALL
    },
    Check {
        name: Kind::Sinking.name(),
        unit: Unit::of("m/s"),
        limits: Limits::above(None, Some(Param::MisSink), 0.0),
        read: |inputs, _| inputs.flight.reading(Kind::Sinking, inputs.now, inputs.vehicle),
        ..FREE_FALL
    },
    Check {
        name: Kind::Overturned.name(),
        unit: Unit::of("deg"),
        limits: Limits::above(None, Some(Param::MisOverturn), 0.0),
        read: |inputs, _| inputs.flight.reading(Kind::Overturned, inputs.now, inputs.vehicle),
        ..FREE_FALL
    },
    alert::<{ Cause::Crash as usize }>(Subsystem::Mishap, Role::NONE),
];

/// What the text of a check orders. DISARM is ordered while it is armed, and FLY FORWARD, CLIMB of what hangs upright on rotors, has
/// not lost one, and has not tried in vain with full throttle: what rotors do not carry comes down. Wings glide. Nobody lands at once because
/// telemetry alone is silent, of all ESCs.
pub(super) fn orders(check: &Check, inputs: &Inputs<'_>, has_lost_drive: impl FnOnce() -> bool) -> Orders {
    let Inputs { now, vehicle, derived, flight, .. } = *inputs;
    if check.name == "esc_silent" && derived.are_escs_silent() {
        return Orders::Watch;
    }
    // It comes down, or lies, whatever it still says.
    if check.name == "autopilot_state" && vehicle.terminated_since.is_some() {
        return Orders::Disarm;
    }
    if check.name == Kind::Sinking.name() {
        let in_vain = derived.crosschecks().full_in_vain().is_some_and(|full| full.value > 0.0);
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
