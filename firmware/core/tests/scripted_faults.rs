//! Scripted faults in a simulated flight: each is found within its debounce plus 100 ms, and its end is seen.
#![allow(clippy::panic, clippy::unwrap_used)]

mod common;

use common::{AUTOPILOT, Quad};
use hums_core::Monitor;
use hums_core::health::{Finding, Level};
use hums_core::observation::{Observation, SystemTime};
use hums_core::params::Params;
use hums_core::status::{LinkReading, Recording};
use hums_core::time::{Instant, Span};
use hums_core::units::{Amperes, Celsius, Fraction, Volts};

/// When the fault begins and ends in each script.
const FAULT_MS: u64 = 20_000;
const END_MS: u64 = 100_000;

/// Flies for two minutes; `script` changes the quad between [`FAULT_MS`] and [`END_MS`].
fn fly(script: impl Fn(u64, &mut Quad)) -> Vec<Finding> {
    let mut monitor = Monitor::new(Params::defaults());
    let mut findings = Vec::new();
    for now_ms in (0..120_000).step_by(50) {
        let now = Instant::from_millis(now_ms);
        let mut quad = Quad::healthy();
        if (FAULT_MS..END_MS).contains(&now_ms) {
            script(now_ms, &mut quad);
        }
        if now_ms.is_multiple_of(100) {
            for observation in quad.says(now_ms) {
                monitor.observe(now, AUTOPILOT, &observation);
            }
        }
        let link = LinkReading { frames_lost: Some(quad.lost), at: now };
        monitor.tick(now, &link, &quad.recorder, &mut |finding| findings.push(*finding));
    }
    findings
}

/// The check reaches the level within its debounce plus 100 ms, is the only one to complain besides `also`, and is
/// well again once the fault has ended.
#[track_caller]
fn found(findings: &[Finding], check: &str, instance: u8, level: Level, debounce_ms: u64, also: &[&str]) {
    let mine = |finding: &&Finding| finding.check == check && finding.instance == instance;
    let first = findings.iter().filter(mine).find(|finding| finding.level == level);
    let first = first.unwrap_or_else(|| panic!("{check} {instance} never {level:?}: {findings:?}"));
    let after_ms = first.at.as_millis().saturating_sub(FAULT_MS);
    assert!(
        (debounce_ms..=debounce_ms + 100).contains(&after_ms),
        "{check} after {after_ms} ms, debounce {debounce_ms} ms"
    );
    let last = findings.iter().rfind(mine).expect("there is one");
    assert_eq!(last.level, Level::Ok, "{check} is not cleared: {last:?}");
    assert!(last.at.as_millis() >= END_MS, "{check} cleared at {:?}, before the fault ended", last.at);
    let others = findings.iter().filter(|finding| finding.check != check && !also.contains(&finding.check));
    assert_eq!(others.count(), 0, "{findings:?}");
}

#[test]
fn a_healthy_flight_has_no_finding() {
    assert_eq!(fly(|_, _| {}), []);
}

#[test]
fn a_battery_that_collapses() {
    let findings = fly(|_, quad| quad.battery.voltage = Some(Volts(13.2)));
    found(&findings, "cell_voltage", 0, Level::Critical, 5_000, &[]);
}

#[test]
fn a_battery_that_runs_empty() {
    let findings = fly(|_, quad| quad.battery.remaining = Some(Fraction(0.05)));
    found(&findings, "batt_remaining", 0, Level::Critical, 2_000, &[]);
}

#[test]
fn one_esc_that_gets_hot() {
    let findings = fly(|_, quad| quad.escs[2].as_mut().unwrap().temperature = Some(Celsius(120.0)));
    found(&findings, "esc_temperature", 2, Level::Critical, 500, &[]);
}

#[test]
fn one_motor_that_draws_nothing() {
    let findings = fly(|_, quad| quad.escs[1].as_mut().unwrap().current = Some(Amperes(0.0)));
    found(&findings, "motor_loss", 1, Level::Critical, 500, &[]);
}

#[test]
fn one_esc_that_falls_silent() {
    let findings = fly(|_, quad| quad.escs[3] = None);
    // Its last word came 100 ms before the fault; 2 s after that it is silent for good.
    let critical = findings.iter().find(|finding| finding.level == Level::Critical).expect("found");
    assert_eq!((critical.check, critical.instance), ("esc_silent", 3));
    assert!((21_900..=22_100).contains(&critical.at.as_millis()), "{critical:?}");
    let warning = findings.iter().find(|finding| finding.level == Level::Warning).expect("found");
    assert!((20_200..=20_400).contains(&warning.at.as_millis()), "{warning:?}");
}

#[test]
fn an_estimator_that_diverges() {
    let findings = fly(|_, quad| {
        (quad.estimator.compass, quad.estimator.velocity) = (Some(1.2), Some(0.9));
    });
    found(&findings, "ekf_failsafe", 0, Level::Critical, 1_000, &["ekf_variance"]);
}

#[test]
fn one_figure_of_the_estimator_alone_is_a_warning() {
    let findings = fly(|_, quad| quad.estimator.compass = Some(1.2));
    found(&findings, "ekf_variance", 0, Level::Warning, 1_000, &[]);
}

#[test]
fn gps_that_is_jammed() {
    let findings = fly(|_, quad| quad.integrity.jamming = 3);
    found(&findings, "gps_jamming", 0, Level::Critical, 1_000, &[]);
}

#[test]
fn a_fix_that_is_lost() {
    let findings = fly(|_, quad| quad.gnss.fix = 1);
    found(&findings, "gps_fix", 0, Level::Critical, 1_000, &[]);
}

#[test]
fn vibration() {
    let findings = fly(|_, quad| quad.vibration.levels[2] = Some(70.0));
    found(&findings, "vibration", 0, Level::Critical, 1_000, &[]);
}

#[test]
fn a_turn_too_tight() {
    let findings = fly(|_, quad| quad.acceleration_down = -45.0);
    found(&findings, "load_factor", 0, Level::Critical, 100, &[]);
}

#[test]
fn a_vehicle_that_rolls_over() {
    let findings = fly(|_, quad| quad.roll = 1.2);
    found(&findings, "roll", 0, Level::Critical, 300, &[]);
}

#[test]
fn an_overloaded_processor() {
    let findings = fly(|_, quad| quad.system.load = Some(Fraction(0.97)));
    found(&findings, "load", 0, Level::Critical, 2_000, &[]);
}

#[test]
fn an_autopilot_that_falls_silent_makes_everything_else_stale() {
    let findings = fly(|_, quad| quad.silent = true);
    let heartbeat =
        findings.iter().find(|finding| finding.level == Level::Critical && finding.check == "heartbeat");
    // Its last heartbeat came 500 ms before the silence.
    let after_ms = heartbeat.expect("found").at.as_millis() - (FAULT_MS - 500);
    assert!((5_000..=5_150).contains(&after_ms), "{after_ms}");
    for check in ["batt_remaining", "ekf_variance", "vibration", "load", "roll"] {
        let stale = findings.iter().any(|finding| finding.check == check && finding.level == Level::Stale);
        assert!(stale, "{check} stayed as it was without any data");
    }
}

#[test]
fn an_autopilot_that_restarts() {
    let findings = fly(|now_ms, quad| quad.boot_offset_ms = -(FAULT_MS as i64) + i64::from(now_ms == 0));
    let reboot = findings.iter().find(|finding| finding.check == "autopilot_reboot").expect("found");
    assert_eq!(reboot.level, Level::Critical);
    assert!((FAULT_MS..=FAULT_MS + 100).contains(&reboot.at.as_millis()), "{reboot:?}");
}

#[test]
fn frames_that_are_lost() {
    let findings = fly(|_, quad| quad.lost = 0.08);
    found(&findings, "frames_lost", 0, Level::Critical, 2_000, &[]);
}

#[test]
fn a_recorder_that_stops_while_armed() {
    let findings = fly(|_, quad| quad.recorder.recording = Recording::Stopped);
    found(&findings, "recording", 0, Level::Critical, 1_000, &[]);
}

#[test]
fn a_card_that_keeps_the_recorder_waiting() {
    let findings = fly(|_, quad| quad.recorder.stall = Span::from_millis(800));
    found(&findings, "card_stall", 0, Level::Warning, 0, &[]);
}

#[test]
fn a_card_that_refuses_writes() {
    let findings = fly(|_, quad| quad.recorder.write_errors = 3);
    let errors = findings.iter().find(|finding| finding.check == "card_errors").expect("found");
    assert_eq!((errors.level, errors.at.as_millis()), (Level::Warning, FAULT_MS));
    let cleared = findings.iter().rfind(|finding| finding.check == "card_errors").expect("there");
    assert_eq!(cleared.level, Level::Ok, "ten seconds without one");
}

#[test]
fn a_card_that_is_full_of_other_files() {
    let findings = fly(|_, quad| quad.recorder.room = Some(0.005));
    found(&findings, "card_room", 0, Level::Critical, 1_000, &[]);
}

#[test]
fn an_error_counter_that_wraps_is_no_flood_of_errors() {
    let findings = fly(|_, quad| quad.escs[0].as_mut().unwrap().errors = Some(2));
    assert_eq!(findings, []);
}

#[test]
fn errors_that_rise() {
    let findings = fly(|now_ms, quad| {
        quad.escs[0].as_mut().unwrap().errors = Some(((now_ms - FAULT_MS) / 100) as u32);
    });
    let errors = findings.iter().find(|finding| finding.check == "esc_errors").expect("found");
    assert_eq!((errors.level, errors.instance), (Level::Warning, 0));
}

#[test]
fn utc_that_jumps_is_no_fault() {
    let mut monitor = Monitor::new(Params::defaults());
    let mut findings = Vec::new();
    for now_ms in (0..30_000).step_by(100) {
        let now = Instant::from_millis(now_ms);
        let quad = Quad::healthy();
        for observation in quad.says(now_ms) {
            monitor.observe(now, AUTOPILOT, &observation);
        }
        let utc_micros = Some(if now_ms < 15_000 { 1_700_000_000_000_000 } else { 1_400_000_000_000_000 });
        let time = SystemTime { boot_ms: (now_ms + 100_000) as u32, utc_micros };
        monitor.observe(now, AUTOPILOT, &Observation::SystemTime(time));
        let link = LinkReading { frames_lost: Some(0.0), at: now };
        monitor.tick(now, &link, &quad.recorder, &mut |finding| findings.push(*finding));
    }
    assert_eq!(findings, []);
}
