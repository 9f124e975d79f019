//! Tumbling and turning over.

use super::*;

#[test]
fn tumbling_is_told_by_body_rates_and_a_vehicle_that_recovers_has_one_flight() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, _, motion| {
            if ms < 1_500 {
                motion.rates = [15.0, 2.0, 0.0];
            }
        });
        assert_eq!(outcome.told(), ["tumbling"], "{of:?}");
        let [(began_ms, Change::Began(Kind::Tumbling)), (over_ms, Change::FliesOn)] = outcome.changes[..]
        else {
            panic!("{of:?}: {:?}", outcome.changes)
        };
        assert!(
            began_ms <= AT_MS + 700 && (AT_MS + 6_000..AT_MS + 7_000).contains(&over_ms),
            "{began_ms} {over_ms}"
        );
        assert_eq!(outcome.flights(), (1, 0, 0), "{of:?}: the flight goes on");
        let last = outcome.findings.last().unwrap();
        assert_eq!((last.check, last.level), ("tumbling", Level::Ok));
    }
    let pilots = [
        (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 2, 1),
        (Autopilot::Px4, VehicleKind::Rotorcraft, 2, 0x0005_0000),
        (Autopilot::ArduPilot, VehicleKind::Plane, 1, 4),
    ];
    for (autopilot, kind, type_number, mode) in pilots {
        let acro = Quad { mode, ..hovering((autopilot, kind, type_number)) };
        let outcome = fly(&acro, |ms, _, motion| {
            if ms < 3_000 {
                motion.rates = [8.0, 0.0, 0.0];
            }
        });
        assert!(outcome.told().is_empty(), "{autopilot:?} {kind:?}: acro is what the pilot wants");
    }
}

#[test]
fn a_plane_rolls_and_dives_as_it_likes_and_a_spin_is_told() {
    for of in WINGS {
        let roll = fly(&on_wings(of), |ms, quad, motion| {
            motion.ground_mps = 18.0;
            if ms < 1_000 {
                (motion.rates, quad.climb, motion.load_g) = ([6.5, 0.0, 0.0], -12.0, 0.1);
            }
        });
        assert!(roll.told().is_empty(), "{of:?}: {:?}", roll.findings);
        let spin = fly(&on_wings(of), |ms, _, motion| {
            motion.ground_mps = 18.0;
            if ms < 4_000 {
                motion.rates = [6.5, 1.0, 3.0];
            }
        });
        assert_eq!(spin.told(), ["tumbling"], "{of:?}");
    }
}

#[test]
fn on_the_bench_it_is_an_event_for_each_arming_and_not_told() {
    let bench =
        Quad { height: 0.0, landed: Some(LandedState::OnGround), throttle: 0.0, ..hovering(ROTORS[0]) };
    let outcome = fly(&bench, |ms, _, motion| {
        if ms % 5_000 < 2_000 {
            motion.rates = [9.0, 0.0, 0.0];
        }
    });
    assert!(outcome.told().is_empty(), "{:?}", outcome.findings);
    assert!(matches!(outcome.changes[..], [(_, Change::OnBench(Kind::Tumbling))]), "{:?}", outcome.changes);
    let disarmed = Quad { armed: false, ..bench };
    assert!(fly(&disarmed, fall).changes.is_empty(), "nobody watches what is carried about");
}

#[test]
fn a_multicopter_whose_top_looks_down_is_told_but_not_in_modes_made_for_it() {
    let overturned: Script = |ms, quad, motion| {
        if ms < 1_500 {
            (quad.roll, motion.rates) = (2.5, [3.0, 0.5, 0.0]);
        }
    };
    for of in ROTORS {
        let outcome = fly(&hovering(of), overturned);
        assert_eq!(outcome.told(), ["overturned"], "{of:?}");
        let finding = outcome.findings.iter().find(|finding| finding.check == "overturned").unwrap();
        assert!((finding.value - 143.2).abs() < 1.0, "{finding:?}: its tilt");
        let mode = if of.0 == Autopilot::Px4 { 0x0005_0000 } else { 1 };
        let kind = of.1;
        if kind == VehicleKind::Rotorcraft {
            assert!(fly(&Quad { mode, ..hovering(of) }, overturned).told().is_empty(), "{of:?}");
        }
    }
    for of in WINGS {
        assert!(fly(&on_wings(of), overturned).told().is_empty(), "{of:?}: a roll");
    }
}

/// Stands level and still, and its estimator turns over by 7 degrees a second.
fn drifts(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    let drifted = 0.122 * ms as f32 / 1_000.0;
    (quad.roll, motion.rates) = (drifted % core::f32::consts::PI, [0.122, 0.02, 0.0]);
}

#[test]
fn an_attitude_that_the_sensors_contradict_is_none() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), drifts);
        let attitude: Vec<_> =
            outcome.findings.iter().filter(|of| matches!(of.check, "roll" | "pitch")).collect();
        assert!(outcome.told().is_empty() && attitude.is_empty(), "{of:?}: {:?}", outcome.findings);
    }
}

/// Armed on the ground with throttle; its motors turn it over by its side in half a second, and it lies there.
fn flips(quad: &mut Quad, motion: &mut Motion, ms: u64, throttle: f32) {
    (quad.throttle, quad.height) = (if ms < 1_500 { throttle } else { 0.0 }, 0.0);
    quad.armed = ms < 4_000;
    if ms < 500 {
        (quad.roll, motion.rates) = (2.0 * ms as f32 / 500.0, [4.5, 0.0, 0.0]);
    } else {
        // What the estimator makes of it is another thing.
        (quad.roll, motion.rates, motion.load_g) = (0.3, [0.0; 3], -0.9);
    }
}

#[test]
fn what_its_own_rotors_turn_over_is_told_though_it_never_flew_and_what_a_hand_turns_over_is_not() {
    let stands =
        |of| Quad { landed: Some(LandedState::OnGround), height: 0.0, throttle: 0.0, ..hovering(of) };
    for of in ROTORS {
        let outcome = fly(&stands(of), |ms, quad, motion| flips(quad, motion, ms, 0.4));
        assert_eq!(outcome.told(), ["overturned"], "{of:?}: {:?}", outcome.changes);
        assert!(matches!(outcome.changes[..], [(_, Change::Began(_)), (_, Change::Down)]), "{of:?}");
        assert_eq!(outcome.flights(), (0, 0, 0), "{of:?}: it never flew");
        let by_hand = fly(&stands(of), |ms, quad, motion| flips(quad, motion, ms, 0.0));
        assert!(by_hand.told().is_empty(), "{of:?}: {:?}", by_hand.findings);
    }
}

#[test]
fn what_turns_over_after_each_arming_is_told_each_time() {
    let stands =
        Quad { landed: Some(LandedState::OnGround), height: 0.0, throttle: 0.0, ..hovering(ROTORS[0]) };
    let outcome = fly(&stands, |ms, quad, motion| match ms % 13_000 {
        since @ ..6_000 => flips(quad, motion, since, 0.4),
        // Stood up again, armed again.
        since => (quad.armed, quad.throttle, quad.height) = (since > 8_000, 0.0, 0.0),
    });
    assert_eq!(outcome.told(), ["overturned"; 3], "{:?}", outcome.changes);
}

/// Banks and then flies on, or is stopped, with what the air or the ground carries it with from ahead.
fn is_carried_from_ahead(ms: u64, quad: &mut Quad, motion: &mut Motion, ground_mps: f32) {
    (quad.height, quad.throttle, motion.ground_mps) = (40.0, 0.5, ground_mps);
    match ms {
        ..500 => motion.rates = [0.0, 2.0, 0.0],
        500..4_000 => (motion.load_g, motion.drag_g, motion.pitch) = (0.4, 0.9, -1.1),
        _ => {}
    }
}

#[test]
fn what_flies_fast_is_carried_by_the_air_too_and_does_not_lie_over() {
    for of in ROTORS {
        let lies = fly(&hovering(of), |ms, quad, motion| is_carried_from_ahead(ms, quad, motion, 1.0));
        assert!(lies.told().contains(&"overturned"), "{of:?}: {:?}", lies.changes);
        let flies = fly(&hovering(of), |ms, quad, motion| is_carried_from_ahead(ms, quad, motion, 30.0));
        assert!(flies.told().is_empty(), "{of:?}: {:?}", flies.changes);
    }
}
