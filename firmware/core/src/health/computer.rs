//! The autopilot's processor.

use super::check::{Check, Debounce, InstanceOf, Side, Unit, When};
use super::common::{STALE, alert};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{FAILSAFES, Group, Role};
use crate::cause::Cause;
use crate::latest::Reading;
use crate::motion::{climb_mps, ground_speed_mps};
use crate::observation::Heartbeat;
use crate::params::Param;
use crate::time::Span;

/// What was killed at its touch-down rests after so long, level and still for the second of these, and slower than this, m/s. In two
/// real landings the sensors were still 0.6 and 1.2 s after the kill.
const COMES_TO_REST: Span = Span::from_secs(2);
const RESTS: Span = Span::from_millis(300);
const SLOW_MPS: f32 = 1.0;

const LOAD: Check = Check {
    name: "load",
    subsystem: Subsystem::Computer,
    unit: Unit::of("%"),
    side: Side::Above,
    warn: Some(Param::CpuLoadWarn),
    critical: Some(Param::CpuLoadCrit),
    hysteresis: 2.0,
    debounce_warn: Debounce::secs(2),
    debounce_critical: Debounce::secs(2),
    when: When::Always,
    stale_s: STALE,
    instances: 1,
    alarm_only: false,
    is_flag: false,
    role: Role::NONE,
    of: InstanceOf::Vehicle,
    read: load_percent,
};

pub(super) const CHECKS: &[Check] = &[
    Check { of: InstanceOf::Vehicle, ..LOAD },
    Check {
        name: "mcu_temperature",
        unit: Unit::of("degC"),
        warn: Some(Param::McuTempWarn),
        critical: Some(Param::McuTempCrit),
        of: InstanceOf::Vehicle,
        read: temperature_c,
        ..LOAD
    },
    Check {
        name: "autopilot_reboot",
        role: Role::of(Group::Reboot, 0),
        is_flag: true,
        unit: Unit::of(""),
        warn: None,
        critical: Some(Param::RebootCrit),
        hysteresis: 0.0,
        debounce_critical: Debounce::NONE,
        stale_s: None,
        alarm_only: true,
        read: restarted,
        ..LOAD
    },
    Check {
        name: "autopilot_state",
        role: Role::of(Group::Other, FAILSAFES | Group::Failsafe.bit()),
        is_flag: true,
        unit: Unit::of(""),
        warn: None,
        critical: Some(Param::StateCrit),
        hysteresis: 0.0,
        debounce_critical: Debounce::millis(500),
        when: When::Armed,
        alarm_only: true,
        read: state,
        ..LOAD
    },
    alert::<{ Cause::Processor as usize }>(Subsystem::Computer, Role::NONE),
    alert::<{ Cause::Logging as usize }>(Subsystem::Computer, Role::NONE),
    alert::<{ Cause::Fence as usize }>(Subsystem::Computer, Role::NONE),
    alert::<{ Cause::Failsafe as usize }>(Subsystem::Computer, Role::of(Group::Failsafe, FAILSAFES)),
    alert::<{ Cause::Other as usize }>(Subsystem::Computer, Role::NONE),
];

fn load_percent(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.system;
    Reading::new(slot.at(), slot.get()?.load.map(|load| load.0 * 100.0))
}

/// `MAV_STATE`. PX4's kill switch makes a termination of it, and pilots press it when they have touched down. What was terminated in
/// the air falls, glides or hangs on a parachute after [`COMES_TO_REST`].
fn state(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    const ACTIVE: u8 = 4;
    let Inputs { now, vehicle, .. } = *inputs;
    let slow = |speed_mps: Option<f32>| speed_mps.is_none_or(|speed_mps| libm::fabsf(speed_mps) < SLOW_MPS);
    let rests = || {
        vehicle.inertial.is_level_for(now, RESTS)
            && slow(climb_mps(now, vehicle))
            && slow(ground_speed_mps(now, vehicle))
    };
    let ended = vehicle.terminated_since.is_some_and(|since| now.since(since) >= COMES_TO_REST) && !rests();
    let counts = |state| if state == Heartbeat::TERMINATED && !ended { ACTIVE } else { state };
    let slot = &vehicle.heartbeat;
    Reading::new(slot.at(), slot.get().map(|heartbeat| f32::from(counts(heartbeat.state))))
}

/// 1 for half a minute after a restart while it was armed.
fn restarted(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    inputs.vehicle.heartbeat.get()?;
    let recently = |at| inputs.now.since(at) <= Span::from_secs(30);
    let vehicle = inputs.vehicle;
    let value = f32::from(u8::from(vehicle.rebooted_armed && vehicle.rebooted_at.is_some_and(recently)));
    Some(Reading { at: inputs.now, value })
}

fn temperature_c(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.processor;
    Reading::new(slot.at(), slot.get()?.temperature.map(|temperature| temperature.0))
}
