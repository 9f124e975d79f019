//! The combustion engine (EFI) and the generator. Normal values depend on the engine, so the limits are off (at the end of
//! their range that no value passes) until they are set.

use super::check::{Check, Debounce, InstanceOf, Side, Unit, When};
use super::common::{STALE, due};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::Role;
use crate::latest::Reading;
use crate::observation::Engine;
use crate::params::Param;

/// Above the ripple of a governor that holds the speed.
const GENERATOR_HYSTERESIS_RPM: f32 = 100.0;

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
    role: Role::NONE,
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
    Check {
        name: "generator_speed",
        unit: Unit::of("rpm"),
        side: Side::Below,
        warn: Some(Param::GenSpeedWarn),
        critical: Some(Param::GenSpeedCrit),
        hysteresis: GENERATOR_HYSTERESIS_RPM,
        when: When::Armed,
        read: generator_rpm,
        ..ENGINE
    },
    Check { name: "engine_due", ..due(Subsystem::Engine) },
];

fn read(inputs: &Inputs<'_>, value: impl FnOnce(&Engine) -> Option<f32>) -> Option<Reading> {
    let engine = &inputs.vehicle.engine;
    Reading::new(engine.at(), value(engine.get()?))
}

/// The speed counts once the generator has reached its limits since it was switched on. Before that, and while it is off, the
/// value is a good one: a value that ends would become stale.
fn generator_rpm(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.generator;
    let (generator, top) = (slot.get()?, inputs.vehicle.generator_top?);
    let limit = inputs.params.get(Param::GenSpeedWarn).max(inputs.params.get(Param::GenSpeedCrit));
    let is_judged = !generator.is_off && top.0 >= limit;
    let value = if is_judged { generator.speed?.0 } else { limit + GENERATOR_HYSTERESIS_RPM };
    Reading::new(slot.at(), Some(value))
}
