//! The flight, on observations made for the purpose.
//!
//! A script has pieces, each until a second: `5 h0 t0.5 / 20 air h25`. A vehicle is armed unless it is `off`. It has
//! a landed state (`ground`, `takingoff`, `air`, `landing`), a height `h` m, a climb of `c` m/s, a throttle `t`, an
//! air speed `a` m/s and a ground speed `v` m/s.

use super::*;
use crate::observation::{GlobalPosition, Heartbeat, Hud, LandedState, Observation, Source, VtolState};
use crate::units::{Fraction, Metres, MetresPerSecond};

const AUTOPILOT: Source = Source { system: 1, component: 1 };

fn observations(words: &str, for_s: f32, kind: VehicleKind) -> Vec<Observation> {
    let has = |word: &str| words.split(' ').any(|it| it == word);
    let number = |name: char| words.split(' ').find_map(|word| word.strip_prefix(name)?.parse::<f32>().ok());
    let heartbeat = Heartbeat { armed: !has("off"), kind, ..Heartbeat::default() };
    let mut said = vec![Observation::Heartbeat(heartbeat)];
    let landed = [
        ("ground", LandedState::OnGround),
        ("takingoff", LandedState::TakingOff),
        ("air", LandedState::InAir),
        ("landing", LandedState::Landing),
    ];
    said.extend(
        landed
            .into_iter()
            .filter(|(word, _)| has(word))
            .map(|(_, landed)| Observation::Landed(landed, VtolState::Unknown)),
    );
    let hud = Hud {
        throttle: number('t').map(Fraction),
        airspeed: number('a').map(MetresPerSecond),
        ..Hud::default()
    };
    said.extend(hud.throttle.map(|_| Observation::Hud(hud)));
    said.extend(number('h').map(|height_m| {
        let relative_altitude = Metres(height_m + number('c').unwrap_or(0.0) * for_s);
        let velocity = [number('v').unwrap_or(0.0), 0.0, 0.0].map(MetresPerSecond);
        Observation::GlobalPosition(GlobalPosition {
            relative_altitude,
            velocity,
            ..GlobalPosition::default()
        })
    }));
    said
}

/// The events of a script: when each was found, and the take-off or the last moment in the air, s.
fn fly(kind: VehicleKind, script: &str) -> String {
    let (mut vehicle, mut flight, mut events) = (Vehicle::default(), Flight::default(), Vec::new());
    let (mut now_ms, mut flew_ms) = (0, 0);
    for piece in script.split(" / ") {
        let (until_s, words) = piece.split_once(' ').unwrap();
        let (since_ms, until_ms) = (now_ms, (until_s.parse::<f32>().unwrap() * 1_000.0) as u64);
        while now_ms < until_ms {
            let now = BootMs::from_millis(now_ms);
            for observation in observations(words, (now_ms - since_ms) as f32 / 1_000.0, kind) {
                if now_ms.is_multiple_of(500) || !matches!(observation, Observation::Landed(..)) {
                    vehicle.observe(now, AUTOPILOT, &observation);
                }
            }
            let event = flight.step(now, &vehicle, &Params::defaults()).1;
            if flight.airborne() && !flight.may_have_landed() {
                flew_ms = now_ms;
            }
            let of_ms = flight.airborne_since().map_or(flew_ms, BootMs::as_millis);
            events.extend(
                event.map(|event| {
                    format!("{event:?} {} of {}", now_ms as f32 / 1_000.0, of_ms as f32 / 1_000.0)
                }),
            );
            now_ms += 50;
        }
    }
    assert_eq!(
        flight.is_open(),
        events.last().is_some_and(|event| !event.starts_with("Landing")),
        "{events:?}"
    );
    events.join(", ")
}

const VALLEY: &str = "1 off h0 / 5 h0 t0 / 17.5 h10 c-2 t0.5 / 60 h-15 t0.5";
const HIDDEN: &str = "1 off h0 / 5 ground h0 t0 / 60 ground h30 t0.5 v15";

/// A name, the vehicle, the script and the events.
const FLIGHTS: &str = "
a height above the place of arming | quad | 1 off h20 / 5 h20 / 10 h25 / 30 h20.1 | TakeOff 5.6 of 5, Landing 18 of 9.95
a submarine | surface | 1 off h0 / 5 h0 / 10 h25 | -
a bounce and a touch-and-go | quad | 1 off h0 / 5 h0 / 20 h25 / 25 h0 / 26 h3 / 32 h0 / 50 h25 / 70 h0 | TakeOff 5.6 of 5, Landing 58 of 49.95
the landed state alone | quad | 5 ground / 7 takingoff / 17 air / 22 landing / 42 ground | TakeOff 7.6 of 7, Landing 30 of 21.95
a rover that is called flying | surface | 5 ground / 25 air | -
one wrong word | quad | 5 ground / 15 air / 15.5 ground / 35 air | TakeOff 5.6 of 5
a landed state that is lost | quad | 1 off h0 / 5 h0 / 20 air h30 / 50 h30 / 60 h0 | TakeOff 5.6 of 5, Landing 58 of 49.95
received first in the air | quad | 2 h50 | Resumed 0.6 of 0
a plane by its air speed | plane | 1 off / 5 t0 a3 / 40 t0.6 a18 / 50 t0 a12 / 62 t0 a2 | TakeOff 5.6 of 5, Landing 58 of 49.95
a wind over the runway | plane | 1 off / 60 t0 a12 | -
a hover in a valley | quad | VALLEY | TakeOff 5.6 of 5
a landing in a valley | quad | VALLEY / 80 h-15 t0.02 | TakeOff 5.6 of 5, Landing 68 of 59.95
a wrong word hides no flight | quad | HIDDEN | TakeOff 10 of 5
nor its landing | quad | HIDDEN / 63 ground h1.5 t0.5 v15 / 80 ground h0 t0 | TakeOff 10 of 5, Landing 71 of 62.95
nor that of a plane | plane | HIDDEN | TakeOff 10 of 5
an estimator that drifts | quad | 1 off h0 / 5 ground h0 t0 / 60 ground h30 t0.15 v15 | -
motors that are tried | quad | 1 off h0 / 5 ground h0 t0 / 60 ground h1.5 t0.5 v15 | -
4 s | quad | 1 off h0 / 5 ground h0 t0 / 9 ground h30 t0.5 v15 / 70 ground h0 t0 | -
a plane that is carried up a hill | plane | 1 off h0 / 5 ground h0 t0 / 60 ground h30 t0 | -
a rover on a hill | surface | HIDDEN | -
a wrong word until 36 s | quad | 1 off h0 / 5 ground h0 t0 / 30 air h30 t0.5 v15 / 36 ground h30 t0.5 v15 / 95 air h30 t0.5 v15 | TakeOff 5.6 of 5
until 90 s | quad | 1 off h0 / 5 ground h0 t0 / 30 air h30 t0.5 v15 / 90 ground h30 t0.5 v15 / 95 air h30 t0.5 v15 | TakeOff 5.6 of 5
";

#[test]
fn a_flight_begins_and_ends_by_what_is_known_of_it() {
    for flight in FLIGHTS.replace("VALLEY", VALLEY).replace("HIDDEN", HIDDEN).trim().lines() {
        let [what, kind, script, events] = flight.split(" | ").collect::<Vec<_>>()[..] else {
            panic!("{flight}")
        };
        let kind = match kind {
            "quad" => VehicleKind::Rotorcraft,
            "plane" => VehicleKind::Plane,
            _ => VehicleKind::Surface,
        };
        assert_eq!(fly(kind, script), events.trim_start_matches('-'), "{what}");
    }
}
