//! Our own recording: a black box that stopped unnoticed is the failure that pilots report most.

use super::prelude::*;
use crate::status::Recording;

const STATE: Check = Check {
    name: "recording",
    subsystem: Subsystem::Recorder,
    limits: Limits::above(Some(Param::RecStopWarn), Some(Param::RecStopCrit), 0.0),
    debounce_ms: [1_000, 1_000],
    read: stopped_rank,
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Recording, 0), unit: Unit::FLAG, ..STATE },
    row!("record_queue" STATE, above(RecQueueWarn RecQueueCrit 10.0),
        role: Role::of(Group::Other, Group::Recording.bit()), unit: Unit::of("%"), debounce_ms: [0, 0],
        read: |inputs, _| inputs.reading(inputs.recorder.queue * 100.0)),
    row!("record_lost" STATE, above(RecLostWarn _ 0.0), role: Role::of(Group::Other, Group::Recording.bit()),
        unit: Unit::of("frames"), debounce_ms: [0, 1_000],
        read: |inputs, _| inputs.reading(inputs.derived.frames_lost.lately())),
    row!("card_stall" STATE, above(RecStallWarn RecStallCrit 0.0),
        role: Role::of(Group::Other, Group::Recording.bit()), unit: Unit::of("ms"), debounce_ms: [0, 0],
        read: |inputs, _| inputs.reading(inputs.recorder.stall.as_millis() as f32)),
    row!("card_errors" STATE, above(RecErrWarn _ 0.0), role: Role::of(Group::Other, Group::Recording.bit()),
        debounce_ms: [0, 1_000], read: |inputs, _| inputs.reading(inputs.derived.write_errors.lately())),
    row!("card_room" STATE, below(RecRoomWarn RecRoomCrit 1.0), unit: Unit::of("%"),
        read: |inputs, _| inputs.reading(inputs.recorder.room? * 100.0)),
    due!("card_due" Recorder),
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
