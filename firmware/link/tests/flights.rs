//! The monitor over recorded flights: findings, and usage against pymavlink's computation of the same messages.
//!
//! Flight time comes from the height above the place of arming, landing from `EXTENDED_SYS_STATE` if sent. Distance is the sum
//! of the speeds of `GLOBAL_POSITION_INT`. Charge and energy come from `BATTERY_STATUS` (or `SYS_STATUS`, or `ESC_STATUS`) by
//! trapezoids.

use crate::common;

use common::{Recording, flight};
use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::health::{Finding, Level};
use hums_core::parameters::Params;
use hums_core::status::{RecorderStatus, Recording as Card};
use hums_core::usage::UsageCounter;
use hums_link::sequence::Sequences;
use hums_link::{Framer, observe};

struct Outcome {
    monitor: Monitor,
    findings: Vec<Finding>,
}

impl Outcome {
    fn alarms(&self) -> Vec<(f64, &'static str, Level)> {
        let bad = |finding: &&Finding| matches!(finding.level, Level::Warning | Level::Critical);
        let entry = |finding: &Finding| (finding.at.as_millis() as f64 / 1e3, finding.check, finding.level);
        self.findings.iter().filter(bad).map(entry).collect()
    }
}

fn watch(recording: &Recording) -> Outcome {
    let mut framer = Framer::new();
    let mut sequences = Sequences::new();
    let mut monitor = Monitor::new(Params::defaults());
    let mut findings = Vec::new();
    let recorder = RecorderStatus { recording: Card::Running, ..RecorderStatus::default() };
    let first_us = recording.frames.first().map_or(0, |frame| frame.2);
    let mut tick_at = Instant::ZERO;
    for &(start, len, micros) in &recording.frames {
        let at = Instant::from_micros(micros.saturating_sub(first_us));
        while tick_at < at {
            let link = sequences.reading(tick_at, monitor.vehicle().source);
            monitor.tick(tick_at.into(), &link, &recorder, &mut |finding| findings.push(*finding));
            tick_at = tick_at + Span::from_millis(50);
        }
        framer.push(&recording.bytes[start..start + len], &mut |frame| {
            sequences.frame(at, &frame);
            if let Some((source, observation)) = observe(&frame) {
                monitor.observe(at.into(), source, &observation);
            }
        });
    }
    Outcome { monitor, findings }
}

struct Expected {
    name: &'static str,
    flights: f64,
    flight_s: f64,
    armed_s: f64,
    distance_m: f64,
    speed_max_m_s: f64,
    height_max_m: f64,
    charge_ah: f64,
    energy_wh: f64,
    /// Tolerance of charge and energy. If current comes every few seconds, the two ways of filling the gaps differ.
    power_tolerance: f64,
}

const EXPECTED: [Expected; 6] = [
    Expected {
        name: "ap_quad_guided.tlog",
        flights: 1.0,
        flight_s: 218.0,
        armed_s: 223.0,
        distance_m: 690.0,
        speed_max_m_s: 7.83,
        height_max_m: 30.02,
        charge_ah: 1.738,
        energy_wh: 21.897,
        power_tolerance: 0.01,
    },
    Expected {
        name: "ap_quad_faults.tlog",
        flights: 1.0,
        flight_s: 307.9,
        armed_s: 313.0,
        distance_m: 1_053.6,
        speed_max_m_s: 7.84,
        height_max_m: 30.02,
        charge_ah: 2.678,
        energy_wh: 30.994,
        power_tolerance: 0.01,
    },
    Expected {
        name: "px4_hil_quad_low.tlog",
        flights: 1.0,
        flight_s: 232.4,
        armed_s: 241.0,
        distance_m: 565.2,
        speed_max_m_s: 5.16,
        height_max_m: 29.98,
        charge_ah: 3.135,
        energy_wh: 48.119,
        power_tolerance: 0.01,
    },
    Expected {
        // From 1.5 m above the place of arming until the throttle of `VFR_HUD` is below 10 %. The last flight hovers for 16 s below half a
        // metre: with its hover throttle, at 0.2 to 1 m/s by the receiver.
        name: "dronekit_flight.tlog",
        flights: 5.0,
        flight_s: 381.4,
        armed_s: 429.5,
        distance_m: 1_005.6,
        speed_max_m_s: 7.98,
        height_max_m: 13.26,
        charge_ah: 2.136,
        energy_wh: 20.802,
        power_tolerance: 0.01,
    },
    Expected {
        name: "thayer_px4_rural.tlog",
        flights: 1.0,
        flight_s: 194.7,
        armed_s: 216.0,
        distance_m: 590.6,
        speed_max_m_s: 5.16,
        height_max_m: 30.05,
        charge_ah: 0.596,
        energy_wh: 9.035,
        power_tolerance: 0.03,
    },
    Expected {
        name: "clyde_rov_dive.tlog",
        flights: 0.0,
        flight_s: 0.0,
        armed_s: 16.0,
        distance_m: 0.0,
        speed_max_m_s: 0.0,
        height_max_m: 0.0,
        charge_ah: 0.030,
        energy_wh: 0.491,
        power_tolerance: 0.03,
    },
];

#[test]
fn usage_agrees_with_an_independent_computation_within_one_percent() {
    for expected in EXPECTED {
        let Some(recording) = flight(expected.name) else { continue };
        let outcome = watch(&recording);
        let usage = outcome.monitor.usage();
        for (counter, value, tolerance) in [
            (UsageCounter::Flights, expected.flights, 0.0),
            (UsageCounter::Landings, expected.flights, 0.0),
            (UsageCounter::Flight, expected.flight_s, 0.01),
            (UsageCounter::Armed, expected.armed_s, 0.01),
            (UsageCounter::Distance, expected.distance_m, 0.01),
            (UsageCounter::SpeedMax, expected.speed_max_m_s, 0.01),
            (UsageCounter::HeightMax, expected.height_max_m, 0.01),
            (UsageCounter::Charge, expected.charge_ah, expected.power_tolerance),
            (UsageCounter::Energy, expected.energy_wh, expected.power_tolerance),
        ] {
            let found = usage.value(counter).unwrap();
            assert!(
                (found - value).abs() <= tolerance * value.abs() + 1e-9,
                "{}: {} is {found}, expected {value}",
                expected.name,
                counter.name()
            );
        }
    }
}

#[test]
fn the_parts_of_a_flight_add_up_to_it() {
    for expected in EXPECTED {
        let Some(recording) = flight(expected.name) else { continue };
        let outcome = watch(&recording);
        let value = |counter| outcome.monitor.usage().value(counter).unwrap();
        let parts = [
            UsageCounter::TakeOff,
            UsageCounter::Hover,
            UsageCounter::Climb,
            UsageCounter::Cruise,
            UsageCounter::Descent,
            UsageCounter::Landing,
        ];
        let sum: f64 = parts.into_iter().map(value).sum();
        let unseen_s = 0.55 * expected.flights;
        assert!((value(UsageCounter::Flight) - sum).abs() <= unseen_s + 1.0, "{}: {sum}", expected.name);
    }
}

#[test]
fn the_touchdown_of_the_simulated_quad_is_as_fast_as_the_simulator_says() {
    // "SIM Hit ground at 0.501037 m/s".
    let outcome = watch(&flight("ap_quad_faults.tlog").expect("in the repository"));
    let touchdown = outcome.monitor.usage().value(UsageCounter::TouchdownMax).unwrap();
    assert!((0.4..0.7).contains(&touchdown), "{touchdown}");
    assert_eq!(outcome.monitor.usage().value(UsageCounter::HardLandings), Some(0.0));
}

#[test]
fn healthy_flights_have_no_critical_finding() {
    for name in [
        "ap_quad_guided.tlog",
        "px4_hil_quad_low.tlog",
        "clyde_rov_dive.tlog",
        "eagle_ac740ecf.tlog",
        "mavometer_px4.tlog",
    ] {
        let Some(recording) = flight(name) else { continue };
        let alarms = watch(&recording).alarms();
        let silent = |alarm: &&(f64, &str, Level)| name == "eagle_ac740ecf.tlog" && alarm.1 == "heartbeat";
        let critical = alarms.iter().filter(|alarm| alarm.2 == Level::Critical && !silent(alarm));
        let critical: Vec<_> = critical.collect();
        assert!(critical.is_empty(), "{name}: {critical:?}");
    }
}

#[test]
fn the_faults_that_show_in_the_telemetry_of_the_faulty_flight_are_found() {
    let recording = flight("ap_quad_faults.tlog").expect("in the repository");
    let alarms = watch(&recording).alarms();
    // The battery falls to 3.4 V a cell at 255.7 s; its own fail-safe at 265.8 s declares the vehicle critical and
    // the battery unhealthy. The simulator's fewer satellites and jammed receiver never reached its messages (ten
    // satellites throughout, enough for a flight). Its vibration from 85.5 s on stays at 15 m/s2, half of the limit,
    // and far above the earlier level of this flight.
    let expected = [
        ("vibration_rise", Level::Warning, 86.5, 87.5),
        ("cell_voltage", Level::Critical, 260.7, 260.9),
        ("battery_alert", Level::Warning, 265.7, 266.0),
        ("autopilot_state", Level::Critical, 266.5, 267.5),
        // The autopilot calls the battery low.
        ("batt_state", Level::Warning, 267.8, 268.5),
    ];
    assert_eq!(alarms.len(), expected.len(), "{alarms:?}");
    for ((at_s, check, level), (name, expected_level, from_s, to_s)) in alarms.into_iter().zip(expected) {
        assert_eq!((check, level), (name, expected_level));
        assert!((from_s..to_s).contains(&at_s), "{check} at {at_s}");
    }
}

#[test]
fn what_was_wrong_with_real_vehicles_is_found() {
    if let Some(recording) = flight("dronekit_flight.tlog") {
        let outcome = watch(&recording);
        let alarms = outcome.alarms();
        let has = |check: &str, level| alarms.iter().any(|alarm| alarm.1 == check && alarm.2 == level);
        // Its pilot was told "Low Battery". The autopilot restarted on the ground (its boot time falls from 279 s to
        // 19 s), which is counted without an alarm.
        assert!(has("cell_voltage", Level::Critical), "{alarms:?}");
        assert!(!has("autopilot_reboot", Level::Critical), "{alarms:?}");
        assert!(has("vibration", Level::Critical) && has("clipping", Level::Critical), "{alarms:?}");
        assert_eq!(outcome.monitor.usage().value(UsageCounter::AutopilotReboots), Some(1.0));
    }
    if let Some(recording) = flight("thayer_px4_rural.tlog") {
        let alarms = watch(&recording).alarms();
        assert!(alarms.iter().any(|alarm| alarm.1 == "vibration_px4" && alarm.2 == Level::Critical));
    }
}
