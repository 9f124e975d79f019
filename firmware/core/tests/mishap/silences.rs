//! Mishaps and terminations during a silence of the link.

use super::*;

fn stands(quad: &mut Quad, motion: &mut Motion) {
    (quad.height, quad.climb, motion.ground_mps) = (0.1, 0.0, 0.0);
    motion.rates = [0.0; 3];
}

/// The same, disarmed.
fn has_landed(quad: &mut Quad, motion: &mut Motion) {
    stands(quad, motion);
    (quad.throttle, quad.armed, quad.landed) = (0.0, false, Some(LandedState::OnGround));
}

fn lies_over(motion: &mut Motion) {
    (motion.load_g, motion.drag_g) = (0.05, 1.0);
}

#[test]
fn a_silence_is_judged_by_what_comes_after_it() {
    type After = fn(&mut Quad, &mut Motion);
    let cases: [(&str, u64, &[&str], Counts, After); 9] = [
        ("it landed and is armed", 15_000, &[], LANDED, |quad, motion| {
            stands(quad, motion);
            (quad.throttle, quad.landed) = (0.0, Some(LandedState::OnGround));
        }),
        ("it landed and is disarmed", 15_000, &[], LANDED, has_landed),
        ("it flies on", 15_000, &[], FLIES, |_, _| ()),
        ("it climbs", 15_000, &[], ANY, |quad, _| {
            (quad.height, quad.climb, quad.throttle) = (12.0, 3.0, 1.0);
        }),
        ("it hovers lower with all its throttle", 15_000, &[], ANY, |quad, _| {
            (quad.height, quad.throttle) = (12.0, 1.0);
        }),
        ("it was terminated and lies over", 4_000, &["disarmed_in_air", ".."], DOWN, |quad, motion| {
            stands(quad, motion);
            lies_over(motion);
            (quad.state, quad.throttle) = (8, 0.0);
        }),
        ("it was terminated and stands", 12_000, &[], ANY, |quad, motion| {
            stands(quad, motion);
            (quad.state, quad.throttle, quad.landed) = (8, 0.0, Some(LandedState::OnGround));
        }),
        // It was 20 m above home and 4 m above a hill.
        ("home was set anew", 6_200, &[], LANDED, |quad, motion| {
            has_landed(quad, motion);
            motion.home_sank_m = -16.0;
        }),
        ("it had the time to land and was laid down", 12_000, &[], LANDED, |quad, motion| {
            has_landed(quad, motion);
            lies_over(motion);
            quad.roll = 1.6;
        }),
    ];
    for (what, silent_ms, told, counts, after) in cases {
        judge(rotors(), what, (told, counts), |ms, quad, motion| {
            motion.unheard = ms < silent_ms;
            if !motion.unheard {
                after(quad, motion);
            }
        });
    }
}

#[test]
fn a_landing_in_a_silence_is_a_landing() {
    // It came down, its battery was changed, and for a while only heartbeats come.
    judge(rotors(), "a landing", (&[], LANDED), |ms, quad, motion| {
        motion.unheard = (4_000..24_000).contains(&ms);
        motion.beats_only = (24_000..27_000).contains(&ms);
        if ms < 4_000 {
            (quad.climb, quad.height) = (-3.0, 20.0 - 0.003 * ms as f32);
        } else {
            has_landed(quad, motion);
        }
    });
}

#[test]
fn streams_that_come_back_late_are_waited_for() {
    judge(rotors(), "killed after a landing", (&[], ANY), |ms, quad, motion| {
        (motion.unheard, motion.beats_only) = (ms < 12_000, true);
        if !motion.unheard {
            has_landed(quad, motion);
            (quad.armed, quad.state) = (true, 8);
        }
    });
    let plane = hovering((Autopilot::ArduPilot, VehicleKind::Plane, 1));
    judge([plane], "a plane lands as ever", (&[], LANDED), |ms, quad, motion| {
        (motion.unheard, motion.beats_only, motion.ground_mps) = (ms < 6_000, ms < 8_000, 18.0);
        if ms > 20_000 {
            has_landed(quad, motion);
        }
    });
}

#[test]
fn a_vehicle_that_was_off_before_it_was_received_is_not_judged() {
    // Terminated in the air or on its side; disarmed, and then it hits the ground or is knocked about on its back.
    let terminated = || rotors().map(|quad| Quad { state: 8, throttle: 0.0, start_height: 20.0, ..quad });
    let disarmed = || rotors().map(|quad| Quad { armed: false, throttle: 0.0, ..quad });
    judge(terminated(), "it sinks", (&[], (0, 0, 0)), |_, quad, motion| {
        (quad.climb, motion.rates) = (-4.0, [2.0, 0.0, 0.0]);
    });
    judge(terminated(), "it lies", (&[], (0, 0, 0)), |_, quad, motion| {
        stands(quad, motion);
        lies_over(motion);
    });
    judge_from(0, disarmed(), "it hits the ground", (&[], (0, 0, 0)), |ms, quad, motion| {
        (quad.climb, quad.height) = if ms < 900 { (-9.0, 8.0 - 0.009 * ms as f32) } else { (0.0, 0.0) };
        motion.load_g = if (900..1_000).contains(&ms) { 12.0 } else { 1.0 };
    });
    judge_from(0, disarmed(), "it is knocked about on its back", (&[], (0, 0, 0)), |ms, quad, motion| {
        (quad.start_height, quad.height) = (0.0, 0.0);
        motion.load_g = if (1_000..1_050).contains(&ms) { 5.0 } else { -1.0 };
    });
}

#[test]
fn what_is_terminated_in_the_air_and_neither_stands_nor_falls_at_once_is_a_mishap() {
    for of in ROTORS {
        // Its motors run on for a while; it reports armed and in the air to the end.
        let drifts = fly(&hovering(of), |ms, quad, motion| {
            (quad.state, motion.ground_mps) = (8, 4.0);
            if ms > 7_000 {
                stands(quad, motion);
                lies_over(motion);
            }
        });
        assert_eq!((drifts.told().first(), drifts.flights()), (Some(&"disarmed_in_air"), DOWN), "{of:?}");
        let at_ms = drifts.changes.first().map(|(at_ms, _)| *at_ms);
        assert!(at_ms.is_some_and(|at_ms| at_ms < AT_MS + 4_500), "{of:?}: {at_ms:?}");
    }
}
