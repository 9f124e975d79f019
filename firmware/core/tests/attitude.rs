//! Roll and pitch against their setpoints.

use crate::common::{Quad, Run};
use hums_core::observation::{Autopilot, Observation, VehicleKind, Wanted};
use hums_core::params::Params;
use hums_core::units::Radians;

const BANK: f32 = 1.2;
const NOTHING: [&str; 0] = [];

/// A minute in which it banks from 20 s on; `wanted` is the autopilot's roll setpoint then, if it sends one.
fn banks(vehicle: &Quad, wanted: Option<f32>) -> Vec<&'static str> {
    let mut run = Run::new(&Params::defaults());
    run.says(0..60_000, |now_ms| {
        let is_banked = (20_000..25_000).contains(&now_ms);
        let quad = Quad { roll: if is_banked { BANK } else { vehicle.roll }, ..vehicle.clone() };
        let roll = |roll| Wanted { roll: Radians(if is_banked { roll } else { 0.0 }), ..Wanted::default() };
        wanted.map(|wanted| Observation::Wanted(roll(wanted))).into_iter().chain(quad.says(now_ms)).collect()
    });
    let mut checks = run.checks();
    checks.retain(|check| matches!(*check, "roll" | "pitch"));
    checks
}

fn quad(autopilot: Autopilot, mode: u32) -> Quad {
    Quad { mode, autopilot, ..Quad::healthy() }
}

const ANGLES: [(Autopilot, u32); 4] = [
    (Autopilot::ArduPilot, 3),
    (Autopilot::ArduPilot, 0),
    (Autopilot::Px4, 0x0404_0000),
    (Autopilot::Px4, 0x0007_0000),
];

#[test]
fn a_bank_that_is_wanted_is_none_and_one_that_nobody_asked_for_is_found() {
    for (autopilot, mode) in ANGLES {
        let quad = quad(autopilot, mode);
        assert_eq!(banks(&quad, Some(BANK - 0.2)), NOTHING, "{autopilot:?} {mode:x}: wanted");
        assert_eq!(banks(&quad, Some(0.1)), ["roll"], "{autopilot:?} {mode:x}: not wanted");
        assert_eq!(banks(&quad, Some(-BANK)), ["roll"], "{autopilot:?} {mode:x}: the other way");
        assert_eq!(banks(&quad, None), ["roll"], "{autopilot:?} {mode:x}: nobody says what is wanted");
    }
}

#[test]
fn where_the_pilot_asks_for_rates_a_bank_says_nothing_by_itself() {
    // ArduCopter's DRIFT and SPORT, PX4's RATTITUDE.
    for (autopilot, mode) in
        [(Autopilot::ArduPilot, 11), (Autopilot::ArduPilot, 13), (Autopilot::Px4, 0x0008_0000)]
    {
        let quad = quad(autopilot, mode);
        assert_eq!(banks(&quad, None), NOTHING, "{autopilot:?} {mode:x}");
        assert_eq!(banks(&quad, Some(0.0)), ["roll"], "{autopilot:?} {mode:x}: it does not follow");
    }
    // ACRO of both: PX4 still sends the setpoint of the mode before.
    for (autopilot, mode) in [(Autopilot::ArduPilot, 1), (Autopilot::Px4, 0x0005_0000)] {
        let quad = quad(autopilot, mode);
        assert!(
            banks(&quad, None).is_empty() && banks(&quad, Some(0.0)).is_empty(),
            "{autopilot:?} {mode:x}"
        );
    }
}

#[test]
fn a_quaternion_that_is_none_wants_nothing() {
    assert_eq!(Wanted::from_quaternion([0.0; 4]), None);
    assert_eq!(Wanted::from_quaternion([f32::NAN, 0.0, 0.0, 0.0]), None);
    let half = core::f32::consts::FRAC_PI_8;
    let rolled = Wanted::from_quaternion([half.cos(), half.sin(), 0.0, 0.0]).unwrap();
    assert!((rolled.roll.0 - 2.0 * half).abs() < 1e-5 && rolled.pitch.0.abs() < 1e-5, "{rolled:?}");
    let pitched = Wanted::from_quaternion([half.cos(), 0.0, half.sin(), 0.0]).unwrap();
    assert!((pitched.pitch.0 - 2.0 * half).abs() < 1e-5 && pitched.roll.0.abs() < 1e-5, "{pitched:?}");
}

#[test]
fn a_plane_with_rotors_is_a_vtol_once_it_says_what_it_flies_on() {
    use hums_core::observation::{LandedState, VtolState};
    let plane = Quad { kind: VehicleKind::Plane, type_number: 1, mode: 19, ..Quad::healthy() };
    assert!(banks(&plane, None).is_empty(), "a plane banks");
    let hovers = Quad { landed: Some(LandedState::InAir), vtol: VtolState::Hover, ..plane };
    assert_eq!(banks(&hovers, None), ["roll"]);
}
