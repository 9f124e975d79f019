//! Batteries and rails.

use super::check::{Check, Debounce, InstanceOf, Side, Unit, When};
use super::common::{STALE, STALE_SLOW, alert, departure, due};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{Group, Role};
use crate::baseline::Quantity;
use crate::cause::Cause;
use crate::latest::{Latest, Reading};
use crate::observation::Feeds;
use crate::params::Param;
use crate::vehicle::BATTERIES_MAX;

const BATTERIES: u8 = BATTERIES_MAX as u8;

const BATTERY: Check = Check {
    name: "batt_remaining",
    subsystem: Subsystem::Power,
    unit: Unit::of("%"),
    side: Side::Below,
    warn: Some(Param::BatRemWarn),
    critical: Some(Param::BatRemCrit),
    hysteresis: 1.0,
    debounce_warn: Debounce::secs(2),
    debounce_critical: Debounce::secs(2),
    when: When::Always,
    stale_s: STALE_SLOW,
    instances: BATTERIES,
    alarm_only: false,
    is_flag: false,
    role: Role::NONE,
    of: InstanceOf::Supply,
    read: remaining_percent,
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Battery, 0), ..BATTERY },
    Check {
        name: "cell_voltage",
        role: Role::of(Group::Battery, 0),
        unit: Unit::of("V"),
        warn: Some(Param::CellVoltWarn),
        critical: Some(Param::CellVoltCrit),
        hysteresis: 0.05,
        // ArduPilot's low voltage timer is 10 s: a sag under full throttle is not an empty battery.
        debounce_warn: Debounce::secs(10),
        debounce_critical: Debounce::secs(5),
        read: |inputs, battery| inputs.derived.cell_voltage(inputs.vehicle, inputs.params, battery),
        when: When::Armed,
        ..BATTERY
    },
    Check {
        name: "cell_deviation",
        role: Role::of(Group::FailsafeCause, 0),
        unit: Unit::of("V"),
        side: Side::Above,
        warn: Some(Param::CellDevWarn),
        critical: Some(Param::CellDevCrit),
        hysteresis: 0.01,
        debounce_warn: Debounce::secs(10),
        debounce_critical: Debounce::secs(10),
        of: InstanceOf::Battery,
        read: cell_deviation_v,
        when: When::Armed,
        ..BATTERY
    },
    Check {
        name: "cell_dev_lasting",
        side: Side::Above,
        unit: Unit::of("V"),
        warn: None,
        critical: Some(Param::CellDevWarn),
        hysteresis: 0.01,
        // AirData: above the warning's limit for a minute is as bad as far above it.
        debounce_critical: Debounce::secs(60),
        of: InstanceOf::Battery,
        read: cell_deviation_v,
        when: When::Armed,
        ..BATTERY
    },
    Check {
        name: "batt_resistance",
        side: Side::Above,
        warn: Some(Param::BatResWarn),
        critical: Some(Param::BatResCrit),
        hysteresis: 5.0,
        debounce_warn: Debounce::secs(10),
        debounce_critical: Debounce::secs(10),
        when: When::InFlight,
        // A trend holds until the next figure.
        stale_s: None,
        of: InstanceOf::Battery,
        read: resistance_rise_percent,
        ..BATTERY
    },
    Check {
        name: "batt_capacity",
        side: Side::Above,
        warn: Some(Param::TrdCapWarn),
        critical: Some(Param::TrdCapCrit),
        hysteresis: 5.0,
        debounce_warn: Debounce::secs(10),
        debounce_critical: Debounce::secs(10),
        when: When::InFlight,
        stale_s: None,
        of: InstanceOf::Vehicle,
        read: |inputs, battery| departure(inputs, Quantity::Capacity(battery)),
        ..BATTERY
    },
    Check {
        name: "batt_fault",
        role: Role::of(Group::FailsafeCause, 0),
        is_flag: true,
        unit: Unit::of(""),
        side: Side::Above,
        warn: Some(Param::BatFaultWarn),
        critical: None,
        hysteresis: 0.0,
        alarm_only: true,
        of: InstanceOf::Battery,
        read: faults,
        ..BATTERY
    },
    Check {
        name: "batt_temperature",
        unit: Unit::of("degC"),
        side: Side::Above,
        warn: Some(Param::BatTempWarn),
        critical: Some(Param::BatTempCrit),
        hysteresis: 3.0,
        of: InstanceOf::Battery,
        read: temperature_c,
        ..BATTERY
    },
    Check {
        name: "batt_state",
        role: Role::of(Group::BatteryState, Group::Battery.bit()),
        is_flag: true,
        unit: Unit::of(""),
        side: Side::Above,
        warn: Some(Param::BatStateWarn),
        critical: Some(Param::BatStateCrit),
        hysteresis: 0.0,
        of: InstanceOf::Battery,
        read: |inputs, battery| {
            let slot = inputs.vehicle.batteries.get(usize::from(battery))?;
            let value = match slot.get()?.charge {
                1 | 7 => 0.0,
                2 | 6 => 1.0,
                3..=5 => 2.0,
                _ => return None,
            };
            Reading::new(slot.at(), Some(value))
        },
        when: When::Armed,
        ..BATTERY
    },
    Check {
        name: "rail_5v_low",
        unit: Unit::of("V"),
        warn: Some(Param::RailLowWarn),
        critical: Some(Param::RailLowCrit),
        hysteresis: 0.05,
        debounce_warn: Debounce::secs(1),
        debounce_critical: Debounce::millis(500),
        when: When::Armed,
        stale_s: STALE,
        instances: 1,
        of: InstanceOf::Vehicle,
        read: rail_v,
        ..BATTERY
    },
    Check {
        name: "rail_5v_high",
        unit: Unit::of("V"),
        side: Side::Above,
        warn: Some(Param::RailHighWarn),
        critical: None,
        hysteresis: 0.05,
        debounce_warn: Debounce::secs(1),
        stale_s: STALE,
        instances: 1,
        of: InstanceOf::Vehicle,
        read: rail_v,
        ..BATTERY
    },
    Check { name: "battery_due", ..due(Subsystem::Power) },
    alert::<{ Cause::Power as usize }>(
        Subsystem::Power,
        Role::of(Group::FailsafeCause, Group::Battery.bit() | Group::BatteryState.bit()),
    ),
];

/// What the battery feeds that a check is of.
pub(super) fn feeds(check: &Check, inputs: &Inputs<'_>, instance: u8) -> Feeds {
    let of_battery = check.subsystem == Subsystem::Power && check.instances == BATTERIES;
    let slot = inputs.vehicle.batteries.get(usize::from(instance)).filter(|_| of_battery);
    slot.and_then(Latest::get).map_or(Feeds::Vehicle, |battery| battery.feeds)
}

/// A battery's own figure; the autopilot's only where no battery reports itself (it is ambiguous with several).
fn remaining_percent(inputs: &Inputs<'_>, battery: u8) -> Option<Reading> {
    let vehicle = inputs.vehicle;
    let slot = vehicle.batteries.get(usize::from(battery))?;
    if let Some(known) = slot.get() {
        return Reading::new(slot.at(), known.remaining.map(|remaining| remaining.0 * 100.0));
    }
    let none_reported = vehicle.batteries.iter().all(|slot| slot.get().is_none());
    let system = vehicle.system.get().filter(|_| battery == 0 && none_reported)?;
    Reading::new(vehicle.system.at(), system.remaining.map(|remaining| remaining.0 * 100.0))
}

fn cell_deviation_v(inputs: &Inputs<'_>, battery: u8) -> Option<Reading> {
    let slot = inputs.vehicle.batteries.get(usize::from(battery))?;
    let cells = slot.get()?.cells.iter().flatten().map(|cell| cell.volts().0);
    let lowest = cells.clone().fold(f32::INFINITY, f32::min);
    let highest = cells.fold(f32::NEG_INFINITY, f32::max);
    Reading::new(slot.at(), Some(highest - lowest))
}

fn resistance_rise_percent(inputs: &Inputs<'_>, battery: u8) -> Option<Reading> {
    let index = usize::from(battery);
    let slot = inputs.vehicle.batteries.get(index)?;
    Reading::new(slot.at(), inputs.derived.resistance(index)?.rise_percent())
}

fn faults(inputs: &Inputs<'_>, battery: u8) -> Option<Reading> {
    let slot = inputs.vehicle.batteries.get(usize::from(battery))?;
    Reading::new(slot.at(), Some(slot.get()?.faults.count_ones() as f32))
}

fn temperature_c(inputs: &Inputs<'_>, battery: u8) -> Option<Reading> {
    let slot = inputs.vehicle.batteries.get(usize::from(battery))?;
    Reading::new(slot.at(), slot.get()?.temperature.map(|temperature| temperature.0))
}

fn rail_v(inputs: &Inputs<'_>, _: u8) -> Option<Reading> {
    let rails = inputs.vehicle.rails;
    Reading::new(rails.at(), rails.get()?.vcc.map(|vcc| vcc.0))
}
