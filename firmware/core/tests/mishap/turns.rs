//! Tumbling and turning over.

use super::*;

fn turns(rates: [f32; 3], lasts_ms: u64) -> impl Fn(u64, &mut Quad, &mut Motion) {
    move |ms, _, motion| motion.rates = if ms < lasts_ms { rates } else { CALM.rates }
}

#[test]
fn tumbling_is_told_by_body_rates_and_a_vehicle_that_recovers_has_one_flight() {
    judge(rotors(), "tumbles", (&["tumbling"], FLIES), turns([15.0, 2.0, 0.0], 1_500));
    let outcome = fly(&hovering(ROTORS[0]), turns([15.0, 2.0, 0.0], 1_500));
    let [(began_ms, MishapChange::Began(MishapKind::Tumbling)), (over_ms, MishapChange::FliesOn)] =
        outcome.changes[..]
    else {
        panic!("{:?}", outcome.changes)
    };
    assert!(began_ms <= AT_MS + 700 && (AT_MS + 6_000..AT_MS + 7_000).contains(&over_ms), "{over_ms}");
    let last = outcome.findings.last().unwrap();
    assert_eq!((last.check, last.level), ("tumbling", Level::Ok));
    // In acro modes the pilot asks for it.
    let acro = [(ROTORS[0], 1), (ROTORS[1], 0x0005_0000), (WINGS[0], 4)];
    let acro = acro.map(|(of, mode)| Quad { mode, ..hovering(of) });
    judge(acro, "acro", (&[], FLIES), turns([8.0, 0.0, 0.0], 3_000));
}

#[test]
fn a_plane_rolls_and_dives_as_it_likes_and_a_spin_is_told() {
    judge(wings(), "a roll", (&[], FLIES), |ms, quad, motion| {
        motion.ground_mps = 18.0;
        if ms < 1_000 {
            (motion.rates, quad.climb, motion.load_g) = ([6.5, 0.0, 0.0], -12.0, 0.1);
        }
    });
    judge(wings(), "a spin", (&["tumbling"], FLIES), |ms, quad, motion| {
        motion.ground_mps = 18.0;
        turns([6.5, 1.0, 3.0], 4_000)(ms, quad, motion);
    });
}

fn on_ground(of: Of) -> Quad {
    Quad { landed: Some(LandedState::OnGround), height: 0.0, throttle: 0.0, ..hovering(of) }
}

#[test]
fn on_the_bench_it_is_an_event_for_each_arming_and_not_told() {
    let outcome = fly(&on_ground(ROTORS[0]), |ms, _, motion| {
        if ms % 5_000 < 2_000 {
            motion.rates = [9.0, 0.0, 0.0];
        }
    });
    assert!(outcome.told().is_empty(), "{:?}", outcome.findings);
    assert!(
        matches!(outcome.changes[..], [(_, MishapChange::OnBench(MishapKind::Tumbling))]),
        "{:?}",
        outcome.changes
    );
    let disarmed = Quad { armed: false, ..on_ground(ROTORS[0]) };
    assert!(fly(&disarmed, fall).changes.is_empty(), "nobody watches what is carried about");
}

#[test]
fn a_multicopter_whose_top_looks_down_is_told_but_not_in_modes_made_for_it() {
    let overturned: Script = |ms, quad, motion| {
        if ms < 1_500 {
            (quad.roll, motion.rates) = (2.5, [3.0, 0.5, 0.0]);
        }
    };
    judge(rotors(), "overturned", (&["overturned"], FLIES), overturned);
    judge(wings(), "a roll", (&[], FLIES), overturned);
    let acro = |quad: &Quad| if quad.autopilot == Autopilot::Px4 { 0x0005_0000 } else { 1 };
    let in_acro = rotors().filter(|quad| quad.kind == VehicleKind::Rotorcraft);
    judge(in_acro.map(|quad| Quad { mode: acro(&quad), ..quad }), "acro", (&[], FLIES), overturned);
    let outcome = fly(&hovering(ROTORS[0]), overturned);
    let finding = outcome.findings.iter().find(|finding| finding.check == "overturned").unwrap();
    assert!((finding.value - 143.2).abs() < 1.0, "{finding:?}: its tilt");
}

#[test]
fn an_attitude_that_the_sensors_contradict_is_none() {
    for of in ROTORS {
        // It is level and still, and its estimator turns over by 7 degrees a second.
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            let drifted = 0.122 * ms as f32 / 1_000.0;
            (quad.roll, motion.rates) = (drifted % core::f32::consts::PI, [0.122, 0.02, 0.0]);
        });
        let mut attitude = outcome.findings.iter().filter(|of| matches!(of.check, "roll" | "pitch"));
        assert!(outcome.told().is_empty() && attitude.next().is_none(), "{of:?}: {:?}", outcome.findings);
    }
}

/// Armed on the ground with throttle; its motors turn it over by its side in half a second, and it lies there.
fn flips(quad: &mut Quad, motion: &mut Motion, ms: u64, throttle: f32) {
    (quad.throttle, quad.height) = (if ms < 1_500 { throttle } else { 0.0 }, 0.0);
    quad.armed = ms < 4_000;
    if ms < 500 {
        (quad.roll, motion.rates) = (2.0 * ms as f32 / 500.0, [4.5, 0.0, 0.0]);
    } else {
        // The estimator disagrees.
        (quad.roll, motion.rates, motion.load_g) = (0.3, [0.0; 3], -0.9);
    }
}

#[test]
fn what_its_own_rotors_turn_over_is_told_though_it_never_flew_and_what_a_hand_turns_over_is_not() {
    let none = (0, 0, 0);
    judge(ROTORS.map(on_ground), "its rotors", (&["overturned"], none), |ms, quad, motion| {
        flips(quad, motion, ms, 0.4);
    });
    judge(ROTORS.map(on_ground), "a hand", (&[], none), |ms, quad, motion| flips(quad, motion, ms, 0.0));
    let each_arming: Come<'_> = (&["overturned"; 3], none);
    judge([on_ground(ROTORS[0])], "each arming", each_arming, |ms, quad, motion| match ms % 13_000 {
        since @ ..6_000 => flips(quad, motion, since, 0.4),
        since => (quad.armed, quad.throttle, quad.height) = (since > 8_000, 0.0, 0.0),
    });
}

#[test]
fn what_flies_fast_is_carried_by_the_air_too_and_does_not_lie_over() {
    // It banks and then flies on, or is stopped, under a force from ahead by the air or the ground.
    let is_carried_from_ahead = |ground_mps: f32| {
        move |ms: u64, quad: &mut Quad, motion: &mut Motion| {
            (quad.height, quad.throttle, motion.ground_mps) = (40.0, 0.5, ground_mps);
            match ms {
                ..500 => motion.rates = [0.0, 2.0, 0.0],
                500..4_000 => (motion.load_g, motion.drag_g, motion.pitch) = (0.4, 0.9, -1.1),
                _ => {}
            }
        }
    };
    for of in ROTORS {
        let lies = fly(&hovering(of), is_carried_from_ahead(1.0));
        assert!(lies.told().contains(&"overturned"), "{of:?}: {:?}", lies.changes);
    }
    judge(rotors(), "fast", (&[], FLIES), is_carried_from_ahead(30.0));
}
