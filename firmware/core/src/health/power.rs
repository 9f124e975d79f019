//! Batteries and rails.

use super::prelude::*;
use crate::observation::{Battery, Feeds};
use crate::vehicle::BATTERIES_MAX;

const BATTERIES: u8 = BATTERIES_MAX as u8;

const BATTERY: Check = Check {
    name: "batt_remaining",
    subsystem: Subsystem::Power,
    unit: Unit::of("%"),
    limits: Limits::below(Some(Param::BatRemWarn), Some(Param::BatRemCrit), 1.0),
    debounce_ms: [2_000, 2_000],
    stale_s: STALE_SLOW,
    instances: BATTERIES,
    of: InstanceKind::Battery,
    read: |inputs, battery| {
        let supply = inputs.vehicle.supply(battery.into())?;
        Some(Reading { at: supply.at, value: supply.remaining?.0 * 100.0 })
    },
    ..PLAIN
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Battery, 0), ..BATTERY },
    // ArduPilot's low voltage timer is 10 s: a sag under full throttle is not an empty battery.
    row!("cell_voltage" BATTERY, below(CellVoltWarn CellVoltCrit 0.05), role: Role::of(Group::Battery, 0),
        unit: Unit::of("V"), debounce_ms: [10_000, 5_000], when: CheckPhase::Armed,
        read: |inputs, battery| inputs.derived.cell_voltage(inputs.vehicle, inputs.params, battery)),
    row!("cell_deviation" BATTERY, above(CellDevWarn CellDevCrit 0.01),
        role: Role::of(Group::FailsafeCause, 0), unit: Unit::of("V"), debounce_ms: [10_000, 10_000],
        when: CheckPhase::Armed, read: |inputs, battery| of(inputs, battery, spread_v)),
    // AirData: above the warning's limit for a minute is as bad as far above it.
    row!("cell_dev_lasting" BATTERY, above(_ CellDevWarn 0.01), unit: Unit::of("V"),
        debounce_ms: [2_000, 60_000], when: CheckPhase::Armed,
        read: |inputs, battery| of(inputs, battery, spread_v)),
    // A trend holds until the next figure.
    row!("batt_resistance" BATTERY, above(BatResWarn BatResCrit 5.0), debounce_ms: [10_000, 10_000],
    when: CheckPhase::InFlight, stale_s: None, read: |inputs, battery| {
        let resistance = inputs.derived.resistance.get(usize::from(battery))?;
        of(inputs, battery, |_| resistance.rise_percent())
    }),
    row!("batt_fault" BATTERY, above(BatFaultWarn _ 0.0), role: Role::of(Group::FailsafeCause, 0),
        unit: Unit::FLAG, alarm_only: true,
        read: |inputs, battery| of(inputs, battery, |battery| Some(battery.faults.count_ones() as f32))),
    row!("batt_temperature" BATTERY, above(BatTempWarn BatTempCrit 3.0), unit: Unit::of("degC"),
        read: |inputs, battery| of(inputs, battery, |battery| Some(battery.temperature?.0))),
    row!("batt_state" BATTERY, above(BatStateWarn BatStateCrit 0.0),
    role: Role::of(Group::BatteryState, Group::Battery.bit()), unit: Unit::FLAG, when: CheckPhase::Armed,
    read: |inputs, battery| {
        // `MAV_BATTERY_CHARGE_STATE`: ok, charging; low, unhealthy; critical, emergency, failed.
        of(inputs, battery, |battery| match battery.charge {
            1 | 7 => Some(0.0),
            2 | 6 => Some(1.0),
            3..=5 => Some(2.0),
            _ => None,
        })
    }),
    row!("rail_5v_low" BATTERY, below(RailLowWarn RailLowCrit 0.05), unit: Unit::of("V"),
        debounce_ms: [1_000, 500], when: CheckPhase::Armed, stale_s: STALE, instances: 1, of: InstanceKind::Vehicle,
        read: |inputs, _| inputs.vehicle.rails.read(|rails| Some(rails.vcc?.0))),
    row!("rail_5v_high" BATTERY, above(RailHighWarn _ 0.05), unit: Unit::of("V"),
        debounce_ms: [1_000, 2_000], stale_s: STALE, instances: 1, of: InstanceKind::Vehicle,
        read: |inputs, _| inputs.vehicle.rails.read(|rails| Some(rails.vcc?.0))),
    due!("battery_due" Power),
    alert!(Power Power, Role::of(Group::FailsafeCause, Group::Battery.bit() | Group::BatteryState.bit())),
];

pub(super) fn feeds(check: &Check, inputs: &Inputs<'_>, instance: u8) -> Feeds {
    let of_battery = check.subsystem == Subsystem::Power && check.instances == BATTERIES;
    let slot = inputs.vehicle.batteries.get(usize::from(instance)).filter(|_| of_battery);
    slot.and_then(Latest::get).map_or(Feeds::Vehicle, |battery| battery.feeds)
}

fn of(inputs: &Inputs<'_>, battery: u8, value: impl FnOnce(&Battery) -> Option<f32>) -> Option<Reading> {
    inputs.vehicle.batteries.get(usize::from(battery))?.read(value)
}

fn spread_v(battery: &Battery) -> Option<f32> {
    let cells = battery.cells.iter().flatten().map(|cell| cell.volts().0);
    Some(cells.clone().reduce(f32::max)? - cells.reduce(f32::min)?)
}
