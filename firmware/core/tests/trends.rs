//! Flights one after the other: what is normal is learned, kept, and what leaves it is found.
#![expect(clippy::unwrap_used, reason = "that is how a test fails")]

use std::cell::Cell;

use crate::common::{AUTOPILOT, Quad};
use hums_core::Monitor;
use hums_core::baseline::Quantity;
use hums_core::component::Label;
use hums_core::health::{Finding, Level};
use hums_core::lifetime::{ITEM_BYTES_MAX, ItemKey};
use hums_core::observation::{Observation, Outputs};
use hums_core::params::Params;
use hums_core::status::LinkReading;
use hums_core::time::Instant;
use hums_core::units::{Amperes, Rpm, Volts};

/// Flies for 80 s and lands; gives the findings, and the baselines as they are saved.
fn fly(
    params: &Params,
    stored: Option<&[u8]>,
    change: impl Fn(&mut Quad),
) -> (Vec<Finding>, Monitor, Vec<u8>) {
    fly_with(params, stored, change, None)
}

/// The same, with what its motors are given in flight.
fn fly_with(
    params: &Params,
    stored: Option<&[u8]>,
    change: impl Fn(&mut Quad),
    pulses: Option<[u16; 4]>,
) -> (Vec<Finding>, Monitor, Vec<u8>) {
    let mut monitor = Monitor::new(*params);
    if let Some(stored) = stored {
        monitor.restore(ItemKey::Baselines, stored).unwrap();
    }
    let mut findings = Vec::new();
    for now_ms in (0..100_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let mut quad = Quad::healthy();
        change(&mut quad);
        quad.armed = now_ms < 90_000;
        if now_ms > 85_000 {
            quad.height = 0.0;
        }
        if now_ms.is_multiple_of(100) {
            for observation in quad.says(now_ms) {
                monitor.observe(now, AUTOPILOT, &observation);
            }
            if let Some(flies) = pulses {
                let mut outputs = Outputs::default();
                let given = if (4_000..85_000).contains(&now_ms) { flies } else { [1_000; 4] };
                outputs.pulses[..4].copy_from_slice(&given);
                monitor.observe(now, AUTOPILOT, &Observation::Outputs(outputs));
            }
        }
        let link = LinkReading { frames_lost: Some(0.0), at: now };
        monitor.tick(now, &link, &quad.recorder, &mut |finding| findings.push(*finding));
    }
    assert!(monitor.save_due(Instant::from_millis(100_000), hums_core::lifetime::Room::Enough).is_some());
    let mut item = [0; ITEM_BYTES_MAX];
    let length = monitor.encode_item(ItemKey::Baselines, &mut item);
    (findings, monitor, item[..length].to_vec())
}

type Change = fn(&mut Quad);

fn three_flights() -> Vec<u8> {
    let mut stored = None;
    for _ in 0..3 {
        let (findings, _, item) = fly(&Params::defaults(), stored.as_deref(), |_| {});
        assert_eq!(findings, []);
        stored = Some(item);
    }
    stored.unwrap()
}

#[test]
fn what_was_normal_for_three_flights_stays_normal() {
    let stored = three_flights();
    let (findings, monitor, _) = fly(&Params::defaults(), Some(&stored), |_| {});
    assert_eq!(findings, []);
    let known = |quantity| monitor.baselines().get(quantity).known().unwrap();
    // 0.5 at 15.5 V, told for 15.2 V.
    assert!((known(Quantity::HoverThrottle) - 0.52).abs() < 0.01);
    assert!((known(Quantity::Vibration) - 5.0).abs() < 0.1);
    assert!(known(Quantity::MotorSpeed(3)).abs() < 0.1);
    assert_eq!(monitor.baselines().get(Quantity::MotorSpeed(4)).known(), None, "there is none");
}

#[test]
fn each_quantity_that_leaves_what_was_normal_is_found_and_not_learned() {
    let stored = three_flights();
    let cases: [(&str, u8, Level, Change); 7] = [
        ("power_trend", 0, Level::Warning, |quad| {
            quad.battery.current = quad.battery.current.map(|current| Amperes(current.0 * 1.1));
        }),
        // A tenth heavier: power goes with the 1.5th power of the weight.
        ("weight_trend", 0, Level::Warning, |quad| {
            quad.throttle = 0.55;
            quad.battery.current = quad.battery.current.map(|current| Amperes(current.0 * 1.154));
        }),
        ("vibration_trend", 0, Level::Warning, |quad| quad.vibration.levels = [Some(9.0); 3]),
        ("vibration_trend", 0, Level::Warning, |quad| quad.vibration.levels = [Some(2.5); 3]),
        ("throttle_trend", 0, Level::Warning, |quad| quad.throttle = 0.55),
        ("throttle_trend", 0, Level::Critical, |quad| quad.throttle = 0.7),
        ("motor_trend", 2, Level::Warning, |quad| quad.escs[2].as_mut().unwrap().rpm = Some(Rpm(5_450.0))),
    ];
    for (check, instance, level, change) in cases {
        let (findings, _, item) = fly(&Params::defaults(), Some(&stored), change);
        let worst = findings
            .iter()
            .filter(|finding| finding.check == check)
            .max_by_key(|finding| finding.level as u8);
        let worst = worst.unwrap_or_else(|| panic!("{check} is not found: {findings:?}"));
        assert_eq!((worst.instance, worst.level), (instance, level), "{findings:?}");
        assert!(findings.iter().all(|finding| finding.check == check), "{findings:?}");
        let (again, ..) = fly(&Params::defaults(), Some(&item), change);
        assert!(again.iter().any(|finding| finding.check == check), "{check} was learned");
    }
}

#[test]
fn a_battery_whose_resistance_rises_is_found() {
    // 20 milliohms for the first 50 s, then 45; the current goes up and down once in two seconds.
    let steps = Cell::new(0);
    let (findings, ..) = fly(&Params::defaults(), None, |quad| {
        let step = steps.replace(steps.get() + 1);
        let ohm = if step < 1_000 { 0.020 } else { 0.045 };
        let amperes = if step / 20 % 2 == 0 { 10.0 } else { 30.0 };
        quad.battery.current = Some(Amperes(amperes));
        quad.battery.voltage = Some(Volts(16.4 - ohm * amperes));
    });
    let found = findings.iter().find(|finding| finding.level == Level::Critical).expect("it is found");
    assert_eq!(found.check, "batt_resistance", "{findings:?}");
    // The mean looks back six seconds, and the debounce is ten.
    assert!((60_000..=75_000).contains(&found.at.as_millis()), "{found:?}");
    assert!((100.0..=130.0).contains(&found.value), "{found:?}");
    assert!(findings.iter().all(|finding| finding.check == "batt_resistance"), "{findings:?}");
}

#[test]
fn without_telemetry_of_escs_a_motors_output_is_its_figure() {
    let no_telemetry: Change = |quad| quad.escs = [None; 4];
    let mut stored = None;
    for _ in 0..3 {
        let (findings, _, item) =
            fly_with(&Params::defaults(), stored.as_deref(), no_telemetry, Some([1_500; 4]));
        assert_eq!(findings, []);
        stored = Some(item);
    }
    let weak = Some([1_450, 1_450, 1_650, 1_450]);
    let (findings, ..) = fly_with(&Params::defaults(), stored.as_deref(), no_telemetry, weak);
    let named: Vec<_> =
        findings.iter().filter(|one| one.instance == 2).map(|one| (one.check, one.level)).collect();
    assert!(named.contains(&("motor_trend", Level::Critical)), "{findings:?}");
}

#[test]
fn before_there_is_a_baseline_nothing_has_left_it() {
    let (findings, ..) = fly(&Params::defaults(), None, |quad| quad.throttle = 0.7);
    assert_eq!(findings, []);
}

#[test]
fn a_new_motor_has_a_new_past() {
    let mut params = Params::defaults();
    params.set("CMP1_KIND", 3.0).unwrap();
    params.set("CMP1_NUMBER", 2.0).unwrap();
    let (_, mut monitor, _) = fly(&params, Some(&three_flights()), |_| {});
    monitor.replace_component(0, Label::new("new")).unwrap();
    let known = |quantity| monitor.baselines().get(quantity).known();
    assert_eq!((known(Quantity::MotorSpeed(1)), known(Quantity::HoverThrottle)), (None, None));
    assert!(known(Quantity::MotorSpeed(0)).is_some());
}

#[test]
fn an_emptier_battery_takes_more_throttle_and_is_no_departure() {
    let stored = three_flights();
    // Thrust goes with the square of the voltage.
    let emptier: Change = |quad| {
        quad.battery.voltage = Some(Volts(14.4));
        quad.throttle = 0.5 * (15.5_f32 / 14.4).powi(2);
    };
    let (findings, ..) = fly(&Params::defaults(), Some(&stored), emptier);
    assert_eq!(findings, []);
    let (findings, ..) =
        fly(&Params::defaults(), Some(&stored), |quad| quad.battery.voltage = Some(Volts(16.4)));
    assert!(findings.iter().any(|finding| finding.check == "throttle_trend"), "heavier: {findings:?}");
}
