//! Every check finds its fault within its own debounce plus 100 ms, alone, and is good again after it.
#![expect(clippy::panic, clippy::unwrap_used, reason = "that is how a test fails")]

use crate::common::{Quad, Run, params};
use hums_core::cause::{Alert, Cause, Urgency};
use hums_core::health::{self, CLEAR, Finding, Level, checks};
use hums_core::observation::{
    Attitude, Autopilot, Battery, CellVoltage, Engine, Esc, EscGroup, EstimatorScale, Generator, Gnss,
    Heartbeat, Imu, Observation, Processor, RadioControl, Rails, TelemetryRadio, VehicleKind,
};
use hums_core::parameters::Params;
use hums_core::status::Recording;
use hums_core::time::Millis;
use hums_core::units::{
    Amperes, Celsius, Fraction, Hectopascals, Metres, Radians, RadiansPerSecond, Rpm, Volts,
};

const FAULT_MS: u64 = 20_000;
const END_MS: u64 = 95_000;

type Fault = fn(&mut Quad, &mut Vec<Observation>);

const LIMITS: [(&str, f32); 6] = [
    ("ENG_CHT_CRIT", 200.0),
    ("ENG_EGT_CRIT", 800.0),
    ("ENG_FUEL_CRIT", 100.0),
    ("GEN_SPEED_CRIT", 5_000.0),
    ("RC_RSSI_CRIT", 50.0),
    ("RADIO_RSSI_WARN", 60.0),
];

fn beats(autopilot: Autopilot, state: u8) -> Observation {
    let (kind, armed) = (VehicleKind::Rotorcraft, true);
    Observation::Heartbeat(Heartbeat { autopilot, kind, armed, state, ..Heartbeat::default() })
}

fn engine(cylinder_head_degc: f32, exhaust_degc: f32, fuel_hpa: f32) -> Observation {
    let [cylinder_head, exhaust] = [cylinder_head_degc, exhaust_degc].map(|degc| Some(Celsius(degc)));
    let fuel_pressure = Some(Hectopascals(fuel_hpa));
    Observation::Engine(Engine { cylinder_head, exhaust, fuel_pressure, ..Engine::default() })
}

fn fly(settings: &[(&str, f32)], fault: impl Fn(&mut Quad, &mut Vec<Observation>)) -> Vec<Finding> {
    let mut run = Run::new(&params(settings));
    run.flies(0..END_MS, |now_ms, quad, more| {
        if now_ms >= FAULT_MS {
            fault(quad, more);
        }
    });
    run.findings
}

const FAULTS: &[(&str, u8, Level, Fault)] = &[
    ("batt_remaining", 0, Level::Critical, |quad, _| quad.battery.remaining = Some(Fraction(0.05))),
    ("batt_remaining", 1, Level::Critical, |_, more| {
        let remaining = Some(Fraction(0.05));
        more.push(Observation::Battery(Battery { id: 1, remaining, ..Battery::default() }));
    }),
    ("cell_voltage", 0, Level::Critical, |quad, _| quad.battery.voltage = Some(Volts(13.2))),
    ("batt_state", 0, Level::Warning, |quad, _| quad.battery.charge = 2),
    ("batt_state", 0, Level::Critical, |quad, _| quad.battery.charge = 3),
    ("batt_state", 1, Level::Critical, |_, more| {
        more.push(Observation::Battery(Battery { id: 1, charge: 4, ..Battery::default() }));
    }),
    ("cell_deviation", 0, Level::Critical, |quad, _| cells(quad, 3.7)),
    ("cell_dev_lasting", 0, Level::Critical, |quad, _| cells(quad, 3.8)),
    ("batt_fault", 0, Level::Warning, |quad, _| quad.battery.faults = 4),
    ("batt_temperature", 0, Level::Critical, |quad, _| quad.battery.temperature = Some(Celsius(80.0))),
    ("rail_5v_low", 0, Level::Critical, |_, more| rail(more, 4.4)),
    ("rail_5v_high", 0, Level::Warning, |_, more| rail(more, 5.6)),
    ("esc_temperature", 3, Level::Critical, |quad, _| esc(quad, 3).temperature = Some(Celsius(120.0))),
    ("esc_temperature", 11, Level::Critical, |_, more| {
        let esc = Esc { rpm: Some(Rpm(5_000.0)), temperature: Some(Celsius(120.0)), ..Esc::default() };
        more.push(Observation::Escs(EscGroup { first: 8, escs: [None, None, None, Some(esc)] }));
    }),
    ("esc_failure", 2, Level::Critical, |quad, _| esc(quad, 2).failures = Some(32)),
    ("esc_failure", 0, Level::Critical, |quad, _| esc(quad, 0).failures = Some(64)),
    ("esc_failure", 1, Level::Warning, |quad, _| esc(quad, 1).failures = Some(4)),
    ("motor_loss", 1, Level::Critical, |quad, _| esc(quad, 1).current = Some(Amperes(0.0))),
    ("motor_imbalance", 0, Level::Critical, |quad, _| esc(quad, 0).rpm = Some(Rpm(7_500.0))),
    ("cylinder_head", 0, Level::Critical, |_, more| more.push(engine(250.0, 700.0, 300.0))),
    ("exhaust_gas", 0, Level::Critical, |_, more| more.push(engine(150.0, 900.0, 300.0))),
    ("fuel_pressure", 0, Level::Critical, |_, more| more.push(engine(150.0, 700.0, 50.0))),
    ("generator_speed", 0, Level::Critical, |_, more| {
        more.extend([6_000.0, 3_000.0].map(|rpm| generator(false, rpm)));
    }),
    ("vibration", 0, Level::Critical, |quad, _| quad.vibration.levels[0] = Some(70.0)),
    ("vibration_px4", 0, Level::Critical, |quad, more| {
        more.push(beats(Autopilot::Px4, 4));
        quad.vibration.levels = [Some(0.0), Some(0.0), Some(12.0)];
    }),
    ("gyro_noise", 0, Level::Warning, |quad, more| {
        more.push(beats(Autopilot::Px4, 4));
        quad.vibration.levels = [Some(0.0), Some(0.7), Some(2.0)];
    }),
    ("clipping", 0, Level::Critical, |quad, _| quad.vibration.clips = [200; 3]),
    ("load_factor", 0, Level::Critical, |quad, _| quad.acceleration_down = -45.0),
    ("ekf_variance", 0, Level::Warning, |quad, _| quad.estimator.velocity = Some(0.9)),
    ("ekf_compass", 0, Level::Warning, |quad, _| quad.estimator.compass = Some(0.9)),
    ("ekf_failsafe", 0, Level::Critical, |quad, _| {
        (quad.estimator.compass, quad.estimator.velocity) = (Some(1.2), Some(0.9));
    }),
    ("ekf_test_ratio", 0, Level::Critical, |quad, _| {
        quad.estimator.scale = EstimatorScale::TestRatio;
        quad.estimator.velocity = Some(1.5);
    }),
    ("ekf_mag_ratio", 0, Level::Critical, |quad, _| {
        quad.estimator.scale = EstimatorScale::TestRatio;
        quad.estimator.compass = Some(1.5);
    }),
    ("gps_satellites", 0, Level::Warning, |quad, _| {
        (quad.gnss.satellites, quad.gnss.accuracy) = (Some(5), Some(Metres(2.0)));
    }),
    ("gps_satellites", 1, Level::Warning, |_, more| {
        more.push(Observation::Gnss(Gnss { instance: 1, fix: 3, satellites: Some(5), ..Gnss::default() }));
    }),
    ("gps_hdop", 0, Level::Warning, |quad, _| {
        (quad.gnss.hdop, quad.gnss.accuracy) = (Some(3.5), None);
    }),
    ("gps_accuracy", 0, Level::Warning, |quad, _| quad.gnss.accuracy = Some(Metres(4.0))),
    ("gps_fix", 0, Level::Critical, |quad, _| quad.gnss.fix = 1),
    ("gps_jamming", 0, Level::Critical, |quad, _| quad.integrity.jamming = 3),
    ("gps_spoofing", 0, Level::Critical, |quad, _| quad.integrity.spoofing = 3),
    ("frames_lost", 0, Level::Critical, |quad, _| quad.lost = 0.08),
    ("rc_rssi", 0, Level::Critical, |_, more| {
        more.push(Observation::RadioControl(RadioControl { rssi: Some(20) }));
    }),
    ("radio_rssi", 0, Level::Warning, |_, more| radio(more, [30, 90], [5, 5])),
    ("radio_margin", 0, Level::Warning, |_, more| radio(more, [90, 90], [85, 30])),
    ("radio_margin", 0, Level::Warning, |_, more| radio(more, [90, 90], [30, 85])),
    ("load", 0, Level::Critical, |quad, _| quad.system.load = Some(Fraction(0.97))),
    ("mcu_temperature", 0, Level::Critical, |_, more| {
        more.push(Observation::Processor(Processor { temperature: Some(Celsius(105.0)) }));
    }),
    ("autopilot_state", 0, Level::Critical, |_, more| more.push(beats(Autopilot::Other, 5))),
    ("roll", 0, Level::Critical, |quad, _| quad.roll = -1.2),
    ("roll", 0, Level::Critical, |quad, _| quad.roll = 1.2),
    ("pitch", 0, Level::Critical, |_, more| {
        more.push(Observation::Attitude(Attitude { pitch: Radians(1.2), ..Attitude::default() }));
    }),
    ("recording", 0, Level::Critical, |quad, _| quad.recorder.recording = Recording::Stopped),
    // The vehicle counts as armed until the next heartbeat, which is sooner than the debounce.
    ("recording", 0, Level::Warning, |quad, _| {
        (quad.armed, quad.recorder.recording) = (false, Recording::Stopped);
    }),
    ("record_queue", 0, Level::Critical, |quad, _| quad.recorder.queue = 0.95),
    ("record_lost", 0, Level::Warning, |quad, _| quad.recorder.frames_lost = 5),
    ("card_stall", 0, Level::Critical, |quad, _| quad.recorder.stall = Millis::from_millis(3_000)),
    ("card_stall", 0, Level::Warning, |quad, _| quad.recorder.stall = Millis::from_millis(800)),
    ("card_errors", 0, Level::Warning, |quad, _| quad.recorder.write_errors = 3),
    ("card_room", 0, Level::Critical, |quad, _| quad.recorder.room = Some(0.005)),
    ("card_room", 0, Level::Warning, |quad, _| quad.recorder.room = Some(0.05)),
];

/// Checks with scripts of their own: silence, restarts and rates in `scripted_faults.rs`, resistance in `battery_cells.rs`,
/// mishaps in `mishap.rs`, departures from usual levels in `crosscheck.rs`.
const ELSEWHERE: &str = "\
    ahrs2_tilt ahrs2_height ahrs2_position gps_sats_fall gps_hdop_rise compass_heading gps_height \
    position_silent baro_height baro_noise ekf_climb accel_stuck gyro_stuck compass_stuck baro_stuck \
    gps_stuck thrust_lost roll_rate pitch_rate accel_mismatch gyro_mismatch imu_gps compass_mismatch \
    baro_mismatch compass_unused vibration_rise motor_output motor_off esc_silent esc_errors heartbeat \
    autopilot_reboot batt_resistance gps_speed free_fall impact tumbling disarmed_in_air sinking overturned";

const WITH: &str = "\
    cell_dev_lasting+cell_deviation cell_deviation+cell_dev_lasting ekf_failsafe+ekf_variance \
    ekf_failsafe+ekf_compass esc_temperature+esc_silent gps_hdop+gps_hdop_rise vibration+vibration_rise";

/// By the kind of the component, from 1 on.
const DUE: [&str; 8] = [
    "airframe_due",
    "battery_due",
    "drive_due",
    "drive_due",
    "drive_due",
    "card_due",
    "engine_due",
    "airframe_due",
];

fn cells(quad: &mut Quad, lowest_v: f32) {
    for cell in &mut quad.battery.cells[..4] {
        *cell = CellVoltage::from_millivolts(3_900);
    }
    quad.battery.cells[1] = CellVoltage::from_millivolts((lowest_v * 1e3) as u16);
}

fn rail(more: &mut Vec<Observation>, volts: f32) {
    more.push(Observation::Rails(Rails { vcc: Some(Volts(volts)), servo: None }));
}

fn esc(quad: &mut Quad, motor: usize) -> &mut Esc {
    quad.escs[motor].as_mut().unwrap()
}

fn radio(more: &mut Vec<Observation>, rssi: [u8; 2], noise: [u8; 2]) {
    let ([rssi, remote_rssi], [noise, remote_noise]) = (rssi.map(Some), noise.map(Some));
    let radio = TelemetryRadio { rssi, remote_rssi, noise, remote_noise, errors: 0 };
    more.push(Observation::TelemetryRadio(radio));
}

fn generator(is_off: bool, rpm: f32) -> Observation {
    Observation::Generator(Generator { is_off, speed: Some(Rpm(rpm)) })
}

fn generator_levels(armed: bool, reports: &[(bool, f32)]) -> Vec<Level> {
    let mut run = Run::new(&params(&[("GEN_SPEED_WARN", 5_500.0), ("GEN_SPEED_CRIT", 5_000.0)]));
    run.flies(0..reports.len() as u64 * 10_000, |now_ms, quad, more| {
        let (is_off, rpm) = reports[now_ms as usize / 10_000];
        quad.armed = armed;
        more.push(generator(is_off, rpm));
    });
    run.of_check("generator_speed").map(|finding| finding.level).collect()
}

#[test]
fn a_generator_is_judged_once_it_has_run_and_until_it_is_switched_off() {
    let (off, starts, runs, slow, stands) =
        ((true, 0.0), (false, 3_000.0), (false, 6_000.0), (false, 5_200.0), (false, 0.0));
    assert_eq!(generator_levels(true, &[runs, slow, stands]), [Level::Warning, Level::Critical]);
    assert_eq!(generator_levels(true, &[runs, stands, off]), [Level::Critical, Level::Ok]);
    assert_eq!(generator_levels(true, &[off, off, stands]), [], "it has not run");
    assert_eq!(generator_levels(true, &[off, starts, runs, off, starts, runs, off]), [], "on purpose");
    assert_eq!(generator_levels(false, &[runs, stands, starts]), [], "disarmed");
}

fn assert_found(name: &str, instance: u8, level: Level, fault: &dyn Fn(&mut Quad, &mut Vec<Observation>)) {
    let check = health::check_named(name).expect(name);
    let mut run = Run::new(&params(&LIMITS));
    run.flies(0..END_MS + 25_000, |now_ms, quad, more| {
        if (FAULT_MS..END_MS).contains(&now_ms) {
            fault(quad, more);
        }
    });
    let mut mine = run.of_check(name).filter(|finding| finding.instance == instance);
    let found = mine.clone().find(|finding| finding.level == level);
    let found = found.unwrap_or_else(|| panic!("{name} {instance} never {level:?}: {:?}", run.findings));
    let debounce_ms = check.debounce_ms[usize::from(level == Level::Critical)].into();
    let after_ms = found.at.as_millis().saturating_sub(FAULT_MS);
    // Speeds that are compared are smoothed: half again above the others is 30 % above after 0.9 s.
    let smoothing_ms = if name == "motor_imbalance" { 900 } else { 0 };
    let in_time = debounce_ms..=debounce_ms + smoothing_ms + 100;
    assert!(found.at.as_millis() >= FAULT_MS, "{name} {instance} before anything was wrong: {found:?}");
    assert!(in_time.contains(&after_ms), "{name} {instance} {level:?} after {after_ms} ms: {in_time:?}");
    let others = run.findings.iter().filter(|one| one.check != name && one.because.is_empty());
    let mut alarms = others.filter(|one| matches!(one.level, Level::Warning | Level::Critical));
    let goes_with = |one: &Finding| WITH.split(' ').any(|pair| pair == format!("{name}+{}", one.check));
    assert!(alarms.all(goes_with), "{name}: {:?}", run.findings);
    let last = mine.next_back().expect("there is one");
    // An alert holds for ten seconds, and speeds are smoothed. Counts are forgotten earlier.
    let is_late = name.ends_with("_alert") || name == "motor_imbalance";
    let good_ms = END_MS + CLEAR.as_millis() + if is_late { 10_000 } else { 100 };
    let last_ms = last.at.as_millis();
    let is_stale = last.level == Level::Stale && last_ms > END_MS;
    assert!(is_stale || (last.level == Level::Ok && last_ms <= good_ms), "{name} is not cleared: {last:?}");
}

#[test]
fn every_check_finds_what_it_is_there_for_in_time() {
    for (name, instance, level, fault) in FAULTS {
        assert_found(name, *instance, *level, fault);
    }
    for cause in Cause::ALL {
        for (urgency, level) in [(Urgency::Warning, Level::Warning), (Urgency::Critical, Level::Critical)] {
            assert_found(cause.name(), 0, level, &|_, more| {
                more.push(Observation::Alert(Alert { cause, urgency }));
            });
        }
    }
}

#[test]
fn a_crash_of_a_vehicle_that_stands_and_never_flew_is_none() {
    let (quad, rover) = (VehicleKind::Rotorcraft, VehicleKind::Surface);
    for (kind, height_m, roll, counts) in [
        (quad, 0.0, 0.0, false),
        (quad, 0.0, 1.0_f32, true),
        (quad, 20.0, 0.0, true),
        (rover, 0.0, 0.0, true),
    ] {
        let mut run = Run::new(&Params::defaults());
        run.flies(0..20_000, |now_ms, quad, more| {
            (quad.kind, quad.height, quad.throttle) = (kind, height_m, height_m / 40.0);
            more.push(Observation::Imu(Imu { rate: Some([RadiansPerSecond(0.0); 3]), ..Imu::default() }));
            if now_ms > 10_000 {
                (quad.roll, quad.acceleration_down) = (roll, -9.8 * roll.cos());
                more.push(Observation::Alert(Alert::critical(Cause::Crash)));
            }
        });
        assert_eq!(run.of_check("crash_alert").next().is_some(), counts, "{kind:?} {height_m} {roll}");
    }
}

#[test]
fn what_else_is_fitted_and_well_has_no_finding() {
    let findings = fly(&LIMITS, |quad, more| {
        cells(quad, 3.89);
        let (remaining, temperature) = (Some(Fraction(0.8)), Some(Celsius(35.0)));
        more.push(Observation::Battery(Battery { id: 1, remaining, temperature, ..Battery::default() }));
        rail(more, 5.0);
        more.extend([engine(150.0, 700.0, 300.0), generator(false, 6_000.0)]);
        let (satellites, hdop) = (Some(14), Some(0.9));
        more.push(Observation::Gnss(Gnss { instance: 1, fix: 3, satellites, hdop, ..Gnss::default() }));
        more.push(Observation::RadioControl(RadioControl { rssi: Some(200) }));
        radio(more, [90, 90], [30, 30]);
        more.push(Observation::Processor(Processor { temperature: Some(Celsius(50.0)) }));
    });
    assert_eq!(findings, []);
}

#[test]
fn the_autopilots_figure_of_the_battery_counts_where_no_battery_reports_itself() {
    let own = Battery { id: 1, remaining: Some(Fraction(0.8)), ..Battery::default() };
    for (reports, expected) in [(None, vec![(0, Level::Critical, 5.0)]), (Some(own), vec![])] {
        let mut run = Run::new(&Params::defaults());
        run.flies(0..5_000, |_, quad, more| {
            (quad.battery_silent, quad.system.remaining) = (true, Some(Fraction(0.05)));
            more.extend(reports.map(Observation::Battery));
        });
        let found = run.of_check("batt_remaining").map(|one| (one.instance, one.level, one.value));
        assert_eq!(found.collect::<Vec<_>>(), expected);
    }
}

#[test]
fn each_kind_of_component_is_due_in_its_own_subsystem() {
    for (kind, name) in (1..).zip(DUE) {
        let limits = [("CMP1_KIND", kind as f32), ("CMP1_FLIGHTS", 1.0)];
        let findings = fly(&limits, |quad, _| (quad.armed, quad.height) = (false, 0.0));
        let found: Vec<_> = findings.iter().map(|finding| (finding.check, finding.level)).collect();
        assert_eq!(found, [(name, Level::Warning), (name, Level::Critical)], "kind {kind}: {findings:?}");
        assert!((3_500..=4_000).contains(&findings[0].at.as_millis()), "{findings:?}");
        let due_ms = findings[1].at.as_millis() - FAULT_MS;
        assert!((1_000..=5_000).contains(&due_ms), "critical on the ground only: {findings:?}");
    }
}

#[test]
fn few_satellites_are_enough_for_a_receiver_that_knows_where_it_is_but_their_loss_is_told() {
    let findings = fly(&LIMITS, |quad, _| {
        (quad.gnss.satellites, quad.gnss.hdop) = (Some(5), Some(3.0));
        quad.gnss.accuracy = Some(Metres(0.8));
    });
    let told: Vec<(&str, &str)> = findings.iter().map(|finding| (finding.check, finding.because)).collect();
    assert_eq!(told, [("gps_sats_fall", ""), ("gps_hdop_rise", "gps_sats_fall")]);
}

#[test]
fn there_is_no_check_that_nothing_shows_to_work() {
    for check in checks() {
        let here = FAULTS.iter().any(|(name, ..)| *name == check.name);
        let due = DUE.contains(&check.name);
        let alert = Cause::ALL.iter().any(|cause| cause.name() == check.name);
        let elsewhere = ELSEWHERE.split(' ').any(|name| name == check.name);
        assert!(here || due || alert || elsewhere, "{}", check.name);
    }
}

#[test]
fn there_are_as_many_of_each_check_as_there_may_be_of_what_it_watches() {
    for check in checks() {
        let instances = match check.name {
            name if name.starts_with("batt_") || name.starts_with("cell_") => 4,
            "motor_output" | "motor_off" => 8,
            "gps_stuck" => 2,
            "gps_height" => 1,
            name if name.ends_with("_mismatch") || name.ends_with("_stuck") => 3,
            name if name.starts_with("esc_") || name.starts_with("motor_") => 12,
            name if name.starts_with("gps_") => 2,
            _ => 1,
        };
        let found = [check.instances, health::instances(check.name)];
        assert_eq!(found, [instances; 2], "{}", check.name);
    }
}

#[test]
fn flags_that_are_not_set_and_parts_that_are_not_due_make_nothing_healthy() {
    let flags = "batt_fault esc_failure autopilot_reboot autopilot_state compass_unused disarmed_in_air motor_off position_silent";
    for check in checks() {
        let due = DUE.contains(&check.name);
        let flag = flags.split(' ').any(|name| name == check.name)
            || check.name.ends_with("_alert")
            || check.name.ends_with("_stuck");
        assert_eq!(check.alarm_only, due || flag, "{}", check.name);
    }
}

#[test]
fn a_radio_that_tells_nothing_of_an_end_has_no_margin_there() {
    let cases: [(Fault, bool); 4] = [
        (|_, more| radio(more, [26, 0], [34, 60]), false),
        (|_, more| radio(more, [0, 225], [0, 60]), false),
        (|_, more| radio(more, [90, 0], [40, 0]), false),
        (|_, more| radio(more, [0, 90], [30, 40]), true),
    ];
    for (number, (says, told)) in cases.into_iter().enumerate() {
        let findings = fly(&LIMITS, says);
        assert_eq!(findings.iter().any(|finding| finding.check == "radio_margin"), told, "{number}");
    }
}
