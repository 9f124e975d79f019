//! The combustion engine (EFI). What is normal depends on the engine, so the limits are off (at their maximum) until
//! they are set.

use super::check::{Check, Debounce, InstanceOf, Side, Unit, When};
use super::common::{STALE, due};
use super::finding::Subsystem;
use super::inputs::Inputs;
use crate::latest::Reading;
use crate::observation::Engine;
use crate::params::Param;

const ENGINE: Check = Check {
    name: "cylinder_head",
    subsystem: Subsystem::Engine,
    unit: Unit::of("degC"),
    side: Side::Above,
    warn: Some(Param::EngChtWarn),
    critical: Some(Param::EngChtCrit),
    hysteresis: 5.0,
    debounce_warn: Debounce::secs(2),
    debounce_critical: Debounce::secs(1),
    when: When::Always,
    stale_s: STALE,
    instances: 1,
    alarm_only: false,
    is_flag: false,
    of: InstanceOf::Vehicle,
    read: |inputs, _| read(inputs, |engine| engine.cylinder_head.map(|temperature| temperature.0)),
};

pub(super) const CHECKS: &[Check] = &[
    ENGINE,
    Check {
        name: "exhaust_gas",
        warn: Some(Param::EngEgtWarn),
        critical: Some(Param::EngEgtCrit),
        read: |inputs, _| read(inputs, |engine| engine.exhaust.map(|temperature| temperature.0)),
        ..ENGINE
    },
    Check {
        name: "fuel_pressure",
        unit: Unit::of("hPa"),
        side: Side::Below,
        warn: Some(Param::EngFuelWarn),
        critical: Some(Param::EngFuelCrit),
        when: When::Armed,
        read: |inputs, _| read(inputs, |engine| engine.fuel_pressure.map(|pressure| pressure.0)),
        ..ENGINE
    },
    Check { name: "engine_due", ..due(Subsystem::Engine) },
];

fn read(inputs: &Inputs<'_>, value: impl FnOnce(&Engine) -> Option<f32>) -> Option<Reading> {
    let engine = &inputs.vehicle.engine;
    Reading::new(engine.at(), value(engine.get()?))
}
