//! Batteries, rails, ESCs.

use hums_core::observation::{
    Battery, CELLS_MAX, CellVoltage, ESC_GROUP, Esc, EscGroup, Observation, Processor, Rails, SpeedSensor,
};
use hums_core::units::{AmpereHours, Amperes, Celsius, Fraction, Rpm, Volts};

use super::handler::{Given, Handler, handler};
use super::out::Out;
use super::state::State;

/// Columns of BAT.
const BAT: &str = "Inst|Instance|I Volt Curr CurrTot EnrgTot Temp RemPct Vcc";
/// Columns of ESC.
const ESC: &str = "Instance|I RPM Volt Curr Temp";

pub(super) const HANDLERS: &[Handler] = &[
    handler("BAT BAT2:1 BAT3:2 BAT4:3 CURR CUR2:1", BAT, battery),
    handler("BCL BCL2:1", "Inst|Instance|I V1 V2 V3 V4 V5 V6 V7 V8 V9 V10 V11 V12 V13 V14", cells),
    handler("POWR", "Vcc|VCC VServo MTemp MVolt", rails),
    handler("MCU", "MTemp MVolt", processor),
    handler("ESC ESC1 ESC2:1 ESC3:2 ESC4:3 ESC5:4 ESC6:5 ESC7:6 ESC8:7", ESC, esc),
    handler("RPM", "I RPM|rpm1 rpm2", rpm),
];

/// Older versions logged whole hundredths of volts and amperes.
fn hundredths(given: &Given<'_>, slot: usize) -> Option<f32> {
    given.single(slot).map(|value| if given.is_integer(slot) { value / 100.0 } else { value })
}

fn battery(state: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let id = given.instance(0);
    // The monitor is off.
    let Some(volts) = hundredths(given, 1).filter(|volts| *volts > 0.0) else { return };
    let current = hundredths(given, 2);
    let consumed_mah = given.single(3);
    let remaining = remaining(state, given, id, current.and(consumed_mah));
    if id == 0 {
        state.voltage.set(given.at, volts);
        if let Some(amperes) = current {
            state.current.set(given.at, amperes);
        }
        if let Some(part) = remaining {
            state.remaining.set(given.at, part);
        }
        // The oldest logs' 5 V rail, mV.
        if let Some(millivolts) = given.single(7).filter(|millivolts| *millivolts > 100.0) {
            let vcc = Some(Volts(millivolts / 1e3));
            out.observe(&Observation::Rails(Rails { vcc, servo: None }));
        }
    }
    out.observe(&Observation::Battery(Battery {
        id,
        cells: state.cells_of(given.at, id),
        voltage: Some(Volts(volts)),
        current: current.map(Amperes),
        consumed: consumed_mah.map(|mah| AmpereHours(mah / 1e3)),
        remaining: remaining.map(Fraction),
        // A battery without a thermometer has 0.
        temperature: given.single(5).filter(|celsius| *celsius != 0.0).map(Celsius),
        ..Battery::default()
    }));
}

/// `RemPct` since 4.1; before, the autopilot's formula (`AP_BattMonitor_Backend`).
fn remaining(state: &State, given: &Given<'_>, id: u8, consumed_mah: Option<f32>) -> Option<f32> {
    if let Some(percent) = given.single(6) {
        // -1 as a byte: a monitor without current.
        return (0.0..=100.0).contains(&percent).then_some(percent / 100.0);
    }
    let capacity_mah = (*state.facts.capacity_mah.get(usize::from(id))?)?;
    Some((1.0 - consumed_mah? / capacity_mah).clamp(0.0, 1.0))
}

/// 0 without a cell: the autopilot adds 1 mV to all, 65535 included.
fn cells(state: &mut State, given: &Given<'_>, _: &mut Out<'_>) {
    let mut cells = [None; CELLS_MAX];
    for (slot, cell) in (1..).zip(&mut cells) {
        let millivolts = given.unsigned(slot).filter(|millivolts| *millivolts > 1 && *millivolts < 65_535);
        *cell = millivolts.and_then(|millivolts| CellVoltage::from_millivolts((millivolts - 1) as u16));
    }
    let id = given.instance(0);
    // Before 2021 BCL2 had a second battery; today the cells beyond the twelfth.
    if given.column(1).is_none() {
        let before = state.cells_of(given.at, id);
        cells = std::array::from_fn(|cell| cells[cell].or(before[cell]));
    }
    if let Some(known) = state.cells.get_mut(usize::from(id)) {
        known.set(given.at, cells);
    }
}

/// Volts since 2015, thousandths before.
fn volts(given: &Given<'_>, slot: usize) -> Option<Volts> {
    let volts = given.single(slot).map(|value| if given.is_integer(slot) { value / 1e3 } else { value });
    volts.filter(|volts| *volts > 0.0).map(Volts)
}

fn rails(_: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let rails = Rails { vcc: volts(given, 0), servo: volts(given, 1) };
    if rails.vcc.is_some() || rails.servo.is_some() {
        out.observe(&Observation::Rails(rails));
    }
    observe_processor(given, 2, out);
}

fn processor(_: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    observe_processor(given, 0, out);
}

fn observe_processor(given: &Given<'_>, first: usize, out: &mut Out<'_>) {
    let temperature = given.single(first).filter(|celsius| *celsius != 0.0).map(Celsius);
    if temperature.is_some() {
        out.observe(&Observation::Processor(Processor { temperature }));
    }
}

fn esc(_: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    // As in ESC_TELEMETRY: the ESC is absent.
    if [1, 2].into_iter().all(|slot| given.single(slot).is_none_or(|value| value == 0.0)) {
        return;
    }
    let mut escs = [None; ESC_GROUP];
    escs[0] = Some(Esc {
        rpm: given.single(1).map(Rpm),
        voltage: given.single(2).map(Volts),
        current: given.single(3).map(Amperes),
        temperature: given.single(4).filter(|celsius| *celsius != 0.0).map(Celsius),
        ..Esc::default()
    });
    out.observe(&Observation::Escs(EscGroup { first: given.instance(0), escs }));
}

/// Negative without a sensor.
fn rpm(_: &mut State, given: &Given<'_>, out: &mut Out<'_>) {
    let first = given.instance(0);
    let sensor = |index: u8, slot: usize| {
        given.single(slot).filter(|rpm| *rpm >= 0.0).map(|rpm| SpeedSensor { index, rpm: Rpm(rpm) })
    };
    out.observe(&Observation::SpeedSensors([sensor(first, 1), sensor(first.saturating_add(1), 2)]));
}
