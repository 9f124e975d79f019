//! More than one quad of ArduPilot: other systems on the port, other vehicles, other batteries.
#![expect(clippy::unwrap_used, reason = "that is how a test fails")]

use crate::common::{AUTOPILOT, Quad, Run, observe};
use hums_core::happening::Happening;
use hums_core::lifetime::{Airframe, Item as _, ItemKey, Lifetime};
use hums_core::observation::{
    Autopilot, AutopilotIdentity, Esc, EscGroup, Heartbeat, LandedState, Observation, Source, VehicleKind,
    VtolState,
};
use hums_core::params::Params;
use hums_core::units::{Amperes, Rpm, Volts};
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

fn minute(says: impl Fn(u64) -> Vec<Observation>) -> Run {
    let mut run = Run::new(&Params::defaults());
    run.says(0..60_000, says);
    run
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

/// A minute of flight of a vehicle of this kind that banks to 70 degrees and whose first motor turns half as fast.
fn banked(kind: VehicleKind, type_number: u8) -> Vec<&'static str> {
    let run = minute(|now_ms| {
        let mut vehicle = Quad { kind, type_number, ..Quad::healthy() };
        if (20_000..25_000).contains(&now_ms) {
            vehicle.roll = 1.2;
        }
        if let Some(esc) = vehicle.escs[0].as_mut() {
            esc.rpm = Some(Rpm(2_500.0));
        }
        vehicle.says(now_ms)
    });
    run.checks()
}

#[test]
fn what_is_a_fault_of_a_multicopter_is_none_of_a_plane_a_vtol_or_a_helicopter() {
    assert_eq!(banked(VehicleKind::Rotorcraft, 2), ["motor_imbalance", "roll"]);
    assert_eq!(banked(VehicleKind::Rotorcraft, 4), ["roll"], "a helicopter's tail turns at its own speed");
    for (kind, type_number) in [(VehicleKind::Plane, 1), (VehicleKind::Vtol, 22)] {
        assert!(banked(kind, type_number).is_empty(), "{kind:?}");
    }
}

/// Reports a restart at 29 s, armed or not, after a silence; whether that is an alarm.
fn restarted(armed: bool, silent_ms: u64) -> bool {
    let run = minute(|now_ms| {
        let height = if armed { 20.0 } else { 0.0 };
        let mut quad = Quad { armed: armed && now_ms < 30_000, height, ..Quad::healthy() };
        if now_ms >= 30_000 {
            quad.boot_offset_ms = -29_000;
        }
        quad.silent = (30_000 - silent_ms..30_000).contains(&now_ms);
        quad.says(now_ms)
    });
    assert_eq!(run.monitor.vehicle().reboots, 1);
    run.checks().contains(&"autopilot_reboot")
}

#[test]
fn an_autopilot_that_restarts_on_the_ground_is_counted_and_one_that_restarts_armed_is_an_alarm() {
    // Its state in a long silence is unknown: it may have landed.
    for (armed, silent_ms, is_alarm) in
        [(false, 0, false), (true, 0, true), (true, 5_000, true), (true, 15_000, false)]
    {
        assert_eq!(restarted(armed, silent_ms), is_alarm, "{armed} {silent_ms}");
    }
}

/// A VTOL that reports this state, with a fault from 20 to 25 s; the checks with findings.
fn checks_of_a_vtol(vtol: VtolState, wrong: impl Fn(&mut Quad)) -> Vec<&'static str> {
    let run = minute(|now_ms| {
        let kind = VehicleKind::Vtol;
        let landed = Some(if now_ms < 2_000 { LandedState::OnGround } else { LandedState::InAir });
        let mut vehicle = Quad { kind, type_number: 22, landed, vtol, mode: 10, ..Quad::healthy() };
        if (20_000..25_000).contains(&now_ms) {
            wrong(&mut vehicle);
        }
        vehicle.says(now_ms)
    });
    run.checks()
}

#[test]
fn a_vtol_that_hovers_is_judged_as_a_multicopter_and_on_its_wings_it_banks_and_its_lifting_motors_stop() {
    let stop = |vehicle: &mut Quad| vehicle.escs[1].as_mut().unwrap().current = Some(Amperes(0.0));
    for (vtol, banked, stopped) in [
        (VtolState::Hover, Some("roll"), Some("motor_loss")),
        (VtolState::Forward, None, None),
        (VtolState::Transition, None, None),
    ] {
        assert_eq!(checks_of_a_vtol(vtol, |vehicle| vehicle.roll = 1.2), Vec::from_iter(banked), "{vtol:?}");
        assert_eq!(checks_of_a_vtol(vtol, stop), Vec::from_iter(stopped), "{vtol:?}");
    }
    assert!(checks_of_a_vtol(VtolState::Unknown, |vehicle| vehicle.roll = 1.2).is_empty());
}

#[test]
fn a_hexacopter_with_one_dead_motor_has_one_motor_named() {
    for dead in 0..6 {
        let run = minute(|now_ms| {
            let mut hexa = Quad { type_number: 13, ..Quad::healthy() };
            let esc = hexa.escs[0].unwrap();
            // The others make up for it; the opposite one least.
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
    let run = minute(|now_ms| {
        let mut said = Quad::healthy().says(now_ms);
        match now_ms {
            20_000..24_500 => said.clear(),
            24_500..24_700 => said.retain(|said| !matches!(said, Observation::Escs(_))),
            _ => {}
        }
        said
    });
    assert_eq!(run.checks(), ["heartbeat"], "{:?}", run.findings);
}

#[test]
fn speeds_that_are_held_and_zeros_of_lost_telemetry_say_nothing_about_a_motor() {
    for silent in [true, false] {
        let run = minute(|now_ms| {
            let mut quad = Quad::healthy();
            // One motor is a little faster than the others, within the usual range.
            quad.escs[1].as_mut().unwrap().rpm = Some(Rpm(5_600.0));
            if now_ms >= 30_000 {
                for esc in &mut quad.escs {
                    if silent {
                        *esc = None;
                    } else if let Some(esc) = esc {
                        esc.rpm = Some(Rpm(0.0));
                    }
                }
            }
            quad.says(now_ms)
        });
        assert!(!run.checks().contains(&"motor_imbalance"), "{silent}: {:?}", run.findings);
    }
}

const CLASSES: [(VehicleKind, u8); 8] = [
    (VehicleKind::Rotorcraft, 2),
    (VehicleKind::Rotorcraft, 13),
    (VehicleKind::Rotorcraft, 4),
    (VehicleKind::Plane, 1),
    (VehicleKind::Vtol, 22),
    (VehicleKind::Surface, 10),
    (VehicleKind::Surface, 11),
    (VehicleKind::Surface, 12),
];

/// A minute and a half: disarmed for five seconds; armed and away, banked to 70 degrees for five seconds, the pack
/// empty at the end; disarmed. `says_landed`: `EXTENDED_SYS_STATE` is sent, which on PX4 calls an armed rover "in
/// air".
fn out_and_back(
    autopilot: Autopilot,
    (kind, type_number): (VehicleKind, u8),
    says_landed: bool,
    now_ms: u64,
) -> Quad {
    let (armed, out) = ((5_000..70_000).contains(&now_ms), (8_000..67_000).contains(&now_ms));
    let mode = match (autopilot, kind) {
        (Autopilot::Px4, _) => 0x0404_0000,
        (_, VehicleKind::Plane | VehicleKind::Vtol) => 10,
        _ => 3,
    };
    let mut vehicle = Quad { armed, mode, autopilot, kind, type_number, ..Quad::healthy() };
    vehicle.climb = 0.0;
    // A multicopter reports hover too, a plane nothing.
    vehicle.vtol = if kind == VehicleKind::Plane { VtolState::Unknown } else { VtolState::Hover };
    let state = if out { LandedState::InAir } else { LandedState::OnGround };
    vehicle.landed = says_landed.then_some(state);
    if !out {
        (vehicle.height, vehicle.throttle) = (0.0, 0.0);
    }
    vehicle.roll = if (20_000..25_000).contains(&now_ms) { 1.2 } else { 0.02 };
    let pack_v = if (30_000..70_000).contains(&now_ms) { 13.2 } else { 15.6 };
    vehicle.battery.voltage = Some(Volts(pack_v));
    vehicle.vibration.levels = [Some(0.1), Some(0.1), Some(1.0)];
    vehicle
}

#[test]
fn each_class_of_vehicle_flies_banks_and_is_protected_as_its_class_on_both_autopilots() {
    let mut params = Params::defaults();
    params.set("PROT_ACTION", 2.0).unwrap();
    let ways =
        [Autopilot::ArduPilot, Autopilot::Px4].map(|autopilot| [(autopilot, false), (autopilot, true)]);
    for (autopilot, says_landed) in ways.into_iter().flatten() {
        for class in CLASSES {
            let mut run = Run::new(&params);
            run.says(0..90_000, |now_ms| out_and_back(autopilot, class, says_landed, now_ms).says(now_ms));
            let of = format!("{autopilot:?} {class:?} {says_landed}");
            let flies = class.0 != VehicleKind::Surface;
            let counted = run.counts([UsageCounter::Flights, UsageCounter::Landings, UsageCounter::Mishaps]);
            assert_eq!(counted, [u32::from(flies), u32::from(flies), 0], "{of}");
            let hangs = class.0 == VehicleKind::Rotorcraft || (class.0 == VehicleKind::Vtol && says_landed);
            let expected: &[&str] = if hangs { &["cell_voltage", "roll"] } else { &["cell_voltage"] };
            assert_eq!(run.checks(), expected, "{of}");
            assert_eq!(!run.requests.is_empty(), flies, "{of}");
        }
    }
}
