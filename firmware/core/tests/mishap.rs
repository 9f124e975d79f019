//! Mishaps, scripted for each class of vehicle: what is one, what is none, and what becomes of the flight.

mod common;

use common::{AUTOPILOT, Quad};
use hums_core::Monitor;
use hums_core::happening::Happening;
use hums_core::health::{Finding, Level, Subsystem};
use hums_core::mishap::{Change, Kind, Place, Report};
use hums_core::observation::{
    Air, Attitude, Autopilot, GlobalPosition, Imu, LandedState, Observation, VehicleKind, VtolState,
};
use hums_core::params::Params;
use hums_core::status::LinkReading;
use hums_core::time::Instant;
use hums_core::units::{
    Hectopascals, MetresPerSecond, MetresPerSecond2, Position, Radians, RadiansPerSecond,
};
use hums_core::usage::UsageCounter;

/// When it goes wrong.
const AT_MS: u64 = 20_000;

/// How the vehicle moves besides what a [`Quad`] says.
#[derive(Clone, Copy)]
struct Motion {
    load_g: f32,
    rates: [f32; 3],
    ground_mps: f32,
    pitch: f32,
    /// What the barometer says; where it says anything.
    pressure_hpa: Option<f32>,
}

const CALM: Motion =
    Motion { load_g: 1.0, rates: [0.01, 0.02, 0.0], ground_mps: 0.1, pitch: 0.02, pressure_hpa: None };

type Script = fn(u64, &mut Quad, &mut Motion);

struct Outcome {
    monitor: Monitor,
    findings: Vec<Finding>,
    changes: Vec<(u64, Change)>,
    reports: Vec<Report>,
}

impl Outcome {
    /// What was told of mishaps, each kind once, in order.
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

/// A minute; `script` gets the time since it goes wrong.
fn fly(vehicle: &Quad, script: Script) -> Outcome {
    let mut monitor = Monitor::new(Params::defaults());
    let (mut findings, mut changes, mut reports) = (Vec::new(), Vec::new(), Vec::new());
    for now_ms in (0..60_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let (mut quad, mut motion) = (vehicle.clone(), CALM);
        if now_ms >= AT_MS {
            script(now_ms - AT_MS, &mut quad, &mut motion);
        }
        // No sensor says the same for ever.
        let noise = (now_ms / 50 % 7) as f32 * 0.002;
        let acceleration = Some([0.0, 0.0, -(motion.load_g + noise) * 9.806_65].map(MetresPerSecond2));
        let rates = Some(motion.rates.map(RadiansPerSecond));
        let imu = Imu { acceleration, rate: rates, ..Imu::default() };
        monitor.observe(now, AUTOPILOT, &Observation::Imu(imu));
        if now_ms.is_multiple_of(100) {
            let (roll, pitch) = (Radians(quad.roll), Radians(motion.pitch));
            let attitude = Attitude { roll, pitch, rates, ..Attitude::default() };
            let height = if now_ms < 2_000 { quad.start_height } else { quad.height };
            let global = GlobalPosition {
                position: Some(Position { latitude_deg: 47.397_742, longitude_deg: -8.545_594 }),
                relative_altitude: hums_core::units::Metres(height),
                velocity: [motion.ground_mps, 0.0, -quad.climb].map(MetresPerSecond),
                ..GlobalPosition::default()
            };
            let said = quad.says(now_ms).into_iter().filter(|said| {
                !matches!(
                    said,
                    Observation::Imu(_) | Observation::Attitude(_) | Observation::GlobalPosition(_)
                )
            });
            let air = Air { pressure: motion.pressure_hpa.map(Hectopascals), ..Air::default() };
            let own =
                [Observation::Air(air), Observation::Attitude(attitude), Observation::GlobalPosition(global)];
            for said in said.chain(own) {
                monitor.observe(now, AUTOPILOT, &said);
            }
        }
        let link = LinkReading { frames_lost: Some(0.0), at: now };
        monitor.tick(now, &link, &quad.recorder, &mut |finding| findings.push(*finding));
        while let Some(happening) = monitor.take_happening() {
            if let Happening::Mishap(change) = happening {
                changes.push((now_ms, change));
                reports.push(monitor.mishap().report(change));
            }
        }
    }
    Outcome { monitor, findings, changes, reports }
}

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

const ROTORS: [(Autopilot, VehicleKind, u8); 6] = [
    (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 2),
    (Autopilot::Px4, VehicleKind::Rotorcraft, 2),
    (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 13),
    (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 4),
    (Autopilot::ArduPilot, VehicleKind::Vtol, 22),
    (Autopilot::Px4, VehicleKind::Vtol, 22),
];

const WINGS: [(Autopilot, VehicleKind, u8); 4] = [
    (Autopilot::ArduPilot, VehicleKind::Plane, 1),
    (Autopilot::Px4, VehicleKind::Plane, 1),
    (Autopilot::ArduPilot, VehicleKind::Vtol, 22),
    (Autopilot::Px4, VehicleKind::Vtol, 22),
];

const SURFACE: [(Autopilot, VehicleKind, u8); 6] = [
    (Autopilot::ArduPilot, VehicleKind::Surface, 10),
    (Autopilot::ArduPilot, VehicleKind::Surface, 11),
    (Autopilot::ArduPilot, VehicleKind::Surface, 12),
    (Autopilot::Px4, VehicleKind::Surface, 10),
    (Autopilot::Px4, VehicleKind::Surface, 11),
    (Autopilot::Px4, VehicleKind::Surface, 12),
];

fn hovering((autopilot, kind, type_number): (Autopilot, VehicleKind, u8)) -> Quad {
    Quad { landed: Some(LandedState::InAir), vtol: VtolState::Hover, ..vehicle(autopilot, kind, type_number) }
}

fn on_wings((autopilot, kind, type_number): (Autopilot, VehicleKind, u8)) -> Quad {
    Quad {
        landed: Some(LandedState::InAir),
        vtol: VtolState::Forward,
        ..vehicle(autopilot, kind, type_number)
    }
}

#[test]
fn a_fall_with_the_motors_asked_for_thrust_ends_the_flight_with_its_touch() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), fall);
        let told = outcome.told();
        assert_eq!(told.first(), Some(&"free_fall"), "{of:?}: {told:?}");
        assert!(told.contains(&"impact"), "{of:?}: {told:?}");
        let [(began_ms, Change::Began(Kind::FreeFall)), (down_ms, Change::Down)] = outcome.changes[..] else {
            panic!("{of:?}: {:?}", outcome.changes)
        };
        let (place, touch) = (outcome.reports[0].place, outcome.reports[1].touch);
        assert!((AT_MS + 300..=AT_MS + 500).contains(&began_ms), "{of:?}: {began_ms}");
        assert!((AT_MS + 3_000..AT_MS + 5_000).contains(&down_ms), "{of:?}: {down_ms}");
        assert_eq!(place.position, Some((473_977_420, -85_455_940)));
        assert!((150..200).contains(&touch), "{of:?}: {touch}");
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}");
        assert_eq!(outcome.count(UsageCounter::HardLandings), 1);
        assert!(outcome.count(UsageCounter::TouchdownMax) >= 15, "{of:?}");
        // Nothing that would only echo it.
        let echoes = outcome.findings.iter().filter(|finding| {
            finding.subsystem != Subsystem::Mishap && finding.at.as_millis() > began_ms + 100
        });
        assert_eq!(echoes.count(), 0, "{of:?}: {:?}", outcome.findings);
    }
}

#[test]
fn what_does_not_fly_has_no_mishap_of_the_air() {
    for (autopilot, kind, type_number) in SURFACE {
        let rover = Quad { landed: Some(LandedState::InAir), ..vehicle(autopilot, kind, type_number) };
        let outcome = fly(&rover, fall);
        assert!(
            outcome.told().is_empty() && outcome.changes.is_empty(),
            "{type_number}: {:?}",
            outcome.changes
        );
    }
}

#[test]
fn a_vehicle_that_is_disarmed_in_the_air_is_told_and_one_that_lands_on_a_hill_is_not() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            fall(ms, quad, motion);
            (quad.armed, quad.throttle) = (false, 0.0);
        });
        let told = outcome.told();
        assert!(told.contains(&"disarmed_in_air"), "{of:?}: {told:?} {:?}", outcome.changes);
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}");
        assert_eq!(outcome.count(UsageCounter::HardLandings), 1, "{of:?}");
        let hill = fly(&hovering(of), |ms, quad, _| {
            (quad.armed, quad.throttle, quad.landed) = (ms < 1_000, 0.0, Some(LandedState::OnGround));
        });
        assert!(hill.told().is_empty(), "{of:?}: {:?}", hill.findings);
        assert_eq!(hill.flights(), (1, 1, 0), "{of:?}");
        // Without a landed state the height above home says that it flies; nothing falls, so nothing was disarmed in the air.
        let mut silent = hovering(of);
        silent.landed = None;
        let hill = fly(&silent, |ms, quad, _| (quad.armed, quad.throttle) = (ms < 1_000, 0.0));
        assert!(hill.told().is_empty(), "{of:?}: {:?}", hill.findings);
        assert_eq!(hill.flights(), (1, 1, 0), "{of:?}");
    }
}

#[test]
fn a_plane_that_is_disarmed_in_the_air_glides_on_and_is_told() {
    for of in WINGS {
        let outcome = fly(&on_wings(of), |ms, quad, motion| {
            (quad.armed, quad.throttle) = (false, 0.0);
            motion.ground_mps = if ms < 8_000 { 18.0 } else { 0.0 };
            (quad.climb, quad.height) =
                if ms < 8_000 { (-2.0, 20.0 - ms as f32 / 500.0) } else { (0.0, 0.0) };
        });
        assert_eq!(outcome.told(), ["disarmed_in_air"], "{of:?}");
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}");
    }
}

#[test]
fn tumbling_is_told_by_body_rates_and_a_vehicle_that_recovers_has_one_flight() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, _, motion| {
            if ms < 1_500 {
                motion.rates = [15.0, 2.0, 0.0];
            }
        });
        assert_eq!(outcome.told(), ["tumbling"], "{of:?}");
        let [(began_ms, Change::Began(Kind::Tumbling)), (over_ms, Change::FliesOn)] = outcome.changes[..]
        else {
            panic!("{of:?}: {:?}", outcome.changes)
        };
        assert!(
            began_ms <= AT_MS + 700 && (AT_MS + 6_000..AT_MS + 7_000).contains(&over_ms),
            "{began_ms} {over_ms}"
        );
        assert_eq!(outcome.flights(), (1, 0, 0), "{of:?}: the flight goes on");
        let last = outcome.findings.last().unwrap();
        assert_eq!((last.check, last.level), ("tumbling", Level::Ok));
    }
    let pilots = [
        (Autopilot::ArduPilot, VehicleKind::Rotorcraft, 2, 1),
        (Autopilot::Px4, VehicleKind::Rotorcraft, 2, 0x0005_0000),
        (Autopilot::ArduPilot, VehicleKind::Plane, 1, 4),
    ];
    for (autopilot, kind, type_number, mode) in pilots {
        let acro = Quad { mode, ..hovering((autopilot, kind, type_number)) };
        let outcome = fly(&acro, |ms, _, motion| {
            if ms < 3_000 {
                motion.rates = [8.0, 0.0, 0.0];
            }
        });
        assert!(outcome.told().is_empty(), "{autopilot:?} {kind:?}: acro is what the pilot wants");
    }
}

#[test]
fn a_plane_rolls_and_dives_as_it_likes_and_a_spin_is_told() {
    for of in WINGS {
        let roll = fly(&on_wings(of), |ms, quad, motion| {
            motion.ground_mps = 18.0;
            if ms < 1_000 {
                (motion.rates, quad.climb, motion.load_g) = ([6.5, 0.0, 0.0], -12.0, 0.1);
            }
        });
        assert!(roll.told().is_empty(), "{of:?}: {:?}", roll.findings);
        let spin = fly(&on_wings(of), |ms, _, motion| {
            motion.ground_mps = 18.0;
            if ms < 4_000 {
                motion.rates = [6.5, 1.0, 3.0];
            }
        });
        assert_eq!(spin.told(), ["tumbling"], "{of:?}");
    }
}

#[test]
fn sinking_is_a_mishap_where_the_autopilot_flies_and_not_where_the_pilot_asks_for_it() {
    let sinks: Script = |ms, quad, _| {
        if ms < 2_000 {
            (quad.climb, quad.height) = (-8.0, 200.0 - ms as f32 / 125.0);
        }
    };
    for of in ROTORS {
        assert_eq!(fly(&hovering(of), sinks).told(), ["sinking"], "{of:?}");
        let pilots_mode = if of.0 == Autopilot::Px4 { 0x0007_0000 } else { 0 };
        let pilots = Quad { mode: pilots_mode, ..hovering(of) };
        assert!(fly(&pilots, sinks).told().is_empty(), "{of:?}");
    }
    for of in WINGS {
        assert!(fly(&on_wings(of), sinks).told().is_empty(), "{of:?}");
    }
}

#[test]
fn an_estimator_that_does_not_believe_itself_makes_no_mishap_unless_the_air_agrees() {
    // It shakes, climbs by the air, and lands hard and safe while the estimator says that it falls.
    let shaken: Script = |ms, quad, motion| {
        let seconds = ms as f32 / 1_000.0;
        motion.pressure_hpa = Some(1_000.0 - if ms < 6_000 { 0.4 * seconds } else { 2.4 });
        quad.estimator.velocity = Some(1.5);
        quad.climb = if (1_500..7_900).contains(&ms) { -10.0 } else { 0.0 };
        if ms >= 8_000 {
            motion.load_g = if ms < 8_100 { 4.0 } else { 1.0 };
            (quad.throttle, motion.rates) = (0.0, [0.0; 3]);
        }
    };
    for of in ROTORS {
        assert!(fly(&hovering(of), shaken).told().is_empty(), "{of:?}");
        let sinks = fly(&hovering(of), |ms, quad, motion| {
            motion.pressure_hpa = Some(1_000.0 + if ms < 2_000 { ms as f32 / 1_000.0 } else { 2.0 });
            (quad.estimator.velocity, quad.climb) = (Some(1.5), if ms < 2_000 { -8.0 } else { 0.0 });
        });
        assert_eq!(sinks.told(), ["sinking"], "{of:?}");
    }
}

#[test]
fn what_is_made_for_falling_is_not_told() {
    let autorotation: Script = |ms, quad, _| {
        if ms < 5_000 {
            (quad.climb, quad.throttle) = (-10.0, 0.0);
        }
    };
    let helicopter = Quad { mode: 26, ..hovering((Autopilot::ArduPilot, VehicleKind::Rotorcraft, 4)) };
    let thrown = Quad { mode: 18, ..hovering(ROTORS[0]) };
    for quad in [helicopter, thrown] {
        assert!(fly(&quad, autorotation).told().is_empty(), "{}", quad.mode);
    }
}

#[test]
fn a_plane_that_sinks_with_all_its_thrust_is_told_and_a_glide_is_not() {
    let pulls_out: Script = |ms, quad, motion| {
        sinks_with_thrust(ms, quad, motion);
        motion.load_g = if (5_000..5_500).contains(&ms) { 4.0 } else { 1.0 };
    };
    let glides: Script = |ms, quad, motion| {
        sinks_with_thrust(ms, quad, motion);
        quad.throttle = 0.0;
    };
    for of in WINGS {
        let outcome = fly(&on_wings(of), pulls_out);
        assert_eq!(outcome.told(), ["sinking"], "{of:?}");
        let (began_ms, _) = outcome.changes[0];
        assert!((AT_MS + 3_000..AT_MS + 4_000).contains(&began_ms), "{of:?}: {began_ms}");
        assert_eq!(outcome.flights(), (1, 0, 0), "{of:?}: it flies on");
        assert!(fly(&on_wings(of), glides).told().is_empty(), "{of:?}");
        let pilots_mode = if of.0 == Autopilot::Px4 { 0x0001_0000 } else { 5 };
        let dives = Quad { mode: pilots_mode, ..on_wings(of) };
        assert!(fly(&dives, sinks_with_thrust).told().is_empty(), "{of:?}: the pilot dives");
    }
}

fn sinks_with_thrust(ms: u64, quad: &mut Quad, motion: &mut Motion) {
    motion.ground_mps = 8.0;
    if ms < 8_000 {
        (quad.climb, quad.throttle, quad.height) = (-3.4, 1.0, 60.0 - 3.4 * ms as f32 / 1_000.0);
    }
}

#[test]
fn a_quad_that_lies_on_its_back_has_crashed_whatever_its_estimator_says() {
    let acro = Quad { mode: 1, landed: None, ..hovering(ROTORS[0]) };
    let outcome = fly(&acro, |ms, quad, motion| {
        if ms < 1_000 {
            (motion.load_g, motion.rates) = (5.0, [12.0, 3.0, 0.0]);
        } else {
            // The estimator goes on falling, the throttle stick is where it was.
            (motion.load_g, motion.rates, quad.climb) = (-1.0, [0.0; 3], -12.0);
            (quad.height, quad.throttle) = (3.0 - ms as f32 / 100.0, 0.4);
        }
    });
    assert_eq!(outcome.told(), ["impact"]);
    assert_eq!(outcome.flights(), (1, 0, 1), "{:?}", outcome.changes);
}

#[test]
fn a_wreck_that_is_carried_home_armed_flies_no_more() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            fall(ms, quad, motion);
            if ms >= 8_000 {
                (motion.ground_mps, motion.rates, quad.height) = (3.0, [0.4, 0.5, 0.2], 1.5);
            }
        });
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}: {:?}", outcome.changes);
    }
}

#[test]
fn an_impact_is_a_shock_a_speed_that_breaks_off_and_then_stillness() {
    let crash: Script = |ms, quad, motion| {
        (motion.ground_mps, quad.climb) = (18.0, -3.0);
        if ms >= 1_000 {
            quad.climb = 0.0;
            motion.load_g = if ms < 1_100 { 8.0 } else { 1.0 };
            (motion.ground_mps, quad.throttle, quad.height, motion.rates) = (0.0, 0.0, 0.5, [0.0; 3]);
        }
    };
    for of in WINGS {
        let outcome = fly(&on_wings(of), crash);
        assert_eq!(outcome.told(), ["impact"], "{of:?}");
        assert_eq!(outcome.flights(), (1, 0, 1), "{of:?}");
        assert_eq!(outcome.reports[0].touch, 30, "{of:?}: as it sank before the shock");
    }
    // A shock alone: a gust, a bird, a hard manoeuvre.
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, _, motion| {
            if ms < 100 {
                motion.load_g = 6.0;
            }
        });
        assert!(outcome.told().is_empty(), "{of:?}: {:?}", outcome.findings);
        assert_eq!(outcome.flights(), (1, 0, 0));
    }
}

#[test]
fn a_hard_landing_is_none() {
    for of in ROTORS {
        let outcome = fly(&hovering(of), |ms, quad, motion| {
            let touches = 9_600;
            if ms < touches {
                (quad.climb, quad.height) = (-2.0, 20.0 - ms as f32 / 500.0);
            } else {
                (quad.climb, quad.height, quad.throttle) = (0.0, 0.8, 0.0);
                motion.load_g = if ms < touches + 100 { 4.0 } else { 1.0 };
                quad.landed =
                    Some(if ms < touches + 1_000 { LandedState::InAir } else { LandedState::OnGround });
                quad.armed = ms < touches + 3_000;
            }
        });
        assert!(outcome.told().is_empty(), "{of:?}: {:?}", outcome.findings);
        assert_eq!(outcome.flights(), (1, 1, 0), "{of:?}");
        assert_eq!(outcome.count(UsageCounter::HardLandings), 1, "{of:?}");
    }
}

#[test]
fn what_the_throttle_asks_for_is_no_free_fall_and_a_dead_sensor_is_none_either() {
    let dive: Script = |ms, quad, motion| {
        if ms < 1_500 {
            (motion.load_g, quad.throttle) = (0.05, 0.0);
        }
    };
    let thrown = Quad { mode: 18, ..hovering(ROTORS[0]) };
    for (quad, script) in [
        (hovering(ROTORS[0]), dive),
        (thrown, |ms, _, motion: &mut Motion| {
            if ms < 1_000 {
                motion.load_g = 0.05;
            }
        }),
    ] {
        assert!(fly(&quad, script).told().is_empty());
    }
}

#[test]
fn on_the_bench_it_is_an_event_for_each_arming_and_not_told() {
    let bench =
        Quad { height: 0.0, landed: Some(LandedState::OnGround), throttle: 0.0, ..hovering(ROTORS[0]) };
    let outcome = fly(&bench, |ms, _, motion| {
        if ms % 5_000 < 2_000 {
            motion.rates = [9.0, 0.0, 0.0];
        }
    });
    assert!(outcome.told().is_empty(), "{:?}", outcome.findings);
    assert!(matches!(outcome.changes[..], [(_, Change::OnBench(Kind::Tumbling))]), "{:?}", outcome.changes);
    let disarmed = Quad { armed: false, ..bench };
    assert!(fly(&disarmed, fall).changes.is_empty(), "nobody watches what is carried about");
}

#[test]
fn after_a_mishap_the_next_arming_begins_anew() {
    let outcome = fly(&hovering(ROTORS[0]), |ms, quad, motion| {
        fall(ms, quad, motion);
        quad.landed = Some(LandedState::OnGround);
        quad.armed = !(8_000..20_000).contains(&ms);
        if ms >= 25_000 {
            (quad.height, quad.throttle, quad.landed) = (20.0, 0.5, Some(LandedState::InAir));
        }
    });
    assert_eq!(outcome.flights(), (2, 0, 1), "{:?}", outcome.changes);
    assert!(outcome.monitor.flight().airborne());
    assert_eq!(outcome.monitor.health().subsystem(Subsystem::Mishap), Level::Ok);
}

#[test]
fn every_text_of_a_mishap_fits() {
    let place = |height_m| Place { position: Some((-899_999_999, -1_799_999_999)), height_m };
    let unknown = Place { position: None, height_m: -12_345 };
    let began = Change::Began(Kind::Sinking);
    let cases = [
        (began, place(-999)),
        (began, place(12_345)),
        (began, unknown),
        (Change::Down, place(0)),
        (Change::FliesOn, unknown),
        (Change::OnBench(Kind::Disarmed), unknown),
    ];
    for (change, place) in cases {
        let text = Report { change, place, touch: 9_999 }.text();
        assert!(!text.is_empty() && "HUMS: ".len() + text.len() <= 50, "{text}");
        if change == Change::Down {
            assert!(text.ends_with("999.9 m/s"), "{text}");
        } else if change == began {
            assert!(text.ends_with(" m"), "{text}");
        }
    }
    let place = Place { position: Some((473_977_420, -85_455_940)), height_m: 30 };
    let report = Report { change: Change::Began(Kind::Impact), place, touch: 0 };
    assert_eq!(report.text(), "mishap at 47.397742,-8.545594 30 m");
}
