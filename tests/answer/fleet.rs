//! A folder of cards as one table: the queries of `docs/fleet.md` return the content of the cards.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use hums_dialect::crc;
use hums_tests::child;
use hums_tests::flights::{own, root};
use hums_tests::oracle;
use hums_tests::program::{LIMIT, command, hums_with};
use serde_json::Value;

fn cards(dir: &Path) {
    fs::create_dir(dir.join("cards")).unwrap();
    // Boards have a source of randomness that distinguishes sessions of equal number; here it is the seed.
    for (card, seed, flight) in [
        ("first", "1", "px4_hil_quad_low.tlog"),
        ("second", "2", "ap_quad_guided.tlog"),
        ("second", "2", "ap_quad_faults.tlog"),
    ] {
        let mut sim = command(["sim", "--seed", seed, "--speed", "max"]);
        let image = dir.join("cards").join(format!("{card}.img"));
        child::run(sim.arg(own(flight)).arg("--sd").arg(image), LIMIT).expect_code(&[0]);
    }
    // Recorders without checks: a packed recording, and one of an unknown vehicle.
    let packed = dir.join("cards/packed.hum");
    hums_with("decode --format hum {} -o {}", &[&own("ap_quad_faults.tlog"), &packed]).expect_code(&[0]);
    let (raw, silent) = (dir.join("silent.raw"), dir.join("cards/silent.hum"));
    // A SYSTEM_TIME and no heartbeat.
    let frame = [0xfe, 12, 0, 1, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0];
    let crc = crc::step(crc::update(crc::START, &frame[1..]), 137);
    fs::write(&raw, [&frame[..], &crc.to_le_bytes()].concat().repeat(100)).unwrap();
    hums_with("decode --format hum {} -o {}", &[&raw, &silent]).expect_code(&[0]);
}

fn rows(results: &Value, heading: &str) -> Vec<Value> {
    let result =
        results.as_array().unwrap().iter().find(|result| result["heading"] == heading).expect(heading);
    let columns: Vec<&str> = result["columns"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let object = |row: &Value| -> Value {
        columns
            .iter()
            .zip(row.as_array().unwrap())
            .map(|(name, value)| ((*name).to_owned(), value.clone()))
            .collect()
    };
    result["rows"].as_array().unwrap().iter().map(object).collect()
}

#[test]
fn the_documents_queries_answer_what_the_cards_say() {
    let dir = tempfile::tempdir().unwrap();
    cards(dir.path());
    let (cards, fleet) = (dir.path().join("cards"), dir.path().join("fleet"));
    let decode = |format: &str, out: &Path| {
        let mut decode = command(["decode".as_ref(), cards.as_os_str(), "-o".as_ref(), out.as_os_str()]);
        child::run(decode.args(["--force", "--format", format]), LIMIT).expect_code(&[0]);
    };
    decode("parquet", &fleet);
    decode("parquet", &fleet);
    let info = hums_with("info --json {}", &[&cards]).expect_code(&[0]).text();
    let info: Value = serde_json::from_str(&info).unwrap();
    let logs = info["logs"].as_array().unwrap();
    assert_eq!(logs.len(), 5, "three sessions on two cards, and two packed recordings");
    let on_board = || logs.iter().filter(|log| log["checked_by"] == "board");

    let results = oracle::fleet(&root().join("docs/fleet.md"), dir.path());
    let vibration = rows(&results, "Worst vibration by airframe");
    let worst = vibration.iter().map(|row| row["worst"].as_f64().unwrap()).fold(0.0, f64::max);
    assert!(worst > 14.0, "the fault flight shakes: {vibration:?}");

    let ageing = rows(&results, "Battery ageing");
    assert_eq!(ageing.len(), 4, "a row for each session's battery: {ageing:?}");
    let unmeasured =
        ageing.iter().filter(|row| row["highest_amperes"].is_null() && row["milliohm"].is_null());
    assert_eq!(unmeasured.count(), 1, "{ageing:?}");

    let attention = rows(&results, "What needs attention");
    let worrying = |log: &&Value| {
        let findings = log["findings"].as_array().unwrap().iter();
        findings.filter(|finding| finding["level"] == "warning" || finding["level"] == "critical").count()
    };
    let expected: usize = logs.iter().map(|log| worrying(&log)).sum();
    assert!(expected > 0 && attention.len() == expected, "{expected}: {attention:?}");
    let by = |by: &str| attention.iter().filter(|row| row["checked_by"] == by).count();
    assert!(by("board") > 0 && by("hums") > 0 && by("nobody") == 0, "{attention:?}");

    assert_all_are_told(&results, logs);

    let printed = oracle::snippets(&root().join("docs/decode.md"), dir.path());
    let printed: Vec<&str> = printed.as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let attitude = |log: &Value| {
        let messages = log["messages"].as_array().unwrap().iter();
        messages
            .filter(|message| message["name"] == "ATTITUDE")
            .filter_map(|message| message["frames"].as_u64())
            .sum::<u64>()
    };
    let expected: u64 = logs.iter().map(attitude).sum();
    assert_eq!(printed.len(), 2, "{printed:?}");
    assert!(
        expected > 10_000 && printed[0].starts_with(&format!("{expected} ")),
        "{expected}: {}",
        printed[0]
    );
    assert_eq!(printed[1].matches("('").count(), 4, "a row for each session with attitudes: {}", printed[1]);

    let printed = oracle::snippets(&root().join("docs/fleet.md"), dir.path());
    let printed: Vec<&str> = printed.as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let flown: f64 = logs.iter().filter_map(|log| log["usage"]["flight_time_s"].as_f64()).sum();
    let [printed] = printed.as_slice() else { panic!("{printed:?}") };
    let sum: f64 = printed.trim().rsplit(' ').next().unwrap().parse().unwrap();
    assert!((sum - flown).abs() < 0.1 && flown > 600.0, "{printed}: {flown} s");

    let recorders = rows(&results, "Recorders");
    let frames: u64 = recorders.iter().map(|row| row["frames_in"].as_u64().unwrap()).sum();
    let expected: u64 = on_board().map(|log| log["frames"].as_u64().unwrap()).sum();
    assert_eq!(frames, expected);
}

#[track_caller]
fn assert_all_are_told(results: &Value, logs: &[Value]) {
    let ran: f64 = logs.iter().filter_map(|log| log["usage"]["motor0_run_time_s"].as_f64()).sum();
    let first_motor = rows(results, "Hours by motor").into_iter().filter(|row| row["motor"] == 1);
    let hours: f64 = first_motor.filter_map(|row| row["hours"].as_f64()).sum();
    assert!((hours * 3600.0 - ran).abs() < 1.0 && ran > 600.0, "motor 1 ran {hours} h, by info {ran} s");
    let sum = |heading, column: &str| {
        rows(results, heading).iter().filter_map(|row| row[column].as_f64()).sum::<f64>()
    };
    let flights: usize = logs.iter().map(|log| log["flights"].as_array().unwrap().len()).sum();
    assert_eq!(sum("Hours and flights by vehicle", "sessions").round() as usize, logs.len());
    assert_eq!(sum("Hours and flights by vehicle", "flights").round() as u64, flights as u64);
    let attention = rows(results, "What needs attention");
    let problems = rows(results, "Problems of the fleet");
    let key = |row: &Value| format!("{} {} {}", row["session"], row["check"], row["instance"]);
    let keys = |rows: &[Value]| rows.iter().map(key).collect::<BTreeSet<_>>();
    assert_eq!(keys(&problems), keys(&attention));
    let of_battery = |heading| rows(results, heading).len();
    assert_eq!(of_battery("Batteries by session"), of_battery("Battery ageing"));
    let worst =
        |heading| rows(results, heading).iter().filter_map(|row| row["worst"].as_f64()).fold(0.0, f64::max);
    let shaken = worst("Vehicles that shake more than others");
    assert!((shaken - worst("Worst vibration by airframe")).abs() < 0.1, "{shaken}");
    assert!(!rows(results, "One vehicle").is_empty() && rows(results, "Parts that are due").is_empty());
    let mut checked: Vec<(String, String, u64)> =
        rows(results, "Sessions and their checks").iter().map(told).collect();
    let mut expected: Vec<(String, String, u64)> = logs
        .iter()
        .map(|log| {
            (
                format!("s{}", word(&log["session"])),
                word(&log["checked_by"]),
                log["findings_count"].as_u64().unwrap(),
            )
        })
        .collect();
    checked.sort_unstable();
    expected.sort_unstable();
    assert_eq!(checked, expected);
    let by = |by: &str| checked.iter().filter(|(_, checked_by, _)| checked_by == by).count();
    assert_eq!((by("board"), by("hums"), by("nobody")), (3, 1, 1));
}

/// `cargo xtask prove fleet` makes 20,000.
#[test]
fn sixty_sessions_of_a_fleet_are_there_once_and_each_query_reads_a_file_for_a_vehicle_and_day() {
    let text = hums_tests::prove::fleet::run(&hums_tests::prove::fleet::Fleet::SHORT).unwrap();
    assert!(text.contains("a year, 18000000 sessions"), "{text}");
}

fn word(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

fn told(row: &Value) -> (String, String, u64) {
    let session = word(&row["session"]);
    let short = session.split_once('-').expect("a unique name").0;
    (short.to_owned(), word(&row["checked_by"]), row["findings"].as_u64().unwrap())
}
