//! What each subsystem's table of checks is written with.

use core::num::NonZeroU8;

pub(super) use super::check::{Check, CheckPhase, InstanceKind, Limits, Unit, ValueReader};
pub(super) use super::finding::{Orders, Subsystem};
pub(super) use super::inputs::Inputs;
pub(super) use super::suppression::{
    COMPASS, DISTURBANCES, DRIVE, ESTIMATORS, FAILSAFES, GYROS, Group, INERTIAL, RATES, RECEIVERS, Role,
    SHAKING, TURNS, VIBRATION, WRONG_RECEIVERS,
};
use crate::alert::ENDED;
pub(super) use crate::cause::Cause;
pub(super) use crate::latest::{Latest, Reading};
use crate::observation::VibrationScale;
pub(super) use crate::parameters::Param;

/// Most streams come at 1 Hz or more even over a radio; some batteries at 0.5 Hz.
pub(super) const STALE: Option<NonZeroU8> = NonZeroU8::new(5);
/// For streams that come at 0.5 Hz.
pub(super) const STALE_SLOW: Option<NonZeroU8> = NonZeroU8::new(12);

pub(super) const PLAIN: Check = Check {
    name: "",
    subsystem: Subsystem::Power,
    unit: Unit::of(""),
    limits: Limits::above(None, None, 0.0),
    debounce_ms: [0, 0],
    told_after_s: 0,
    when: CheckPhase::Always,
    stale_s: None,
    instances: 1,
    alarm_only: false,
    role: Role::NONE,
    of: InstanceKind::Vehicle,
    read: |_, _| None,
};

/// A row of a table of checks: its name, the row that it is like, its limits, and the fields in which it differs. The limits:
/// of a warning, of a critical level (`_`: none), and the hysteresis.
macro_rules! row {
    (@limit _) => { None };
    (@limit $param:ident) => { Some($crate::parameters::Param::$param) };
    ($name:literal $like:expr, $side:ident($warning:tt $critical:tt $hysteresis:expr) $(, $field:ident: $value:expr)*) => {
        Check {
            name: $name,
            limits: $crate::health::Limits::$side(row!(@limit $warning), row!(@limit $critical), $hysteresis),
            $($field: $value,)*
            ..$like
        }
    };
    ($name:literal $like:expr $(, $field:ident: $value:expr)*) => { Check { name: $name, $($field: $value,)* ..$like } };
}
pub(super) use row;

/// A check of the autopilot's own alerts.
pub(super) const ALERT: Check = Check {
    limits: Limits::above(Some(Param::AlertWarn), Some(Param::AlertCrit), 0.0),
    // Silence tells nothing about health.
    alarm_only: true,
    unit: Unit::FLAG,
    ..PLAIN
};

/// The check of a cause that the autopilot reports.
macro_rules! alert {
    ($cause:ident $subsystem:ident, $role:expr) => {
        Check {
            name: Cause::$cause.name(),
            subsystem: Subsystem::$subsystem,
            role: $role,
            read: |inputs, _| said(inputs, Cause::$cause),
            ..ALERT
        }
    };
}
pub(super) use alert;

/// The autopilot's word. A crash of a vehicle that stands and never flew does not count.
pub(super) fn said(inputs: &Inputs<'_>, cause: Cause) -> Option<Reading> {
    let level = inputs.vehicle.alerts.level(inputs.now, cause, inputs.flight.in_mishap())?;
    let is_none = cause == Cause::Crash && inputs.flight.stayed(inputs.now, inputs.vehicle);
    inputs.reading(if is_none { ENDED } else { level })
}

pub(super) const DUE: Check = Check {
    unit: Unit::of("%"),
    limits: Limits::above(Some(Param::CompYellow), Some(Param::CompRed), 0.0),
    debounce_ms: [1_000, 1_000],
    // A part that is not due does not make its subsystem healthy.
    alarm_only: true,
    ..PLAIN
};

/// The check of the components of a subsystem.
macro_rules! due {
    ($name:literal $subsystem:ident) => {
        Check {
            name: $name,
            subsystem: Subsystem::$subsystem,
            read: |inputs, _| used(inputs, Subsystem::$subsystem),
            ..DUE
        }
    };
}
pub(super) use due;

pub(super) fn used(inputs: &Inputs<'_>, subsystem: Subsystem) -> Option<Reading> {
    let mine = inputs.wear.iter().flatten().filter(|(of, _)| *of == subsystem);
    // A part is replaced on the ground, and a flight counts when it is over: until then it is due soon.
    let most = if inputs.flight.is_open() { inputs.params.get(Param::CompRed) } else { f32::INFINITY };
    // A part at its limit is due, while a check's value must be beyond the limit.
    let percent = mine.map(|(_, percent)| percent.next_up()).reduce(f32::max);
    inputs.reading(percent?.min(most))
}

/// One of the three figures of VIBRATION on this scale. ArduPilot: one axis each. PX4: coning of the gyro,
/// high-frequency rate (rad/s), high-frequency acceleration (m/s2).
pub(super) fn vibration(
    inputs: &Inputs<'_>,
    scale: VibrationScale,
    value: fn([Option<f32>; 3]) -> Option<f32>,
) -> Option<Reading> {
    inputs.vehicle.vibration.read(|vibration| value(vibration.levels).filter(|_| vibration.scale == scale))
}
