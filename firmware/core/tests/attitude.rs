//! Roll and pitch against their setpoints.

use crate::common::{Quad, Run, Script};
use hums_core::observation::{AttitudeSetpoint, Observation};
use hums_core::parameters::Params;
use hums_core::units::Radians;

fn is_found(vehicle: &str, wanted: Option<f32>) -> bool {
    let (mut run, script) =
        (Run::new(&Params::defaults()), Script::new(&format!("* {vehicle}; 20-25 roll=1.2")));
    run.says(0..60_000, |now_ms| {
        let mut quad = Quad::healthy();
        script.play(now_ms as i64, |said| assert!(quad.take(said), "{}", said.name()));
        let is_banked = (20_000..25_000).contains(&now_ms);
        let roll = |roll| AttitudeSetpoint {
            roll: Radians(if is_banked { roll } else { 0.0 }),
            ..AttitudeSetpoint::default()
        };
        wanted
            .map(|wanted| Observation::AttitudeSetpoint(roll(wanted)))
            .into_iter()
            .chain(quad.says(now_ms))
            .collect()
    });
    assert!(run.of_check("pitch").next().is_none(), "{vehicle}");
    run.of_check("roll").next().is_some()
}

#[test]
fn a_bank_that_is_wanted_is_none_and_one_that_nobody_asked_for_is_found() {
    for mode in ["ap mode=3", "ap mode=0", "px4 mode=mission", "px4 mode=stabilized"] {
        assert!(!is_found(mode, Some(1.0)), "{mode}: wanted");
        assert!(is_found(mode, Some(0.1)), "{mode}: not wanted");
        assert!(is_found(mode, Some(-1.2)), "{mode}: the other way");
        assert!(is_found(mode, None), "{mode}: nobody says what is wanted");
    }
}

#[test]
fn where_the_pilot_asks_for_rates_a_bank_says_nothing_by_itself() {
    for (mode, is_judged) in [
        ("ap mode=11", true),
        ("ap mode=13", true),
        ("px4 mode=rattitude", true),
        ("ap mode=1", false),
        ("px4 mode=acro", false),
    ] {
        assert!(!is_found(mode, None), "{mode}");
        assert_eq!(is_found(mode, Some(0.0)), is_judged, "{mode}: it does not follow");
    }
}

#[test]
fn a_quaternion_that_is_none_wants_nothing() {
    assert_eq!(AttitudeSetpoint::from_quaternion([0.0; 4]), None);
    assert_eq!(AttitudeSetpoint::from_quaternion([f32::NAN, 0.0, 0.0, 0.0]), None);
    let half = core::f32::consts::FRAC_PI_8;
    let rolled = AttitudeSetpoint::from_quaternion([half.cos(), half.sin(), 0.0, 0.0]).unwrap();
    assert!((rolled.roll.0 - 2.0 * half).abs() < 1e-5 && rolled.pitch.0.abs() < 1e-5, "{rolled:?}");
    let pitched = AttitudeSetpoint::from_quaternion([half.cos(), 0.0, half.sin(), 0.0]).unwrap();
    assert!((pitched.pitch.0 - 2.0 * half).abs() < 1e-5 && pitched.roll.0.abs() < 1e-5, "{pitched:?}");
}

#[test]
fn a_plane_with_rotors_is_a_vtol_once_it_says_what_it_flies_on() {
    assert!(!is_found("ap plane mode=19", None), "a plane banks");
    assert!(is_found("ap plane mode=19 landed=air hover", None));
}
