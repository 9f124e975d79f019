//! Crashes in a radio gap, and falls when first received.

use hums_core::clock::{Instant, Span};
use hums_core::observation::{
    Air, Attitude, Autopilot, GlobalPosition, Imu, LandedState, Observation, VehicleKind, VtolState,
};
use hums_core::units::{Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Radians, RadiansPerSecond};

use super::super::judge::{Judge, Limits};
use super::super::judged::Judgement;
use crate::source::item::{Cause, Gap, Item};
use crate::source::recording::Format;
use common::{AUTOPILOT, Quad};

#[path = "../../../../../firmware/core/tests/common/mod.rs"]
mod common;

const AT_MS: u64 = 20_000;

const ROTORS: [(Autopilot, VehicleKind, u8); 3] = [
    (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 2),
    (Autopilot::Px4, VehicleKind::Rotorcraft, 2),
    (Autopilot::Px4, VehicleKind::Vtol, 22),
];

/// Changed by a script from [`AT_MS`] on.
struct State {
    quad: Quad,
    heard: bool,
    beats_only: bool,
    lies: bool,
    home_sank_m: f32,
    pressure_hpa: Option<f32>,
    rate: f32,
}

impl State {
    fn stand(&mut self) {
        (self.quad.height, self.quad.climb) = (0.1, 0.0);
    }

    fn land(&mut self) {
        self.stand();
        (self.quad.throttle, self.quad.armed, self.quad.landed) = (0.0, false, Some(LandedState::OnGround));
    }

    fn lie(&mut self) {
        self.land();
        (self.quad.roll, self.lies) = (1.6, true);
    }

    fn descend(&mut self, from_m: f32, sink_mps: f32, ms: u64) {
        (self.quad.height, self.quad.climb) = (from_m - sink_mps * ms as f32 / 1_000.0, -sink_mps);
    }
}

/// A minute's hover at 20 m; a span is lost at [`AT_MS`]. The script gets the time since.
fn judge(
    (autopilot, kind, type_number): (Autopilot, VehicleKind, u8),
    (begin_ms, lost): (u64, Span),
    script: impl Fn(u64, &mut State),
) -> Judgement {
    let mode = if autopilot == Autopilot::Px4 { 0x0404_0000 } else { 3 };
    let (landed, vtol) = (Some(LandedState::InAir), VtolState::Hover);
    let hover = Quad { mode, autopilot, kind, type_number, landed, vtol, ..Quad::healthy() };
    let mut judge = Judge::new(&Limits::default(), Format::Tlog);
    for now_ms in (begin_ms..60_000).step_by(50) {
        let quad = Quad { height: if now_ms < 2_000 { 0.0 } else { 20.0 }, ..hover.clone() };
        let mut state = State {
            quad,
            heard: true,
            beats_only: false,
            lies: false,
            home_sank_m: 0.0,
            pressure_hpa: None,
            rate: 0.01,
        };
        let since_ms = now_ms.checked_sub(AT_MS);
        if let Some(ms) = since_ms {
            script(ms, &mut state);
        }
        let gap = Instant::from_millis(AT_MS);
        let late = if since_ms.is_some() { lost } else { Span::ZERO };
        let now = Instant::from_millis(now_ms) + late;
        if since_ms == Some(0) && lost > Span::ZERO {
            let (from, to) = (Some(gap), Some(now));
            let words = String::new();
            judge.item(
                now,
                Item::Gap(&Gap { from, to, cause: Cause::Lost, place: None, bytes: 0, words, own: None }),
            );
        }
        if !state.heard {
            continue;
        }
        let noise = (now_ms / 50 % 7) as f32 * 0.02;
        let force = if state.lies { [9.8, 0.0, -0.5 - noise] } else { [0.0, 0.0, -9.8 - noise] };
        let rates = Some([state.rate, 0.02, 0.0].map(RadiansPerSecond));
        let imu = Imu { acceleration: Some(force.map(MetresPerSecond2)), rate: rates, ..Imu::default() };
        let roll = Radians(state.quad.roll);
        let global = GlobalPosition {
            position: None,
            relative_altitude: Metres(state.quad.height),
            altitude: Metres(480.0 + state.quad.height - state.home_sank_m),
            velocity: [0.1, 0.0, -state.quad.climb].map(MetresPerSecond),
        };
        let mut said = state.quad.says(now_ms);
        said.retain(|said| match said {
            Observation::Heartbeat(_) | Observation::Landed(..) => true,
            Observation::Imu(_) | Observation::Attitude(_) | Observation::GlobalPosition(_) => false,
            _ => !state.beats_only,
        });
        if !state.beats_only {
            said.extend([
                Observation::Imu(imu),
                Observation::Air(Air { pressure: state.pressure_hpa.map(Hectopascals), ..Air::default() }),
                Observation::Attitude(Attitude { roll, rates, ..Attitude::default() }),
                Observation::GlobalPosition(global),
            ]);
        }
        for said in &said {
            judge.item(now, Item::Observation(AUTOPILOT, said));
        }
    }
    judge.end()
}

/// Mishaps; flights, landings, mishaps in a radio gap.
fn told(judged: &Judgement) -> (Vec<&str>, [usize; 3]) {
    let mishaps = judged.problems.iter().filter(|problem| problem.is_mishap());
    let count =
        |is: fn(&super::super::flights::Flight) -> bool| judged.flights.iter().filter(|one| is(one)).count();
    let counts = [judged.flights.len(), count(|one| one.landed), count(|one| one.unheard_s().is_some())];
    (mishaps.map(|problem| problem.check.as_str()).collect(), counts)
}

#[test]
#[expect(clippy::too_many_lines, clippy::type_complexity, reason = "a table of cases")]
fn what_came_down_in_a_silence_is_told_from_what_landed_and_from_what_flies_on() {
    type After = fn(u64, &mut State);
    let dive = |ms: u64, state: &mut State, from_m, sink_mps, heard_ms: u64| {
        state.heard = !(heard_ms..heard_ms + 8_000).contains(&ms);
        if ms < heard_ms {
            state.descend(from_m, sink_mps, ms);
            state.quad.throttle = 0.2;
        } else {
            state.land();
        }
    };
    let crash = |check| (vec![check], [1, 0, 1]);
    let landing = || (vec![], [1, 0, 0]);
    let cases: [(&str, u64, After, (Vec<&str>, [usize; 3])); 11] = [
        ("lies over", 6_000, |_, state| state.lie(), crash("overturned")),
        ("had the time to land, and was laid down", 12_000, |_, state| state.lie(), landing()),
        (
            "drives in vain",
            12_000,
            |_, state| {
                state.stand();
                state.quad.throttle = 1.0;
            },
            crash("impact"),
        ),
        ("is disarmed earlier than a landing takes", 5_200, |_, state| state.land(), crash("impact")),
        ("is disarmed a second later", 6_200, |_, state| state.land(), crash("impact")),
        ("landed", 15_000, |_, state| state.land(), landing()),
        ("flies on", 15_000, |_, _| (), (vec![], [1, 0, 0])),
        (
            "climbs with all its throttle",
            15_000,
            |_, state| {
                (state.quad.height, state.quad.climb, state.quad.throttle) = (12.0, 3.0, 1.0);
            },
            (vec![], [1, 0, 0]),
        ),
        (
            "hovers with all its throttle",
            15_000,
            |_, state| {
                (state.quad.height, state.quad.throttle) = (12.0, 1.0);
            },
            (vec![], [1, 0, 0]),
        ),
        (
            "was 4 m above a hill, and set home anew",
            6_200,
            |_, state| {
                state.land();
                state.home_sank_m = -16.0;
            },
            landing(),
        ),
        (
            "starts again, and tells later how it lies",
            6_000,
            |ms, state| {
                state.lie();
                state.beats_only = ms < 14_000;
            },
            crash("impact"),
        ),
    ];
    for of in ROTORS {
        for (what, silent_ms, after, outcome) in &cases {
            let judged = judge(of, (0, Span::ZERO), |ms, state| {
                state.heard = ms >= *silent_ms;
                if state.heard {
                    after(ms, state);
                }
            });
            assert_eq!(told(&judged), *outcome, "{what}: {of:?}");
        }
        let lost = judge(of, (0, Span::from_secs(5)), |_, state| state.land());
        assert_eq!(told(&lost), crash("impact"), "lost of the recording: {of:?}");
        let slow = judge(of, (0, Span::ZERO), |ms, state| dive(ms, state, 100.0, 5.5, 2_000));
        assert_eq!(told(&slow).0, ["impact"], "as fast as it may be told to: {of:?}");
        let fast = judge(of, (0, Span::ZERO), |ms, state| dive(ms, state, 160.0, 18.0, 4_000));
        assert!(!told(&fast).0.contains(&"impact"), "it was in a dive: {of:?}");
    }
}

#[test]
fn what_falls_disarmed_when_it_is_heard_first_is_a_mishap_and_what_is_carried_down_is_none() {
    for of in ROTORS {
        let falls = || vec!["disarmed_in_air"];
        let cases = [
            ("falls", 9.0, 0.0, 0, falls()),
            ("falls and tumbles", 9.0, 7.0, 0, falls()),
            ("falls, disarmed half a second later", 9.0, 0.0, 500, falls()),
            ("is carried down", 4.0, 0.0, 0, vec![]),
        ];
        for (what, sink_mps, rate, armed_ms, outcome) in cases {
            let judged = judge(of, (AT_MS, Span::ZERO), |ms, state| {
                let down_m = sink_mps * ms.min(3_000) as f32 / 1_000.0;
                state.land();
                (state.quad.landed, state.quad.armed) = (Some(LandedState::InAir), ms < armed_ms);
                if ms < 3_000 {
                    state.descend(30.0, sink_mps, ms);
                    state.rate = rate;
                }
                state.pressure_hpa = Some(980.0 + 0.12 * down_m + (ms / 50 % 3) as f32 * 0.01);
            });
            assert_eq!(told(&judged).0, outcome, "{what}: {of:?}");
        }
    }
}
