//! Our own recording: a black box that stopped unnoticed is the failure that pilots report most.

use super::check::{Check, Debounce, Limits, Unit};
use super::common::{PLAIN, due};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{Group, Role};
use crate::latest::Reading;
use crate::params::Param;
use crate::status::Recording;

const STATE: Check = Check {
    name: "recording",
    subsystem: Subsystem::Recorder,
    limits: Limits::above(Some(Param::RecStopWarn), Some(Param::RecStopCrit), 0.0),
    debounce: [Debounce::secs(1); 2],
    read: stopped_rank,
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Recording, 0), unit: Unit::FLAG, ..STATE },
    Check {
        name: "record_queue",
        role: Role::of(Group::Other, Group::Recording.bit()),
        unit: Unit::of("%"),
        limits: Limits::above(Some(Param::RecQueueWarn), Some(Param::RecQueueCrit), 10.0),
        debounce: [Debounce::NONE; 2],
        read: |inputs, _| inputs.reading(inputs.recorder.queue * 100.0),
        ..STATE
    },
    Check {
        name: "record_lost",
        role: Role::of(Group::Other, Group::Recording.bit()),
        unit: Unit::of("frames"),
        limits: Limits::above(Some(Param::RecLostWarn), None, 0.0),
        debounce: [Debounce::NONE, Debounce::secs(1)],
        read: |inputs, _| inputs.reading(inputs.derived.frames_lost_lately()),
        ..STATE
    },
    Check {
        name: "card_stall",
        role: Role::of(Group::Other, Group::Recording.bit()),
        unit: Unit::of("ms"),
        limits: Limits::above(Some(Param::RecStallWarn), Some(Param::RecStallCrit), 0.0),
        debounce: [Debounce::NONE; 2],
        read: |inputs, _| inputs.reading(inputs.recorder.stall.as_millis() as f32),
        ..STATE
    },
    Check {
        name: "card_errors",
        role: Role::of(Group::Other, Group::Recording.bit()),
        limits: Limits::above(Some(Param::RecErrWarn), None, 0.0),
        debounce: [Debounce::NONE, Debounce::secs(1)],
        read: |inputs, _| inputs.reading(inputs.derived.write_errors_lately()),
        ..STATE
    },
    Check {
        name: "card_room",
        unit: Unit::of("%"),
        limits: Limits::below(Some(Param::RecRoomWarn), Some(Param::RecRoomCrit), 1.0),
        read: |inputs, _| inputs.reading(inputs.recorder.room? * 100.0),
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
    inputs.reading(value)
}
