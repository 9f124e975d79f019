//! The autopilot's processor.

use super::check::{Check, Reading, Side, When};
use super::{Inputs, STALE, Subsystem};
use crate::params::Param;
use crate::time::Span;

const LOAD: Check = Check {
    name: "load",
    words: "CPU load",
    subsystem: Subsystem::Computer,
    unit: "%",
    side: Side::Above,
    warn: Some(Param::CpuLoadWarn),
    critical: Some(Param::CpuLoadCrit),
    hysteresis: 2.0,
    debounce_warn: Span::from_secs(2),
    debounce_critical: Span::from_secs(2),
    when: When::Always,
    stale_after: STALE,
    instances: 1,
    read: load_percent,
};

pub(super) const CHECKS: &[Check] = &[
    LOAD,
    Check {
        name: "mcu_temperature",
        words: "MCU hot",
        unit: "degC",
        warn: Some(Param::McuTempWarn),
        critical: Some(Param::McuTempCrit),
        read: temperature_c,
        ..LOAD
    },
];

fn load_percent(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.system;
    Reading::new(slot.at(), slot.get()?.load.map(|load| load.0 * 100.0))
}

fn temperature_c(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.processor;
    Reading::new(slot.at(), slot.get()?.temperature.map(|temperature| temperature.0))
}
