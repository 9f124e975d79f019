//! Impacts, landings and wrecks.

use super::*;

const CRASH: &str = "0-1 ground=18 c=-3; 1 c=0 ground=0 thr=0 h=0.5 rates=0; 1-1.1 load=8";
const HARD: &str = "0-9.6 c=-2 h=20..0.8; 9.6 c=0 h=0.8 thr=0; 9.6-9.7 load=4; 10.6 landed=ground; 12.6 off";
const HITS: &str = "0-5 thr=0.95 c=-12 h=60..0; 5 thr=0.5 c=0 h=0 load=1.4 rates=1.5,0.7,0.4; 5-5.1 load=15";
const DROPS: &str = "0-0.45 load=0.4 h=0.7 c=-2; 0.45 rates=0 h=0 c=-1.5 thr=0.2";

const CASES: &str = "
wings | it flies into the ground | impact | down | CRASH
rotors | a shock alone: a gust, a bird, a hard manoeuvre | - | flies | 0-0.1 load=6
rotors | disarmed before it lies still | impact | down | 0-3.3 c=-6 h=20..0.2; 3.3 c=0 h=0.3 ground=0 rates=0.5,0,0 thr=0.4; 3.3-3.4 load=10; 5.3 off thr=0; 5.9 rates=0
rotors | a hard landing | - | landed | HARD
rotors | a landing that legs take, though it moves sideways | - | landed | 0-7.8 ground=3.3 c=-2.5 h=20..0.5; 7.8 c=0 h=0.2 thr=0 ground=0 rates=0; 7.8-7.9 load=3.8
rotors | a jolt, shaking, and a landing | - | landed | 0-0.5 ground=4; 0.5 ground=1; 0.5-31%2:0-0.05 load=4.2; 30 h=0.1 thr=0 c=0 ground=0 rates=0 landed=ground; 33 off
rotors | a hop, and it lies at 45 degrees | impact | down | 0-2 c=-1.5 h=3..0; 2 c=0 h=0 thr=0 ground=0 rates=0 load=0.7 drag=0.7; 2-2.1 load=6
rotors | a hop onto a slope of 20 degrees | - | landed | 0-2 c=-1.5 h=3..0; 2 c=0 h=0 thr=0 ground=0 rates=0 load=0.94 drag=0.34; 2-2.1 load=6; 3 landed=ground; 5 off
wings | it lands without throttle and skids | - | any | 0-2 ground=11.5 c=-0.4 h=0.8..0; 2 c=0 h=0 ground=0; 2-3.44 ground=11.5..0; 2-2.1 load=10.8; 3.5 rates=0; 0 thr=0.05
wings | the same with throttle | impact | any | 0-2 ground=11.5 c=-0.4 h=0.8..0; 2 c=0 h=0 ground=0; 2-3.44 ground=11.5..0; 2-2.1 load=10.8; 3.5 rates=0; 0 thr=0.6; 3.6 landed=ground
wings | it stops | impact | any | 0 thr=0; 0-1 ground=20; 1 ground=0 h=0.5 rates=0; 1-1.1 load=6
wings | slower | - | any | 0 thr=0; 0-1 ground=12; 1 ground=0 h=0.5 rates=0; 1-1.1 load=6
rotors | carried home armed | free_fall .. | down | 0 fall; 8 ground=3 rates=0.4,0.5,0.2 h=1.5
rotors | it dances with all its thrust | sinking | down | 0 thr=1; 0-2.5 c=-8 h=20..0; 2.5 c=0.3 h=0.6 ground=0.5 rates=0.5,0.3,2.5
rotors | it hovers later | free_fall .. | again | 0 fall; 20 c=0 h=12 thr=0.5 ground=0.1 load=1 rates=0.01,0.02,0
rotors | it turns over | overturned | flies | 1-3 roll=2.5 rates=3,0.5,0
# The throttle of a climb is none of a hover.
rotors 3 | out of a long climb | free_fall .. | down | * c=3 thr=0.9; 0 thr=0.4 fall
rotors 1 | it drops low | - | any | DROPS
ap quad mode=1 hover | it lies on its back, whatever its estimator says | impact overturned | down | 0-1 load=5 rates=12,3,0; 1 load=-1 rates=0 c=-12 thr=0.4; 1-40 h=-7..-397
";

#[test]
fn an_impact_is_a_shock_a_speed_that_breaks_off_and_then_stillness_and_a_landing_is_none() {
    judge(&CASES.replace("CRASH", CRASH).replace("HARD", HARD).replace("DROPS", DROPS));
    assert_eq!(fly(WINGS[0], CRASH).reports[0].touch, 30, "as it sank before the shock");
    assert_eq!(fly(ROTORS[0], HARD).count(UsageCounter::HardLandings), 1);
}

#[test]
fn what_turns_over_after_a_shock_hit_something_first_with_its_greatest_shock() {
    for of in ROTORS {
        let outcome = fly(of, "1-3 roll=2.5 rates=3,0.5,0; 0-0.1 load=11; 1.4-1.5 load=4");
        let (impact, over) = (outcome.first("impact"), outcome.first("overturned"));
        assert!((impact.value - 11.0).abs() < 0.1, "{of}: {impact:?}");
        assert_eq!(impact.at, over.at, "{of}");
    }
}

#[test]
fn a_shock_between_two_samples_of_what_fell_is_an_impact_at_its_own_time() {
    let outcome = fly(ROTORS[0], &format!("{DROPS}; @0.45 shock=17"));
    let impact = outcome.first("impact");
    assert!((impact.value - 17.0).abs() < 0.1, "{impact:?}");
    assert_eq!(outcome.monitor.flight().hit_at(), BootMs::from_millis(AT_MS + 450));
}

#[test]
fn what_lies_over_with_running_motors_never_flies_on() {
    for of in &ROTORS[..4] {
        let outcome = fly(of, &format!("{HITS}; 5 roll=1.3 ground=3; 5%6:0-1.5 roll=2.4"));
        assert!(outcome.told().starts_with(&["sinking", "impact"]), "{of}: {:?}", outcome.told());
        assert!(!outcome.flies_on() && outcome.flights() == DOWN, "{of}: {:?}", outcome.changes);
        let upright = fly(of, HITS);
        assert_eq!(upright.flights(), DOWN, "{of}: {:?}", upright.changes);
    }
}

#[test]
fn what_an_estimate_moves_and_the_receiver_does_not_never_flies_on() {
    for of in &ROTORS[..2] {
        let strays = |receiver_mps: f32| {
            let moves =
                "5 ground=3.5 c=0.2 load=1; 5-5.1 load=15; 5-40 h=4.5..8; 0-5 hpa=955..962.2; 5 hpa=962.2";
            fly(of, &format!("{HITS}; {moves}; 0 gps={receiver_mps}"))
        };
        let rests = strays(0.1);
        assert!(!rests.flies_on() && rests.flights() == DOWN, "{of}: {:?}", rests.changes);
        let flies = strays(3.4);
        assert!(flies.flies_on(), "{of}: {:?}", flies.changes);
    }
}

#[test]
fn what_is_disarmed_is_not_to_be_disarmed_and_what_a_mishap_was_is_no_value_of_now() {
    for (script, orders) in [("0 fall", Orders::Own), ("0 fall off", Orders::Nothing)] {
        assert_eq!(fly(ROTORS[0], script).first("impact").orders, orders);
    }
    let outcome = fly(ROTORS[0], "0 fall; 10 off");
    let over =
        outcome.findings.iter().filter(|one| one.subsystem == Subsystem::Mishap && one.level == Level::Ok);
    assert!(over.clone().all(Finding::is_unjudged), "{:?}", over.collect::<Vec<_>>());
}

#[test]
fn what_its_rotors_shake_hit_something_at_the_last_shocks_and_not_at_the_first() {
    for of in ROTORS {
        let outcome =
            fly(of, "0-20.1%0.4:0-0.1 load=4.5; 20-20.1 load=12; 20.1-21 rates=3,0.5,0; 20.1 roll=2.5 thr=0");
        let hit_ms = outcome.monitor.flight().hit_at().as_millis();
        assert!((AT_MS + 19_000..=AT_MS + 20_100).contains(&hit_ms), "{of}: {hit_ms}");
    }
}

#[test]
fn a_second_shock_does_not_hide_the_first() {
    for of in ROTORS {
        let shocks =
            "0-0.5 ground=15; 0.5 ground=0.2 h=0.3 thr=0.4 rates=0.5,0,0; 0.5-0.6 load=6; 1.8-1.9 load=4.5";
        let outcome = fly(of, &format!("{shocks}; 2 rates=0 thr=0"));
        assert_eq!(outcome.told(), ["impact"], "{of}: {:?}", outcome.changes);
        assert_eq!(outcome.monitor.flight().hit_at(), BootMs::from_millis(AT_MS + 500), "{of}");
    }
}

#[test]
fn what_stands_with_little_throttle_flies_no_more_whatever_its_estimate_says() {
    for of in ROTORS {
        let is_multicopter = of.contains("quad") || of.contains("hexa");
        let stands = "0-40 h=20..140; 0 c=3 ground=4 rates=0 hpa=955 thr=0.12";
        let outcome = fly(of, stands);
        assert!(outcome.told().is_empty(), "{of}: {:?}", outcome.told());
        assert_eq!(outcome.flights(), (1, u32::from(is_multicopter), 0), "{of}");
        let flew_into_it = fly(of, &format!("{stands} load=1.4; 0-5 hpa=955..959.2; 5 hpa=959.2"));
        let told = if is_multicopter { vec!["impact"] } else { Vec::new() };
        assert_eq!(
            (flew_into_it.told(), flew_into_it.flights().2),
            (told, u32::from(is_multicopter)),
            "{of}"
        );
        assert_eq!(fly(of, &format!("{stands}; 0 thr=0.3")).flights(), FLIES, "{of}");
    }
}

#[test]
fn what_holds_its_place_in_the_air_after_a_knock_flies_on() {
    for (height, throttle) in [(3.0, 0.45), (20.0, 0.45), (20.0, 0.25), (300.0, 0.7), (-25.0, 0.45)] {
        for knock_g in [3.5, 5.0, 9.0] {
            for word in ["landed=air; 10-10.5 landed=ground", "landed=-"].iter().take(if height > 0.0 {
                2
            } else {
                1
            }) {
                let script =
                    format!("* h={height} thr={throttle} c=0 {word}; 0-0.8 load={knock_g} rates=6.2,0,0");
                let outcome = fly("", &script);
                assert_eq!(outcome.flights(), FLIES, "{script}: {:?}", outcome.changes);
                let is_last = matches!(outcome.changes.last(), Some((_, MishapChange::FliesOn)));
                assert!(is_last && outcome.monitor.flight().airborne(), "{script}: {:?}", outcome.changes);
            }
        }
    }
}

#[test]
fn a_silence_after_a_knock_ends_no_flight_of_what_hangs_in_the_air() {
    let outcome = fly("c=0", "0-0.8 load=5 rates=6.2,0,0; 1-9 unheard");
    assert!(outcome.flies_on() && outcome.monitor.flight().airborne(), "{:?}", outcome.changes);
}

#[test]
fn little_throttle_alone_is_no_landing() {
    for height in [3.0_f32, 7.0, 20.0, 300.0, -25.0] {
        for throttle in [0.04, 0.07, 0.09, 0.12, 0.19] {
            for vehicle in ["ap quad", "px4 hexa"] {
                let script = format!(
                    "0-8 landed=ground thr=0 h=0 c=0; 8 landed=air shake=0.02; 8-20 thr={} h=0..{height} c={}; \
                     20 thr={throttle} h={height} c=0; 0-30 ground=0.1; 30 ground=3",
                    3.0 * throttle,
                    height / 12.0
                );
                let outcome = fly_between(0, 60_000, vehicle, &script);
                assert_eq!(outcome.flights(), FLIES, "{vehicle} {script}");
                assert!(outcome.monitor.flight().airborne(), "{vehicle} {script}");
            }
        }
    }
}

#[test]
fn a_barometer_that_freezes_before_the_take_off_hides_no_flight() {
    for (frozen_s, height) in [(3.0, 5.0), (7.0, 20.0), (7.9, 300.0), (30.0, 20.0)] {
        for ground_mps in [0.1, 6.0] {
            let high_hpa = if frozen_s > 8.0 { 957.0 - 0.12 * height } else { 957.0 };
            let script = format!(
                "0-2 off; 0-8 landed=ground thr=0 h=0 hpa=957; 8 landed=air thr=0.4 h={height} hpa={high_hpa} \
                 ground={ground_mps} c=-1; 8%4:0-2 c=1; {frozen_s} frozen={high_hpa}"
            );
            let outcome = fly_between(0, 60_000, "", &script);
            assert_eq!(outcome.flights(), FLIES, "{script}");
            assert!(outcome.findings.iter().any(|finding| finding.check == "baro_stuck"), "{script}");
        }
    }
}
