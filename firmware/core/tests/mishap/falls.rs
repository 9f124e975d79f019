//! Free falls, disarming in the air, and what becomes of the flight.

use super::*;

#[test]
fn a_fall_with_the_motors_asked_for_thrust_ends_the_flight_with_its_touch() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), fall);
        let told = outcome.told();
        assert_eq!(told.first(), Some(&"free_fall"), "{of:?}: {told:?}");
        assert!(told.contains(&"impact"), "{of:?}: {told:?}");
        let [(began_ms, Change::Began(Kind::FreeFall)), (down_ms, Change::Down)] = outcome.changes[..] else {
            panic!("{of:?}: {:?}", outcome.changes)
        };
        let (place, touch) = (outcome.reports[0].place, outcome.reports[1].touch);
        assert!((AT_MS + 300..=AT_MS + 500).contains(&began_ms), "{of:?}: {began_ms}");
        assert!((AT_MS + 3_000..AT_MS + 5_000).contains(&down_ms), "{of:?}: {down_ms}");
        assert_eq!(place.position, Some((473_977_420, -85_455_940)));
        assert!((150..200).contains(&touch), "{of:?}: {touch}");
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}");
        assert_eq!(outcome.count(UsageCounter::HardLandings), 1);
        assert!(outcome.count(UsageCounter::TouchdownMax) >= 15, "{of:?}");
        // Nothing that would only echo it.
        let echoes = outcome.findings.iter().filter(|finding| {
            finding.subsystem != Subsystem::Mishap && finding.at.as_millis() > began_ms + 100
        });
        assert_eq!(echoes.count(), 0, "{of:?}: {:?}", outcome.findings);
    }
}

#[test]
fn what_does_not_fly_has_no_mishap_of_the_air() {
    for (autopilot, kind, type_number) in SURFACE {
        let rover = Quad { landed: Some(LandedState::InAir), ..vehicle(autopilot, kind, type_number) };
        let outcome = fly(&rover, fall);
        assert!(
            outcome.told().is_empty() && outcome.changes.is_empty(),
            "{type_number}: {:?}",
            outcome.changes
        );
    }
}

#[test]
fn a_vehicle_that_is_disarmed_in_the_air_is_told_and_one_that_lands_on_a_hill_is_not() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            fall(ms, quad, motion);
            (quad.armed, quad.throttle) = (false, 0.0);
        });
        let told = outcome.told();
        assert!(told.contains(&"disarmed_in_air"), "{of:?}: {told:?} {:?}", outcome.changes);
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}");
        assert_eq!(outcome.count(UsageCounter::HardLandings), 1, "{of:?}");
        let hill = fly(&hovering(of), |ms, quad, _| {
            (quad.armed, quad.throttle, quad.landed) = (ms < 1_000, 0.0, Some(LandedState::OnGround));
        });
        assert!(hill.told().is_empty(), "{of:?}: {:?}", hill.findings);
        assert_eq!(hill.flights(), (1, 1, 0), "{of:?}");
        // Without a landed state the height above home says that it flies; nothing falls, so nothing was disarmed in the air.
        let mut silent = hovering(of);
        silent.landed = None;
        let hill = fly(&silent, |ms, quad, _| (quad.armed, quad.throttle) = (ms < 1_000, 0.0));
        assert!(hill.told().is_empty(), "{of:?}: {:?}", hill.findings);
        assert_eq!(hill.flights(), (1, 1, 0), "{of:?}");
    }
}

#[test]
fn a_plane_that_is_disarmed_in_the_air_glides_on_and_is_told() {
    for of in WINGS {
        let outcome = fly(&on_wings(of), |ms, quad, motion| {
            (quad.armed, quad.throttle) = (false, 0.0);
            motion.ground_mps = if ms < 8_000 { 18.0 } else { 0.0 };
            (quad.climb, quad.height) =
                if ms < 8_000 { (-2.0, 20.0 - ms as f32 / 500.0) } else { (0.0, 0.0) };
        });
        assert_eq!(outcome.told(), ["disarmed_in_air"], "{of:?}");
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}");
    }
}

#[test]
fn what_the_throttle_asks_for_is_no_free_fall_and_a_dead_sensor_is_none_either() {
    let dive: Script = |ms, quad, motion| {
        if ms < 1_500 {
            (motion.load_g, quad.throttle) = (0.05, 0.0);
        }
    };
    let thrown = Quad { mode: 18, ..hovering(ROTORS[0]) };
    for (quad, script) in [
        (hovering(ROTORS[0]), dive),
        (thrown, |ms, _, motion: &mut Motion| {
            if ms < 1_000 {
                motion.load_g = 0.05;
            }
        }),
    ] {
        assert!(fly(&quad, script).told().is_empty());
    }
}

#[test]
fn after_a_mishap_the_next_arming_begins_anew() {
    let outcome = fly(&hovering(ROTORS[0]), |ms, quad, motion| {
        fall(ms, quad, motion);
        quad.landed = Some(LandedState::OnGround);
        quad.armed = !(8_000..20_000).contains(&ms);
        if ms >= 25_000 {
            (quad.height, quad.throttle, quad.landed) = (20.0, 0.5, Some(LandedState::InAir));
        }
    });
    assert_eq!(outcome.flights(), (2, 0, 1), "{:?}", outcome.changes);
    assert!(outcome.monitor.flight().airborne());
    assert_eq!(outcome.monitor.health().subsystem(Subsystem::Mishap), Level::Ok);
}

/// When the check of the vibration went bad and good again; it shakes for 3 s, and then it falls.
fn shakes_and_falls(script: Script) -> Vec<(Level, u64)> {
    let outcome = fly(&hovering(ROTORS[0]), script);
    assert!(outcome.changes.iter().any(|(_, change)| *change == Change::Down), "{:?}", outcome.changes);
    let of_vibration = outcome.findings.iter().filter(|finding| finding.check == "vibration");
    of_vibration.map(|finding| (finding.level, finding.at.as_millis())).collect()
}

#[test]
fn what_was_wrong_before_a_mishap_ends_when_it_lies_disarmed_and_when_it_is_silent() {
    fn shaken(ms: u64, quad: &mut Quad, motion: &mut Motion) {
        quad.vibration.levels = [Some(45.0); 3];
        if ms >= 3_000 {
            fall(ms - 3_000, quad, motion);
        }
    }
    let disarmed = shakes_and_falls(|ms, quad, motion| {
        shaken(ms, quad, motion);
        quad.armed = ms < 12_000;
    });
    let [(Level::Warning, bad), (Level::Ok, good)] = disarmed[..] else { panic!("{disarmed:?}") };
    assert!(bad < AT_MS + 3_000 && (12_000..12_600).contains(&(good - AT_MS)), "{bad} {good}");
    let silent = shakes_and_falls(|ms, quad, motion| {
        shaken(ms, quad, motion);
        quad.silent = ms >= 8_000;
    });
    let [(Level::Warning, _), (Level::Ok, good)] = silent[..] else { panic!("{silent:?}") };
    assert!((12_400..13_200).contains(&(good - AT_MS)), "{good}");
    let armed = shakes_and_falls(shaken);
    assert!(matches!(armed[..], [(Level::Warning, _)]), "while it is armed it stays as it was: {armed:?}");
}

#[test]
fn every_text_of_a_mishap_fits() {
    let place = |height_m| Place { position: Some((-899_999_999, -1_799_999_999)), height_m };
    let unknown = Place { position: None, height_m: -12_345 };
    let began = Change::Began(Kind::Sinking);
    let cases = [
        (began, place(-999)),
        (began, place(12_345)),
        (began, unknown),
        (Change::Down, place(0)),
        (Change::FliesOn, unknown),
        (Change::OnBench(Kind::Disarmed), unknown),
    ];
    for (change, place) in cases {
        let text = Report { change, place, touch: 9_999 }.text();
        assert!(!text.is_empty() && "HUMS: ".len() + text.len() <= 50, "{text}");
        if change == Change::Down {
            assert!(text.ends_with("999.9 m/s"), "{text}");
        } else if change == began {
            assert!(text.ends_with(" m"), "{text}");
        }
    }
    let place = Place { position: Some((473_977_420, -85_455_940)), height_m: 30 };
    let report = Report { change: Change::Began(Kind::Impact), place, touch: 0 };
    assert_eq!(report.text(), "mishap at 47.397742,-8.545594 30 m");
}

/// Whether the autopilot's state was told as critical.
fn tells_state(outcome: &Outcome) -> bool {
    outcome
        .findings
        .iter()
        .any(|finding| finding.check == "autopilot_state" && finding.level == Level::Critical)
}

#[test]
fn a_kill_switch_at_the_touch_down_is_no_alarm_and_in_the_air_it_is_one() {
    for of in ROTORS {
        let lands = Quad { height: 0.2, ..hovering(of) };
        let killed = fly(&lands, |ms, quad, motion| {
            (quad.state, quad.height, quad.climb) = (8, 0.0, 0.0);
            // The bounce of its legs.
            motion.load_g = if ms < 600 && ms % 100 == 0 { 2.5 } else { 1.0 };
            quad.armed = ms < 5_000;
        });
        assert!(killed.told().is_empty() && !tells_state(&killed), "{of:?}: {:?}", killed.findings);
        let falls = fly(&hovering(of), |ms, quad, motion| {
            fall(ms, quad, motion);
            quad.state = 8;
        });
        assert_eq!(falls.told().get(..2), Some(&["disarmed_in_air", "free_fall"][..]), "{of:?}");
        let parachute = fly(&Quad { height: 100.0, ..hovering(of) }, |ms, quad, motion| {
            let sunk_m = 5.0 * ms as f32 / 1_000.0;
            (quad.state, quad.throttle) = (8, 0.0);
            (quad.climb, quad.height) = if sunk_m < 100.0 { (-5.0, 100.0 - sunk_m) } else { (0.0, 0.0) };
            motion.rates = [0.1, 0.0, 0.0];
        });
        assert_eq!(parachute.told().first(), Some(&"disarmed_in_air"), "{of:?}: {:?}", parachute.findings);
        assert_eq!(parachute.flights(), (1, 0, 1), "{of:?}: its flight is over");
    }
}

#[test]
fn a_flight_that_is_terminated_without_an_estimate_falls_by_the_air_pressure() {
    // Position, speed and specific force stay as they were.
    let terminated = |script: Script| {
        let outcome = fly(&hovering(ROTORS[1]), script);
        let at_ms = outcome.changes.first().map(|(at_ms, _)| *at_ms - AT_MS);
        (outcome.told(), at_ms, outcome.flights())
    };
    let (told, at_ms, flights) = terminated(|ms, quad, motion| {
        let seconds = (ms as f32 / 1_000.0).min(2.5);
        quad.state = 8;
        motion.pressure_hpa = Some(980.0 + 0.12 * 4.9 * seconds * seconds + (ms / 50 % 3) as f32 * 0.01);
    });
    assert_eq!((told, flights), (vec!["disarmed_in_air"], (1, 0, 1)));
    assert!(at_ms.is_some_and(|at_ms| (2_000..=2_700).contains(&at_ms)), "{at_ms:?}");
    let (told, ..) = terminated(|ms, quad, motion| {
        quad.state = 8;
        motion.pressure_hpa = Some(980.0 + (ms / 50 % 3) as f32 * 0.01);
    });
    assert!(told.is_empty(), "killed on a hill: {told:?}");
}

#[test]
fn what_is_disarmed_below_home_falls_too() {
    for of in ROTORS {
        let outcome = fly(&Quad { start_height: -10.0, ..hovering(of) }, |ms, quad, motion| {
            fall(ms, quad, motion);
            quad.height -= 30.0;
            (quad.armed, quad.throttle) = (false, 0.0);
        });
        assert!(outcome.told().contains(&"disarmed_in_air"), "{of:?}: {:?}", outcome.told());
        let valley = fly(&hovering(of), |ms, quad, motion| {
            let landed = ms >= 8_000;
            let height_m = if landed { -12.0 } else { 20.0 - 0.004 * ms as f32 };
            (quad.height, quad.climb) = (height_m, if landed { 0.0 } else { -4.0 });
            if landed {
                (motion.rates, motion.ground_mps) = ([0.0; 3], 0.0);
                (quad.throttle, quad.armed) = (0.0, ms < 10_000);
            }
        });
        assert!(valley.told().is_empty() && valley.flights() == (1, 1, 0), "{of:?}: {:?}", valley.told());
    }
}

#[test]
fn what_stands_after_its_disarming_has_landed_within_two_seconds() {
    for of in ROTORS {
        let landed = fly_until(AT_MS + 2_600, &hovering(of), |ms, quad, motion| {
            (motion.rates, motion.ground_mps) = ([0.0; 3], 0.0);
            (quad.armed, quad.throttle) = (ms < 1_000, 0.0);
        });
        assert!(landed.told().is_empty() && landed.flights() == (1, 1, 0), "{of:?}: {:?}", landed.flights());
    }
}

#[test]
fn what_comes_down_under_a_parachute_is_down_when_it_is_on_the_ground() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            let seconds = ms as f32 / 1_000.0;
            (quad.armed, quad.throttle) = (false, 0.0);
            motion.rates = [0.0; 3];
            let down_m = if ms < 1_000 { 4.9 * seconds * seconds } else { 4.9 + 5.0 * (seconds - 1.0) };
            motion.load_g = if ms < 1_000 { 0.05 } else { 1.0 };
            let lands = down_m >= 80.0;
            quad.climb = if lands { 0.0 } else { -5.0 };
            quad.height = 20.0 - down_m.min(80.0);
            motion.pressure_hpa = Some(950.0 + 0.12 * down_m.min(80.0) + (ms / 50 % 3) as f32 * 0.01);
        });
        assert_eq!(outcome.told().first(), Some(&"disarmed_in_air"), "{of:?}");
        let down_ms = outcome.changes.iter().find(|(_, change)| *change == Change::Down).map(|(ms, _)| *ms);
        let lands_ms = AT_MS + 16_000;
        assert!(down_ms.is_some_and(|ms| (lands_ms..lands_ms + 5_000).contains(&ms)), "{of:?}: {down_ms:?}");
    }
}

#[test]
fn what_is_heard_too_seldom_is_no_fall() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, _, motion| {
            // A sample without weight, a gap of three seconds, and two more.
            motion.load_g = if ms < 50 || (3_000..3_100).contains(&ms) { 0.05 } else { 1.0 };
            motion.unheard = (50..3_000).contains(&ms);
        });
        assert!(outcome.told().is_empty(), "{of:?}: {:?}", outcome.told());
    }
}
