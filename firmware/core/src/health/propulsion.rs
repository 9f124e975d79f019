//! Motors, ESCs and propellers.

use super::check::{Check, Debounce, InstanceOf, Limits, Unit, When};
use super::common::{PLAIN, STALE_SLOW, alert, due};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{DRIVE, GYROS, Group, RATES, Role};
use crate::cause::Cause;
use crate::latest::Reading;
use crate::observation::{Esc, MOTORS_MAX};
use crate::outputs::{JUDGED_MAX, Verdict};
use crate::params::Param;
use crate::residual::Comparison;

const ESC: Check = Check {
    name: "esc_silent",
    subsystem: Subsystem::Propulsion,
    unit: Unit::of("s"),
    limits: Limits::above(Some(Param::EscAgeWarn), Some(Param::EscAgeCrit), 0.0),
    when: When::Armed,
    instances: MOTORS_MAX as u8,
    of: InstanceOf::Motor,
    read: |inputs, motor| inputs.derived.esc_silence(inputs.now, motor),
    ..PLAIN
};

/// A body rate that does not follow its setpoint.
const RATE: Check = Check {
    unit: Unit::of("deg/s"),
    limits: Limits::above(Some(Param::RateWarn), Some(Param::RateCrit), 5.0),
    debounce: [Debounce::millis(200); 2],
    when: When::InFlight,
    instances: 1,
    of: InstanceOf::Vehicle,
    ..ESC
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::EscTelemetry, Group::Reboot.bit()), ..ESC },
    Check {
        name: "esc_temperature",
        unit: Unit::of("degC"),
        limits: Limits::above(Some(Param::EscTempWarn), Some(Param::EscTempCrit), 3.0),
        debounce: [Debounce::secs(1), Debounce::millis(500)],
        when: When::Always,
        stale_s: STALE_SLOW,
        read: |inputs, motor| state(inputs, motor, |esc| Some(esc.temperature?.0)),
        ..ESC
    },
    Check {
        name: "esc_failure",
        role: Role::of(Group::Drive, 0),
        unit: Unit::FLAG,
        limits: Limits::above(Some(Param::EscFailWarn), Some(Param::EscFailCrit), 0.0),
        stale_s: STALE_SLOW,
        when: When::Always,
        alarm_only: true,
        read: |inputs, motor| state(inputs, motor, |esc| esc.failures.map(failure_rank)),
        ..ESC
    },
    Check {
        name: "esc_errors",
        unit: Unit::of("1/min"),
        limits: Limits::above(Some(Param::EscErrWarn), None, 2.0),
        debounce: [Debounce::secs(1), Debounce::NONE],
        stale_s: STALE_SLOW,
        read: |inputs, motor| state(inputs, motor, |_| inputs.derived.motors.errors(motor)),
        ..ESC
    },
    Check {
        name: "motor_loss",
        role: Role::of(Group::MotorLoss, 0),
        unit: Unit::of("%"),
        limits: Limits::below(None, Some(Param::MotLossCrit), 5.0),
        debounce: [Debounce::NONE, Debounce::millis(500)],
        when: When::InFlight,
        read: |Inputs { now, vehicle, derived, .. }, motor| {
            derived.motors.share(*now, vehicle, &derived.outputs, motor)
        },
        ..ESC
    },
    Check {
        name: "motor_imbalance",
        role: Role::of(Group::MotorOutput, Group::MotorLoss.bit()),
        unit: Unit::of("%"),
        limits: Limits::above(Some(Param::MotImbalWarn), Some(Param::MotImbalCrit), 2.0),
        debounce: [Debounce::secs(3), Debounce::secs(1)],
        when: When::InFlight,
        // Never stale: only steady flight says something, and ESCs that stop talking are `esc_silent`.
        read: |Inputs { now, vehicle, flight, derived, .. }, motor| {
            derived.motors.imbalance(*now, vehicle, flight, &derived.outputs, motor)
        },
        ..ESC
    },
    Check {
        name: "motor_output",
        role: Role::of(Group::MotorOutput, Group::MotorLoss.bit()),
        unit: Unit::of("%"),
        limits: Limits::above(Some(Param::MotOutWarn), Some(Param::MotOutCrit), 5.0),
        debounce: [Debounce::millis(500), Debounce::secs(1)],
        when: When::InFlight,
        instances: JUDGED_MAX as u8,
        of: InstanceOf::Output,
        read: |inputs, motor| verdict(inputs, motor, Verdict::excess_percent),
        ..ESC
    },
    Check {
        name: "motor_off",
        role: Role::of(Group::MotorOutput, Group::MotorLoss.bit()),
        unit: Unit::FLAG,
        limits: Limits::above(Some(Param::AlertWarn), Some(Param::AlertCrit), 0.0),
        debounce: [Debounce::millis(500), Debounce::secs(1)],
        when: When::InFlight,
        instances: JUDGED_MAX as u8,
        of: InstanceOf::Output,
        // A driven motor is not thereby good.
        alarm_only: true,
        read: |inputs, motor| verdict(inputs, motor, Verdict::off_rank),
        ..ESC
    },
    Check {
        name: "thrust_lost",
        role: Role::of(Group::Other, DRIVE | Group::EscTelemetry.bit() | RATES | Group::EkfClimb.bit()),
        limits: Limits::above(Some(Param::ThrustWarn), None, 0.0),
        when: When::InFlight,
        instances: 1,
        of: InstanceOf::Vehicle,
        read: |inputs, _| inputs.derived.crosschecks.thrust.in_vain(),
        ..ESC
    },
    Check {
        name: "roll_rate",
        role: Role::of(Group::RollRate, DRIVE | GYROS),
        read: |inputs, _| rate_off_deg_s(inputs, 0),
        ..RATE
    },
    Check {
        name: "pitch_rate",
        role: Role::of(Group::PitchRate, DRIVE | GYROS),
        read: |inputs, _| rate_off_deg_s(inputs, 1),
        ..RATE
    },
    Check { name: "drive_due", ..due(Subsystem::Propulsion) },
    alert::<{ Cause::Propulsion as usize }>(
        Subsystem::Propulsion,
        Role::of(Group::Drive, Group::MotorLoss.bit() | Group::MotorOutput.bit()),
    ),
];

/// The verdict of the outputs on a motor, as a check's value.
fn verdict(inputs: &Inputs<'_>, motor: u8, value: fn(Verdict) -> f32) -> Option<Reading> {
    let (at, verdict) = inputs.derived.outputs.verdict(inputs.now, inputs.vehicle, motor)?;
    Some(Reading { at, value: value(verdict) })
}

/// The difference between rate setpoint and rate, about roll (0) or pitch (1).
fn rate_off_deg_s(inputs: &Inputs<'_>, axis: usize) -> Option<Reading> {
    let reading = inputs.derived.crosschecks.residuals.reading(inputs.now, Comparison::RATES[axis])?;
    Some(Reading { value: reading.value.to_degrees(), ..reading })
}

/// A figure of a motor's last `ESC_INFO`.
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
