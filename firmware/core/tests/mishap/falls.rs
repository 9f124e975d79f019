//! Free falls, disarming in the air, and the end of the flight.

use super::*;

#[test]
fn a_fall_with_the_motors_asked_for_thrust_ends_the_flight_with_its_touch() {
    for of in ROTORS {
        let outcome = fly(of, "0 fall");
        let told = outcome.told();
        assert_eq!(told.first(), Some(&"free_fall"), "{of}: {told:?}");
        assert!(told.contains(&"impact"), "{of}: {told:?}");
        let [(began_ms, MishapChange::Began(MishapKind::FreeFall)), (down_ms, MishapChange::Down)] =
            outcome.changes[..]
        else {
            panic!("{of}: {:?}", outcome.changes)
        };
        let (place, touch) = (outcome.reports[0].place, outcome.reports[1].touch);
        assert!((AT_MS + 300..=AT_MS + 500).contains(&began_ms), "{of}: {began_ms}");
        assert!((AT_MS + 3_000..AT_MS + 5_000).contains(&down_ms), "{of}: {down_ms}");
        assert_eq!(place.position, Some((473_977_420, -85_455_940)));
        assert!((150..200).contains(&touch), "{of}: {touch}");
        assert_eq!(outcome.flights(), DOWN, "{of}");
        assert_eq!(outcome.count(UsageCounter::HardLandings), 1);
        assert!(outcome.count(UsageCounter::TouchdownMax) >= 15, "{of}");
        let echoes = outcome.findings.iter().filter(|finding| {
            finding.subsystem != Subsystem::Mishap && finding.at.as_millis() > began_ms + 100
        });
        assert_eq!(echoes.count(), 0, "{of}: {:?}", outcome.findings);
    }
}

const DISARMED: &str = "
ap rover, ap boat, ap submarine, px4 rover, px4 boat, px4 submarine | a rover does not fly | - | none | * landed=air; 0 fall
rotors | in the air | disarmed_in_air .. | down | 0 fall off thr=0
rotors | below home | disarmed_in_air .. | down | * start=-10; 0 fall off thr=0; 0-2 h=-10..-30; 2 h=-30
rotors | on a hill | - | landed | 0 thr=0 landed=ground; 1 off
rotors | on a hill, without a landed state | - | landed | * landed=-; 0 thr=0; 1 off
rotors | in a valley | - | landed | 0-8 h=20..-12 c=-4; 8 h=-12 c=0 rates=0 ground=0 thr=0; 10 off
wings | a plane glides on | disarmed_in_air | down | 0 off thr=0; 0-8 ground=18 c=-2 h=20..4; 8 ground=0 c=0 h=0
wings | a plane rolls on, on a field above home | - | landed | 0 thr=0 h=8 c=0; 4 off; 0-8 ground=12; 8 ground=0
rotors 1 | a dive | - | flies | 0-1.5 load=0.05 thr=0
rotors 1 | thrown | - | flies | * mode=18; 0-1 load=0.05 thr=0.5
rotors | heard too seldom | - | flies | 0-0.05 load=0.05; 3-3.1 load=0.05; 0.05-3 unheard
# The bounce of its legs.
rotors | killed at the touch-down | - | landed | KILLED
rotors | killed in the air | disarmed_in_air free_fall .. | down | 0 fall state=8
rotors | under a parachute | disarmed_in_air .. | down | * h=100; 0 state=8 thr=0 rates=0.1,0,0; 0-20 c=-5 h=100..0; 20 c=0 h=0
";
const KILLED: &str = "* h=0.2; 0 state=8 h=0 c=0; 0-0.6%0.1:0-0.05 load=2.5; 5 off";

#[test]
fn what_is_disarmed_or_killed_in_the_air_is_told_and_what_has_landed_dives_or_is_thrown_is_not() {
    judge(&DISARMED.replace("KILLED", KILLED));
    for of in ROTORS {
        let landed = fly_between(AT_MS, AT_MS + 2_600, of, "0 rates=0 ground=0 thr=0; 1 off");
        assert!(landed.told().is_empty() && landed.flights() == LANDED, "within two seconds, {of}");
        let killed = fly(of, KILLED);
        let mut state = killed.findings.iter().filter(|finding| finding.check == "autopilot_state");
        assert!(!state.any(|finding| finding.level == Level::Critical), "{:?}", killed.findings);
    }
}

#[test]
fn a_long_fall_is_no_bad_sensor() {
    let falls =
        "* h=1000; 0-15 load=0.05 h=1000..250 c=-50; 15 h=0 c=0 thr=0 rates=0 ground=0; 15-15.1 load=15";
    for of in ROTORS {
        for pilots in ["", "; * stick"] {
            let outcome = fly(of, &format!("{falls}{pilots}"));
            assert!(!outcome.flies_on() && outcome.flights() == DOWN, "{of}{pilots}: {:?}", outcome.changes);
        }
    }
}

#[test]
fn after_a_mishap_the_next_arming_begins_anew() {
    let outcome = fly(ROTORS[0], "0 fall landed=ground; 8-20 off; 25 h=20 thr=0.5 landed=air");
    assert_eq!(outcome.flights(), (2, 0, 1), "{:?}", outcome.changes);
    assert!(outcome.monitor.flight().airborne());
    assert_eq!(outcome.monitor.health().subsystem(Subsystem::Mishap), Level::Ok);
}

#[test]
fn what_was_wrong_before_a_mishap_ends_when_it_lies_disarmed_and_when_it_is_silent() {
    for (end, good_ms) in [("12 off", Some(12_000..12_600)), ("8 silent", Some(12_400..13_200)), ("", None)] {
        let outcome = fly(ROTORS[0], &format!("0 vibe=45; 3 fall; {end}"));
        let is_down = outcome.changes.iter().any(|(_, change)| *change == MishapChange::Down);
        assert!(is_down, "{:?}", outcome.changes);
        let vibration = outcome.findings.iter().filter(|finding| finding.check == "vibration");
        let levels: Vec<_> = vibration.map(|it| (it.level, it.at.as_millis() - AT_MS)).collect();
        let is_right = match (&levels[..], good_ms) {
            ([(Level::Warning, bad)], None) => *bad < 3_000,
            ([(Level::Warning, bad), (Level::Ok, good)], Some(range)) => *bad < 3_000 && range.contains(good),
            _ => false,
        };
        assert!(is_right, "{end}: {levels:?}");
    }
}

#[test]
fn a_flight_that_is_terminated_without_an_estimate_falls_by_the_air_pressure() {
    let falls =
        "0 state=8; 0-1 hpa=980..980.6; 1-2 hpa=980.6..982.35; 2-2.5 hpa=982.35..983.7; 2.5 hpa=983.7";
    let outcome = fly(ROTORS[1], falls);
    assert_eq!((outcome.told(), outcome.flights()), (vec!["disarmed_in_air"], DOWN));
    let at_ms = outcome.changes.first().map(|(at_ms, _)| *at_ms - AT_MS);
    assert!(at_ms.is_some_and(|at_ms| (2_000..=2_700).contains(&at_ms)), "{at_ms:?}");
    assert!(fly(ROTORS[1], "0 state=8 hpa=980").told().is_empty());
}

#[test]
fn what_comes_down_under_a_parachute_is_down_when_it_is_on_the_ground() {
    let script = "0 off thr=0 rates=0; 0-1 load=0.05 c=-5 h=20..15.1 hpa=950..950.59; \
                  1-16 c=-5 h=15.1..-60 hpa=950.59..959.6; 16 c=0 h=-60 hpa=959.6";
    for of in ROTORS {
        let outcome = fly(of, script);
        assert_eq!(outcome.told().first(), Some(&"disarmed_in_air"), "{of}");
        let down = outcome.changes.iter().find(|(_, change)| *change == MishapChange::Down);
        let lands_ms = AT_MS + 16_000;
        assert!(down.is_some_and(|(ms, _)| (lands_ms..lands_ms + 5_000).contains(ms)), "{of}: {down:?}");
    }
}
