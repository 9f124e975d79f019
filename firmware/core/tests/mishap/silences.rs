//! Mishaps and terminations during a silence of the link.

use super::*;

const CASES: &str = "
rotors | it landed and is armed | - | landed | 0-15 unheard; 15 stands thr=0 landed=ground
rotors | it landed and is disarmed | - | landed | 0-15 unheard; 15 rests
rotors | it flies on | - | flies | 0-15 unheard
rotors | it climbs | - | any | 0-15 unheard; 15 h=12 c=3 thr=1
rotors | it hovers lower with all its throttle | - | any | 0-15 unheard; 15 h=12 thr=1
rotors | it was terminated and lies over | disarmed_in_air .. | down | 0-4 unheard; 4 stands lies state=8 thr=0
rotors | it was terminated and stands | - | any | 0-12 unheard; 12 stands state=8 thr=0 landed=ground
rotors | home was set anew | - | landed | 0-6.2 unheard; 6.2 rests sank=-16
rotors | it had the time to land and was laid down | - | landed | 0-12 unheard; 12 rests lies roll=1.6
rotors | a landing | - | landed | 0-4 c=-3 h=20..8; 4 rests; 4-24 unheard; 24-27 beats
rotors | killed after a landing | - | any | 0 beats; 0-12 unheard; 12 rests on state=8
ap plane mode=10 hover landed=air | a plane lands as ever | - | landed | 0 ground=18; 0-6 unheard; 0-8 beats; 20.05 rests
rotors | it sank before it was received | - | none | * state=8 thr=0 start=20; 0 c=-4 rates=2,0,0
rotors | it lay before it was received | - | none | * state=8 thr=0 start=20; 0 stands lies
";

#[test]
fn a_silence_is_judged_by_what_comes_after_it_and_a_vehicle_that_was_off_before_it_was_received_is_not() {
    judge(CASES);
    judge_from(
        0,
        "rotors | it hits | - | none | * off thr=0; 0-0.9 c=-9 h=8..-0.1; 0.9 c=0 h=0; 0.9-1 load=12
         rotors | it is knocked | - | none | * off thr=0 start=0 h=0 load=-1; 1-1.05 load=5",
    );
}

#[test]
fn what_is_terminated_in_the_air_and_neither_stands_nor_falls_at_once_is_a_mishap() {
    for of in ROTORS {
        let drifts = fly(of, "0 state=8 ground=4; 7.05 stands lies");
        assert_eq!((drifts.told().first(), drifts.flights()), (Some(&"disarmed_in_air"), DOWN), "{of}");
        let at_ms = drifts.changes.first().map(|(at_ms, _)| *at_ms);
        assert!(at_ms.is_some_and(|at_ms| at_ms < AT_MS + 4_500), "{of}: {at_ms:?}");
    }
}
