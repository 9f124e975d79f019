//! What comes down, or is terminated, while nobody hears it.

use super::*;

/// What hovers at 20 m is not heard for so long, and then it is as `after` makes it.
fn unheard(of: (Autopilot, VehicleKind, u8), silent_ms: u64, after: fn(&mut Quad, &mut Motion)) -> Outcome {
    fly(&hovering(of), |ms, quad, motion| {
        motion.unheard = ms < silent_ms;
        if !motion.unheard {
            after(quad, motion);
        }
    })
}

fn stands(quad: &mut Quad, motion: &mut Motion) {
    (quad.height, quad.climb, motion.ground_mps) = (0.1, 0.0, 0.0);
    motion.rates = [0.0; 3];
}

#[test]
fn what_lies_over_after_a_silence_turned_over_in_it() {
    for of in ROTORS {
        let lies = unheard(of, 6_000, |quad, motion| {
            stands(quad, motion);
            (quad.roll, motion.load_g) = (1.6, 0.05);
            motion.drag_g = 1.0;
        });
        assert_eq!((lies.told().first(), lies.flights()), (Some(&"overturned"), (1, 0, 1)), "{of:?}");
        let unheard_from = lies.monitor.mishap().unheard_from();
        assert!(
            unheard_from.is_some_and(|from| Instant::from_millis(AT_MS).is_after(from)),
            "{unheard_from:?}"
        );
        assert!(lies.changes.first().is_some_and(|(at_ms, _)| *at_ms < AT_MS + 9_000), "{:?}", lies.changes);
    }
}

#[test]
fn what_stands_with_all_its_throttle_after_a_silence_or_came_down_too_fast_crashed_in_it() {
    for of in ROTORS {
        let driven = unheard(of, 12_000, |quad, motion| {
            stands(quad, motion);
            quad.throttle = 1.0;
        });
        assert_eq!((driven.told().first(), driven.flights()), (Some(&"impact"), (1, 0, 1)), "{of:?}");
        // The autopilot takes its time to see that it stands.
        for silent_ms in [5_200, 6_200] {
            let fell = unheard(of, silent_ms, |quad, motion| {
                stands(quad, motion);
                (quad.throttle, quad.armed, quad.landed) = (0.0, false, Some(LandedState::OnGround));
            });
            assert_eq!((fell.told(), fell.flights()), (vec!["impact"], (1, 0, 1)), "{of:?}");
        }
        let lost = fly(&hovering(of), |ms, quad, motion| {
            stands(quad, motion);
            (quad.throttle, quad.armed, quad.landed) = (0.0, false, Some(LandedState::OnGround));
            motion.lost_s = (ms == 0).then_some(6);
        });
        assert_eq!((lost.told(), lost.flights()), (vec!["impact"], (1, 0, 1)), "{of:?}");
    }
}

#[test]
fn what_lands_in_a_silence_has_landed_and_what_flies_on_flies_on() {
    for of in ROTORS {
        for (silent_ms, armed) in [(15_000, false), (15_000, true)] {
            let landed = if armed {
                unheard(of, silent_ms, |quad, motion| {
                    stands(quad, motion);
                    (quad.throttle, quad.landed) = (0.0, Some(LandedState::OnGround));
                })
            } else {
                unheard(of, silent_ms, |quad, motion| {
                    stands(quad, motion);
                    (quad.throttle, quad.armed, quad.landed) = (0.0, false, Some(LandedState::OnGround));
                })
            };
            assert!(landed.told().is_empty() && landed.flights() == (1, 1, 0), "{of:?}: {:?}", landed.told());
        }
        let flies = unheard(of, 15_000, |_, _| ());
        assert!(flies.told().is_empty() && flies.flights().2 == 0, "{of:?}: {:?}", flies.told());
        let climbs =
            unheard(of, 15_000, |quad, _| (quad.height, quad.climb, quad.throttle) = (12.0, 3.0, 1.0));
        assert!(climbs.told().is_empty(), "{of:?}: {:?}", climbs.told());
        let hovers = unheard(of, 15_000, |quad, _| (quad.height, quad.throttle) = (12.0, 1.0));
        assert!(hovers.told().is_empty(), "{of:?}: {:?}", hovers.told());
    }
}

#[test]
fn a_flight_that_is_terminated_in_a_silence_is_a_mishap_but_where_it_stands() {
    for of in ROTORS {
        let lies = unheard(of, 4_000, |quad, motion| {
            stands(quad, motion);
            (quad.state, quad.throttle, motion.load_g, motion.drag_g) = (8, 0.0, 0.05, 1.0);
        });
        assert_eq!((lies.told().first(), lies.flights().1), (Some(&"disarmed_in_air"), 0), "{of:?}");
        let killed = unheard(of, 12_000, |quad, motion| {
            stands(quad, motion);
            (quad.state, quad.throttle, quad.landed) = (8, 0.0, Some(LandedState::OnGround));
        });
        assert!(killed.told().is_empty(), "{of:?}: {:?}", killed.told());
    }
}

#[test]
fn a_flight_that_was_terminated_before_it_was_heard_is_a_mishap() {
    for of in ROTORS {
        let terminated = Quad { state: 8, throttle: 0.0, start_height: 20.0, ..hovering(of) };
        let falls = fly(&terminated, |_, _, motion| motion.rates = [2.0, 0.0, 0.0]);
        let state = falls.findings.iter().find(|finding| finding.check == "disarmed_in_air");
        assert!(state.is_none(), "still and level: {of:?}");
        let moves = fly(&Quad { climb: -4.0, ..terminated }, |_, _, _| ());
        let told = moves.findings.iter().find(|finding| finding.check == "disarmed_in_air");
        assert_eq!(told.map(|finding| finding.orders), Some(Orders::Own), "{of:?}: {:?}", moves.told());
    }
}

#[test]
fn what_is_terminated_in_the_air_and_neither_stands_nor_falls_at_once_is_a_mishap() {
    for of in ROTORS {
        // Its motors go on for a while; it calls itself armed and in the air to the end.
        let drifts = fly(&hovering(of), |ms, quad, motion| {
            (quad.state, motion.ground_mps) = (8, 4.0);
            if ms > 7_000 {
                stands(quad, motion);
                (motion.load_g, motion.drag_g) = (0.05, 1.0);
            }
        });
        assert_eq!(
            (drifts.told().first(), drifts.flights()),
            (Some(&"disarmed_in_air"), (1, 0, 1)),
            "{of:?}"
        );
        let at_ms = drifts.changes.first().map(|(at_ms, _)| *at_ms);
        assert!(at_ms.is_some_and(|at_ms| at_ms < AT_MS + 4_500), "{of:?}: {at_ms:?}");
    }
}

#[test]
fn what_lies_terminated_when_it_is_heard_first_neither_flies_nor_falls() {
    for of in ROTORS {
        let lies = fly_from(0, &Quad { state: 8, start_height: 0.0, ..hovering(of) }, |_, quad, motion| {
            stands(quad, motion);
            (motion.load_g, motion.drag_g) = (0.05, 1.0);
        });
        assert!(lies.told().is_empty() && lies.flights() == (0, 0, 0), "{of:?}: {:?}", lies.told());
    }
}

/// Disarmed when it is heard first, it goes down so fast for three seconds, and the air pressure says so; then it lies.
fn goes_down(of: (Autopilot, VehicleKind, u8), sink_mps: f32) -> Outcome {
    fly_from(0, &Quad { armed: false, throttle: 0.0, ..hovering(of) }, |ms, quad, motion| {
        let down_m = sink_mps * ms.min(3_000) as f32 / 1_000.0;
        (quad.climb, quad.height) = if ms < 3_000 { (-sink_mps, 30.0 - down_m) } else { (0.0, 0.0) };
        motion.pressure_hpa = Some(980.0 + 0.12 * down_m + (ms / 50 % 3) as f32 * 0.01);
    })
}

#[test]
fn what_falls_disarmed_when_it_is_heard_first_is_a_mishap_and_what_is_carried_down_is_none() {
    for of in ROTORS {
        let falls = goes_down(of, 9.0);
        assert_eq!(falls.told().first(), Some(&"disarmed_in_air"), "{of:?}");
        let carried = goes_down(of, 4.0);
        assert!(carried.told().is_empty() && carried.changes.is_empty(), "{of:?}: {:?}", carried.told());
    }
}

/// It stands, and is disarmed.
fn has_landed(quad: &mut Quad, motion: &mut Motion) {
    stands(quad, motion);
    (quad.throttle, quad.armed, quad.landed) = (0.0, false, Some(LandedState::OnGround));
}

#[test]
fn a_home_that_is_set_anew_is_no_fall() {
    for of in ROTORS {
        // It was 20 m above home and 4 m above a hill.
        let landed = unheard(of, 6_200, |quad, motion| {
            has_landed(quad, motion);
            motion.home_sank_m = -16.0;
        });
        assert!(landed.told().is_empty() && landed.flights() == (1, 1, 0), "{of:?}: {:?}", landed.told());
    }
}

#[test]
fn what_was_in_a_dive_comes_down_as_fast() {
    for of in ROTORS {
        // From so high, so fast for so long before the silence.
        let dives = |from_m: f32, sink_mps: f32, heard_ms: u64| {
            fly(&hovering(of), move |ms, quad, motion| {
                motion.unheard = (heard_ms..heard_ms + 8_000).contains(&ms);
                if ms < heard_ms {
                    quad.height = from_m - sink_mps * ms as f32 / 1_000.0;
                    (quad.climb, quad.throttle) = (-sink_mps, 0.2);
                } else {
                    has_landed(quad, motion);
                }
            })
        };
        assert_eq!(dives(100.0, 5.5, 2_000).told(), ["impact"], "{of:?}: as fast as it may be told to");
        let fast = dives(160.0, 18.0, 4_000);
        assert!(!fast.told().contains(&"impact"), "{of:?}: {:?}", fast.told());
    }
}

#[test]
fn what_had_the_time_to_land_and_lies_over_may_have_been_laid_down() {
    for of in ROTORS {
        let on_its_side = |quad: &mut Quad, motion: &mut Motion| {
            has_landed(quad, motion);
            (quad.roll, motion.load_g, motion.drag_g) = (1.6, 0.05, 1.0);
        };
        let carried = unheard(of, 12_000, on_its_side);
        assert!(carried.told().is_empty() && carried.flights() == (1, 1, 0), "{of:?}: {:?}", carried.told());
        let crashed = unheard(of, 6_000, on_its_side);
        assert!(crashed.told().contains(&"overturned"), "{of:?}: {:?}", crashed.told());
    }
}

#[test]
fn an_autopilot_that_starts_again_tells_later_how_it_lies() {
    for of in ROTORS {
        let lies = fly(&hovering(of), |ms, quad, motion| {
            motion.unheard = ms < 6_000;
            motion.beats_only = ms < 14_000;
            if !motion.unheard {
                has_landed(quad, motion);
                (quad.roll, motion.load_g, motion.drag_g) = (1.6, 0.05, 1.0);
            }
        });
        assert_eq!((lies.told().is_empty(), lies.flights()), (false, (1, 0, 1)), "{of:?}");
    }
}

#[test]
fn what_is_killed_after_a_landing_and_calls_itself_landed_is_no_mishap() {
    for of in ROTORS {
        let killed = fly(&hovering(of), |ms, quad, motion| {
            motion.unheard = ms < 12_000;
            motion.beats_only = true;
            if !motion.unheard {
                has_landed(quad, motion);
                (quad.armed, quad.state) = (true, 8);
            }
        });
        assert!(killed.told().is_empty(), "{of:?}: {:?}", killed.told());
    }
}

#[test]
fn a_plane_whose_streams_come_back_late_lands_as_ever() {
    let of = (Autopilot::ArduPilot, VehicleKind::Plane, 1);
    let flown = fly(&hovering(of), |ms, quad, motion| {
        (motion.unheard, motion.beats_only, motion.ground_mps) = (ms < 6_000, ms < 8_000, 18.0);
        if ms > 20_000 {
            has_landed(quad, motion);
        }
    });
    assert!(
        flown.told().is_empty() && flown.flights() == (1, 1, 0),
        "{:?} {:?}",
        flown.told(),
        flown.flights()
    );
}

#[test]
fn a_sink_of_before_the_silence_is_no_sink_of_now() {
    for of in ROTORS {
        // It came down, its battery was changed, and for a while it tells no more than heartbeats.
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            motion.unheard = (4_000..24_000).contains(&ms);
            motion.beats_only = (24_000..27_000).contains(&ms);
            if ms < 4_000 {
                (quad.climb, quad.height) = (-3.0, 20.0 - 0.003 * ms as f32);
            } else {
                has_landed(quad, motion);
            }
        });
        assert!(outcome.told().is_empty() && outcome.flights() == (1, 1, 0), "{of:?}: {:?}", outcome.told());
    }
}

#[test]
fn what_hits_the_ground_disarmed_when_it_is_heard_first_is_an_impact() {
    for of in ROTORS {
        let hits = fly_from(0, &Quad { armed: false, throttle: 0.0, ..hovering(of) }, |ms, quad, motion| {
            (quad.climb, quad.height) = if ms < 900 { (-9.0, 8.0 - 0.009 * ms as f32) } else { (0.0, 0.0) };
            motion.load_g = if (900..1_000).contains(&ms) { 12.0 } else { 1.0 };
            motion.rates = [0.0; 3];
            motion.ground_mps = 0.0;
        });
        assert_eq!(hits.told(), ["impact"], "{of:?}: {:?}", hits.changes);
    }
}

#[test]
fn what_tumbles_and_falls_disarmed_when_it_is_heard_first_is_told_as_disarmed() {
    for of in ROTORS {
        let falls = fly_from(0, &Quad { armed: false, throttle: 0.0, ..hovering(of) }, |ms, quad, motion| {
            let down_m = 9.0 * ms.min(3_000) as f32 / 1_000.0;
            (quad.climb, quad.height) = if ms < 3_000 { (-9.0, 30.0 - down_m) } else { (0.0, 0.0) };
            motion.rates = if ms < 3_000 { [7.0, 0.0, 0.0] } else { [0.0; 3] };
            motion.pressure_hpa = Some(980.0 + 0.12 * down_m + (ms / 50 % 3) as f32 * 0.01);
        });
        assert!(falls.told().contains(&"disarmed_in_air"), "{of:?}: {:?}", falls.told());
    }
}

#[test]
fn what_is_knocked_about_on_its_back_when_it_is_heard_first_is_none() {
    for of in ROTORS {
        let bench = Quad { armed: false, throttle: 0.0, start_height: 0.0, height: 0.0, ..hovering(of) };
        let knocked = fly_from(0, &bench, |ms, quad, motion| {
            quad.height = 0.0;
            motion.load_g = if (1_000..1_050).contains(&ms) { 5.0 } else { -1.0 };
            (motion.ground_mps, motion.rates) = (0.0, [0.0; 3]);
        });
        assert!(knocked.told().is_empty() && knocked.changes.is_empty(), "{of:?}: {:?}", knocked.changes);
    }
}

#[test]
fn what_is_disarmed_right_after_it_is_heard_first_and_falls_is_told() {
    for of in ROTORS {
        let falls = fly_from(0, &hovering(of), |ms, quad, motion| {
            (quad.armed, quad.throttle) = (ms < 500, 0.0);
            let down_m = 9.0 * ms.min(4_000) as f32 / 1_000.0;
            (quad.climb, quad.height) = if ms < 4_000 { (-9.0, 40.0 - down_m) } else { (0.0, 4.0) };
            motion.pressure_hpa = Some(980.0 + 0.12 * down_m + (ms / 50 % 3) as f32 * 0.01);
        });
        assert_eq!(falls.told().first(), Some(&"disarmed_in_air"), "{of:?}: {:?}", falls.told());
    }
}
