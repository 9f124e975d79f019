//! Sinking without a command.

use super::*;

const THRUSTS: &str = "0 ground=8; 0-8 c=-3.4 thr=1 h=60..32.8";

const CASES: &str = "
rotors | the autopilot flies | sinking | flies | 0-2 c=-8 h=200..184
rotors | the pilot | - | flies | * stick; 0-2 c=-8 h=200..184
wings | on wings | - | flies | 0-2 c=-8 h=200..184
ap heli mode=26 hover landed=air, ap quad mode=18 hover landed=air | autorotation, THROW | - | flies | 0-5 c=-10 thr=0
rotors | an estimator that does not believe itself, against the air | - | any | 0-6 hpa=1000..997.6; 6 hpa=997.6; 0 vel=1.5 c=0; 1.5-7.9 c=-10; 8 thr=0 rates=0; 8-8.1 load=4
rotors | with the air | sinking | flies | 0 vel=1.5; 0-2 hpa=1000..1002 c=-8; 2 hpa=1002 c=0
wings | with all its thrust, and it pulls out | sinking | flies | 0 ground=8; 0-8 c=-3.4 thr=1 h=60..32.8; 5-5.5 load=4
wings | it glides | - | flies | 0 ground=8; 0-8 c=-3.4 thr=0 h=60..32.8; 0 thr=0
wings | the pilot dives | - | flies | * dive; 0 ground=8; 0-8 c=-3.4 thr=1 h=60..32.8
wings | it follows its glide path against the wind | - | flies | * h=90; 0 ground=8 thr=1 c=-0.7; 0-40 h=90..62
rotors | slowly, with all its thrust | sinking | flies | * h=60; 0-6 c=-4.5 h=60..33 thr=0.97
rotors | it is told to | - | flies | * h=60; 0-6 c=-4.5 h=60..33 thr=0.3
rotors 3 | it is told to bank steeply | - | flies | * h=60; 0 bank=0.8; 0-6 c=-4.5 h=60..33 thr=0.97
rotors 3 | it is told to bank | sinking | flies | * h=60; 0 bank=0.3; 0-6 c=-4.5 h=60..33 thr=0.97
rotors | its barometer says that it stands | - | flies | 0 c=0 hpa=980; 3-8 c=-12
rotors | a barometer that never changes | sinking | flies | 0 c=0 frozen=980; 3-8 c=-12
rotors | its display says that it stands | - | flies | 0 c=0 display=0.02; 3-8 c=-12
rotors | its display sinks too | sinking | flies | 0 c=0 display=0; 3-8 c=-12 display=-6
rotors | nothing but zeros is no display | sinking | flies | 0 c=0 display=0; 3-8 c=-12
rotors | a script asks for it | - | flies | 0-2 c=-8 h=200..184 wants=-8.5; 2 wants=0
rotors | it falls, and was to sink | sinking | any | 0 fall load=0.5 wants=-6.5
rotors | it is to sink slowly | sinking | flies | 0 wants=-2 c=0; 0-2 c=-8
";

#[test]
fn sinking_is_a_mishap_unless_somebody_asks_for_it_or_a_witness_denies_it() {
    judge(CASES);
    let (began_ms, _) = fly(WINGS[0], THRUSTS).changes[0];
    assert!((AT_MS + 3_000..AT_MS + 4_000).contains(&began_ms), "{began_ms}");
}

#[test]
fn only_what_hangs_upright_on_rotors_is_told_to_climb() {
    let in_vain = "0 thr=1; 0-3 c=-2 h=200..188; 3-6 c=-8 h=188..176";
    for (what, vehicle, orders, script) in [
        ("it sinks", ROTORS[0], Orders::Own, "0-2 c=-8 h=200..184"),
        (
            "it was on its side a second before",
            ROTORS[0],
            Orders::Disarm,
            "0-0.5 roll=1.9; 0.5 roll=0.1; 0-3 h=200..176 c=-8; 0-0.6 c=0",
        ),
        ("it leans by 50 degrees", ROTORS[0], Orders::Disarm, "0-2 c=-8 h=200..184; 0 roll=0.87"),
        (
            "it turns by 150 degrees a second",
            ROTORS[0],
            Orders::Disarm,
            "0-2 c=-8 h=200..184; 0 rates=2.6,0,0",
        ),
        ("it has lost a motor", ROTORS[0], Orders::Disarm, "0 amps=5,0,5,5; 2-4 c=-8 h=200..184"),
        ("all the throttle does not do it", ROTORS[0], Orders::Disarm, in_vain),
        ("it hangs on wings", WINGS[0], Orders::Nothing, in_vain),
    ] {
        assert_eq!(fly(vehicle, script).first("sinking").orders, orders, "{what}");
    }
}
