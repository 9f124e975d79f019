//! The flight, on observations made for the purpose.

use super::FlightEvent::{Landing, Resumed, TakeOff};
use super::VehicleKind::{Plane, Rotorcraft, Surface};
use super::*;
use crate::observation::LandedState::{InAir, OnGround, TakingOff};
use crate::observation::{GlobalPosition, Heartbeat, Hud, LandedState, Observation, Source, VtolState};
use crate::units::{Fraction, Metres, MetresPerSecond};

const AUTOPILOT: Source = Source { system: 1, component: 1 };

/// What a vehicle reports: its landed state twice a second, the rest every 50 ms.
#[derive(Clone, Copy, Debug, Default)]
struct Says {
    disarmed: bool,
    word: Option<LandedState>,
    /// The height at the beginning, and the climb from there, m and m/s.
    height_m: Option<f32>,
    climb_mps: f32,
    throttle: Option<f32>,
    air_mps: Option<f32>,
    ground_mps: f32,
}

/// Each of these until a time, ms.
type Script = Vec<(u64, Says)>;

/// An event, when it was found, and the time that it has: of the take-off, and of the last moment in the air.
type Event = (FlightEvent, u64, u64);

/// Disarmed for a second.
const OFF: (u64, Says) = (1_000, Says { disarmed: true, ..height(0.0) });

const fn height(height_m: f32) -> Says {
    Says { height_m: Some(height_m), ..word_of(None) }
}

const fn word(word: LandedState) -> Says {
    word_of(Some(word))
}

const fn word_of(word: Option<LandedState>) -> Says {
    let (disarmed, climb_mps, ground_mps) = (false, 0.0, 0.0);
    Says { disarmed, word, height_m: None, climb_mps, throttle: None, air_mps: None, ground_mps }
}

/// By throttle and air speed alone.
fn hud(throttle: f32, air_mps: f32) -> Says {
    Says { throttle: Some(throttle), air_mps: Some(air_mps), ..word_of(None) }
}

/// By throttle and height; with a throttle it goes at 15 m/s.
fn moves(word: Option<LandedState>, throttle: f32, height_m: f32) -> Says {
    let ground_mps = if word.is_some() && throttle > 0.0 { 15.0 } else { 0.0 };
    Says { throttle: Some(throttle), word, ground_mps, ..height(height_m) }
}

impl Says {
    fn observations(self, now_ms: u64, since_ms: u64, kind: VehicleKind) -> Vec<Observation> {
        let heartbeat = Heartbeat { armed: !self.disarmed, kind, ..Heartbeat::default() };
        let word = self.word.filter(|_| now_ms.is_multiple_of(500));
        let hud = Hud {
            throttle: self.throttle.map(Fraction),
            airspeed: self.air_mps.map(MetresPerSecond),
            ..Hud::default()
        };
        let global = self.height_m.map(|height_m| GlobalPosition {
            relative_altitude: Metres(height_m + self.climb_mps * (now_ms - since_ms) as f32 / 1_000.0),
            velocity: [self.ground_mps, 0.0, 0.0].map(MetresPerSecond),
            ..GlobalPosition::default()
        });
        let mut said = vec![Observation::Heartbeat(heartbeat)];
        said.extend(word.map(|word| Observation::Landed(word, VtolState::Unknown)));
        said.extend((self.throttle.is_some()).then_some(Observation::Hud(hud)));
        said.extend(global.map(Observation::GlobalPosition));
        said
    }
}

fn fly(kind: VehicleKind, script: &[(u64, Says)]) -> Vec<Event> {
    let (mut vehicle, mut flight, mut events) = (Vehicle::unknown(), Flight::grounded(), Vec::new());
    let (mut now_ms, mut flew_ms) = (0, 0);
    for (until_ms, says) in script {
        let since_ms = now_ms;
        while now_ms < *until_ms {
            let now = Instant::from_millis(now_ms);
            for observation in says.observations(now_ms, since_ms, kind) {
                vehicle.observe(now, AUTOPILOT, &observation);
            }
            let event = flight.step(now, &vehicle, &Params::defaults()).1;
            if flight.airborne() && !flight.may_have_landed() {
                flew_ms = now_ms;
            }
            let of_ms = flight.airborne_since().map_or(flew_ms, |since| since.as_millis());
            events.extend(event.map(|event| (event, now_ms, of_ms)));
            now_ms += 50;
        }
    }
    let is_over = events.last().is_none_or(|(event, ..)| *event == Landing);
    assert_eq!(flight.is_open(), !is_over, "{events:?}");
    events
}

#[test]
fn a_flight_begins_and_ends_by_what_is_known_of_it() {
    let valley = (17_500, Says { climb_mps: -2.0, ..moves(None, 0.5, 10.0) });
    let ground = || (5_000, moves(Some(OnGround), 0.0, 0.0));
    let hidden = || (60_000, moves(Some(OnGround), 0.5, 30.0));
    let cases: Vec<(&str, VehicleKind, Script, Vec<Event>)> = vec![
        (
            "a height above the place of arming, which is 20 m above home",
            Rotorcraft,
            vec![OFF, (5_000, height(20.0)), (10_000, height(25.0)), (30_000, height(20.1))],
            vec![(TakeOff, 5_600, 5_000), (Landing, 18_000, 9_950)],
        ),
        ("a submarine", Surface, vec![OFF, (5_000, height(0.0)), (10_000, height(25.0))], vec![]),
        (
            "a bounce, and a touch-and-go",
            Rotorcraft,
            vec![
                OFF,
                (5_000, height(0.0)),
                (20_000, height(25.0)),
                (25_000, height(0.0)),
                (26_000, height(3.0)),
                (32_000, height(0.0)),
                (50_000, height(25.0)),
                (70_000, height(0.0)),
            ],
            vec![(TakeOff, 5_600, 5_000), (Landing, 58_000, 49_950)],
        ),
        (
            "the landed state alone",
            Rotorcraft,
            vec![
                (5_000, word(OnGround)),
                (7_000, word(TakingOff)),
                (17_000, word(InAir)),
                (22_000, word(LandedState::Landing)),
                (42_000, word(OnGround)),
            ],
            vec![(TakeOff, 7_600, 7_000), (Landing, 30_000, 21_950)],
        ),
        (
            "a rover that is called flying",
            Surface,
            vec![(5_000, word(OnGround)), (25_000, word(InAir))],
            vec![],
        ),
        (
            "one wrong word",
            Rotorcraft,
            vec![
                (5_000, word(OnGround)),
                (15_000, word(InAir)),
                (15_500, word(OnGround)),
                (35_000, word(InAir)),
            ],
            vec![(TakeOff, 5_600, 5_000)],
        ),
        (
            "a landed state that is lost",
            Rotorcraft,
            vec![
                OFF,
                (5_000, height(0.0)),
                (20_000, Says { word: Some(InAir), ..height(30.0) }),
                (50_000, height(30.0)),
                (60_000, height(0.0)),
            ],
            vec![(TakeOff, 5_600, 5_000), (Landing, 58_000, 49_950)],
        ),
        ("first received in the air", Rotorcraft, vec![(2_000, height(50.0))], vec![(Resumed, 600, 0)]),
        (
            "a plane by its air speed",
            Plane,
            vec![
                OFF,
                (5_000, hud(0.0, 3.0)),
                (40_000, hud(0.6, 18.0)),
                (50_000, hud(0.0, 12.0)),
                (62_000, hud(0.0, 2.0)),
            ],
            vec![(TakeOff, 5_600, 5_000), (Landing, 58_000, 49_950)],
        ),
        ("a wind over the runway", Plane, vec![OFF, (60_000, hud(0.0, 12.0))], vec![]),
        (
            "a hover in a valley",
            Rotorcraft,
            vec![OFF, (5_000, moves(None, 0.0, 0.0)), valley, (60_000, moves(None, 0.5, -15.0))],
            vec![(TakeOff, 5_600, 5_000)],
        ),
        (
            "a landing in a valley",
            Rotorcraft,
            vec![
                OFF,
                (5_000, moves(None, 0.0, 0.0)),
                valley,
                (60_000, moves(None, 0.5, -15.0)),
                (80_000, moves(None, 0.02, -15.0)),
            ],
            vec![(TakeOff, 5_600, 5_000), (Landing, 68_000, 59_950)],
        ),
        (
            "a wrong word hides no flight",
            Rotorcraft,
            vec![OFF, ground(), hidden()],
            vec![(TakeOff, 10_000, 5_000)],
        ),
        (
            "nor its landing",
            Rotorcraft,
            vec![
                OFF,
                ground(),
                hidden(),
                (63_000, moves(Some(OnGround), 0.5, 1.5)),
                (80_000, moves(Some(OnGround), 0.0, 0.0)),
            ],
            vec![(TakeOff, 10_000, 5_000), (Landing, 71_000, 62_950)],
        ),
        ("nor that of a plane", Plane, vec![OFF, ground(), hidden()], vec![(TakeOff, 10_000, 5_000)]),
    ];
    for (what, kind, script, events) in cases {
        assert_eq!(fly(kind, &script), events, "{what}");
    }
}

#[test]
fn a_word_that_it_stands_ends_no_flight_in_the_air_and_counts_against_a_drift_and_a_moment() {
    for wrong_until_ms in [36_000, 90_000] {
        let script = [
            OFF,
            (5_000, moves(Some(OnGround), 0.0, 0.0)),
            (30_000, moves(Some(InAir), 0.5, 30.0)),
            (wrong_until_ms, moves(Some(OnGround), 0.5, 30.0)),
            (95_000, moves(Some(InAir), 0.5, 30.0)),
        ];
        assert_eq!(fly(Rotorcraft, &script), [(TakeOff, 5_600, 5_000)], "{wrong_until_ms}");
    }
    for (kind, throttle, height_m, until_ms) in [
        // An estimator that drifts, motors that are tried, a glitch of 4 s; a plane that is carried up a hill.
        (Rotorcraft, 0.15, 30.0, 60_000),
        (Rotorcraft, 0.5, 1.5, 60_000),
        (Rotorcraft, 0.5, 30.0, 9_000),
        (Plane, 0.0, 30.0, 60_000),
        (Surface, 0.5, 30.0, 60_000),
    ] {
        let stands = |until_ms| (until_ms, moves(Some(OnGround), 0.0, 0.0));
        let script =
            [OFF, stands(5_000), (until_ms, moves(Some(OnGround), throttle, height_m)), stands(70_000)];
        assert_eq!(fly(kind, &script), [], "{kind:?} {throttle} {height_m}");
    }
}
