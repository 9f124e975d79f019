//! The flight, on observations made for the purpose.

use super::*;
use crate::observation::{GlobalPosition, Heartbeat, Hud, LandedState, Observation, Source, VtolState};
use crate::units::{Fraction, Metres, MetresPerSecond};

const AUTOPILOT: Source = Source { system: 1, component: 1 };

fn fly(kind: VehicleKind, heights_m: &[(u64, f32)]) -> Vec<(u64, FlightEvent)> {
    let mut vehicle = Vehicle::unknown();
    let mut flight = Flight::grounded();
    let mut events = Vec::new();
    let mut now_ms = 0;
    for (until_ms, height_m) in heights_m {
        while now_ms < *until_ms {
            let now = Instant::from_millis(now_ms);
            let heartbeat = Heartbeat { armed: now_ms >= 1_000, kind, ..Heartbeat::default() };
            vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
            let global = GlobalPosition { relative_altitude: Metres(*height_m), ..GlobalPosition::default() };
            vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
            events.extend(flight.step(now, &vehicle, &Params::defaults()).1.map(|event| (now_ms, event)));
            now_ms += 50;
        }
    }
    events
}

#[test]
fn height_above_the_place_of_arming_is_a_take_off() {
    let heights = [(5_000, 20.0), (10_000, 25.0), (30_000, 20.1)];
    // Two seconds of standing, and then the flight is over.
    let expected = [(5_600, FlightEvent::TakeOff), (19_950, FlightEvent::Landing)];
    assert_eq!(fly(VehicleKind::Rotorcraft, &heights), expected);
}

#[test]
fn a_submarine_never_flies() {
    assert_eq!(fly(VehicleKind::Surface, &[(5_000, 0.0), (10_000, 25.0)]), []);
}

#[test]
fn a_bounce_and_a_touch_and_go_are_one_flight() {
    let heights = [
        (5_000, 0.0),
        (20_000, 25.0),
        (25_000, 0.0),
        (26_000, 3.0),
        (32_000, 0.0),
        (50_000, 25.0),
        (70_000, 0.0),
    ];
    let events: Vec<_> = fly(VehicleKind::Rotorcraft, &heights).into_iter().map(|(_, event)| event).collect();
    assert_eq!(events, [FlightEvent::TakeOff, FlightEvent::Landing]);
}

/// Armed all along; what the autopilot says of it, each for so many messages, two a second.
fn told(kind: VehicleKind, words: &[(u64, LandedState)]) -> Vec<(u64, FlightEvent)> {
    let (mut vehicle, mut flight, mut events, mut now_ms) =
        (Vehicle::unknown(), Flight::grounded(), Vec::new(), 0);
    let heartbeat = Heartbeat { armed: true, kind, ..Heartbeat::default() };
    for (messages, landed) in words {
        for _ in 0..messages * 10 {
            let now = Instant::from_millis(now_ms);
            vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
            if now_ms % 500 == 0 {
                vehicle.observe(now, AUTOPILOT, &Observation::Landed(*landed, VtolState::Unknown));
            }
            events.extend(flight.step(now, &vehicle, &Params::defaults()).1.map(|event| (now_ms, event)));
            now_ms += 50;
        }
    }
    events
}

#[test]
fn the_autopilots_own_word_counts() {
    let words = [
        (10, LandedState::OnGround),
        (4, LandedState::TakingOff),
        (20, LandedState::InAir),
        (10, LandedState::Landing),
        (40, LandedState::OnGround),
    ];
    let expected = [(7_600, FlightEvent::TakeOff), (31_950, FlightEvent::Landing)];
    assert_eq!(told(VehicleKind::Rotorcraft, &words), expected);
}

#[test]
fn a_rover_never_flies_whatever_its_landed_state_says() {
    assert_eq!(told(VehicleKind::Surface, &[(10, LandedState::OnGround), (40, LandedState::InAir)]), []);
}

#[test]
fn one_wrong_word_is_no_landing() {
    let mut words = vec![(10, LandedState::OnGround), (20, LandedState::InAir)];
    words.extend([(1, LandedState::OnGround), (40, LandedState::InAir)]);
    assert_eq!(told(VehicleKind::Rotorcraft, &words).len(), 1);
}

#[test]
fn a_landed_state_that_is_lost_leaves_the_decision_to_what_else_is_known() {
    let (mut vehicle, mut flight, mut events) = (Vehicle::unknown(), Flight::grounded(), Vec::new());
    for now_ms in (0..60_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let heartbeat =
            Heartbeat { armed: now_ms >= 1_000, kind: VehicleKind::Rotorcraft, ..Heartbeat::default() };
        vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
        let height_m = if (5_000..50_000).contains(&now_ms) { 30.0 } else { 0.0 };
        let global = GlobalPosition { relative_altitude: Metres(height_m), ..GlobalPosition::default() };
        vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
        if (5_000..20_000).contains(&now_ms) {
            vehicle.observe(now, AUTOPILOT, &Observation::Landed(LandedState::InAir, VtolState::Unknown));
        }
        events.extend(flight.step(now, &vehicle, &Params::defaults()).1);
    }
    assert_eq!(events, [FlightEvent::TakeOff, FlightEvent::Landing]);
}

#[test]
fn who_is_heard_first_in_the_air_goes_on_in_the_air_at_once() {
    let (mut vehicle, mut flight) = (Vehicle::unknown(), Flight::grounded());
    let mut events = Vec::new();
    for now_ms in (0..2_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let heartbeat = Heartbeat { armed: true, kind: VehicleKind::Rotorcraft, ..Heartbeat::default() };
        vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
        let global = GlobalPosition { relative_altitude: Metres(50.0), ..GlobalPosition::default() };
        vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
        events.extend(flight.step(now, &vehicle, &Params::defaults()).1.map(|event| (now_ms, event)));
    }
    assert_eq!(events, [(600, FlightEvent::Resumed)]);
}

/// Armed from 1 s on, without any position: its throttle and its airspeed, each until a time.
fn fly_by_hud(kind: VehicleKind, said: &[(u64, f32, f32)], height_m: Option<f32>) -> Vec<FlightEvent> {
    let (mut vehicle, mut flight, mut events, mut now_ms) =
        (Vehicle::unknown(), Flight::grounded(), Vec::new(), 0);
    for (until_ms, throttle, airspeed_mps) in said {
        while now_ms < *until_ms {
            let now = Instant::from_millis(now_ms);
            let heartbeat = Heartbeat { armed: now_ms >= 1_000, kind, ..Heartbeat::default() };
            vehicle.observe(now, AUTOPILOT, &Observation::Heartbeat(heartbeat));
            let hud = Hud {
                throttle: Some(Fraction(*throttle)),
                airspeed: Some(MetresPerSecond(*airspeed_mps)),
                ..Hud::default()
            };
            vehicle.observe(now, AUTOPILOT, &Observation::Hud(hud));
            if let Some(height_m) = height_m {
                // Down into a valley, where it stays.
                let height_m =
                    if now_ms < 5_000 { 0.0 } else { (20.0 - now_ms as f32 / 500.0).max(height_m) };
                let relative_altitude = Metres(height_m);
                let global = GlobalPosition { relative_altitude, ..GlobalPosition::default() };
                vehicle.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
            }
            events.extend(flight.step(now, &vehicle, &Params::defaults()).1);
            now_ms += 50;
        }
    }
    events
}

#[test]
fn a_plane_without_a_position_flies_by_its_airspeed_and_a_wind_over_the_runway_is_no_flight() {
    let flown = [(5_000, 0.0, 3.0), (40_000, 0.6, 18.0), (50_000, 0.0, 12.0), (60_000, 0.0, 2.0)];
    let expected = [FlightEvent::TakeOff, FlightEvent::Landing];
    assert_eq!(fly_by_hud(VehicleKind::Plane, &flown, None), expected);
    assert_eq!(fly_by_hud(VehicleKind::Plane, &[(60_000, 0.0, 12.0)], None), []);
}

#[test]
fn a_multicopter_that_hovers_below_its_place_of_arming_flies_until_it_stands_there() {
    let hovers = [(5_000, 0.0, 0.0), (60_000, 0.5, 0.0)];
    assert_eq!(fly_by_hud(VehicleKind::Rotorcraft, &hovers, Some(-15.0)), [FlightEvent::TakeOff]);
    let lands = [(5_000, 0.0, 0.0), (60_000, 0.5, 0.0), (80_000, 0.02, 0.0)];
    let expected = [FlightEvent::TakeOff, FlightEvent::Landing];
    assert_eq!(fly_by_hud(VehicleKind::Rotorcraft, &lands, Some(-15.0)), expected);
}

/// Armed from 1 s on; what the autopilot says of its landing, its throttle and its height, each until a time. The events, and
/// since when it was in the air after the last step.
fn told_and_seen(
    kind: VehicleKind,
    said: &[(u64, LandedState, f32, f32)],
) -> (Vec<FlightEvent>, Option<Instant>) {
    let (mut vehicle, mut flight, mut events, mut now_ms) =
        (Vehicle::unknown(), Flight::grounded(), Vec::new(), 0);
    for (until_ms, landed, throttle, height_m) in said {
        while now_ms < *until_ms {
            let now = Instant::from_millis(now_ms);
            let heartbeat = Heartbeat { armed: now_ms >= 1_000, kind, ..Heartbeat::default() };
            let relative_altitude = Metres(*height_m);
            let hud = Hud { throttle: Some(Fraction(*throttle)), ..Hud::default() };
            let north = MetresPerSecond(if *throttle > 0.0 { 15.0 } else { 0.0 });
            let velocity = [north, MetresPerSecond(0.0), MetresPerSecond(0.0)];
            let global = GlobalPosition { relative_altitude, velocity, ..GlobalPosition::default() };
            for observation in [
                Observation::Heartbeat(heartbeat),
                Observation::Landed(*landed, VtolState::Unknown),
                Observation::Hud(hud),
                Observation::GlobalPosition(global),
            ] {
                vehicle.observe(now, AUTOPILOT, &observation);
            }
            events.extend(flight.step(now, &vehicle, &Params::defaults()).1);
            now_ms += 50;
        }
    }
    (events, flight.airborne_since())
}

#[test]
fn a_word_that_it_stands_hides_no_flight() {
    use LandedState::OnGround;
    let flown = [(5_000, OnGround, 0.0, 0.0), (60_000, OnGround, 0.5, 30.0)];
    let expected = (vec![FlightEvent::TakeOff], Some(Instant::from_millis(5_000)));
    assert_eq!(told_and_seen(VehicleKind::Rotorcraft, &flown), expected);
    let landed = [&flown[..], &[(63_000, OnGround, 0.5, 1.5), (80_000, OnGround, 0.0, 0.0)]].concat();
    let expected = (vec![FlightEvent::TakeOff, FlightEvent::Landing], None);
    assert_eq!(told_and_seen(VehicleKind::Rotorcraft, &landed), expected);
}

#[test]
fn a_word_that_it_stands_again_in_the_air_ends_no_flight() {
    use LandedState::{InAir, OnGround};
    for wrong_until_ms in [36_000, 90_000] {
        let flown = [
            (5_000, OnGround, 0.0, 0.0),
            (30_000, InAir, 0.5, 30.0),
            (wrong_until_ms, OnGround, 0.5, 30.0),
            (95_000, InAir, 0.5, 30.0),
        ];
        let (events, since) = told_and_seen(VehicleKind::Rotorcraft, &flown);
        assert_eq!((events, since.is_some()), (vec![FlightEvent::TakeOff], true), "{wrong_until_ms}");
    }
}

#[test]
fn a_word_that_it_stands_counts_against_what_may_drift_and_against_a_moment() {
    use LandedState::OnGround;
    for (kind, throttle, height_m, until_ms) in [
        // An estimator that drifts, motors that are tried, a glitch of 4 s; a plane that is carried up a hill.
        (VehicleKind::Rotorcraft, 0.15, 30.0, 60_000),
        (VehicleKind::Rotorcraft, 0.5, 1.5, 60_000),
        (VehicleKind::Rotorcraft, 0.5, 30.0, 9_000),
        (VehicleKind::Plane, 0.0, 30.0, 60_000),
        (VehicleKind::Surface, 0.5, 30.0, 60_000),
    ] {
        let said = [
            (5_000, OnGround, 0.0, 0.0),
            (until_ms, OnGround, throttle, height_m),
            (70_000, OnGround, 0.0, 0.0),
        ];
        assert_eq!(told_and_seen(kind, &said), (vec![], None), "{kind:?} {throttle} {height_m}");
    }
    let fast = [(5_000, OnGround, 0.0, 0.0), (60_000, OnGround, 0.5, 30.0)];
    assert_eq!(told_and_seen(VehicleKind::Plane, &fast).0, [FlightEvent::TakeOff]);
}
