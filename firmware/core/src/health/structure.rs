//! Vibration, clipping and load factor.

use super::check::{Check, Debounce, InstanceOf, Side, Unit, When};
use super::common::{STALE, alert, departure, due, px4_metric};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{DRIVE, Group, INERTIAL, Role, SHAKING};
use crate::baseline::Quantity;
use crate::cause::Cause;
use crate::latest::Reading;
use crate::observation::VibrationScale;
use crate::params::Param;

const VIBRATION: Check = Check {
    name: "vibration",
    subsystem: Subsystem::Structure,
    unit: Unit::of("m/s2"),
    side: Side::Above,
    warn: Some(Param::VibeWarn),
    critical: Some(Param::VibeCrit),
    hysteresis: 3.0,
    debounce_warn: Debounce::secs(1),
    debounce_critical: Debounce::secs(1),
    when: When::Armed,
    stale_s: STALE,
    instances: 1,
    alarm_only: false,
    is_flag: false,
    role: Role::NONE,
    of: InstanceOf::Vehicle,
    read: per_axis,
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Vibration, 0), ..VIBRATION },
    Check {
        name: "vibration_px4",
        role: Role::of(Group::Vibration, 0),
        warn: Some(Param::VibePx4Warn),
        critical: Some(Param::VibePx4Crit),
        hysteresis: 0.5,
        read: |inputs, _| px4_metric(inputs, 2),
        ..VIBRATION
    },
    Check {
        name: "vibration_rise",
        role: Role::of(Group::Shaking, DRIVE | Group::EscTelemetry.bit() | Group::Vibration.bit()),
        unit: Unit::of("times"),
        warn: Some(Param::VibeRiseWarn),
        critical: None,
        hysteresis: 0.5,
        // Two messages at 5 Hz.
        debounce_warn: Debounce::millis(200),
        when: When::InFlight,
        // Never stale: only what flies on rotors says something.
        stale_s: None,
        read: |inputs, _| inputs.derived.crosschecks().vibration_rise(inputs.now, inputs.vehicle),
        ..VIBRATION
    },
    Check {
        name: "clipping",
        role: Role::of(Group::Shaking, Group::Vibration.bit()),
        unit: Unit::of(""),
        warn: Some(Param::ClipWarn),
        critical: Some(Param::ClipCrit),
        hysteresis: 0.0,
        debounce_warn: Debounce::NONE,
        debounce_critical: Debounce::NONE,
        when: When::InFlight,
        read: |inputs, _| inputs.derived.clips(inputs.vehicle),
        ..VIBRATION
    },
    Check {
        name: "load_factor",
        role: Role::of(Group::Other, SHAKING),
        unit: Unit::of("g"),
        warn: Some(Param::LoadFacWarn),
        critical: Some(Param::LoadFacCrit),
        hysteresis: 0.2,
        // What lasts is a manoeuvre; a shock or vibration does not, and an impact is a mishap.
        debounce_warn: Debounce::millis(500),
        debounce_critical: Debounce::millis(500),
        when: When::InFlight,
        // Never stale: what shakes has none.
        stale_s: None,
        of: InstanceOf::Vehicle,
        read: |inputs, _| inputs.derived.load_factor(),
        ..VIBRATION
    },
    Check {
        name: "vibration_trend",
        unit: Unit::of("%"),
        warn: Some(Param::TrdVibeWarn),
        critical: Some(Param::TrdVibeCrit),
        hysteresis: 5.0,
        debounce_warn: Debounce::secs(10),
        debounce_critical: Debounce::secs(10),
        when: When::InFlight,
        // A trend holds until the next figure.
        stale_s: None,
        of: InstanceOf::Vehicle,
        read: |inputs, _| departure(inputs, Quantity::Vibration),
        ..VIBRATION
    },
    Check { name: "airframe_due", ..due(Subsystem::Structure) },
    alert::<{ Cause::Vibration as usize }>(
        Subsystem::Structure,
        Role::of(Group::VibrationWord, Group::Vibration.bit() | INERTIAL | Group::ImuGnss.bit()),
    ),
];

fn per_axis(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.vibration;
    let vibration = slot.get().filter(|vibration| vibration.scale == VibrationScale::PerAxis)?;
    Reading::new(slot.at(), vibration.levels.into_iter().flatten().reduce(f32::max))
}
