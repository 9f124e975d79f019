//! Tumbling and turning over.

use super::*;

const ON_GROUND: &str = "* landed=ground h=0 thr=0; ";

const CASES: &str = "
rotors | tumbles | tumbling | flies | 0-1.5 rates=15,2,0
ap quad mode=1 hover landed=air, px4 quad mode=acro hover landed=air, ap plane mode=4 hover landed=air | acro | - | flies | 0-3 rates=8,0,0
wings | a roll and a dive | - | flies | 0 ground=18; 0-1 rates=6.5,0,0 c=-12 load=0.1
wings | a spin | tumbling | flies | 0 ground=18; 0-4 rates=6.5,1,3
rotors | overturned | overturned | flies | 0-1.5 roll=2.5 rates=3,0.5,0
wings | a roll | - | flies | 0-1.5 roll=2.5 rates=3,0.5,0
rotors 4 | overturned in acro | - | flies | * acro; 0-1.5 roll=2.5 rates=3,0.5,0
rotors | what flies fast is carried by the air too | - | flies | 0 h=40 thr=0.5 ground=30; 0-0.5 rates=0,2,0; 0.5-4 load=0.4 drag=0.9 pitch=-1.1
rotors | its rotors turn it over | overturned | none | * landed=ground h=0 thr=0; 0-1.5 thr=0.4; 4 off; 0-0.5 roll=0..2 rates=4.5,0,0; 0.5 roll=0.3 rates=0 load=-0.9
rotors | a hand turns it over | - | none | * landed=ground h=0 thr=0; 4 off; 0-0.5 roll=0..2 rates=4.5,0,0; 0.5 roll=0.3 rates=0 load=-0.9
rotors 1 | each arming | overturned overturned overturned | none | * landed=ground h=0 thr=0; 0%13:0-1.5 thr=0.4; 0%13:4-8.05 off; 0%13:0-0.5 roll=1 rates=4.5,0,0; 0%13:0.5-6 roll=0.3 rates=0 load=-0.9
";

#[test]
fn turning_over_is_told_unless_a_pilot_a_plane_or_a_hand_does_it() {
    judge(CASES);
    for of in ROTORS {
        let stopped = "0 h=40 thr=0.5 ground=1; 0-0.5 rates=0,2,0; 0.5-4 load=0.4 drag=0.9 pitch=-1.1";
        let lies = fly(of, stopped);
        assert!(lies.told().contains(&"overturned"), "{of}: {:?}", lies.changes);
    }
    let outcome = fly(ROTORS[0], "0-1.5 roll=2.5 rates=3,0.5,0");
    let tilt_deg = outcome.first("overturned").value;
    assert!((tilt_deg - 143.2).abs() < 1.0, "{tilt_deg}");
    let is_roll = |finding: &Finding| finding.check == "roll";
    assert!(!outcome.findings.iter().any(is_roll), "an attitude is not wrong: {:?}", outcome.findings);
}

#[test]
fn a_vehicle_that_recovers_from_tumbling_has_one_flight() {
    let outcome = fly(ROTORS[0], "0-1.5 rates=15,2,0");
    let [(began_ms, MishapChange::Began(MishapKind::Tumbling)), (over_ms, MishapChange::FliesOn)] =
        outcome.changes[..]
    else {
        panic!("{:?}", outcome.changes)
    };
    assert!(began_ms <= AT_MS + 700 && (AT_MS + 6_000..AT_MS + 7_000).contains(&over_ms), "{over_ms}");
    let last = outcome.findings.last().unwrap();
    assert_eq!((last.check, last.level), ("tumbling", Level::Ok));
}

#[test]
fn on_the_bench_it_is_an_event_for_each_arming_and_not_told() {
    let outcome = fly(ROTORS[0], &format!("{ON_GROUND}0%5:0-2 rates=9,0,0"));
    assert!(outcome.told().is_empty(), "{:?}", outcome.findings);
    let is_event = matches!(outcome.changes[..], [(_, MishapChange::OnBench(MishapKind::Tumbling))]);
    assert!(is_event, "{:?}", outcome.changes);
    let carried = fly(ROTORS[0], &format!("{ON_GROUND}* off; 0 fall"));
    assert!(carried.changes.is_empty(), "nobody watches what is carried about");
}

#[test]
fn an_attitude_that_the_sensors_contradict_is_none() {
    for of in ROTORS {
        let outcome = fly(of, "0 rates=0.122,0.02,0; 0-25.75 roll=0..3.1415; 25.75-40 roll=0..1.738");
        let mut attitude = outcome.findings.iter().filter(|of| matches!(of.check, "roll" | "pitch"));
        assert!(outcome.told().is_empty() && attitude.next().is_none(), "{of}: {:?}", outcome.findings);
    }
}
