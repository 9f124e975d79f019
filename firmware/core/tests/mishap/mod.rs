//! Mishaps, scripted for each class of vehicle: signs, false signs, and the end of the flight.
#![expect(clippy::panic, reason = "that is how a test fails")]

mod falls;
mod impacts;
mod silences;
mod sinks;
mod turns;

use crate::common::{AUTOPILOT, Quad, Run, Said, Script, observe, rows};
use hums_core::Monitor;
use hums_core::health::{Finding, Level, Orders, Subsystem};
use hums_core::mishap::{MishapChange, MishapKind, Report};
use hums_core::observation::{
    Air, Attitude, AttitudeSetpoint, Autopilot, GlobalPosition, Hud, Imu, LandedState, Observation, Source,
    TelemetryRadio,
};
use hums_core::parameters::Params;
use hums_core::time::BootMs;
use hums_core::units::{
    Fraction, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Position, Radians, RadiansPerSecond,
};
use hums_core::usage::UsageCounter;

/// The script begins here.
const AT_MS: u64 = 20_000;
const RADIO: Source = Source { system: 51, component: 68 };

#[derive(Clone, Copy, Default)]
struct Motion {
    load_g: f32,
    /// A force from ahead.
    drag_g: f32,
    rates: [f32; 3],
    ground_mps: f32,
    pitch: f32,
    pressure_hpa: Option<f32>,
    shock_g: Option<f32>,
    displayed_mps: Option<f32>,
    roll_wanted: Option<f32>,
    unheard: bool,
    beats_only: bool,
    /// Fall of the home height, m.
    home_sank_m: f32,
}

const CALM: [f32; 3] = [0.01, 0.02, 0.0];

impl Motion {
    fn calm() -> Self {
        Self { load_g: 1.0, rates: CALM, ground_mps: 0.1, pitch: 0.02, ..Self::default() }
    }

    /// Words of the motion: forces in g, rates in rad/s, speeds in m/s. `hpa` is a live barometer, `frozen` one that repeats its value.
    fn take(&mut self, said: &Said<'_>, now_ms: u64, quad: &mut Quad) {
        let is_px4 = quad.autopilot == Autopilot::Px4;
        match said.name() {
            _ if quad.take(said) => {}
            "load" => self.load_g = said.number(),
            "shake" => self.load_g += said.number() * (now_ms / 50 % 3) as f32,
            "drag" => self.drag_g = said.number(),
            "rates" => self.rates = said.list(),
            "ground" => self.ground_mps = said.number(),
            "pitch" => self.pitch = said.number(),
            "hpa" => self.pressure_hpa = Some(said.number() + (now_ms / 50 % 3) as f32 * 0.01),
            "frozen" => self.pressure_hpa = Some(said.number()),
            "shock" => self.shock_g = Some(said.number()),
            "display" => self.displayed_mps = Some(said.number()),
            "bank" => self.roll_wanted = Some(said.number()),
            "unheard" => self.unheard = true,
            "beats" => self.beats_only = true,
            "sank" => self.home_sank_m = said.number(),
            "fall" => self.fall(said.since_ms, quad),
            "stands" => self.stand(quad),
            "rests" => {
                self.stand(quad);
                (quad.throttle, quad.armed, quad.landed) = (0.0, false, Some(LandedState::OnGround));
            }
            "lies" => (self.load_g, self.drag_g) = (0.05, 1.0),
            // Modes in which the pilot has the throttle, on rotors and on wings, and one that is made for turning over.
            "stick" => quad.mode = if is_px4 { 0x0007_0000 } else { 0 },
            "dive" => quad.mode = if is_px4 { 0x0001_0000 } else { 5 },
            "acro" => quad.mode = if is_px4 { 0x0005_0000 } else { 1 },
            word => panic!("{word}: no word"),
        }
    }

    fn fall(&mut self, ms: u64, quad: &mut Quad) {
        let seconds = ms as f32 / 1_000.0;
        if ms < 2_000 {
            (self.load_g, quad.climb, quad.height) = (0.05, -9.8 * seconds, 20.0 - 4.9 * seconds * seconds);
        } else {
            (quad.climb, quad.height, quad.throttle) = (0.0, 0.0, 0.0);
            self.load_g = if ms < 2_100 { 15.0 } else { 1.0 };
            self.rates = [0.0; 3];
        }
    }

    fn stand(&mut self, quad: &mut Quad) {
        (quad.height, quad.climb, self.ground_mps, self.rates) = (0.1, 0.0, 0.0, [0.0; 3]);
    }
}

struct Outcome {
    monitor: Monitor,
    findings: Vec<Finding>,
    changes: Vec<(u64, MishapChange)>,
    reports: Vec<Report>,
}

impl Outcome {
    fn told(&self) -> Vec<&'static str> {
        let of_mishap =
            |finding: &&Finding| finding.subsystem == Subsystem::Mishap && finding.level == Level::Critical;
        self.findings.iter().filter(of_mishap).map(|finding| finding.check).collect()
    }

    fn first(&self, check: &str) -> &Finding {
        self.findings.iter().find(|finding| finding.check == check).unwrap_or_else(|| panic!("no {check}"))
    }

    fn count(&self, counter: UsageCounter) -> u32 {
        self.monitor.usage().value(counter).unwrap_or(0.0) as u32
    }

    fn flights(&self) -> Counts {
        let [flights, landings, mishaps] =
            [UsageCounter::Flights, UsageCounter::Landings, UsageCounter::Mishaps].map(|of| self.count(of));
        (flights, landings, mishaps)
    }

    fn flies_on(&self) -> bool {
        let flies_on =
            |change: &MishapChange| matches!(change, MishapChange::FliesOn | MishapChange::FliesAgain);
        self.changes.iter().any(|(_, change)| flies_on(change))
    }
}

fn said_besides(said: &Observation, beats_only: bool) -> bool {
    let beats = matches!(said, Observation::Heartbeat(_) | Observation::Landed(..));
    let made =
        matches!(said, Observation::Imu(_) | Observation::Attitude(_) | Observation::GlobalPosition(_));
    if beats_only { beats } else { !made }
}

/// A minute; the script begins at [`AT_MS`].
fn fly(vehicle: &str, script: &str) -> Outcome {
    fly_between(AT_MS, 60_000, vehicle, script)
}

fn fly_between(at_ms: u64, end_ms: u64, vehicle: &str, script: &str) -> Outcome {
    let script = Script::new(&format!("* {vehicle}; {script}"));
    let mut run = Run::new(&Params::defaults());
    run.steps(0..end_ms, |now_ms, monitor| {
        let now = BootMs::from_millis(now_ms);
        let (mut quad, mut motion) = (Quad::healthy(), Motion::calm());
        script.play(now_ms as i64 - at_ms as i64, |said| motion.take(said, now_ms, &mut quad));
        if motion.unheard {
            monitor.observe(now, RADIO, &Observation::TelemetryRadio(TelemetryRadio::default()));
        }
        let noise = (now_ms / 50 % 7) as f32 * 0.002;
        let forces_g = [motion.drag_g, 0.0, -(motion.load_g + noise)];
        let acceleration = Some(forces_g.map(|force_g| MetresPerSecond2(force_g * 9.806_65)));
        let rates = Some(motion.rates.map(RadiansPerSecond));
        let imu = Imu { acceleration, rate: rates, ..Imu::default() };
        if let Some(shock_g) = motion.shock_g {
            monitor.observe(now, AUTOPILOT, &Observation::Shock(MetresPerSecond2(shock_g * 9.806_65)));
        }
        if !motion.unheard && !motion.beats_only {
            monitor.observe(now, AUTOPILOT, &Observation::Imu(imu));
        }
        if now_ms.is_multiple_of(100) && !motion.unheard {
            let (roll, pitch) = (Radians(quad.roll), Radians(motion.pitch));
            let attitude = Attitude { roll, pitch, rates, ..Attitude::default() };
            let height = if now_ms < 2_000 { quad.start_height } else { quad.height };
            let global = GlobalPosition {
                position: Some(Position { latitude_deg: 47.397_742, longitude_deg: -8.545_594 }),
                relative_altitude: Metres(height),
                altitude: Metres(480.0 + height - motion.home_sank_m),
                velocity: [motion.ground_mps, 0.0, -quad.climb].map(MetresPerSecond),
            };
            let said = quad.says(now_ms).into_iter().filter(|said| said_besides(said, motion.beats_only));
            let air = Air { pressure: motion.pressure_hpa.map(Hectopascals), ..Air::default() };
            let own =
                [Observation::Air(air), Observation::Attitude(attitude), Observation::GlobalPosition(global)];
            let hud = motion.displayed_mps.map(|climb_mps| {
                let throttle = Some(Fraction(quad.throttle));
                Observation::Hud(Hud { throttle, climb: Some(MetresPerSecond(climb_mps)), ..Hud::default() })
            });
            let wanted = motion.roll_wanted.map(|roll| {
                Observation::AttitudeSetpoint(AttitudeSetpoint {
                    roll: Radians(roll),
                    ..AttitudeSetpoint::default()
                })
            });
            let own = own.into_iter().filter(|_| !motion.beats_only);
            observe(monitor, now_ms, AUTOPILOT, said.chain(hud).chain(wanted).chain(own));
        }
    });
    let changes = run.reports.iter().map(|(at_ms, report)| (*at_ms, report.change)).collect();
    let reports = run.reports.iter().map(|(_, report)| *report).collect();
    Outcome { monitor: run.monitor, findings: run.findings, changes, reports }
}

/// Flights, landings and mishaps.
type Counts = (u32, u32, u32);
const FLIES: Counts = (1, 0, 0);
const LANDED: Counts = (1, 1, 0);
const DOWN: Counts = (1, 0, 1);
const NONE: Counts = (0, 0, 0);

fn vehicles(text: &str) -> Vec<&str> {
    let (of, count) = text.split_once(' ').unwrap_or((text, "6"));
    match of {
        "rotors" => ROTORS.iter().take(count.parse().expect(text)).copied().collect(),
        "wings" => WINGS.to_vec(),
        _ => text.split(", ").collect(),
    }
}

/// Cases, one a line: the vehicles that fly it, what it is, the reported mishaps in order (after ".." any others), what is counted, and
/// the script.
fn judge(cases: &str) {
    judge_from(AT_MS, cases);
}

fn judge_from(at_ms: u64, cases: &str) {
    for [of, what, told, counts, script] in rows(cases) {
        let counts = match counts {
            "flies" => Some(FLIES),
            "landed" => Some(LANDED),
            "down" => Some(DOWN),
            "none" => Some(NONE),
            "again" => Some((2, 0, 1)),
            "any" => None,
            _ => panic!("{what}: {counts}?"),
        };
        for vehicle in vehicles(of) {
            let outcome = fly_between(at_ms, 60_000, vehicle, script);
            let is = outcome.told().join(" ");
            let is_told =
                told.strip_suffix("..").map_or(is == told, |first| format!("{is} ").starts_with(first));
            let is_counted = counts.is_none_or(|counts| outcome.flights() == counts);
            assert!(
                is_told && is_counted,
                "{what}, {vehicle}: {is} {:?} {:?}",
                outcome.flights(),
                outcome.changes
            );
        }
    }
}

/// In modes in which the autopilot flies: AUTO of ArduPilot, missions of PX4.
const ROTORS: &[&str] = &[
    "ap quad mode=3 hover landed=air",
    "px4 quad mode=mission hover landed=air",
    "ap hexa mode=3 hover landed=air",
    "ap heli mode=3 hover landed=air",
    "ap vtol mode=10 hover landed=air",
    "px4 vtol mode=mission hover landed=air",
];
const WINGS: &[&str] = &[
    "ap plane mode=10 forward landed=air",
    "px4 plane mode=mission forward landed=air",
    "ap vtol mode=10 forward landed=air",
    "px4 vtol mode=mission forward landed=air",
];
