//! Batteries and rails.

use hums_core::observation::{Battery, CELLS_MAX, CellVoltage, Feeds, Rails};
use hums_core::units::{AmpereHours, Celsius, Volts};
use hums_dialect::ardupilotmega as ap;

use super::fields::{current, percent, read, voltage};
use crate::packet::Fields;

/// Highest charge voltage of a lithium cell, mV. A higher value is the sum of several cells.
const CELL_MAX_MV: u16 = 5_000;
/// `MAV_BATTERY_TYPE_LIFE`.
const LITHIUM_IRON: u8 = 2;
/// `MAV_BATTERY_TYPE_NIMH`.
const NICKEL: u8 = 4;

pub(super) fn rails(payload: &[u8]) -> Option<Rails> {
    let rails = read::<ap::POWER_STATUS_DATA>(payload, &[])?;
    Some(Rails { vcc: voltage(rails.Vcc), servo: voltage(rails.Vservo) })
}

pub(super) fn battery(payload: &[u8]) -> Option<Battery> {
    // Function, type, charge state and mode; the rest of the message does not depend on them.
    let battery = read::<ap::BATTERY_STATUS_DATA>(payload, &[33, 34, 40, 49])?;
    let (voltage, cells) = cells(&battery.voltages, battery.voltages_ext);
    let is_measured = voltage.is_some() || battery.current_battery >= 0;
    Some(Battery {
        id: battery.id,
        voltage,
        cells,
        current: current(battery.current_battery),
        // -1 is unknown; PX4 scales its own -1 and then sends other negative numbers.
        consumed: (battery.current_consumed >= 0).then(|| AmpereHours(battery.current_consumed as f32 / 1e3)),
        // ArduPilot sends 0 % for a battery without a monitor.
        remaining: percent(battery.battery_remaining).filter(|part| part.0 > 0.0 || is_measured),
        temperature: (battery.temperature != i16::MAX)
            .then(|| Celsius(f32::from(battery.temperature) / 100.0)),
        faults: battery.fault_bitmask.bits(),
        lithium: battery.mavtype as u8 != LITHIUM_IRON && battery.mavtype as u8 != NICKEL,
        // MAV_BATTERY_FUNCTION
        feeds: match Fields(payload).u8(33) {
            1 | 2 => Feeds::Vehicle,
            3 => Feeds::Avionics,
            4 => Feeds::Payload,
            _ => Feeds::Unsaid,
        },
        charge: Fields(payload).u8(40),
    })
}

/// The sum, and the cells if each is known. A sender that knows only the sum puts it into the first place, and the
/// part beyond its range into the next. An unused place is 65535, in the extension 0.
fn cells(base: &[u16; 10], extension: [u16; 4]) -> (Option<Volts>, [Option<CellVoltage>; CELLS_MAX]) {
    let mut cells = [None; CELLS_MAX];
    let (mut sum_mv, mut singly) = (0_u32, true);
    let used = base
        .iter()
        .filter(|&&mv| mv != u16::MAX)
        .chain(extension.iter().filter(|&&mv| mv != 0 && mv != u16::MAX));
    for (cell, &mv) in cells.iter_mut().zip(used) {
        *cell = CellVoltage::from_millivolts(mv);
        sum_mv += u32::from(mv);
        singly &= mv <= CELL_MAX_MV;
    }
    let voltage = (sum_mv > 0).then(|| Volts(sum_mv as f32 / 1e3));
    if voltage.is_some() && singly { (voltage, cells) } else { (voltage, [None; CELLS_MAX]) }
}
