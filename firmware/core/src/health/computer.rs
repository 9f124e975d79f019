//! The autopilot's processor.

use super::check::{Check, Side, When};
use super::common::{STALE, alert};
use super::finding::Subsystem;
use super::inputs::Inputs;
use crate::cause::Cause;
use crate::latest::Reading;
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
    alarm_only: false,
    is_flag: false,
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
    Check {
        name: "autopilot_reboot",
        is_flag: true,
        words: "autopilot reboot",
        unit: "",
        warn: None,
        critical: Some(Param::RebootCrit),
        hysteresis: 0.0,
        debounce_critical: Span::ZERO,
        stale_after: None,
        alarm_only: true,
        read: restarted,
        ..LOAD
    },
    Check {
        name: "autopilot_state",
        is_flag: true,
        words: "autopilot failsafe",
        unit: "",
        warn: None,
        critical: Some(Param::StateCrit),
        hysteresis: 0.0,
        debounce_critical: Span::from_millis(500),
        when: When::Armed,
        alarm_only: true,
        read: |inputs, _| {
            let slot = &inputs.vehicle.heartbeat;
            Reading::new(slot.at(), slot.get().map(|heartbeat| f32::from(heartbeat.state)))
        },
        ..LOAD
    },
    alert::<{ Cause::Processor as usize }>("processor alert", Subsystem::Computer),
    alert::<{ Cause::Logging as usize }>("autopilot not logging", Subsystem::Computer),
    alert::<{ Cause::Fence as usize }>("geofence breached", Subsystem::Computer),
    alert::<{ Cause::Failsafe as usize }>("failsafe", Subsystem::Computer),
    alert::<{ Cause::Other as usize }>("autopilot alert", Subsystem::Computer),
];

fn load_percent(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let slot = &inputs.vehicle.system;
    Reading::new(slot.at(), slot.get()?.load.map(|load| load.0 * 100.0))
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
