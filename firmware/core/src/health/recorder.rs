//! Our own recording: a black box that stopped unnoticed is the failure that pilots report most.

use super::check::{Check, Debounce, InstanceOf, Side, Unit, When};
use super::common::due;
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{Group, Role};
use crate::latest::Reading;
use crate::params::Param;
use crate::status::Recording;

const STATE: Check = Check {
    name: "recording",
    subsystem: Subsystem::Recorder,
    unit: Unit::of(""),
    side: Side::Above,
    warn: Some(Param::RecStopWarn),
    critical: Some(Param::RecStopCrit),
    hysteresis: 0.0,
    debounce_warn: Debounce::secs(1),
    debounce_critical: Debounce::secs(1),
    when: When::Always,
    stale_s: None,
    instances: 1,
    alarm_only: false,
    is_flag: false,
    role: Role::NONE,
    of: InstanceOf::Vehicle,
    read: stopped_rank,
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Recording, 0), is_flag: true, ..STATE },
    Check {
        name: "record_queue",
        role: Role::of(Group::Other, Group::Recording.bit()),
        unit: Unit::of("%"),
        warn: Some(Param::RecQueueWarn),
        critical: Some(Param::RecQueueCrit),
        hysteresis: 10.0,
        debounce_warn: Debounce::NONE,
        debounce_critical: Debounce::NONE,
        read: |inputs, _| Some(Reading { at: inputs.now, value: inputs.recorder.queue * 100.0 }),
        ..STATE
    },
    Check {
        name: "record_lost",
        role: Role::of(Group::Other, Group::Recording.bit()),
        unit: Unit::of("frames"),
        warn: Some(Param::RecLostWarn),
        critical: None,
        debounce_warn: Debounce::NONE,
        read: |inputs, _| Some(Reading { at: inputs.now, value: inputs.derived.frames_lost_lately() }),
        ..STATE
    },
    Check {
        name: "card_stall",
        role: Role::of(Group::Other, Group::Recording.bit()),
        unit: Unit::of("ms"),
        warn: Some(Param::RecStallWarn),
        critical: Some(Param::RecStallCrit),
        debounce_warn: Debounce::NONE,
        debounce_critical: Debounce::NONE,
        read: |inputs, _| Some(Reading { at: inputs.now, value: inputs.recorder.stall.as_millis() as f32 }),
        ..STATE
    },
    Check {
        name: "card_errors",
        role: Role::of(Group::Other, Group::Recording.bit()),
        warn: Some(Param::RecErrWarn),
        critical: None,
        debounce_warn: Debounce::NONE,
        read: |inputs, _| Some(Reading { at: inputs.now, value: inputs.derived.write_errors_lately() }),
        ..STATE
    },
    Check {
        name: "card_room",
        unit: Unit::of("%"),
        side: Side::Below,
        warn: Some(Param::RecRoomWarn),
        critical: Some(Param::RecRoomCrit),
        hysteresis: 1.0,
        read: |inputs, _| Some(Reading { at: inputs.now, value: inputs.recorder.room? * 100.0 }),
        ..STATE
    },
    Check { name: "card_due", ..due(Subsystem::Recorder) },
];

/// 0 recording, 1 not recording, 2 not recording while armed.
fn stopped_rank(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let value = match inputs.recorder.recording {
        Recording::Starting => return None,
        Recording::Running => 0.0,
        Recording::Stopped if inputs.vehicle.armed() => 2.0,
        Recording::Stopped => 1.0,
    };
    Some(Reading { at: inputs.now, value })
}
