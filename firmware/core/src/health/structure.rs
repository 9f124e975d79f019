//! Vibration, clipping and load factor.

use super::check::{Check, Debounce, Limits, Unit, When};
use super::common::{PLAIN, STALE, alert, due, vibration};
use super::finding::Subsystem;
use super::suppression::{DRIVE, Group, INERTIAL, Role, SHAKING};
use crate::cause::Cause;
use crate::observation::VibrationScale;
use crate::params::Param;

const VIBRATION: Check = Check {
    name: "vibration",
    subsystem: Subsystem::Structure,
    unit: Unit::of("m/s2"),
    limits: Limits::above(Some(Param::VibeWarn), Some(Param::VibeCrit), 3.0),
    debounce: [Debounce::secs(1); 2],
    when: When::Armed,
    stale_s: STALE,
    read: |inputs, _| {
        vibration(inputs, VibrationScale::PerAxis, |levels| levels.into_iter().flatten().reduce(f32::max))
    },
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Vibration, 0), ..VIBRATION },
    Check {
        name: "vibration_px4",
        role: Role::of(Group::Vibration, 0),
        limits: Limits::above(Some(Param::VibePx4Warn), Some(Param::VibePx4Crit), 0.5),
        read: |inputs, _| vibration(inputs, VibrationScale::Px4Metrics, |[.., accelerometer]| accelerometer),
        ..VIBRATION
    },
    Check {
        name: "vibration_rise",
        role: Role::of(Group::Shaking, DRIVE | Group::EscTelemetry.bit() | Group::Vibration.bit()),
        unit: Unit::of("times"),
        limits: Limits::above(Some(Param::VibeRiseWarn), None, 0.5),
        // Two messages at 5 Hz.
        debounce: [Debounce::millis(200), Debounce::secs(1)],
        when: When::InFlight,
        // Never stale: only flight on rotors can be judged.
        stale_s: None,
        read: |inputs, _| inputs.derived.crosschecks.vibration_rise(inputs.now, inputs.vehicle),
        ..VIBRATION
    },
    Check {
        name: "clipping",
        role: Role::of(Group::Shaking, Group::Vibration.bit()),
        unit: Unit::of(""),
        limits: Limits::above(Some(Param::ClipWarn), Some(Param::ClipCrit), 0.0),
        debounce: [Debounce::NONE; 2],
        when: When::InFlight,
        read: |inputs, _| inputs.derived.clips(inputs.vehicle),
        ..VIBRATION
    },
    Check {
        name: "load_factor",
        role: Role::of(Group::Other, SHAKING),
        unit: Unit::of("g"),
        limits: Limits::above(Some(Param::LoadFacWarn), Some(Param::LoadFacCrit), 0.2),
        // A manoeuvre lasts; a shock or vibration does not, and an impact is a mishap.
        debounce: [Debounce::millis(500); 2],
        when: When::InFlight,
        // Never stale: a shaking vehicle has no load factor.
        stale_s: None,
        read: |inputs, _| inputs.derived.load_factor(),
        ..VIBRATION
    },
    Check { name: "airframe_due", ..due(Subsystem::Structure) },
    alert::<{ Cause::Vibration as usize }>(
        Subsystem::Structure,
        Role::of(Group::VibrationWord, Group::Vibration.bit() | INERTIAL | Group::ImuGnss.bit()),
    ),
];
