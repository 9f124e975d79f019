//! Consecutive flights: the normal figures are learnt, and a flight that leaves them is found.

#[path = "../../../firmware/core/tests/common/mod.rs"]
mod common;

use common::{AUTOPILOT, Quad};
use hums::check::trends::{Baselines, FlightFigures};
use hums::source::told::Finding;
use hums_core::Monitor;
use hums_core::clock;
use hums_core::figures::Quantity;
use hums_core::health::Level;
use hums_core::observation::{Observation, Outputs};
use hums_core::parameters::Params;
use hums_core::status::LinkReading;
use hums_core::time::BootMs;
use hums_core::units::{Amperes, Rpm, Volts};

type Change = fn(&mut Quad);
type Expected = (&'static str, u8, Level);

fn fly(past: &mut Baselines, change: Change, pulses: Option<[u16; 4]>) -> Vec<Finding> {
    let mut monitor = Monitor::new(Params::defaults());
    for now_ms in (0..100_000).step_by(50) {
        let now = BootMs::from_millis(now_ms);
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
        monitor.tick(now, &link, &quad.recorder, &mut |_| {});
    }
    let flown = FlightFigures::of(clock::Instant::from_millis(100_000), true, &monitor);
    past.judge(&flown, &Params::defaults()).0
}

fn three_flights(change: Change, pulses: Option<[u16; 4]>) -> Baselines {
    let mut past = Baselines::default();
    for _ in 0..3 {
        assert_eq!(fly(&mut past, change, pulses), []);
    }
    past
}

#[test]
fn what_was_normal_for_three_flights_stays_normal() {
    let mut past = three_flights(|_| {}, None);
    assert_eq!(fly(&mut past, |_| {}, None), []);
    let known = |quantity| past.known(quantity).unwrap();
    // 0.5 at 15.5 V, converted to 15.2 V.
    assert!((known(Quantity::HoverThrottle) - 0.52).abs() < 0.01);
    assert!((known(Quantity::Vibration) - 5.0).abs() < 0.1);
    assert!(known(Quantity::MotorSpeed(3)).abs() < 0.1);
    assert_eq!(past.known(Quantity::MotorSpeed(4)), None, "there is none");
}

#[test]
fn each_quantity_that_leaves_what_was_normal_is_found_and_not_learned() {
    let past = three_flights(|_| {}, None);
    let heavier: Change = |quad| {
        quad.throttle = 0.55;
        quad.battery.current = quad.battery.current.map(|current| Amperes(current.0 * 1.154));
    };
    let emptier: Change = |quad| {
        quad.battery.voltage = Some(Volts(14.4));
        quad.throttle = 0.5 * (15.5_f32 / 14.4).powi(2);
    };
    let cases: [(Option<Expected>, Change); 9] = [
        (Some(("power_trend", 0, Level::Warning)), |quad| {
            quad.battery.current = quad.battery.current.map(|current| Amperes(current.0 * 1.1));
        }),
        (Some(("weight_trend", 0, Level::Warning)), heavier),
        (Some(("vibration_trend", 0, Level::Warning)), |quad| quad.vibration.levels = [Some(9.0); 3]),
        (Some(("vibration_trend", 0, Level::Warning)), |quad| quad.vibration.levels = [Some(2.5); 3]),
        (Some(("throttle_trend", 0, Level::Warning)), |quad| quad.throttle = 0.55),
        (Some(("throttle_trend", 0, Level::Critical)), |quad| quad.throttle = 0.7),
        (Some(("motor_trend", 2, Level::Warning)), |quad| {
            quad.escs[2].as_mut().unwrap().rpm = Some(Rpm(5_450.0));
        }),
        (None, emptier),
        (Some(("throttle_trend", 0, Level::Warning)), |quad| {
            quad.battery.voltage = Some(Volts(16.4));
            quad.battery.current = quad.battery.current.map(|current| Amperes(current.0 * 15.5 / 16.4));
        }),
    ];
    for (number, (expected, change)) in cases.into_iter().enumerate() {
        let mut past = past.clone();
        let of = |found: &[Finding]| -> Vec<_> {
            found.iter().map(|one| (one.check.clone(), one.instance, one.level)).collect()
        };
        let found = of(&fly(&mut past, change, None));
        let expected: Vec<_> =
            expected.into_iter().map(|(check, part, level)| (check.to_owned(), part, level)).collect();
        assert_eq!(found, expected, "{number}");
        assert_eq!(of(&fly(&mut past, change, None)), expected, "{number} was learned");
    }
    assert_eq!(fly(&mut Baselines::default(), |quad| quad.throttle = 0.7, None), [], "without a past");
}

#[test]
fn without_telemetry_of_escs_a_motors_output_is_its_figure() {
    let no_telemetry: Change = |quad| quad.escs = [None; 4];
    let mut past = three_flights(no_telemetry, Some([1_500; 4]));
    let found = fly(&mut past, no_telemetry, Some([1_450, 1_450, 1_650, 1_450]));
    let motor = found.iter().find(|one| (one.check.as_str(), one.instance) == ("motor_trend", 2)).unwrap();
    assert_eq!(motor.level, Level::Critical, "{found:?}");
}
