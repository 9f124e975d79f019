//! Mishaps, scripted for each class of vehicle: signs, false signs, and the end of the flight.

mod falls;
mod impacts;
mod silences;
mod sinks;
mod turns;

use crate::common::{AUTOPILOT, Quad, Run, observe};
use hums_core::Monitor;
use hums_core::health::{Finding, Level, Orders, Subsystem};
use hums_core::mishap::{MishapChange, MishapKind, Place, Report};
use hums_core::observation::{
    Air, Attitude, Autopilot, GlobalPosition, Hud, Imu, LandedState, Observation, Source, TelemetryRadio,
    VehicleKind, VtolState, Wanted,
};
use hums_core::params::Params;
use hums_core::time::BootMs;
use hums_core::units::{
    Amperes, Fraction, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Position, Radians,
    RadiansPerSecond,
};
use hums_core::usage::UsageCounter;

const AT_MS: u64 = 20_000;

const RADIO: Source = Source { system: 51, component: 68 };

/// Motion of the vehicle besides the messages of a [`Quad`].
#[derive(Clone, Copy)]
struct Motion {
    load_g: f32,
    drag_g: f32,
    rates: [f32; 3],
    ground_mps: f32,
    pitch: f32,
    pressure_hpa: Option<f32>,
    /// The greatest specific force since the last sample, for a shock.
    shock_g: Option<f32>,
    displayed_mps: Option<f32>,
    roll_wanted: Option<f32>,
    unheard: bool,
    /// The autopilot sends only heartbeats, and whether it reports a landing.
    beats_only: bool,
    /// Fall of the home height, m.
    home_sank_m: f32,
}

const CALM: Motion = Motion {
    load_g: 1.0,
    drag_g: 0.0,
    rates: [0.01, 0.02, 0.0],
    ground_mps: 0.1,
    pitch: 0.02,
    pressure_hpa: None,
    shock_g: None,
    displayed_mps: None,
    roll_wanted: None,
    unheard: false,
    beats_only: false,
    home_sank_m: 0.0,
};

type Script = fn(u64, &mut Quad, &mut Motion);

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

    fn count(&self, counter: UsageCounter) -> u32 {
        self.monitor.usage().value(counter).unwrap_or(0.0) as u32
    }

    fn flights(&self) -> (u32, u32, u32) {
        let [flights, landings, mishaps] =
            [UsageCounter::Flights, UsageCounter::Landings, UsageCounter::Mishaps].map(|of| self.count(of));
        (flights, landings, mishaps)
    }
}

/// Whether an observation is independent of the motion that [`fly_from`] adds.
fn said_besides(said: &Observation, beats_only: bool) -> bool {
    let beats = matches!(said, Observation::Heartbeat(_) | Observation::Landed(..));
    let made =
        matches!(said, Observation::Imu(_) | Observation::Attitude(_) | Observation::GlobalPosition(_));
    if beats_only { beats } else { !made }
}

/// A minute; `script` gets the time since [`AT_MS`].
fn fly(vehicle: &Quad, script: impl Fn(u64, &mut Quad, &mut Motion)) -> Outcome {
    fly_from(AT_MS, vehicle, script)
}

fn fly_from(at_ms: u64, vehicle: &Quad, script: impl Fn(u64, &mut Quad, &mut Motion)) -> Outcome {
    fly_between(at_ms, 60_000, vehicle, script)
}

fn fly_until(end_ms: u64, vehicle: &Quad, script: impl Fn(u64, &mut Quad, &mut Motion)) -> Outcome {
    fly_between(AT_MS, end_ms, vehicle, script)
}

fn fly_between(
    at_ms: u64,
    end_ms: u64,
    vehicle: &Quad,
    script: impl Fn(u64, &mut Quad, &mut Motion),
) -> Outcome {
    let mut run = Run::new(&Params::defaults());
    run.steps(0..end_ms, |now_ms, monitor| {
        let now = BootMs::from_millis(now_ms);
        let (mut quad, mut motion) = (vehicle.clone(), CALM);
        if now_ms >= at_ms {
            script(now_ms - at_ms, &mut quad, &mut motion);
        }
        if motion.unheard {
            monitor.observe(now, RADIO, &Observation::TelemetryRadio(TelemetryRadio::default()));
        }
        // No sensor repeats one value for ever.
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
            let wanted = motion
                .roll_wanted
                .map(|roll| Observation::Wanted(Wanted { roll: Radians(roll), ..Wanted::default() }));
            let own = own.into_iter().filter(|_| !motion.beats_only);
            observe(monitor, now_ms, AUTOPILOT, said.chain(hud).chain(wanted).chain(own));
        }
    });
    let changes = run.reports.iter().map(|(at_ms, report)| (*at_ms, report.change)).collect();
    let reports = run.reports.iter().map(|(_, report)| *report).collect();
    Outcome { monitor: run.monitor, findings: run.findings, changes, reports }
}

type Of = (Autopilot, VehicleKind, u8);

type Counts = (u32, u32, u32);

type Come<'a> = (&'a [&'a str], Counts);

/// Each of these vehicles flies the script. `told` are the reported mishaps, in order; after ".." any others.
fn judge(
    vehicles: impl IntoIterator<Item = Quad>,
    what: &str,
    (told, counts): Come<'_>,
    script: impl Fn(u64, &mut Quad, &mut Motion),
) {
    judge_from(AT_MS, vehicles, what, (told, counts), script);
}

fn judge_from(
    at_ms: u64,
    vehicles: impl IntoIterator<Item = Quad>,
    what: &str,
    (told, counts): Come<'_>,
    script: impl Fn(u64, &mut Quad, &mut Motion),
) {
    for quad in vehicles {
        let outcome = fly_from(at_ms, &quad, &script);
        let is_told = match told {
            [first @ .., ".."] => outcome.told().starts_with(first),
            all => outcome.told() == all,
        };
        let of = (quad.autopilot, quad.kind, quad.type_number);
        let came = (outcome.told(), outcome.flights(), &outcome.changes);
        assert!(is_told && (counts == ANY || outcome.flights() == counts), "{what}, {of:?}: {came:?}");
    }
}

fn rotors() -> impl Iterator<Item = Quad> {
    ROTORS.into_iter().map(hovering)
}

fn wings() -> impl Iterator<Item = Quad> {
    WINGS.into_iter().map(on_wings)
}

/// It flies on, it landed, it came down in a mishap.
const FLIES: Counts = (1, 0, 0);
const LANDED: Counts = (1, 1, 0);
const DOWN: Counts = (1, 0, 1);
const ANY: Counts = (u32::MAX, 0, 0);

/// Falls from 20 m for two seconds, hits with 15 g, and lies.
fn fall(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    let seconds = ms as f32 / 1_000.0;
    if ms < 2_000 {
        (motion.load_g, quad.climb, quad.height) = (0.05, -9.8 * seconds, 20.0 - 4.9 * seconds * seconds);
    } else {
        (quad.climb, quad.height, quad.throttle) = (0.0, 0.0, 0.0);
        motion.load_g = if ms < 2_100 { 15.0 } else { 1.0 };
        motion.rates = [0.0; 3];
    }
}

fn vehicle(autopilot: Autopilot, kind: VehicleKind, type_number: u8) -> Quad {
    // A mode in which the autopilot flies: ArduCopter's AUTO, ArduPlane's and PX4's missions.
    let mode = match (autopilot, kind) {
        (Autopilot::Px4, _) => 0x0404_0000,
        (_, VehicleKind::Plane | VehicleKind::Vtol) => 10,
        _ => 3,
    };
    Quad { mode, autopilot, kind, type_number, ..Quad::healthy() }
}

const ROTORS: [Of; 6] = [
    (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 2),
    (Autopilot::Px4, VehicleKind::Rotorcraft, 2),
    (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 13),
    (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 4),
    (Autopilot::ArduPilot, VehicleKind::Vtol, 22),
    (Autopilot::Px4, VehicleKind::Vtol, 22),
];

const WINGS: [Of; 4] = [
    (Autopilot::ArduPilot, VehicleKind::Plane, 1),
    (Autopilot::Px4, VehicleKind::Plane, 1),
    (Autopilot::ArduPilot, VehicleKind::Vtol, 22),
    (Autopilot::Px4, VehicleKind::Vtol, 22),
];

const SURFACE: [Of; 6] = [
    (Autopilot::ArduPilot, VehicleKind::Surface, 10),
    (Autopilot::ArduPilot, VehicleKind::Surface, 11),
    (Autopilot::ArduPilot, VehicleKind::Surface, 12),
    (Autopilot::Px4, VehicleKind::Surface, 10),
    (Autopilot::Px4, VehicleKind::Surface, 11),
    (Autopilot::Px4, VehicleKind::Surface, 12),
];

fn hovering((autopilot, kind, type_number): Of) -> Quad {
    Quad { landed: Some(LandedState::InAir), vtol: VtolState::Hover, ..vehicle(autopilot, kind, type_number) }
}

fn on_wings((autopilot, kind, type_number): Of) -> Quad {
    Quad {
        landed: Some(LandedState::InAir),
        vtol: VtolState::Forward,
        ..vehicle(autopilot, kind, type_number)
    }
}
