//! The combustion engine (EFI) and the generator. Normal values depend on the engine, so the limits are off (at the end of
//! their range that no value passes) until they are set.

use super::prelude::*;

const GENERATOR_HYSTERESIS_RPM: f32 = 100.0;

const ENGINE: Check = Check {
    name: "cylinder_head",
    subsystem: Subsystem::Engine,
    unit: Unit::of("degC"),
    limits: Limits::above(Some(Param::EngChtWarn), Some(Param::EngChtCrit), 5.0),
    debounce_ms: [2_000, 1_000],
    stale_s: STALE,
    read: |inputs, _| inputs.vehicle.engine.read(|engine| Some(engine.cylinder_head?.0)),
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    ENGINE,
    row!("exhaust_gas" ENGINE, above(EngEgtWarn EngEgtCrit 5.0),
        read: |inputs, _| inputs.vehicle.engine.read(|engine| Some(engine.exhaust?.0))),
    row!("fuel_pressure" ENGINE, below(EngFuelWarn EngFuelCrit 5.0), unit: Unit::of("hPa"), when: CheckPhase::Armed,
        read: |inputs, _| inputs.vehicle.engine.read(|engine| Some(engine.fuel_pressure?.0))),
    row!("generator_speed" ENGINE, below(GenSpeedWarn GenSpeedCrit GENERATOR_HYSTERESIS_RPM),
        unit: Unit::of("rpm"), when: CheckPhase::Armed, read: generator_rpm),
    due!("engine_due" Engine),
];

/// The speed counts once the generator has reached its limits since it was switched on. Before that, and while it is off, the
/// value is a good one: a value that ends would become stale.
fn generator_rpm(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let top = inputs.vehicle.generator_top?;
    let limit = inputs.params.get(Param::GenSpeedWarn).max(inputs.params.get(Param::GenSpeedCrit));
    inputs.vehicle.generator.read(|generator| {
        let is_judged = !generator.is_off && top.0 >= limit;
        Some(if is_judged { generator.speed?.0 } else { limit + GENERATOR_HYSTERESIS_RPM })
    })
}
