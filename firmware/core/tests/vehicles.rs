//! More than one quad of ArduPilot: other systems on the port, other vehicles, other batteries.
#![expect(clippy::panic, clippy::unwrap_used, reason = "that is how a test fails")]

use crate::common::{AUTOPILOT, Quad, Run, Script, observe, params};
use hums_core::happening::Happening;
use hums_core::lifetime::{Airframe, Item as _, ItemKey, Lifetime};
use hums_core::observation::{AutopilotIdentity, Esc, EscGroup, Heartbeat, Observation, Source, VehicleKind};
use hums_core::parameters::Params;
use hums_core::units::Rpm;
use hums_core::usage::UsageCounter;

const OTHER: Source = Source { system: 7, component: 1 };

fn with_life_of(airframe: Airframe) -> Run {
    let mut run = Run::new(&Params::defaults());
    let life = Lifetime { airframe, boots: 41, ..Lifetime::default() };
    let mut bytes = [0; Lifetime::BYTES];
    life.encode(&mut bytes);
    run.monitor.restore(ItemKey::Lifetime, &bytes).unwrap();
    run
}

/// A minute, of a monitor without settings. Words besides the vehicle's: `rpm` of its four ESCs, `escs` that measure nothing, and
/// `unsent`, no message of theirs.
fn minute(script: &str) -> Run {
    let mut run = Run::new(&Params::defaults());
    play(&mut run, 60_000, script);
    run
}

fn play(run: &mut Run, end_ms: u64, script: &str) {
    let script = Script::new(script);
    run.says(0..end_ms, |now_ms| {
        let (mut quad, mut is_unsent) = (Quad::healthy(), false);
        script.play(now_ms as i64, |said| match said.name() {
            _ if quad.take(said) => {}
            "rpm" => {
                for (esc, rpm) in quad.escs.iter_mut().flatten().zip(said.list::<4>()) {
                    esc.rpm = Some(Rpm(rpm));
                }
            }
            "escs" => quad.escs = [None; 4],
            "unsent" => is_unsent = true,
            word => panic!("{word}: no word"),
        });
        let mut said = quad.says(now_ms);
        said.retain(|one| !is_unsent || !matches!(one, Observation::Escs(_)));
        said
    });
}

#[test]
fn another_vehicles_heartbeat_that_is_forwarded_first_does_not_make_it_the_vehicle() {
    let mut run = with_life_of(Airframe { system: 1, uid: 0 });
    run.steps(0..60_000, |now_ms, monitor| {
        if now_ms.is_multiple_of(1_000) {
            let heartbeat = Heartbeat { kind: VehicleKind::Plane, ..Heartbeat::default() };
            observe(monitor, now_ms, OTHER, [Observation::Heartbeat(heartbeat)]);
        }
        if now_ms >= 200 && now_ms.is_multiple_of(100) {
            observe(monitor, now_ms, AUTOPILOT, Quad::healthy().says(now_ms));
        }
    });
    assert_eq!(run.monitor.vehicle().source, Some(AUTOPILOT));
    assert_eq!(run.monitor.usage().value(UsageCounter::Flights), Some(1.0));
    let is_other = run.happenings.iter().any(|(_, happening)| *happening == Happening::OtherAirframe);
    assert!(!is_other, "its life goes on: {:?}", run.happenings);
    assert_eq!(run.monitor.lifetime().boots, 42);
}

#[test]
fn a_system_id_that_is_changed_is_followed_and_the_life_of_its_unique_id_goes_on() {
    let airframe = Airframe { system: 1, uid: 99 };
    let mut run = with_life_of(airframe);
    let identity = Observation::Identity(AutopilotIdentity { uid: 99, ..AutopilotIdentity::default() });
    for (times_ms, source) in [(0..30_000, AUTOPILOT), (30_000..90_000, OTHER)] {
        run.steps(times_ms, |now_ms, monitor| {
            if now_ms.is_multiple_of(100) {
                let said = Quad { armed: false, height: 0.0, ..Quad::healthy() }.says(now_ms);
                let identity = (now_ms % 20_000 == 19_000).then_some(identity);
                observe(monitor, now_ms, source, said.into_iter().chain(identity));
            }
        });
    }
    assert_eq!(run.monitor.vehicle().source, Some(OTHER));
    let changes = run.happenings.iter().filter(|(_, what)| *what == Happening::OtherVehicle);
    let changed_ms: Vec<_> = changes.map(|(at_ms, _)| *at_ms).collect();
    assert!(matches!(changed_ms[..], [59_900..62_000]), "{:?}", run.happenings);
    assert!(run.happenings.iter().all(|(_, what)| *what != Happening::OtherAirframe), "{:?}", run.happenings);
    assert_eq!(run.monitor.lifetime().airframe, Airframe { system: 7, uid: 99 });
}

#[test]
fn what_another_system_says_is_judged_by_nobody() {
    let mut run = Run::new(&Params::defaults());
    run.steps(0..60_000, |now_ms, monitor| {
        if now_ms.is_multiple_of(100) {
            let mut bad = Quad::healthy();
            bad.vibration.levels = [Some(90.0); 3];
            bad.estimator.velocity = Some(9.0);
            observe(monitor, now_ms, AUTOPILOT, Quad::healthy().says(now_ms));
            observe(monitor, now_ms, OTHER, bad.says(now_ms));
        }
    });
    assert_eq!(run.findings, []);
}

#[test]
fn what_is_a_fault_of_a_multicopter_is_none_of_a_plane_a_vtol_or_a_helicopter() {
    for (kind, expected) in
        [("quad", &["motor_imbalance", "roll"][..]), ("heli", &["roll"]), ("plane", &[]), ("vtol", &[])]
    {
        let run = minute(&format!("* {kind} rpm=2500,5000x3; 20-25 roll=1.2"));
        assert_eq!(run.checks(), expected, "{kind}");
    }
}

#[test]
fn an_autopilot_that_restarts_on_the_ground_is_counted_and_one_that_restarts_armed_is_an_alarm() {
    for (script, is_alarm) in [
        ("* off h=0; 30 boot=-29000", false),
        ("30 off boot=-29000", true),
        ("30 off boot=-29000; 25-30 silent", true),
        // Its state in a long silence is unknown: it may have landed.
        ("30 off boot=-29000; 15-30 silent", false),
    ] {
        let run = minute(script);
        assert_eq!(run.monitor.vehicle().reboots, 1);
        assert_eq!(run.checks().contains(&"autopilot_reboot"), is_alarm, "{script}");
    }
}

#[test]
fn a_vtol_that_hovers_is_judged_as_a_multicopter_and_on_its_wings_it_banks_and_its_lifting_motors_stop() {
    for (state, fault, expected) in [
        ("hover", "roll=1.2", &["roll"][..]),
        ("hover", "amps=5,0,5,5", &["motor_loss"]),
        ("forward", "roll=1.2", &[]),
        ("forward", "amps=5,0,5,5", &[]),
        ("transition", "roll=1.2", &[]),
        ("transition", "amps=5,0,5,5", &[]),
        ("", "roll=1.2", &[]),
    ] {
        let run = minute(&format!("* vtol mode=10 {state}; 0-2 landed=ground; 2 landed=air; 20-25 {fault}"));
        assert_eq!(run.checks(), expected, "{state} {fault}");
    }
}

#[test]
fn a_hexacopter_with_one_dead_motor_has_one_motor_named() {
    for dead in 0..6 {
        let mut run = Run::new(&Params::defaults());
        run.says(0..60_000, |now_ms| {
            let mut hexa = Quad { type_number: 13, ..Quad::healthy() };
            let esc = hexa.escs[0].unwrap();
            let rpm = |motor: usize| match (motor + 6 - dead) % 6 {
                _ if now_ms < 20_000 => 5_000.0,
                0 => 500.0,
                3 if now_ms > 40_000 => 0.0,
                3 => 4_200.0,
                1 | 5 => 6_600.0,
                _ => 5_900.0,
            };
            hexa.escs = [0, 1, 2, 3].map(|motor| Some(Esc { rpm: Some(Rpm(rpm(motor))), ..esc }));
            let more = [4, 5].map(|motor| Some(Esc { rpm: Some(Rpm(rpm(motor))), ..esc }));
            let mut said = hexa.says(now_ms);
            said.push(Observation::Escs(EscGroup { first: 4, escs: [more[0], more[1], None, None] }));
            said
        });
        let mut named: Vec<_> =
            run.findings.iter().map(|finding| (finding.check, finding.instance)).collect();
        named.dedup();
        assert_eq!(named, [("motor_imbalance", dead as u8)], "{:?}", run.findings);
    }
}

#[test]
fn a_link_that_is_silent_is_told_as_such_and_not_as_silent_escs() {
    let run = minute("20-24.5 silent; 24.5-24.7 unsent");
    assert_eq!(run.checks(), ["heartbeat"], "{:?}", run.findings);
}

#[test]
fn speeds_that_are_held_and_zeros_of_lost_telemetry_say_nothing_about_a_motor() {
    for lost in ["escs", "rpm=0"] {
        let run = minute(&format!("* rpm=5000,5600,5000x2; 30 {lost}"));
        assert!(!run.checks().contains(&"motor_imbalance"), "{lost}: {:?}", run.findings);
    }
}

const OUT_AND_BACK: &str = "* c=0 vibe=0.1,0.1,1 volt=15.6; 0-5 off; 70 off; 0-8 h=0 thr=0; 67 h=0 thr=0; \
                            20-25 roll=1.2; 30-70 volt=13.2; ";

#[test]
fn each_class_of_vehicle_flies_banks_and_is_protected_as_its_class_on_both_autopilots() {
    let params = params(&[("PROT_ACTION", 2.0)]);
    for kind in ["quad", "hexa", "heli", "plane", "vtol", "rover", "boat", "submarine"] {
        for autopilot in ["ap", "px4"] {
            for landed in ["", "0-8 landed=ground; 8-67 landed=air; 67 landed=ground"] {
                let mode = match (autopilot, kind) {
                    ("px4", _) => "mission",
                    (_, "plane" | "vtol") => "10",
                    _ => "3",
                };
                let hover = if kind == "plane" { "" } else { "hover" };
                let of = format!("* {autopilot} {kind} mode={mode} {hover}; {OUT_AND_BACK}{landed}");
                let mut run = Run::new(&params);
                play(&mut run, 90_000, &of);
                let flies = !matches!(kind, "rover" | "boat" | "submarine");
                let counted =
                    run.counts([UsageCounter::Flights, UsageCounter::Landings, UsageCounter::Mishaps]);
                assert_eq!(counted, [u32::from(flies), u32::from(flies), 0], "{of}");
                let hangs =
                    matches!(kind, "quad" | "hexa" | "heli") || (kind == "vtol" && !landed.is_empty());
                let expected: &[&str] = if hangs { &["cell_voltage", "roll"] } else { &["cell_voltage"] };
                assert_eq!((run.checks().as_slice(), run.requests.is_empty()), (expected, !flies), "{of}");
            }
        }
    }
}
