//! Motors, ESCs and propellers.

use super::prelude::*;
use crate::observation::{Esc, MOTORS_MAX};
use crate::outputs::{JUDGED_MAX, Verdict};
use crate::residual::Comparison;

const ESC: Check = Check {
    name: "esc_silent",
    subsystem: Subsystem::Propulsion,
    unit: Unit::of("s"),
    limits: Limits::above(Some(Param::EscAgeWarn), Some(Param::EscAgeCrit), 0.0),
    when: CheckPhase::Armed,
    instances: MOTORS_MAX as u8,
    of: InstanceKind::Motor,
    read: |inputs, motor| inputs.derived.motors.silence(inputs.now, motor),
    ..PLAIN
};

const RATE: Check = Check {
    unit: Unit::of("deg/s"),
    limits: Limits::above(Some(Param::RateWarn), Some(Param::RateCrit), 5.0),
    debounce_ms: [200, 200],
    when: CheckPhase::InFlight,
    instances: 1,
    of: InstanceKind::Vehicle,
    ..ESC
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::EscTelemetry, Group::Reboot.bit()), ..ESC },
    row!("esc_temperature" ESC, above(EscTempWarn EscTempCrit 3.0), unit: Unit::of("degC"),
        debounce_ms: [1_000, 500], when: CheckPhase::Always, stale_s: STALE_SLOW,
        read: |inputs, motor| state(inputs, motor, |esc| Some(esc.temperature?.0))),
    row!("esc_failure" ESC, above(EscFailWarn EscFailCrit 0.0), role: Role::of(Group::Drive, 0),
        unit: Unit::FLAG, when: CheckPhase::Always, stale_s: STALE_SLOW, alarm_only: true,
        read: |inputs, motor| state(inputs, motor, |esc| esc.failures.map(failure_rank))),
    row!("esc_errors" ESC, above(EscErrWarn _ 2.0), unit: Unit::of("1/min"), debounce_ms: [1_000, 0],
        stale_s: STALE_SLOW,
        read: |inputs, motor| state(inputs, motor, |_| inputs.derived.motors.errors(motor))),
    row!("motor_loss" ESC, below(_ MotLossCrit 5.0), role: Role::of(Group::MotorLoss, 0), unit: Unit::of("%"),
    debounce_ms: [0, 500], when: CheckPhase::InFlight,
        read: |inputs, motor| inputs.derived.motors.share(inputs.now, inputs.vehicle, motor)),
    // Never stale: only steady flight says something, and ESCs that stop talking are `esc_silent`.
    row!("motor_imbalance" ESC, above(MotImbalWarn MotImbalCrit 2.0),
    role: Role::of(Group::MotorOutput, Group::MotorLoss.bit()), unit: Unit::of("%"),
    debounce_ms: [3_000, 1_000], when: CheckPhase::InFlight,
    read: |inputs, motor| inputs.derived.motors.imbalance(inputs, motor)),
    row!("motor_output" ESC, above(MotOutWarn MotOutCrit 5.0),
        role: Role::of(Group::MotorOutput, Group::MotorLoss.bit()), unit: Unit::of("%"),
        debounce_ms: [500, 1_000], when: CheckPhase::InFlight, instances: JUDGED_MAX as u8,
        read: |inputs, motor| verdict(inputs, motor, Verdict::excess_percent)),
    // A driven motor is not thereby good.
    row!("motor_off" ESC, above(AlertWarn AlertCrit 0.0),
        role: Role::of(Group::MotorOutput, Group::MotorLoss.bit()), unit: Unit::FLAG, alarm_only: true,
        debounce_ms: [500, 1_000], when: CheckPhase::InFlight, instances: JUDGED_MAX as u8,
        read: |inputs, motor| verdict(inputs, motor, |verdict| if verdict == Verdict::ShutOff { 2.0 } else { 0.0 })
            .filter(|_| inputs.derived.motors.outputs.judged(inputs.vehicle) != 4)),
    row!("thrust_lost" ESC, above(ThrustWarn _ 0.0),
        role: Role::of(Group::Other, DRIVE | Group::EscTelemetry.bit() | RATES | Group::EkfClimb.bit()),
        when: CheckPhase::InFlight, instances: 1, of: InstanceKind::Vehicle,
        read: |inputs, _| inputs.derived.crosschecks.thrust.in_vain()),
    row!("roll_rate" RATE, role: Role::of(Group::RollRate, DRIVE | GYROS),
        read: |inputs, _| rate_off_deg_s(inputs, 0)),
    row!("pitch_rate" RATE, role: Role::of(Group::PitchRate, DRIVE | GYROS),
        read: |inputs, _| rate_off_deg_s(inputs, 1)),
    due!("drive_due" Propulsion),
    alert!(Propulsion Propulsion, Role::of(Group::Drive, Group::MotorLoss.bit() | Group::MotorOutput.bit())),
];

fn verdict(inputs: &Inputs<'_>, motor: u8, value: fn(Verdict) -> f32) -> Option<Reading> {
    let (at, verdict) = inputs.derived.motors.outputs.verdict(inputs.now, inputs.vehicle, motor)?;
    Some(Reading { at, value: value(verdict) })
}

fn rate_off_deg_s(inputs: &Inputs<'_>, axis: usize) -> Option<Reading> {
    let reading = inputs.derived.crosschecks.residuals.reading(inputs.now, Comparison::RATES[axis])?;
    Some(Reading { value: reading.value.to_degrees(), ..reading })
}

fn state(inputs: &Inputs<'_>, motor: u8, value: impl FnOnce(&Esc) -> Option<f32>) -> Option<Reading> {
    let motor = inputs.vehicle.motors.get(usize::from(motor))?;
    Reading::new(motor.state_at, value(&motor.esc))
}

/// `ESC_FAILURE_FLAGS`: over current 1, over voltage 2, over temperature 4, over rpm 8, inconsistent command 16, motor
/// stuck 32, generic 64. A motor that is stuck or an ESC that failed cannot be flown on.
fn failure_rank(flags: u16) -> f32 {
    const STUCK_OR_FAILED: u16 = 0x60;
    match flags {
        0 => 0.0,
        flags if flags & STUCK_OR_FAILED != 0 => 2.0,
        _ => 1.0,
    }
}
