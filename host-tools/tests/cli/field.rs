//! `hums check` of the small inputs in `tests/field`, which users of other tools reported.

use serde_json::Value;

use super::support::{json, run, text};

fn check(name: &str, code: i32) -> Value {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/field");
    json(&run(folder.as_ref(), &format!("check --json {name}.gz"), code))
}

fn problems(checked: &Value) -> Vec<(String, String, f64, String)> {
    let text = |problem: &Value, name: &str| problem[name].as_str().unwrap_or_default().to_owned();
    let of = |problem: &Value| {
        let at = problem["time_s"].as_f64().expect("a time");
        (text(problem, "check"), text(problem, "level"), at, text(problem, "detail"))
    };
    checked["problems"].as_array().expect("an array").iter().map(of).collect()
}

#[test]
fn an_autopilot_s_own_report_of_a_fault_is_a_finding() {
    for (name, code, check_name, level, at_s, detail) in [
        ("watchdog_reset.bin", 4, "processor_alert", "critical", 1.1, "after a hard fault"),
        ("wdog_message_only.bin", 4, "processor_alert", "critical", 1.1, "after a hard fault"),
        ("pm_internal_error.bin", 4, "processor_alert", "warning", 2.1, "0x8000"),
        ("hardfault_synthetic.ulg", 4, "processor_alert", "critical", 20.8, "pc 0x08001234"),
        ("text_in_chunks.tlog", 4, "ekf_alert", "warning", 20.1, "EKF variance: position"),
        ("text_in_chunks.tlog", 4, "crash_alert", "critical", 30.1, "Crash: Disarming"),
        ("text_in_chunks.tlog", 4, "drive_alert", "warning", 35.1, "Potential Thrust Loss"),
    ] {
        let problems = problems(&check(name, code));
        let is_it = |(check, of, at, words): &(String, String, f64, String)| {
            check == check_name && of == level && (at - at_s).abs() < 0.5 && words.contains(detail)
        };
        assert!(problems.iter().any(is_it), "{name}: {problems:#?}");
    }
}

#[test]
fn each_vehicle_of_a_recording_has_findings_and_flights_of_its_own() {
    for (name, code, expected) in [
        ("sysid_changed.tlog", 0, [(1, 1, ""), (5, 1, "")]),
        ("other_vehicle_after_crash.tlog", 4, [(1, 1, "crash_alert"), (2, 1, "")]),
    ] {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/field");
        let lines = text(&run(folder.as_ref(), &format!("check --json {name}.gz"), code));
        let objects: Vec<Value> =
            lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
        assert_eq!(objects.len(), 2, "{name}");
        for (object, (system, flights, finding)) in objects.iter().zip(expected) {
            assert_eq!(object["vehicle"]["system"].as_u64(), Some(system), "{name}");
            assert_eq!(object["flights"].as_array().map(Vec::len), Some(flights), "{name}, system {system}");
            let problems = problems(object);
            let is_expected = problems.iter().any(|(check, ..)| check == finding) || problems.is_empty();
            assert!(is_expected && problems.is_empty() == finding.is_empty(), "{name}: {problems:#?}");
        }
    }
}

#[test]
fn one_flight_stays_one_when_the_time_since_boot_begins_again_after_49_days() {
    let checked = check("boot_ms_wraps.raw", 0);
    assert_eq!(checked["flights"].as_array().map(Vec::len), Some(1));
    assert_eq!(problems(&checked), []);
}

#[test]
fn a_date_before_mavlink_was_made_is_no_date() {
    for name in ["utc_2006.raw", "gps_week_rolled.bin"] {
        assert!(check(name, 0)["start_utc"].is_null(), "{name}");
    }
}
