//! Vibration, clipping and load factor.

use super::prelude::*;
use crate::observation::VibrationScale;

const VIBRATION: Check = Check {
    name: "vibration",
    subsystem: Subsystem::Structure,
    unit: Unit::of("m/s2"),
    limits: Limits::above(Some(Param::VibeWarn), Some(Param::VibeCrit), 3.0),
    debounce_ms: [1_000, 1_000],
    when: CheckPhase::Armed,
    stale_s: STALE,
    read: |inputs, _| {
        vibration(inputs, VibrationScale::PerAxis, |levels| levels.into_iter().flatten().reduce(f32::max))
    },
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Vibration, 0), ..VIBRATION },
    row!("vibration_px4" VIBRATION, above(VibePx4Warn VibePx4Crit 0.5), role: Role::of(Group::Vibration, 0),
        read: |inputs, _| vibration(inputs, VibrationScale::Px4Metrics, |[.., accelerometer]| accelerometer)),
    // A worn or broken part shakes all the time; gusts and the vehicle's own downwash end within ten seconds. It explains other alarms
    // meanwhile.
    // Never stale: only flight on rotors can be judged.
    row!("vibration_rise" VIBRATION, above(VibeRiseWarn _ 0.5),
        role: Role::of(Group::Shaking, DRIVE | Group::EscTelemetry.bit() | Group::Vibration.bit()),
        unit: Unit::of("times"), debounce_ms: [200, 1_000], told_after_s: 10, when: CheckPhase::InFlight, stale_s: None,
        read: |inputs, _| inputs.derived.crosschecks.vibration_rise(inputs.now, inputs.vehicle)),
    row!("clipping" VIBRATION, above(ClipWarn ClipCrit 0.0),
        role: Role::of(Group::Shaking, Group::Vibration.bit()), unit: Unit::of(""), debounce_ms: [0, 0],
        when: CheckPhase::InFlight, read: |inputs, _| inputs.derived.clips(inputs.vehicle)),
    // A manoeuvre lasts; a shock or vibration does not, and an impact is a mishap.
    // Never stale: a shaking vehicle has no load factor.
    row!("load_factor" VIBRATION, above(LoadFacWarn LoadFacCrit 0.2), role: Role::of(Group::Other, SHAKING),
        unit: Unit::of("g"), debounce_ms: [500, 500], when: CheckPhase::InFlight, stale_s: None,
        read: |inputs, _| inputs.derived.load_factor()),
    due!("airframe_due" Structure),
    alert!(Vibration Structure, Role::of(Group::VibrationWord, Group::Vibration.bit() | INERTIAL | Group::ImuGnss.bit())),
];
