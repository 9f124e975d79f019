//! Cells of batteries, from the autopilot's messages to an alarm. Unknown cells raise no alarm, and are reported.
#![expect(clippy::unwrap_used, reason = "that is how a test fails")]

use crate::common::Run;
use hums_core::Monitor;
use hums_core::figures::Quantity;
use hums_core::happening::Happening;
use hums_core::health::Level;
use hums_core::lifetime::{ITEM_BYTES_MAX, Item as _, ItemKey, Lifetime};
use hums_core::observation::{Battery, Feeds, Observation};
use hums_core::params::{Param, Params};
use hums_core::units::{Amperes, Volts};
use hums_core::usage::UsageCounter;

const EMPTY_MS: u64 = 60_000;

fn cells(run: &Run) -> Vec<(u8, Level)> {
    run.of_check("cell_voltage").map(|finding| (finding.instance, finding.level)).collect()
}

fn told_ms(run: &Run) -> Vec<u64> {
    let told = run.happenings.iter().filter(|(_, happening)| *happening == Happening::CellsUnknown);
    told.map(|(at_ms, _)| *at_ms).collect()
}

/// A hundred seconds with a pack of `resting_v` at rest, and then `empty_v`.
fn fly(monitor: &Monitor, resting_v: f32, empty_v: f32, more: &[Observation]) -> Run {
    fly_with(monitor, |now_ms| (if now_ms < EMPTY_MS { resting_v } else { empty_v }, 20.0), more)
}

fn fly_with(monitor: &Monitor, pack: impl Fn(u64) -> (f32, f32), more: &[Observation]) -> Run {
    let mut run = Run::of(monitor);
    run.flies(0..100_000, |now_ms, quad, said| {
        let (pack_v, pack_a) = pack(now_ms);
        (quad.battery.voltage, quad.battery.current) = (Some(Volts(pack_v)), Some(Amperes(pack_a)));
        said.extend(more);
    });
    run
}

fn restarted(run: &Run, params: &Params) -> Monitor {
    let mut item = [0; ITEM_BYTES_MAX];
    let length = run.monitor.encode_item(ItemKey::Lifetime, &mut item);
    let mut next = Monitor::new(*params);
    next.restore(ItemKey::Lifetime, &item[..length]).unwrap();
    next
}

fn protected() -> Params {
    let mut params = Params::defaults();
    params.set("PROT_ACTION", 2.0).unwrap();
    params
}

fn setting(name: &str, value: f32) -> Observation {
    Observation::Parameter(hums_core::cells::known(name).unwrap(), value)
}

#[test]
fn a_pack_whose_cells_are_not_known_gives_no_alarm_and_no_action_and_is_told_once() {
    let outcome = fly(&Monitor::new(protected()), 25.2, 18.0, &[]);
    assert!(cells(&outcome).is_empty(), "6 or 7: {:?}", outcome.findings);
    assert_eq!(outcome.requests, []);
    assert!(matches!(told_ms(&outcome)[..], [45_000..47_000]), "{:?}", told_ms(&outcome));
}

#[test]
fn what_the_autopilot_the_setting_or_an_earlier_flight_tells_makes_it_known() {
    let told: [&[Observation]; 4] = [
        &[setting("BAT1_N_CELLS", 6.0)],
        &[setting("MOT_BAT_VOLT_MAX", 25.2)],
        &[setting("BATT_LOW_VOLT", 21.6), setting("BATT_CRT_VOLT", 20.4)],
        &[setting("MOT_BAT_VOLT_MIN", 19.8), setting("BATT_LOW_VOLT", 21.6)],
    ];
    for more in told {
        let outcome = fly(&Monitor::new(protected()), 25.2, 18.0, more);
        assert_eq!(cells(&outcome), [(0, Level::Critical)], "{more:?}");
        assert!(told_ms(&outcome).is_empty() && !outcome.requests.is_empty(), "{more:?}");
    }
    let mut set = protected();
    set.set("BAT_CELLS", 6.0).unwrap();
    assert_eq!(cells(&fly(&Monitor::new(set), 25.2, 18.0, &[])), [(0, Level::Critical)]);
    let mut monitor = Monitor::new(protected());
    let life = Lifetime { cells: [6, 0, 0, 0], ..Lifetime::default() };
    let mut stored = [0; Lifetime::BYTES];
    life.encode(&mut stored);
    monitor.restore(ItemKey::Lifetime, &stored).unwrap();
    assert_eq!(cells(&fly(&monitor, 25.2, 18.0, &[])), [(0, Level::Critical)]);
}

#[test]
fn packs_of_1_to_14_cells_are_critical_when_they_are_empty_and_not_before() {
    for count in [1, 2, 3, 4, 6, 7, 8, 10, 12, 14] {
        let told = setting("BAT1_N_CELLS", count as f32);
        let n = count as f32;
        let outcome = fly(&Monitor::new(protected()), 4.2 * n, 3.0 * n, &[told]);
        assert_eq!(cells(&outcome), [(0, Level::Critical)], "{count}S");
        assert!(!outcome.requests.is_empty() && told_ms(&outcome).is_empty(), "{count}S");
        let outcome = fly(&Monitor::new(protected()), 4.2 * n, 3.7 * n, &[told]);
        assert!(cells(&outcome).is_empty() && outcome.requests.is_empty(), "{count}S");
    }
}

#[test]
fn a_setting_is_no_count_of_a_pack_that_it_does_not_fit() {
    let mut set = protected();
    set.set("BAT_CELLS", 6.0).unwrap();
    let second = Battery { id: 1, voltage: Some(Volts(12.5)), ..Battery::default() };
    let outcome = fly(&Monitor::new(set), 25.0, 23.0, &[Observation::Battery(second)]);
    assert!(outcome.findings.is_empty() && outcome.requests.is_empty(), "{:?}", outcome.findings);
    assert_eq!(told_ms(&outcome).len(), 1, "the second pack's cells are not known");
    // The pack that it fits is judged by it.
    let outcome = fly(&Monitor::new(set), 25.0, 18.0, &[Observation::Battery(second)]);
    let levels: Vec<_> = cells(&outcome).into_iter().map(|(_, level)| level).collect();
    assert_eq!(levels, [Level::Critical]);
}

#[test]
fn a_full_5s_after_a_flight_with_a_6s_is_no_empty_6s_on_the_ground_or_after_a_restart_in_the_air() {
    let six = fly(&Monitor::new(protected()), 25.2, 24.0, &[setting("MOT_BAT_VOLT_MAX", 25.2)]);
    let outcome = fly(&restarted(&six, &protected()), 21.1, 20.3, &[]);
    let mut levels = cells(&outcome).into_iter().map(|(_, level)| level);
    assert!(levels.all(|level| level == Level::Stale), "{:?}", outcome.findings);
    assert!(outcome.requests.is_empty() && told_ms(&outcome).len() == 1, "not known, and told");
    let mut in_air = Run::of(&restarted(&outcome, &protected()));
    in_air.flies(0..60_000, |_, quad, _| {
        (quad.start_height, quad.height, quad.battery.voltage) = (30.0, 30.0, Some(Volts(20.0)));
    });
    assert!(in_air.findings.is_empty() && in_air.requests.is_empty(), "{:?}", in_air.findings);
}

#[test]
fn cells_that_are_not_known_are_told_as_soon_as_the_parameters_were_asked_for() {
    let mut monitor = Monitor::new(Params::defaults());
    monitor.parameters_asked();
    let outcome = fly(&monitor, 25.2, 24.0, &[]);
    assert!(matches!(told_ms(&outcome)[..], [0..1_000]), "{:?}", told_ms(&outcome));
}

#[test]
fn a_count_is_kept_for_the_next_power_on_and_only_confirms() {
    let six = fly(&Monitor::new(Params::defaults()), 25.2, 22.0, &[setting("BAT1_N_CELLS", 6.0)]);
    // A 4S in place of the 6S is not taken for a dead 6S: 3.9 V a cell.
    let outcome = fly(&restarted(&six, &Params::defaults()), 16.8, 15.6, &[]);
    assert!(outcome.findings.is_empty() && told_ms(&outcome).is_empty(), "{:?}", outcome.findings);
}

#[test]
fn a_payloads_pack_of_unknown_cells_is_no_news_and_two_packs_are_judged_each_by_its_own() {
    let payload = Battery {
        id: 3,
        voltage: Some(Volts(25.2)),
        current: Some(Amperes(1.0)),
        feeds: Feeds::Payload,
        ..Battery::default()
    };
    let outcome = fly(&Monitor::new(protected()), 16.8, 15.6, &[Observation::Battery(payload)]);
    assert!(told_ms(&outcome).is_empty() && outcome.findings.is_empty(), "{:?}", outcome.findings);
    let second = Battery { id: 1, voltage: Some(Volts(10.2)), ..Battery::default() };
    let outcome = fly(&Monitor::new(Params::defaults()), 16.8, 15.6, &[Observation::Battery(second)]);
    // 10.2 V are 3.4 V a cell of three, or 5.1 V of two, or 2.55 V of four; below 3.5 V at rest it fits none.
    assert!(cells(&outcome).is_empty(), "{:?}", cells(&outcome));
    let second = [Observation::Battery(second), setting("BATT2_LOW_VOLT", 10.8)];
    let outcome = fly(&Monitor::new(Params::defaults()), 16.8, 15.6, &second);
    // It was received before the vehicle's heartbeat let the other one count: places go by that, parameters by the
    // id.
    assert_eq!(cells(&outcome), [(0, Level::Critical)]);
}

#[test]
fn what_the_autopilot_calls_low_is_low_without_any_count() {
    let low = Battery { voltage: Some(Volts(21.0)), charge: 2, ..Battery::default() };
    let outcome = fly(&Monitor::new(Params::defaults()), 25.2, 21.0, &[Observation::Battery(low)]);
    let found: Vec<_> = outcome.findings.iter().map(|finding| (finding.check, finding.level)).collect();
    assert_eq!(found, [("batt_state", Level::Warning)]);
    assert!(outcome.monitor.params().get(Param::BatCells) == 0.0);
}

#[test]
fn a_pack_that_sags_under_its_load_is_not_empty_until_its_cells_are() {
    // 0.13 ohm, as a small pack's: 16.1 V at rest, 14.3 V in hover, and in the end 13.7 V: 3.4 V a cell, 3.8 without the load.
    let sags = |now_ms: u64| match now_ms {
        0..10_000 => (16.1, 0.4),
        10_000..EMPTY_MS => (14.3, 14.0),
        _ => (13.7, 14.0),
    };
    assert!(fly_with(&Monitor::new(protected()), sags, &[]).findings.is_empty());
    // 3.1 V are too little, with any sag.
    let outcome = fly_with(
        &Monitor::new(protected()),
        |now_ms| if now_ms < EMPTY_MS { sags(now_ms) } else { (12.4, 14.0) },
        &[],
    );
    assert_eq!(cells(&outcome), [(0, Level::Critical)]);
    // A failing cell under an even load is not a sag.
    let fails = |now_ms: u64| if now_ms < EMPTY_MS { (15.6, 14.0) } else { (13.7, 15.0) };
    assert_eq!(cells(&fly_with(&Monitor::new(protected()), fails, &[])), [(0, Level::Critical)]);
    // If no battery reports itself, the autopilot's figures serve as well.
    let mut run = Run::of(&Monitor::new(protected()));
    run.flies(0..100_000, |now_ms, quad, _| {
        let (pack_v, pack_a) = sags(now_ms);
        quad.battery_silent = true;
        (quad.system.voltage, quad.system.current) = (Some(Volts(pack_v)), Some(Amperes(pack_a)));
    });
    assert_eq!(run.findings, []);
}

#[test]
fn cycles_count_by_the_capacity_that_the_autopilot_knows_and_a_setting_comes_first() {
    let cycles = |params: Params| {
        let outcome = fly(&Monitor::new(params), 15.6, 15.6, &[setting("BATT_CAPACITY", 1_000.0)]);
        outcome.monitor.usage().value(UsageCounter::BatteryCycles).unwrap_or(0.0)
    };
    // 20 A for a hundred seconds are 0.56 Ah.
    assert!((cycles(Params::defaults()) - 0.55).abs() < 0.02);
    let mut set = Params::defaults();
    set.set("BAT_CAPACITY", 10.0).unwrap();
    assert!((cycles(set) - 0.055).abs() < 0.002);
}

#[test]
fn a_battery_whose_resistance_rises_is_found() {
    // 20 milliohms for the first 50 s, then 45; the current goes up and down once in two seconds.
    let outcome = fly_with(
        &Monitor::new(Params::defaults()),
        |now_ms| {
            let ohm = if now_ms < 50_000 { 0.020 } else { 0.045 };
            let amperes = if now_ms / 1_000 % 2 == 0 { 10.0 } else { 30.0 };
            (16.4 - ohm * amperes, amperes)
        },
        &[],
    );
    let found = outcome.of_check("batt_resistance").find(|finding| finding.level == Level::Critical).unwrap();
    // The mean looks back six seconds, and the debounce is ten.
    assert!((60_000..=75_000).contains(&found.at.as_millis()), "{found:?}");
    assert!((100.0..=130.0).contains(&found.value), "{found:?}");
    let figure = outcome.monitor.figures().get(Quantity::Resistance(0)).unwrap();
    assert!((0.03..0.05).contains(&figure), "{figure}");
}
