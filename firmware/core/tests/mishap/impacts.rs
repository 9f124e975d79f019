//! Impacts, landings and wrecks.

use super::*;

#[test]
fn a_quad_that_lies_on_its_back_has_crashed_whatever_its_estimator_says() {
    let acro = Quad { mode: 1, landed: None, ..hovering(ROTORS[0]) };
    let outcome = fly(&acro, |ms, quad, motion| {
        if ms < 1_000 {
            (motion.load_g, motion.rates) = (5.0, [12.0, 3.0, 0.0]);
        } else {
            // The estimator falls on; the throttle stick stays.
            (motion.load_g, motion.rates, quad.climb) = (-1.0, [0.0; 3], -12.0);
            (quad.height, quad.throttle) = (3.0 - ms as f32 / 100.0, 0.4);
        }
    });
    assert_eq!(outcome.told(), ["impact", "overturned"]);
    assert_eq!(outcome.flights(), (1, 0, 1), "{:?}", outcome.changes);
}

fn turns_over(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    if (1_000..3_000).contains(&ms) {
        (quad.roll, motion.rates) = (2.5, [3.0, 0.5, 0.0]);
    }
}

#[test]
fn what_turns_over_after_a_shock_hit_something_first_with_its_greatest_shock() {
    for of in ROTORS {
        assert_eq!(fly(&hovering(of), turns_over).told(), ["overturned"], "{of:?}");
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            turns_over(ms, quad, motion);
            motion.load_g = match ms {
                0..100 => 11.0,
                1_400..1_500 => 4.0,
                _ => 1.0,
            };
        });
        let told = |check: &str| outcome.findings.iter().find(|finding| finding.check == check).copied();
        let (impact, over) = (told("impact").expect("hit"), told("overturned").expect("over"));
        assert!((impact.value - 11.0).abs() < 0.1, "{of:?}: {impact:?}");
        assert_eq!(impact.at, over.at, "{of:?}");
    }
}

#[test]
fn an_impact_is_a_shock_a_speed_that_breaks_off_and_then_stillness() {
    let crash: Script = |ms, quad, motion| {
        (motion.ground_mps, quad.climb) = (18.0, -3.0);
        if ms >= 1_000 {
            quad.climb = 0.0;
            motion.load_g = if ms < 1_100 { 8.0 } else { 1.0 };
            (motion.ground_mps, quad.throttle, quad.height, motion.rates) = (0.0, 0.0, 0.5, [0.0; 3]);
        }
    };
    judge(wings(), "it flies into the ground", (&["impact"], DOWN), crash);
    assert_eq!(fly(&on_wings(WINGS[0]), crash).reports[0].touch, 30, "as it sank before the shock");
    judge(rotors(), "a shock alone: a gust, a bird, a hard manoeuvre", (&[], FLIES), |ms, _, motion| {
        motion.load_g = if ms < 100 { 6.0 } else { 1.0 };
    });
    judge(rotors(), "disarmed before it lies still", (&["impact"], DOWN), |ms, quad, motion| {
        let hits = 3_300;
        if ms < hits {
            (quad.climb, quad.height) = (-6.0, 20.0 - 0.006 * ms as f32);
        } else {
            (quad.climb, quad.height, motion.ground_mps) = (0.0, 0.3, 0.0);
            motion.load_g = if ms < hits + 100 { 10.0 } else { 1.0 };
            let still = ms >= hits + 2_600;
            motion.rates = if still { [0.0; 3] } else { [0.5, 0.0, 0.0] };
            let off = ms >= hits + 2_000;
            (quad.armed, quad.throttle) = (!off, if off { 0.0 } else { 0.4 });
        }
    });
}

#[test]
fn a_landing_is_none_however_hard() {
    let hard: Script = |ms, quad, motion| {
        let touches = 9_600;
        if ms < touches {
            (quad.climb, quad.height) = (-2.0, 20.0 - ms as f32 / 500.0);
        } else {
            (quad.climb, quad.height, quad.throttle) = (0.0, 0.8, 0.0);
            motion.load_g = if ms < touches + 100 { 4.0 } else { 1.0 };
            quad.landed = Some(if ms < touches + 1_000 { LandedState::InAir } else { LandedState::OnGround });
            quad.armed = ms < touches + 3_000;
        }
    };
    judge(rotors(), "a hard landing", (&[], LANDED), hard);
    assert_eq!(fly(&hovering(ROTORS[0]), hard).count(UsageCounter::HardLandings), 1);
    judge(
        rotors(),
        "a landing that legs take, though it moves sideways",
        (&[], LANDED),
        |ms, quad, motion| {
            let touches = 7_800;
            if ms < touches {
                motion.ground_mps = 3.3;
                (quad.climb, quad.height) = (-2.5, 20.0 - ms as f32 / 400.0);
            } else {
                (quad.climb, quad.height, quad.throttle) = (0.0, 0.2, 0.0);
                (motion.ground_mps, motion.rates) = (0.0, [0.0; 3]);
                motion.load_g = if ms < touches + 100 { 3.8 } else { 1.0 };
            }
        },
    );
    judge(rotors(), "a jolt, shaking, and a landing", (&[], LANDED), |ms, quad, motion| {
        motion.ground_mps = if ms < 500 { 4.0 } else { 1.0 };
        let jolts = (500..31_000).contains(&ms) && ms % 2_000 < 50;
        motion.load_g = if jolts { 4.2 } else { 1.0 };
        if ms >= 30_000 {
            (quad.height, quad.throttle, quad.climb) = (0.1, 0.0, 0.0);
            (motion.ground_mps, motion.rates) = (0.0, [0.0; 3]);
            quad.landed = Some(LandedState::OnGround);
            quad.armed = ms < 33_000;
        }
    });
}

fn skids(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    let slid = ms as f32 / 1_000.0;
    motion.ground_mps = if ms < 2_000 { 11.5 } else { (11.5 - 8.0 * (slid - 2.0)).max(0.0) };
    (quad.climb, quad.height) = if ms < 2_000 { (-0.4, 0.8 - 0.4 * slid) } else { (0.0, 0.0) };
    motion.load_g = if (2_000..2_100).contains(&ms) { 10.8 } else { 1.0 };
    motion.rates = if ms < 3_500 { CALM.rates } else { [0.0; 3] };
    quad.throttle = 0.05;
}

#[test]
fn a_plane_that_lands_without_throttle_skids_and_one_that_flies_into_a_wall_does_not() {
    judge(wings(), "it skids", (&[], ANY), skids);
    judge(wings(), "it has throttle", (&["impact"], ANY), |ms, quad, motion| {
        skids(ms, quad, motion);
        quad.throttle = 0.6;
        if ms >= 3_600 {
            quad.landed = Some(LandedState::OnGround);
        }
    });
    for (ground_mps, told) in [(20.0, &["impact"][..]), (12.0, &[])] {
        judge(wings(), "it stops", (told, ANY), |ms, quad, motion| {
            (motion.ground_mps, quad.throttle) = (ground_mps, 0.0);
            if ms >= 1_000 {
                motion.load_g = if ms < 1_100 { 6.0 } else { 1.0 };
                (motion.ground_mps, quad.height, motion.rates) = (0.0, 0.5, [0.0; 3]);
            }
        });
    }
}

#[test]
fn a_wreck_is_down_whatever_it_does_and_flies_again_where_it_hovers() {
    judge(rotors(), "carried home armed", (&["free_fall", ".."], DOWN), |ms, quad, motion| {
        fall(ms, quad, motion);
        if ms >= 8_000 {
            (motion.ground_mps, motion.rates, quad.height) = (3.0, [0.4, 0.5, 0.2], 1.5);
        }
    });
    judge(rotors(), "it dances with all its thrust", (&["sinking"], DOWN), |ms, quad, motion| {
        quad.throttle = 1.0;
        if ms < 2_500 {
            (quad.climb, quad.height) = (-8.0, 20.0 - ms as f32 / 125.0);
        } else {
            (quad.climb, quad.height, motion.ground_mps) = (0.3, 0.6, 0.5);
            motion.rates = [0.5, 0.3, 2.5];
        }
    });
    judge(rotors(), "it hovers later", (&["free_fall", ".."], (2, 0, 1)), |ms, quad, motion| {
        fall(ms, quad, motion);
        if ms >= 20_000 {
            (quad.climb, quad.height, quad.throttle) = (0.0, 12.0, 0.5);
            (motion.ground_mps, motion.load_g, motion.rates) = (0.1, 1.0, CALM.rates);
        }
    });
}

fn drop_low(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    if ms < 450 {
        (motion.load_g, quad.height, quad.climb) = (0.4, 0.7, -2.0);
    } else {
        // Armed still, with the throttle of idling rotors; the estimator sinks on.
        (motion.rates, quad.height, quad.climb, quad.throttle) = ([0.0; 3], 0.0, -1.5, 0.2);
    }
}

#[test]
fn a_shock_between_two_samples_of_what_fell_is_an_impact_at_its_own_time() {
    let outcome = fly(&hovering(ROTORS[0]), |ms, quad, motion| {
        drop_low(ms, quad, motion);
        motion.shock_g = (ms == 450).then_some(17.0);
    });
    let impact = outcome.findings.iter().find(|finding| finding.check == "impact").expect("hit");
    assert!((impact.value - 17.0).abs() < 0.1, "{impact:?}");
    assert_eq!(outcome.monitor.flight().hit_at(), BootMs::from_millis(AT_MS + 450));
    assert_eq!(fly(&hovering(ROTORS[0]), drop_low).told(), [""; 0]);
}

fn hits_and_runs_on(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    let seconds = ms as f32 / 1_000.0;
    quad.throttle = if ms < 5_000 { 0.95 } else { 0.5 };
    if ms < 5_000 {
        (quad.climb, quad.height) = (-12.0, 60.0 - 12.0 * seconds);
    } else {
        (quad.climb, quad.height) = (0.0, 0.0);
        motion.load_g = if ms < 5_100 { 15.0 } else { 1.4 };
        motion.rates = [1.5, 0.7, 0.4];
    }
}

#[test]
fn what_lies_over_with_running_motors_never_flies_on() {
    for of in &ROTORS[..4] {
        // On its side, and by turns on its back.
        let outcome = fly(&hovering(*of), |ms, quad, motion| {
            hits_and_runs_on(ms, quad, motion);
            if ms >= 5_000 {
                (quad.roll, motion.ground_mps) = (if ms % 6_000 < 1_500 { 2.4 } else { 1.3 }, 3.0);
            }
        });
        assert!(outcome.told().starts_with(&["sinking", "impact"]), "{of:?}: {:?}", outcome.told());
        let is_over = outcome
            .changes
            .iter()
            .any(|(_, change)| matches!(change, MishapChange::FliesOn | MishapChange::FliesAgain));
        assert!(!is_over, "{of:?}: {:?}", outcome.changes);
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}: {:?}", outcome.changes);
        let upright = fly(&hovering(*of), hits_and_runs_on);
        assert_eq!(upright.flights(), (1, 0, 1), "{of:?}: {:?}", upright.changes);
    }
}

/// After a fall its estimate moves on while the receiver, if it sends a speed, stands.
fn strays(ms: u64, quad: &mut Quad, motion: &mut Motion, receiver_mps: Option<f32>) {
    hits_and_runs_on(ms, quad, motion);
    if ms >= 5_000 {
        (quad.height, motion.ground_mps) = (4.0 + 0.1 * (ms as f32 / 1_000.0), 3.5);
        (quad.climb, motion.load_g) = (0.2, if ms < 5_100 { 15.0 } else { 1.0 });
    }
    quad.gnss.speed = receiver_mps.map(MetresPerSecond);
    motion.pressure_hpa =
        Some(955.0 + 0.12 * (ms as f32 / 1_000.0).min(5.0) * 12.0 + (ms % 300) as f32 * 1e-5);
}

#[test]
fn what_an_estimate_moves_and_the_receiver_does_not_never_flies_on() {
    let moves = |outcome: &Outcome| {
        outcome
            .changes
            .iter()
            .any(|(_, change)| matches!(change, MishapChange::FliesOn | MishapChange::FliesAgain))
    };
    for of in &ROTORS[..2] {
        let rests = fly(&hovering(*of), |ms, quad, motion| strays(ms, quad, motion, Some(0.1)));
        assert!(!moves(&rests), "{of:?}: {:?}", rests.changes);
        assert_eq!(rests.flights(), (1, 0, 1), "{of:?}: {:?}", rests.changes);
        let flies = fly(&hovering(*of), |ms, quad, motion| strays(ms, quad, motion, Some(3.4)));
        assert!(moves(&flies), "{of:?}: {:?}", flies.changes);
    }
}

#[test]
fn what_is_disarmed_is_not_to_be_disarmed() {
    for armed in [true, false] {
        let script: Script = if armed {
            fall
        } else {
            |ms, quad, motion| {
                fall(ms, quad, motion);
                quad.armed = false;
            }
        };
        let outcome = fly(&hovering(ROTORS[0]), script);
        let impact = outcome.findings.iter().find(|one| one.check == "impact").expect("hit");
        assert_eq!(impact.orders, if armed { Orders::Own } else { Orders::Nothing });
    }
}

#[test]
fn what_a_mishap_was_is_no_value_of_now() {
    let outcome = fly(&hovering(ROTORS[0]), |ms, quad, motion| {
        fall(ms, quad, motion);
        quad.armed = ms < 10_000;
    });
    let over =
        outcome.findings.iter().filter(|one| one.subsystem == Subsystem::Mishap && one.level == Level::Ok);
    assert!(over.clone().all(Finding::is_unjudged), "{:?}", over.collect::<Vec<_>>());
}

#[test]
fn a_second_shock_does_not_hide_the_first() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            if ms < 500 {
                motion.ground_mps = 15.0;
            } else {
                (motion.ground_mps, quad.throttle, quad.height) = (0.2, 0.4, 0.3);
                motion.load_g = match ms {
                    500..600 => 6.0,
                    1_800..1_900 => 4.5,
                    _ => 1.0,
                };
                motion.rates = if ms < 2_000 { [0.5, 0.0, 0.0] } else { [0.0; 3] };
                quad.throttle = if ms < 2_000 { 0.4 } else { 0.0 };
            }
        });
        assert_eq!(outcome.told(), ["impact"], "{of:?}: {:?}", outcome.changes);
        assert_eq!(outcome.monitor.flight().hit_at(), BootMs::from_millis(AT_MS + 500), "{of:?}");
    }
}

/// Upright on the ground, with a throttle far below hover throttle, while its estimate climbs away.
fn stands_with_a_lost_estimate(ms: u64, quad: &mut Quad, motion: &mut Motion, throttle: f32) {
    let seconds = ms as f32 / 1_000.0;
    (quad.throttle, quad.height, quad.climb) = (throttle, 20.0 + 3.0 * seconds, 3.0);
    (motion.ground_mps, motion.rates) = (4.0, [0.0; 3]);
    motion.pressure_hpa = Some(955.0 + (ms / 50 % 3) as f32 * 0.01);
}

#[test]
fn what_stands_with_little_throttle_flies_no_more_whatever_its_estimate_says() {
    for of in ROTORS {
        let is_multicopter = matches!(of.2, 2 | 13);
        let stands =
            fly(&hovering(of), |ms, quad, motion| stands_with_a_lost_estimate(ms, quad, motion, 0.12));
        assert!(stands.told().is_empty(), "{of:?}: {:?}", stands.told());
        assert_eq!(stands.flights(), (1, u32::from(is_multicopter), 0), "{of:?}");
        // It came down at 7 m/s for five seconds.
        let flew_into_it = fly(&hovering(of), |ms, quad, motion| {
            stands_with_a_lost_estimate(ms, quad, motion, 0.12);
            let falls_m = 0.007 * ms.min(5_000) as f32;
            motion.load_g = 1.4;
            motion.pressure_hpa = motion.pressure_hpa.map(|hpa| hpa + 0.12 * falls_m);
        });
        let told = if is_multicopter { vec!["impact"] } else { Vec::new() };
        assert_eq!(
            (flew_into_it.told(), flew_into_it.flights().2),
            (told, u32::from(is_multicopter)),
            "{of:?}"
        );
        let hovers =
            fly(&hovering(of), |ms, quad, motion| stands_with_a_lost_estimate(ms, quad, motion, 0.3));
        assert_eq!(hovers.flights(), (1, 0, 0), "{of:?}");
    }
}

fn is_knocked(ms: u64, motion: &mut Motion, knock_g: f32) {
    if ms < 800 {
        (motion.load_g, motion.rates) = (knock_g, [6.2, 0.0, 0.0]);
    }
}

#[test]
fn what_holds_its_place_in_the_air_after_a_knock_flies_on() {
    for (height, throttle) in [(3.0, 0.45), (20.0, 0.45), (20.0, 0.25), (300.0, 0.7), (-25.0, 0.45)] {
        for knock_g in [3.5, 5.0, 9.0] {
            // Only its autopilot notices that it leaves the ground downwards.
            let words = [Some(LandedState::InAir), None];
            for landed in words.into_iter().take(if height > 0.0 { 2 } else { 1 }) {
                let quad = Quad { height, throttle, climb: 0.0, landed, ..Quad::healthy() };
                let outcome = fly(&quad, |ms, quad, motion| {
                    // The autopilot is wrong once.
                    if landed.is_some() && (10_000..10_500).contains(&ms) {
                        quad.landed = Some(LandedState::OnGround);
                    }
                    is_knocked(ms, motion, knock_g);
                });
                let what = (height, throttle, knock_g, landed, &outcome.changes);
                assert_eq!(outcome.flights(), (1, 0, 0), "{what:?}");
                assert!(matches!(outcome.changes.last(), Some((_, MishapChange::FliesOn))), "{what:?}");
                assert!(outcome.monitor.flight().airborne(), "{what:?}");
            }
        }
    }
}

#[test]
fn a_silence_after_a_knock_ends_no_flight_of_what_hangs_in_the_air() {
    let quad = Quad { climb: 0.0, ..Quad::healthy() };
    let outcome = fly(&quad, |ms, _, motion| {
        is_knocked(ms, motion, 5.0);
        motion.unheard = (1_000..9_000).contains(&ms);
    });
    assert!(
        matches!(outcome.changes.last(), Some((_, MishapChange::FliesOn | MishapChange::FliesAgain))),
        "{:?}",
        outcome.changes
    );
    assert!(outcome.monitor.flight().airborne());
}

#[test]
fn little_throttle_alone_is_no_landing() {
    for height in [3.0, 7.0, 20.0, 300.0, -25.0] {
        for throttle in [0.04, 0.07, 0.09, 0.12, 0.19] {
            for (autopilot, type_number) in [(Autopilot::ArduPilot, 2), (Autopilot::Px4, 13)] {
                let quad = Quad { autopilot, type_number, ..Quad::healthy() };
                let outcome = fly_from(0, &quad, |ms, quad, motion| {
                    // It stands without thrust, climbs at three times its hover throttle, hovers and moves at 3 m/s.
                    let hovers = ms >= 20_000;
                    quad.landed = Some(if ms < 8_000 { LandedState::OnGround } else { LandedState::InAir });
                    quad.throttle = if ms < 8_000 {
                        0.0
                    } else if hovers {
                        throttle
                    } else {
                        3.0 * throttle
                    };
                    let climbed = ms.saturating_sub(8_000).min(12_000) as f32 / 12_000.0;
                    quad.height = height * climbed;
                    quad.climb = if ms < 8_000 || hovers { 0.0 } else { height / 12.0 };
                    motion.ground_mps = if ms < 30_000 { 0.1 } else { 3.0 };
                    if ms >= 8_000 {
                        motion.load_g += 0.02 * (ms / 50 % 3) as f32;
                    }
                });
                let what = (height, throttle, autopilot);
                assert_eq!(outcome.flights(), (1, 0, 0), "{what:?}");
                assert!(outcome.monitor.flight().airborne(), "{what:?}");
            }
        }
    }
}

#[test]
fn a_barometer_that_freezes_before_the_take_off_hides_no_flight() {
    for (frozen_ms, height) in [(3_000, 5.0), (7_000, 20.0), (7_900, 300.0), (30_000, 20.0)] {
        for ground_mps in [0.1, 6.0] {
            let outcome = fly_from(0, &Quad::healthy(), |ms, quad, motion| {
                let flies = ms >= 8_000;
                quad.armed = ms >= 2_000;
                quad.landed = Some(if flies { LandedState::InAir } else { LandedState::OnGround });
                (quad.throttle, quad.height) = if flies { (0.4, height) } else { (0.0, 0.0) };
                let noise = (ms.min(frozen_ms) / 100 * 37 % 11) as f32 * 0.002;
                let high_m = if ms.min(frozen_ms) >= 8_000 { height } else { 0.0 };
                motion.pressure_hpa = Some(957.0 - 0.12 * high_m + noise);
                if flies {
                    quad.climb = if ms / 2_000 % 2 == 0 { 1.0 } else { -1.0 };
                    motion.ground_mps = ground_mps;
                }
            });
            let what = (frozen_ms, height, ground_mps);
            assert_eq!(outcome.flights(), (1, 0, 0), "{what:?}");
            assert!(outcome.findings.iter().any(|finding| finding.check == "baro_stuck"), "{what:?}");
        }
    }
}
