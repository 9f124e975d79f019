//! Free falls, disarming in the air, and the end of the flight.

use super::*;

/// Disarmed, without throttle.
fn off(quad: &mut Quad) {
    (quad.armed, quad.throttle) = (false, 0.0);
}

#[test]
fn a_fall_with_the_motors_asked_for_thrust_ends_the_flight_with_its_touch() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), fall);
        let told = outcome.told();
        assert_eq!(told.first(), Some(&"free_fall"), "{of:?}: {told:?}");
        assert!(told.contains(&"impact"), "{of:?}: {told:?}");
        let [(began_ms, MishapChange::Began(MishapKind::FreeFall)), (down_ms, MishapChange::Down)] =
            outcome.changes[..]
        else {
            panic!("{of:?}: {:?}", outcome.changes)
        };
        let (place, touch) = (outcome.reports[0].place, outcome.reports[1].touch);
        assert!((AT_MS + 300..=AT_MS + 500).contains(&began_ms), "{of:?}: {began_ms}");
        assert!((AT_MS + 3_000..AT_MS + 5_000).contains(&down_ms), "{of:?}: {down_ms}");
        assert_eq!(place.position, Some((473_977_420, -85_455_940)));
        assert!((150..200).contains(&touch), "{of:?}: {touch}");
        assert_eq!(outcome.flights(), DOWN, "{of:?}");
        assert_eq!(outcome.count(UsageCounter::HardLandings), 1);
        assert!(outcome.count(UsageCounter::TouchdownMax) >= 15, "{of:?}");
        let echoes = outcome.findings.iter().filter(|finding| {
            finding.subsystem != Subsystem::Mishap && finding.at.as_millis() > began_ms + 100
        });
        assert_eq!(echoes.count(), 0, "{of:?}: {:?}", outcome.findings);
    }
    let surface = SURFACE.map(|of| Quad { landed: Some(LandedState::InAir), ..vehicle(of.0, of.1, of.2) });
    judge(surface, "a rover does not fly", (&[], (0, 0, 0)), fall);
}

#[test]
fn what_is_disarmed_in_the_air_is_told_and_what_has_landed_is_not() {
    let told: Come<'_> = (&["disarmed_in_air", ".."], DOWN);
    judge(rotors(), "in the air", told, |ms, quad, motion| {
        fall(ms, quad, motion);
        off(quad);
    });
    let low = ROTORS.map(|of| Quad { start_height: -10.0, ..hovering(of) });
    judge(low, "below home", told, |ms, quad, motion| {
        fall(ms, quad, motion);
        quad.height -= 30.0;
        off(quad);
    });
    judge(rotors(), "on a hill", (&[], LANDED), |ms, quad, _| {
        (quad.armed, quad.throttle, quad.landed) = (ms < 1_000, 0.0, Some(LandedState::OnGround));
    });
    // Without a landed state the height above home shows flight; no fall, so no disarming in the air.
    let silent = ROTORS.map(|of| Quad { landed: None, ..hovering(of) });
    judge(silent, "on a hill, without a landed state", (&[], LANDED), |ms, quad, _| {
        (quad.armed, quad.throttle) = (ms < 1_000, 0.0);
    });
    judge(rotors(), "in a valley", (&[], LANDED), |ms, quad, motion| {
        let landed = ms >= 8_000;
        quad.height = if landed { -12.0 } else { 20.0 - 0.004 * ms as f32 };
        quad.climb = if landed { 0.0 } else { -4.0 };
        if landed {
            (motion.rates, motion.ground_mps) = ([0.0; 3], 0.0);
            (quad.throttle, quad.armed) = (0.0, ms < 10_000);
        }
    });
    judge(wings(), "a plane glides on", (&["disarmed_in_air"], DOWN), |ms, quad, motion| {
        off(quad);
        motion.ground_mps = if ms < 8_000 { 18.0 } else { 0.0 };
        (quad.climb, quad.height) = if ms < 8_000 { (-2.0, 20.0 - ms as f32 / 500.0) } else { (0.0, 0.0) };
    });
    judge(wings(), "a plane rolls on, on a field above home", (&[], LANDED), |ms, quad, motion| {
        (quad.throttle, quad.armed, quad.height, quad.climb) = (0.0, ms < 4_000, 8.0, 0.0);
        motion.ground_mps = if ms < 8_000 { 12.0 } else { 0.0 };
    });
    for of in ROTORS {
        let landed = fly_until(AT_MS + 2_600, &hovering(of), |ms, quad, motion| {
            (motion.rates, motion.ground_mps) = ([0.0; 3], 0.0);
            (quad.armed, quad.throttle) = (ms < 1_000, 0.0);
        });
        assert!(landed.told().is_empty() && landed.flights() == LANDED, "within two seconds, {of:?}");
    }
}

#[test]
fn what_the_throttle_asks_for_is_no_free_fall_nor_what_is_thrown_or_heard_too_seldom() {
    let thrown = Quad { mode: 18, ..hovering(ROTORS[0]) };
    for (what, quad, lasts_ms, throttle) in
        [("a dive", hovering(ROTORS[0]), 1_500, 0.0), ("thrown", thrown, 1_000, 0.5)]
    {
        judge([quad], what, (&[], FLIES), |ms, quad, motion| {
            if ms < lasts_ms {
                (motion.load_g, quad.throttle) = (0.05, throttle);
            }
        });
    }
    // A sample without weight, a gap of three seconds, and two more.
    judge(rotors(), "heard too seldom", (&[], FLIES), |ms, _, motion| {
        motion.load_g = if ms < 50 || (3_000..3_100).contains(&ms) { 0.05 } else { 1.0 };
        motion.unheard = (50..3_000).contains(&ms);
    });
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

#[test]
fn what_was_wrong_before_a_mishap_ends_when_it_lies_disarmed_and_when_it_is_silent() {
    // It shakes for 3 s, and then it falls. The time when the vibration check is good again, milliseconds after the
    // vibration began.
    for (what, off_ms, silent_ms, good_ms) in [
        ("disarmed", 12_000, u64::MAX, Some(12_000..12_600)),
        ("silent", u64::MAX, 8_000, Some(12_400..13_200)),
        ("armed", u64::MAX, u64::MAX, None),
    ] {
        let outcome = fly(&hovering(ROTORS[0]), |ms, quad, motion| {
            quad.vibration.levels = [Some(45.0); 3];
            if ms >= 3_000 {
                fall(ms - 3_000, quad, motion);
            }
            (quad.armed, quad.silent) = (ms < off_ms, ms >= silent_ms);
        });
        assert!(
            outcome.changes.iter().any(|(_, change)| *change == MishapChange::Down),
            "{:?}",
            outcome.changes
        );
        let vibration = outcome.findings.iter().filter(|finding| finding.check == "vibration");
        let levels: Vec<_> = vibration.map(|it| (it.level, it.at.as_millis() - AT_MS)).collect();
        let is_right = match (&levels[..], good_ms) {
            ([(Level::Warning, bad)], None) => *bad < 3_000,
            ([(Level::Warning, bad), (Level::Ok, good)], Some(range)) => *bad < 3_000 && range.contains(good),
            _ => false,
        };
        assert!(is_right, "{what}: {levels:?}");
    }
}

#[test]
fn every_text_of_a_mishap_fits() {
    let place = |height_m| Place { position: Some((-899_999_999, -1_799_999_999)), height_m };
    let unknown = Place { position: None, height_m: -12_345 };
    let began = MishapChange::Began(MishapKind::Sinking);
    for (change, place, end) in [
        (began, place(-999), " m"),
        (began, place(12_345), " m"),
        (began, unknown, " m"),
        (MishapChange::Down, place(0), "999.9 m/s"),
        (MishapChange::FliesOn, unknown, ""),
        (MishapChange::OnBench(MishapKind::Disarmed), unknown, ""),
    ] {
        let text = Report { change, place, touch: 9_999 }.text();
        assert!(!text.is_empty() && text.ends_with(end) && "HUMS: ".len() + text.len() <= 50, "{text}");
    }
    let place = Place { position: Some((473_977_420, -85_455_940)), height_m: 30 };
    let report = Report { change: MishapChange::Began(MishapKind::Impact), place, touch: 0 };
    assert_eq!(report.text(), "mishap at 47.397742,-8.545594 30 m");
}

#[test]
fn a_kill_switch_at_the_touch_down_is_no_alarm_and_in_the_air_it_is_one() {
    let low = || ROTORS.map(|of| Quad { height: 0.2, ..hovering(of) });
    let killed: Script = |ms, quad, motion| {
        (quad.state, quad.height, quad.climb) = (8, 0.0, 0.0);
        // The bounce of its legs.
        motion.load_g = if ms < 600 && ms % 100 == 0 { 2.5 } else { 1.0 };
        quad.armed = ms < 5_000;
    };
    judge(low(), "at the touch-down", (&[], LANDED), killed);
    for quad in low() {
        let outcome = fly(&quad, killed);
        let mut state = outcome.findings.iter().filter(|finding| finding.check == "autopilot_state");
        assert!(!state.any(|finding| finding.level == Level::Critical), "{:?}", outcome.findings);
    }
    judge(rotors(), "in the air", (&["disarmed_in_air", "free_fall", ".."], DOWN), |ms, quad, motion| {
        fall(ms, quad, motion);
        quad.state = 8;
    });
    let high = ROTORS.map(|of| Quad { height: 100.0, ..hovering(of) });
    judge(high, "under a parachute", (&["disarmed_in_air", ".."], DOWN), |ms, quad, motion| {
        let sunk_m = 5.0 * ms as f32 / 1_000.0;
        (quad.state, quad.throttle) = (8, 0.0);
        (quad.climb, quad.height) = if sunk_m < 100.0 { (-5.0, 100.0 - sunk_m) } else { (0.0, 0.0) };
        motion.rates = [0.1, 0.0, 0.0];
    });
}

#[test]
fn a_flight_that_is_terminated_without_an_estimate_falls_by_the_air_pressure() {
    for (falls, told, counts) in [(true, &["disarmed_in_air"][..], DOWN), (false, &[], ANY)] {
        let outcome = fly(&hovering(ROTORS[1]), |ms, quad, motion| {
            let seconds = if falls { (ms as f32 / 1_000.0).min(2.5) } else { 0.0 };
            quad.state = 8;
            motion.pressure_hpa = Some(980.0 + 0.12 * 4.9 * seconds * seconds + (ms / 50 % 3) as f32 * 0.01);
        });
        assert_eq!(outcome.told(), told, "{falls}");
        assert!(counts == ANY || outcome.flights() == counts, "{falls}");
        let at_ms = outcome.changes.first().map(|(at_ms, _)| *at_ms - AT_MS);
        assert!(!falls || at_ms.is_some_and(|at_ms| (2_000..=2_700).contains(&at_ms)), "{at_ms:?}");
    }
}

#[test]
fn what_comes_down_under_a_parachute_is_down_when_it_is_on_the_ground() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            let seconds = ms as f32 / 1_000.0;
            off(quad);
            motion.rates = [0.0; 3];
            let down_m = if ms < 1_000 { 4.9 * seconds * seconds } else { 4.9 + 5.0 * (seconds - 1.0) };
            motion.load_g = if ms < 1_000 { 0.05 } else { 1.0 };
            quad.climb = if down_m >= 80.0 { 0.0 } else { -5.0 };
            quad.height = 20.0 - down_m.min(80.0);
            motion.pressure_hpa = Some(950.0 + 0.12 * down_m.min(80.0) + (ms / 50 % 3) as f32 * 0.01);
        });
        assert_eq!(outcome.told().first(), Some(&"disarmed_in_air"), "{of:?}");
        let down_ms =
            outcome.changes.iter().find(|(_, change)| *change == MishapChange::Down).map(|(ms, _)| *ms);
        let lands_ms = AT_MS + 16_000;
        assert!(down_ms.is_some_and(|ms| (lands_ms..lands_ms + 5_000).contains(&ms)), "{of:?}: {down_ms:?}");
    }
}
