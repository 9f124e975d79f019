//! Batteries and rails.

use super::check::{Check, Debounce, InstanceOf, Limits, Unit, When};
use super::common::{PLAIN, STALE, STALE_SLOW, alert, due};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{Group, Role};
use crate::cause::Cause;
use crate::latest::{Latest, Reading};
use crate::observation::{Battery, Feeds};
use crate::params::Param;
use crate::units::Fraction;
use crate::vehicle::BATTERIES_MAX;

const BATTERIES: u8 = BATTERIES_MAX as u8;

const BATTERY: Check = Check {
    name: "batt_remaining",
    subsystem: Subsystem::Power,
    unit: Unit::of("%"),
    limits: Limits::below(Some(Param::BatRemWarn), Some(Param::BatRemCrit), 1.0),
    debounce: [Debounce::secs(2); 2],
    stale_s: STALE_SLOW,
    instances: BATTERIES,
    of: InstanceOf::Supply,
    read: remaining_percent,
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Battery, 0), ..BATTERY },
    Check {
        name: "cell_voltage",
        role: Role::of(Group::Battery, 0),
        unit: Unit::of("V"),
        limits: Limits::below(Some(Param::CellVoltWarn), Some(Param::CellVoltCrit), 0.05),
        // ArduPilot's low voltage timer is 10 s: a sag under full throttle is not an empty battery.
        debounce: [Debounce::secs(10), Debounce::secs(5)],
        read: |inputs, battery| inputs.derived.cell_voltage(inputs.vehicle, inputs.params, battery),
        when: When::Armed,
        ..BATTERY
    },
    Check {
        name: "cell_deviation",
        role: Role::of(Group::FailsafeCause, 0),
        unit: Unit::of("V"),
        limits: Limits::above(Some(Param::CellDevWarn), Some(Param::CellDevCrit), 0.01),
        debounce: [Debounce::secs(10); 2],
        of: InstanceOf::Battery,
        read: |inputs, battery| of(inputs, battery, spread_v),
        when: When::Armed,
        ..BATTERY
    },
    Check {
        name: "cell_dev_lasting",
        limits: Limits::above(None, Some(Param::CellDevWarn), 0.01),
        unit: Unit::of("V"),
        // AirData: above the warning's limit for a minute is as bad as far above it.
        debounce: [Debounce::secs(2), Debounce::secs(60)],
        of: InstanceOf::Battery,
        read: |inputs, battery| of(inputs, battery, spread_v),
        when: When::Armed,
        ..BATTERY
    },
    Check {
        name: "batt_resistance",
        limits: Limits::above(Some(Param::BatResWarn), Some(Param::BatResCrit), 5.0),
        debounce: [Debounce::secs(10); 2],
        when: When::InFlight,
        // A trend holds until the next figure.
        stale_s: None,
        of: InstanceOf::Battery,
        read: |inputs, battery| {
            let resistance = inputs.derived.resistance(usize::from(battery))?;
            of(inputs, battery, |_| resistance.rise_percent())
        },
        ..BATTERY
    },
    Check {
        name: "batt_fault",
        role: Role::of(Group::FailsafeCause, 0),
        unit: Unit::FLAG,
        limits: Limits::above(Some(Param::BatFaultWarn), None, 0.0),
        alarm_only: true,
        of: InstanceOf::Battery,
        read: |inputs, battery| of(inputs, battery, |battery| Some(battery.faults.count_ones() as f32)),
        ..BATTERY
    },
    Check {
        name: "batt_temperature",
        unit: Unit::of("degC"),
        limits: Limits::above(Some(Param::BatTempWarn), Some(Param::BatTempCrit), 3.0),
        of: InstanceOf::Battery,
        read: |inputs, battery| of(inputs, battery, |battery| Some(battery.temperature?.0)),
        ..BATTERY
    },
    Check {
        name: "batt_state",
        role: Role::of(Group::BatteryState, Group::Battery.bit()),
        unit: Unit::FLAG,
        limits: Limits::above(Some(Param::BatStateWarn), Some(Param::BatStateCrit), 0.0),
        of: InstanceOf::Battery,
        read: |inputs, battery| {
            of(inputs, battery, |battery| match battery.charge {
                1 | 7 => Some(0.0),
                2 | 6 => Some(1.0),
                3..=5 => Some(2.0),
                _ => None,
            })
        },
        when: When::Armed,
        ..BATTERY
    },
    Check {
        name: "rail_5v_low",
        unit: Unit::of("V"),
        limits: Limits::below(Some(Param::RailLowWarn), Some(Param::RailLowCrit), 0.05),
        debounce: [Debounce::secs(1), Debounce::millis(500)],
        when: When::Armed,
        stale_s: STALE,
        instances: 1,
        of: InstanceOf::Vehicle,
        read: |inputs, _| inputs.vehicle.rails.read(|rails| Some(rails.vcc?.0)),
        ..BATTERY
    },
    Check {
        name: "rail_5v_high",
        unit: Unit::of("V"),
        limits: Limits::above(Some(Param::RailHighWarn), None, 0.05),
        debounce: [Debounce::secs(1), Debounce::secs(2)],
        stale_s: STALE,
        instances: 1,
        of: InstanceOf::Vehicle,
        read: |inputs, _| inputs.vehicle.rails.read(|rails| Some(rails.vcc?.0)),
        ..BATTERY
    },
    Check { name: "battery_due", ..due(Subsystem::Power) },
    alert::<{ Cause::Power as usize }>(
        Subsystem::Power,
        Role::of(Group::FailsafeCause, Group::Battery.bit() | Group::BatteryState.bit()),
    ),
];

/// The consumer of the battery that a check is of.
pub(super) fn feeds(check: &Check, inputs: &Inputs<'_>, instance: u8) -> Feeds {
    let of_battery = check.subsystem == Subsystem::Power && check.instances == BATTERIES;
    let slot = inputs.vehicle.batteries.get(usize::from(instance)).filter(|_| of_battery);
    slot.and_then(Latest::get).map_or(Feeds::Vehicle, |battery| battery.feeds)
}

/// A figure of a battery that reports itself.
fn of(inputs: &Inputs<'_>, battery: u8, value: impl FnOnce(&Battery) -> Option<f32>) -> Option<Reading> {
    inputs.vehicle.batteries.get(usize::from(battery))?.read(value)
}

/// The highest cell less the lowest one.
fn spread_v(battery: &Battery) -> Option<f32> {
    let cells = battery.cells.iter().flatten().map(|cell| cell.volts().0);
    Some(cells.clone().reduce(f32::max)? - cells.reduce(f32::min)?)
}

/// A battery's own figure; the autopilot's only where no battery reports itself (it is ambiguous with several).
fn remaining_percent(inputs: &Inputs<'_>, battery: u8) -> Option<Reading> {
    let vehicle = inputs.vehicle;
    let percent = |remaining: Option<Fraction>| Some(remaining?.0 * 100.0);
    if vehicle.batteries_known() > 0 || battery > 0 {
        return of(inputs, battery, |battery| percent(battery.remaining));
    }
    vehicle.system.read(|system| percent(system.remaining))
}
