//! The autopilot's processor.

use super::prelude::*;
use crate::observation::Heartbeat;
use crate::time::Millis;

/// A vehicle that was killed at its touchdown has been level and still for a second after this time. In two real landings the sensors were
/// still 0.6 and 1.2 s after the kill.
const COMES_TO_REST: Millis = Millis::from_secs(3);

const LOAD: Check = Check {
    name: "load",
    subsystem: Subsystem::Computer,
    unit: Unit::of("%"),
    limits: Limits::above(Some(Param::CpuLoadWarn), Some(Param::CpuLoadCrit), 2.0),
    debounce_ms: [2_000, 2_000],
    stale_s: STALE,
    read: |inputs, _| inputs.vehicle.system.read(|system| Some(system.load?.0 * 100.0)),
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    Check { told_after_s: Check::RECORDED, ..LOAD },
    row!("mcu_temperature" LOAD, above(McuTempWarn McuTempCrit 2.0), unit: Unit::of("degC"),
        read: |inputs, _| inputs.vehicle.processor.read(|processor| Some(processor.temperature?.0))),
    row!("autopilot_reboot" LOAD, above(_ RebootCrit 0.0), role: Role::of(Group::Reboot, 0), unit: Unit::FLAG,
        debounce_ms: [2_000, 0], stale_s: None, alarm_only: true, read: restarted),
    row!("autopilot_state" LOAD, above(_ StateCrit 0.0),
        role: Role::of(Group::Other, FAILSAFES | Group::Failsafe.bit()), unit: Unit::FLAG,
        debounce_ms: [2_000, 500], when: CheckPhase::Armed, alarm_only: true, read: state),
    alert!(Processor Computer, Role::NONE),
    Check { told_after_s: Check::RECORDED, ..alert!(Logging Computer, Role::NONE) },
    alert!(Fence Computer, Role::NONE),
    alert!(Failsafe Computer, Role::of(Group::Failsafe, FAILSAFES)),
    // The pilot has its text from the autopilot.
    Check { told_after_s: Check::RECORDED, ..alert!(Other Computer, Role::NONE) },
];

/// `MAV_STATE`, without a failsafe that stands since before the arming. PX4's kill switch is a termination, and pilots press it after a touchdown. A vehicle that was terminated in the air falls,
/// glides or hangs on a parachute after [`COMES_TO_REST`].
fn state(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    const ACTIVE: u8 = 4;
    let Inputs { now, vehicle, flight, .. } = *inputs;
    let ended = vehicle.terminated_since.is_some_and(|since| now.since(since) >= COMES_TO_REST);
    let killed_on_ground =
        |state| state == Heartbeat::TERMINATED && (!ended || flight.stands_off(now, vehicle));
    let stands = |state| state <= vehicle.state_since_arming || killed_on_ground(state);
    let counts = |state| if stands(state) { ACTIVE.min(state) } else { state };
    vehicle.heartbeat.read(|heartbeat| Some(f32::from(counts(heartbeat.state))))
}

fn restarted(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let Inputs { now, vehicle, .. } = *inputs;
    let recently = |at| now.since(at) <= Millis::from_secs(30);
    let is_new = vehicle.rebooted_armed && vehicle.rebooted_at.is_some_and(recently);
    vehicle.heartbeat.get().and_then(|_| inputs.reading(f32::from(u8::from(is_new))))
}
