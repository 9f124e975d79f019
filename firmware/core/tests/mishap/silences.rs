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
        assert!(unheard_from.is_some_and(|from| from < Instant::from_millis(AT_MS)), "{unheard_from:?}");
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
        let fell = unheard(of, 5_200, |quad, motion| {
            stands(quad, motion);
            (quad.throttle, quad.armed, quad.landed) = (0.0, false, Some(LandedState::OnGround));
        });
        assert_eq!((fell.told(), fell.flights()), (vec!["impact"], (1, 0, 1)), "{of:?}");
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
