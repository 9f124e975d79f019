//! Standing vehicles that report flight: on the bench, spooling up, landed by hand.

use crate::common::{Quad, Run};
use hums_core::observation::{Air, Hud, Imu, LandedState, Observation, VehicleKind};
use hums_core::params::Params;
use hums_core::units::{Fraction, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, RadiansPerSecond};
use hums_core::usage::UsageCounter;

fn counts(script: impl Fn(u64) -> Vec<Observation>) -> (u32, u32) {
    let mut run = Run::new(&Params::defaults());
    run.says(0..120_000, script);
    let [flights, landings, _] =
        run.counts([UsageCounter::Flights, UsageCounter::Landings, UsageCounter::Mishaps]);
    (flights, landings)
}

/// In the air from its arming on, by its autopilot.
fn called_in_air(now_ms: u64) -> Quad {
    Quad { armed: now_ms >= 5_000, landed: Some(LandedState::InAir), climb: 0.0, ..Quad::healthy() }
}

#[test]
fn what_idles_on_the_bench_does_not_fly_though_the_autopilot_calls_it_in_the_air() {
    let bench = |now_ms| Quad { height: 0.2, throttle: 0.12, ..called_in_air(now_ms) }.says(now_ms);
    assert_eq!(counts(bench), (0, 0));
    let takes_off = |now_ms| {
        let throttle = if now_ms < 40_000 { 0.12 } else { 0.45 };
        let height = if now_ms < 42_000 { 0.2 } else { 10.0 };
        Quad { height, throttle, ..called_in_air(now_ms) }.says(now_ms)
    };
    assert_eq!(counts(takes_off), (1, 0));
    let restarted =
        |now_ms| Quad { armed: true, height: 0.3, throttle: 0.4, ..called_in_air(now_ms) }.says(now_ms);
    assert_eq!(counts(restarted), (1, 0), "heard first in a hover at the height of home");
}

#[test]
fn what_a_pilot_landed_and_left_armed_has_landed() {
    let lands = |now_ms| {
        let flies = (10_000..50_000).contains(&now_ms) || (80_000..100_000).contains(&now_ms);
        let (height, throttle) = if flies { (8.0, 0.4) } else { (0.1, 0.0) };
        let mut said = Quad { height, throttle, ..called_in_air(now_ms) }.says(now_ms);
        for said in &mut said {
            if let Observation::GlobalPosition(global) = said {
                global.velocity = Default::default();
            }
        }
        said
    };
    assert_eq!(counts(lands), (2, 2));
}

#[test]
fn motors_tried_without_any_position_are_no_flight_where_the_barometer_does_not_rise() {
    let tried = |height_m: f32| {
        move |now_ms: u64| {
            let runs = now_ms >= 20_000;
            let quad = Quad { armed: now_ms >= 5_000, ..Quad::healthy() };
            let altitude = 480.0 + if runs { height_m } else { 0.3 };
            let throttle = Some(Fraction(if runs { 0.6 } else { 0.0 }));
            let hud = Hud { throttle, altitude: Some(Metres(altitude)), ..Hud::default() };
            let own =
                |said: &Observation| !matches!(said, Observation::GlobalPosition(_) | Observation::Hud(_));
            quad.says(now_ms).into_iter().filter(own).chain([Observation::Hud(hud)]).collect()
        }
    };
    assert_eq!(counts(tried(0.6)), (0, 0));
    assert_eq!(counts(tried(6.0)), (1, 0));
}

/// In the air from its arming at 5 s on, by its autopilot, without a position.
fn without_position(now_ms: u64, throttle: f32, altitude_m: Option<f32>, climb_mps: f32) -> Vec<Observation> {
    let hud = Hud {
        throttle: Some(Fraction(throttle)),
        altitude: altitude_m.map(Metres),
        climb: Some(MetresPerSecond(climb_mps)),
        ..Hud::default()
    };
    let own = |said: &Observation| !matches!(said, Observation::GlobalPosition(_) | Observation::Hud(_));
    let said = called_in_air(now_ms).says(now_ms).into_iter().filter(own);
    said.chain([Observation::Hud(hud)]).collect()
}

#[test]
fn what_has_no_throttle_and_does_not_move_does_not_fly_whatever_is_said_of_it() {
    assert_eq!(counts(|now_ms| without_position(now_ms, 0.0, None, 0.2)), (0, 0), "nothing tells its height");
    let drifts =
        |now_ms: u64| Quad { height: now_ms as f32 / 20_000.0, throttle: 0.02, ..called_in_air(now_ms) };
    assert_eq!(counts(|now_ms| drifts(now_ms).says(now_ms)), (0, 0), "its height drifts by 6 m");
    let unsaid = |now_ms| Quad { landed: None, ..drifts(now_ms) }.says(now_ms);
    assert_eq!(counts(unsaid), (0, 0), "nobody says that it flies");
    let full = |now_ms| {
        let throttle = if now_ms < 20_000 { 0.0 } else { 1.0 };
        Quad { height: 0.4, throttle, ..called_in_air(now_ms) }.says(now_ms)
    };
    assert_eq!(counts(full), (0, 0), "without propellers, all its throttle");
    let rolls = |now_ms| {
        let kind = VehicleKind::Plane;
        Quad { kind, type_number: 1, height: 0.3, throttle: 0.0, ..called_in_air(now_ms) }.says(now_ms)
    };
    assert_eq!(counts(rolls), (0, 0), "a plane that stands");
}

#[test]
fn what_hovers_low_what_glides_and_what_falls_without_throttle_flies() {
    let low = |now_ms| {
        let throttle = if now_ms < 20_000 { 0.0 } else { 0.3 };
        let climb = if (20_000..21_000).contains(&now_ms) { 0.5 } else { 0.0 };
        without_position(now_ms, throttle, Some(if now_ms < 20_000 { 480.0 } else { 480.5 }), climb)
    };
    assert_eq!(counts(low), (1, 0), "half a metre up, without a position");
    let glides = |now_ms| {
        let kind = VehicleKind::Plane;
        let mut said =
            Quad { kind, type_number: 1, height: 60.0, throttle: 0.0, climb: -1.0, ..called_in_air(now_ms) }
                .says(now_ms);
        for said in &mut said {
            if let Observation::GlobalPosition(global) = said {
                global.velocity[0] = MetresPerSecond(14.0);
            }
        }
        said
    };
    assert_eq!(counts(glides), (1, 0), "with its motor off");
    let sinks = |now_ms| {
        let (throttle, climb) = if now_ms < 60_000 { (0.5, 0.0) } else { (0.0, -4.0) };
        without_position(now_ms, throttle, None, climb)
    };
    assert_eq!(counts(sinks), (1, 0), "it descends without throttle");
}

#[test]
fn an_estimator_that_drifts_away_while_the_sensors_rest_begins_no_second_flight() {
    // As an ArduPlane's did: landed, left armed, and called landing again and again.
    let drifts = |rests: bool| {
        move |now_ms: u64| {
            let flies = (10_000..60_000).contains(&now_ms);
            let says = match now_ms {
                ..10_000 => LandedState::OnGround,
                10_000..60_000 => LandedState::InAir,
                _ if (now_ms / 10_000).is_multiple_of(3) => LandedState::OnGround,
                _ => LandedState::Landing,
            };
            let (height, throttle, climb) = match now_ms {
                _ if flies => (12.0, 0.5, 0.0),
                ..60_000 => (0.0, 0.0, 0.0),
                _ => (-(now_ms as f32 - 60_000.0) / 500.0, 0.03, -2.0),
            };
            let quad = Quad { landed: Some(says), height, throttle, climb, ..called_in_air(now_ms) };
            let mut said = quad.says(now_ms);
            for said in &mut said {
                if let Observation::Imu(imu) = said {
                    let turns = if rests || now_ms < 60_000 { 0.0 } else { 2.0 };
                    imu.rate = Some([turns, 0.0, 0.0].map(RadiansPerSecond));
                }
            }
            said
        }
    };
    assert_eq!(counts(drifts(true)), (1, 1));
    assert_ne!(counts(drifts(false)), (1, 1), "what turns may fall");
}

#[test]
fn what_rotors_do_not_shake_and_the_barometer_never_saw_rise_does_not_fly_whatever_an_estimator_makes_of_it()
{
    // Motors without propellers, half of the throttle, and an estimator that falls by 10 m.
    let script = |step_mps2: f32, rise_m: f32| {
        move |now_ms: u64| {
            let height = if now_ms < 20_000 { 0.0 } else { -((now_ms - 20_000) as f32 / 1_000.0).min(10.0) };
            let quad =
                Quad { height, throttle: if now_ms < 10_000 { 0.0 } else { 0.5 }, ..called_in_air(now_ms) };
            let noise = (now_ms / 100 % 3) as f32;
            let flies = (20_000..100_000).contains(&now_ms);
            let pressure = 960.0 + 0.01 * noise - if flies { 0.12 * rise_m } else { 0.0 };
            let force = [0.0, 0.0, -9.8 + step_mps2 * noise].map(MetresPerSecond2);
            let imu =
                Imu { acceleration: Some(force), rate: Some([RadiansPerSecond(0.01); 3]), ..Imu::default() };
            let air = Air { pressure: Some(Hectopascals(pressure)), ..Air::default() };
            let own = |said: &Observation| !matches!(said, Observation::Imu(_));
            let said = quad.says(now_ms).into_iter().filter(own);
            said.chain([Observation::Imu(imu), Observation::Air(air)]).collect()
        }
    };
    assert_eq!(counts(script(0.03, 0.5)).0, 0);
    assert_eq!(counts(script(0.03, 8.0)).0, 1, "it rose: a simulator without noise");
    assert_eq!(counts(script(0.5, 0.5)).0, 1, "it shakes: low over the ground");
    let heard_in_air = |now_ms: u64| -> Vec<Observation> {
        let hovers = Quad { armed: true, throttle: 0.5, ..called_in_air(now_ms) }.says(now_ms);
        let sensor = |said: &Observation| matches!(said, Observation::Imu(_) | Observation::Air(_));
        let still = script(0.03, 0.0)(now_ms).into_iter().filter(sensor);
        hovers.into_iter().filter(|said| !sensor(said)).chain(still).collect()
    };
    assert_eq!(counts(heard_in_air), (1, 0), "a simulator that hovers when it is heard first");
}
