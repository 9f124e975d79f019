//! Findings and usage against pymavlink's own computation. All recordings: `HUMS_FLIGHTS=... cargo test -p hums-tests
//! --features oracle usage -- --nocapture`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use hums_tests::flights::{OWN, own, root};
use hums_tests::program::{Machine, Recording};
use serde_json::Value;

const COLUMNS: [(&str, usize); 12] = [
    ("flights", 0),
    ("flight_time_s", 1),
    ("armed_time_s", 1),
    ("distance_m", 0),
    ("speed_max_m_s", 2),
    ("height_max_m", 1),
    ("charge_ah", 2),
    ("energy_wh", 2),
    ("current_max_a", 1),
    ("voltage_min_v", 2),
    ("vibration_max_m_s2", 2),
    ("load_factor_max_g", 2),
];

fn name(flight: &Path) -> String {
    flight.file_name().unwrap().to_string_lossy().into_owned()
}

fn usage_row(flight: &Path, json: &Value) -> String {
    let mut row = format!("| {} |", name(flight));
    for (column, places) in COLUMNS {
        match json["usage"][column].as_f64() {
            Some(value) => write!(row, " {value:.places$} |").unwrap(),
            None => row.push_str(" – |"),
        }
    }
    row
}

fn finding_rows(flight: &Path, json: &Value) -> Vec<String> {
    let findings = json["findings"].as_array().unwrap().iter();
    let bad = findings.filter(|finding| finding["level"] == "warning" || finding["level"] == "critical");
    let row = |finding: &Value| {
        let text = |key: &str| finding[key].as_str().unwrap().to_owned();
        let (time_s, value) = (finding["time_s"].as_f64().unwrap(), finding["value"].as_f64().unwrap());
        let (check, level, unit) = (text("check"), text("level"), text("unit"));
        format!(
            "| {} | {time_s:.1} | {check} | {level} | {} |",
            name(flight),
            format!("{value:.2} {unit}").trim()
        )
    };
    bad.map(row).collect()
}

#[test]
fn the_documentation_shows_the_findings_and_the_usage_of_the_recordings() {
    let document = fs::read_to_string(root().join("tests/flights/README.md")).unwrap();
    let (mut rows, mut shown) = (0, String::new());
    for flight in OWN.map(own) {
        let json = Recording::make(Machine::Sim, &flight, &[]).json();
        for row in finding_rows(&flight, &json).into_iter().chain([usage_row(&flight, &json)]) {
            writeln!(shown, "{row}").unwrap();
            rows += 1;
        }
    }
    let missing: Vec<&str> = shown.lines().filter(|row| !document.contains(*row)).collect();
    assert!(missing.is_empty(), "tests/flights/README.md has not:\n{}", missing.join("\n"));
    let documented =
        document.lines().filter(|line| OWN.iter().any(|name| line.starts_with(&format!("| {name} |"))));
    assert_eq!(documented.count(), rows, "tests/flights/README.md has rows that there are not:\n{shown}");
}

#[cfg(feature = "oracle")]
#[test]
fn usage_is_what_pymavlink_says_within_one_percent_on_every_recording() {
    let flights: Vec<std::path::PathBuf> =
        OWN.map(own).into_iter().chain(hums_tests::flights::more()).collect();
    let expected = hums_tests::oracle::usage(&flights);
    let mut wrong = Vec::new();
    for flight in &flights {
        let json = Recording::make(Machine::Sim, flight, &[]).json();
        for row in finding_rows(flight, &json) {
            eprintln!("{row}");
        }
        eprintln!("{}", usage_row(flight, &json));
        let figures = expected[name(flight)].as_object().unwrap();
        assert!(figures.len() >= COLUMNS.len(), "{figures:?}");
        for (counter, expected) in figures {
            let (found, expected) = (json["usage"][counter].as_f64(), expected.as_f64());
            let agrees = match (found, expected) {
                (Some(found), Some(expected)) => (found - expected).abs() <= 0.01 * expected.abs(),
                (found, expected) => found.is_none() && expected.is_none(),
            };
            if !agrees {
                wrong.push(format!("{}: {counter} is {found:?}, pymavlink says {expected:?}", name(flight)));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
