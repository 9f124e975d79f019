//! Batteries, rails, the processor's load, motors.

use hums_core::observation::{
    Battery, CELLS_MAX, CellVoltage, ESC_GROUP, Esc, EscGroup, MOTORS_MAX, Observation, Rails, SystemStatus,
};
use hums_core::units::{AmpereHours, Amperes, Celsius, Fraction, Rpm, Volts};

use super::state::{BATTERIES_MAX, MEDIUM_US, Pack, Px4, Sample, Topic, topic};

macro_rules! esc_fields {
    ($($n:literal),*) => {
        concat!("esc_count", $(" esc[", $n, "].esc_rpm esc[", $n, "].esc_voltage esc[", $n, "].esc_current esc[", $n,
            "].esc_temperature esc[", $n, "].esc_errorcount esc[", $n, "].failures",)*)
    };
}

const ESC_FIELDS: usize = 6;

const BATTERY_STATUS: &str = "connected voltage_v voltage_filtered_v current_a current_filtered_a remaining discharged_mah \
    temperature faults cell_count voltage_cell_v id warning";

const ESC_STATUS: &str = esc_fields!(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11);

pub(super) const TOPICS: &[Topic] = &[
    topic("battery_status", BATTERIES_MAX as u8, MEDIUM_US, BATTERY_STATUS, battery),
    topic("cpuload", 1, 0, "load", load),
    topic("system_power", 1, MEDIUM_US, "voltage5v_v voltage5V_v", rails),
    topic("esc_status", 1, MEDIUM_US, ESC_STATUS, escs),
];

fn battery(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    // Before this field: a plausible voltage.
    let connected = fields.get(0).map_or(fields.finite(1) > Some(0.1), |flag| flag != 0.0);
    let when = |value: Option<f32>| value.filter(|_| connected);
    // MAVLink's are filtered (until v1.16). -1 is unknown.
    let current =
        when(fields.finite(4).or_else(|| fields.finite(3))).filter(|amperes| (*amperes + 1.0).abs() > 1e-6);
    let remaining = when(fields.finite(5)).filter(|part| (0.0..=1.0).contains(part));
    let whole = when(fields.finite(1).or_else(|| fields.finite(2))).filter(|volts| *volts > 0.0);
    let cells = cells(sample).filter(|_| connected);
    let voltage = cells.map_or(whole, |cells| Some(cells.iter().flatten().map(|cell| cell.0).sum()));
    let battery = Battery {
        // Counts from 1; without a number, or with 0, instances count.
        id: fields.byte(11).and_then(|id| id.checked_sub(1)).unwrap_or(sample.instance),
        cells: cells
            .unwrap_or([None; CELLS_MAX])
            .map(|cell| cell.and_then(|volts| CellVoltage::from_millivolts((volts.0 * 1e3).round() as u16))),
        voltage: voltage.map(Volts),
        current: current.map(Amperes),
        consumed: when(fields.finite(6)).filter(|mah| *mah >= 0.0).map(|mah| AmpereHours(mah / 1e3)),
        remaining: remaining.map(|part| Fraction((part * 100.0).round() / 100.0)),
        temperature: when(fields.finite(7)).map(Celsius),
        faults: fields.count(8).unwrap_or(0) as u32,
        charge: if connected { charge(fields.byte(12)) } else { 0 },
        // As PX4 calls every battery.
        ..Battery::default()
    };
    let voltage = when(fields.finite(2).or_else(|| fields.finite(1))).filter(|volts| *volts > 0.0).map(Volts);
    if let Some(pack) = px4.power.batteries.get_mut(usize::from(sample.instance)) {
        let (current, remaining) =
            (battery.current, remaining.map(|part| Fraction((part * 100.0).ceil() / 100.0)));
        *pack = connected.then_some(Pack { voltage, current, remaining });
    }
    px4.observe(Observation::Battery(battery));
    if !px4.power.has_load {
        system_status(px4);
    }
}

/// `MAV_BATTERY_CHARGE_STATE` of `battery_status.warning`, as in PX4's `BATTERY_STATUS`: none, low, critical,
/// emergency, failed. 6 and 7 (since v1.13) are unhealthy and charging in both.
const fn charge(warning: Option<u8>) -> u8 {
    const UNDEFINED: u8 = 0;
    match warning {
        Some(warning @ 0..=4) => warning + 1,
        Some(state @ 6..=7) => state,
        _ => UNDEFINED,
    }
}

fn cells(sample: &Sample<'_>) -> Option<[Option<Volts>; CELLS_MAX]> {
    let fields = &sample.fields;
    let count = fields.count(9).filter(|&count| count > 0)?;
    fields.element(10, 0).filter(|volts| *volts >= 0.0001)?;
    let mut cells = [None; CELLS_MAX];
    for (number, cell) in cells.iter_mut().enumerate().take(count as usize) {
        *cell = fields.element(10, number).map(|volts| Volts(volts as f32)).and_then(Volts::finite);
    }
    Some(cells)
}

fn load(px4: &mut Px4, sample: &Sample<'_>) {
    px4.power.has_load = true;
    px4.power.load = sample.fields.finite(0).filter(|load| (0.0..=1.0).contains(load));
    system_status(px4);
}

/// The battery with the least left.
fn system_status(px4: &mut Px4) {
    let left = |pack: &Pack| pack.remaining.map_or(1.0, |part| part.0);
    let lowest = px4.power.batteries.iter().flatten().min_by(|a, b| left(a).total_cmp(&left(b)));
    let status = SystemStatus {
        load: px4.power.load.map(Fraction),
        voltage: lowest.and_then(|pack| pack.voltage),
        current: lowest.and_then(|pack| pack.current),
        remaining: lowest.and_then(|pack| pack.remaining),
        sensors: px4.system.sensors(),
    };
    px4.observe(Observation::SystemStatus(status));
}

/// Capital letter before v1.12.
fn rails(px4: &mut Px4, sample: &Sample<'_>) {
    let vcc = sample.fields.finite(0).or_else(|| sample.fields.finite(1)).filter(|volts| *volts > 0.0);
    // PX4's topic has no servo rail.
    px4.observe(Observation::Rails(Rails { vcc: vcc.map(Volts), servo: None }));
}

fn escs(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    let count = (fields.count(0).unwrap_or(0) as usize).min(MOTORS_MAX);
    for first in (0..count).step_by(ESC_GROUP) {
        let mut group = EscGroup { first: first as u8, escs: [None; ESC_GROUP] };
        for (place, esc) in group.escs.iter_mut().enumerate().take(count - first) {
            *esc = Some(one_esc(sample, 1 + (first + place) * ESC_FIELDS));
        }
        px4.observe(Observation::Escs(group));
    }
}

/// Until v1.11 CAN ESCs are in kelvin: none works above 200 degrees Celsius, nor below 200 kelvin.
fn celsius(temperature: f32) -> Celsius {
    const ZERO_CELSIUS: f32 = 273.15;
    Celsius(if temperature > 200.0 { temperature - ZERO_CELSIUS } else { temperature })
}

/// Zeros or NaN for speed, voltage and current: no ESC, or no power.
fn one_esc(sample: &Sample<'_>, at: usize) -> Esc {
    let fields = &sample.fields;
    let nothing = |value: Option<f32>| value.is_none_or(|value| value == 0.0);
    let (rpm, volts, amperes) = (fields.finite(at), fields.finite(at + 1), fields.finite(at + 2));
    let silent = nothing(rpm) && nothing(volts) && nothing(amperes);
    Esc {
        rpm: rpm.filter(|_| !silent).map(Rpm),
        voltage: volts.filter(|_| !silent).map(Volts),
        current: amperes.filter(|_| !silent).map(Amperes),
        temperature: fields.finite(at + 3).map(celsius),
        failures: Some(fields.count(at + 5).unwrap_or(0) as u16),
        errors: fields.count(at + 4).map(|errors| errors as u32),
    }
}
