//! Reports of recorded flights, looked at in Chromium.

use std::fs;
use std::path::{Path, PathBuf};

use hums_tests::flights::{Manifest, own};
use hums_tests::frames::build_v2;
use hums_tests::program::{LIMIT, Machine, Recording, command, hums};
use hums_tests::{child, oracle};
use serde_json::Value;

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

#[track_caller]
fn report(source: &Path, codes: &[i32]) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("report.html");
    hums(["report".as_ref(), source.as_os_str(), "-o".as_ref(), page.as_os_str()]).expect_code(codes);
    (dir, page)
}

/// What holds for every page.
#[track_caller]
fn assert_sound(shown: &Value) {
    assert_eq!(shown["console"], serde_json::json!([]), "the browser complains");
    assert_eq!(shown["requests"], serde_json::json!([]), "the page asks for something");
    let width = shown["width"].as_array().unwrap();
    assert!(width[0].as_f64() <= width[1].as_f64(), "it is wider than a phone: {width:?}");
    for (id, plot) in shown["plots"].as_object().unwrap() {
        // One line may hide another, but not all of them.
        let pixels = plot["pixels"].as_array().unwrap().iter().filter_map(Value::as_u64);
        assert!(pixels.sum::<u64>() > 50, "{id} has no line: {plot}");
    }
}

/// A number as the page prints it: its groups apart, its unit after it.
fn number(text: &str) -> f64 {
    let plain: String =
        text.chars().filter(|c| *c != '\u{202f}').map(|c| if c == '\u{2212}' { '-' } else { c }).collect();
    let end = plain.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-'))).unwrap_or(plain.len());
    plain[..end].parse().unwrap_or_else(|_| panic!("no number: {text:?}"))
}

/// The values of one field around a time, from the JSON lines: lowest and highest within `around_s`.
fn around(jsonl: &str, message: &str, at_s: f64, around_s: f64, value: impl Fn(&Value) -> f64) -> (f64, f64) {
    let wanted = format!("\"message\":\"{message}\"");
    let values = jsonl.lines().filter(|line| line.contains(&wanted)).map(json).filter_map(|entry| {
        let near = (entry["time_boot"].as_f64().unwrap() - at_s).abs() <= around_s;
        near.then(|| value(&entry["fields"]))
    });
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
}

#[test]
fn a_flights_page_shows_the_flight() {
    let recording = Recording::make(Machine::Sim, &own("ap_quad_faults.tlog"), &[]);
    let (_dir, page) = report(&recording.image(), &[0]);
    let shown = oracle::browser(&page);
    assert_sound(&shown);

    let info = json(&hums(["info".as_ref(), "--json".as_ref(), recording.image().as_os_str()]).text());
    let log = &info["logs"][0];
    let findings = shown["findings"].as_array().unwrap();
    let expected = log["findings"].as_array().unwrap();
    assert_eq!(findings.len(), expected.len());
    assert!(!expected.is_empty());
    for (row, finding) in findings.iter().zip(expected) {
        assert_eq!((&row[1], &row[2]), (&finding["level"], &finding["check"]));
    }
    let tiles = &shown["tiles"];
    let tile = |name: &str| number(tiles[name].as_str().unwrap_or_else(|| panic!("no {name} in {tiles}")));
    assert!((tile("frames recorded") - log["frames"].as_f64().unwrap()).abs() < 0.5);
    assert!((tile("greatest height") - log["usage"]["height_max_m"].as_f64().unwrap()).abs() <= 0.051);
    assert!((tile("lowest battery voltage") - 10.2).abs() < 0.006, "by the recording's own description");
    assert!(shown["map"][0].as_f64().unwrap() > 0.02, "no track: {}", shown["map"]);
    assert!(shown["timeline"].as_f64().unwrap() > 0.2, "no phases: {}", shown["timeline"]);
    for plot in [
        "Height",
        "Speed",
        "PackVolts",
        "MotorRpm",
        "MotorVolts",
        "MotorAmperes",
        "MotorCelsius",
        "Vibration",
        "Clips",
        "Estimator",
        "Satellites",
        "Frames",
    ] {
        assert!(shown["plots"][plot].is_object(), "there is no plot {plot}");
    }
    for motor_plot in ["MotorRpm", "MotorVolts"] {
        assert_eq!(shown["plots"][motor_plot]["lines"], 4, "{motor_plot}");
    }
    assert_pointed_values(&recording.image(), &shown);
    assert!(shown["cursor"].as_str().unwrap().contains(':'), "no time under the cursor: {}", shown["cursor"]);
    // The defaults of docs/parameters.md.
    let limits = [0, 1].map(|level| shown["limits"]["Vibration"][level].as_f64());
    assert_eq!(limits, [Some(30.0), Some(60.0)]);
    assert!(!shown["why"].as_array().unwrap().is_empty(), "no finding says what it means");
}

/// The values of a pixel's width and of an interval on both sides.
const AROUND_S: f64 = 1.6;

/// A plot, a line of it, the message it is of, how finely it is printed, and the value of the message's fields.
type Line = (&'static str, &'static str, &'static str, f64, fn(&Value) -> f64);

/// The modes are those of the heartbeats, one after the other.
fn assert_modes(jsonl: &str, shown: &Value) {
    let beats = jsonl.lines().filter(|line| line.contains("\"message\":\"HEARTBEAT\"")).map(json);
    let of_autopilot = beats.filter(|entry| entry["component"] == 1);
    let mut modes: Vec<u64> =
        of_autopilot.filter_map(|entry| entry["fields"]["custom_mode"].as_u64()).collect();
    modes.dedup();
    // ArduCopter's mode.h.
    let names = modes.iter().map(|mode| match mode {
        0 => "STABILIZE",
        3 => "AUTO",
        4 => "GUIDED",
        5 => "LOITER",
        6 => "RTL",
        9 => "LAND",
        _ => "?",
    });
    assert_eq!(shown["modes"], serde_json::json!(names.collect::<Vec<_>>()));
    assert!(!modes.is_empty());
}

/// Where the mouse points, a line says what the vehicle said there.
fn assert_pointed_values(image: &Path, shown: &Value) {
    let mut decode = command(["decode".as_ref(), image.as_os_str()]);
    let jsonl = child::run(decode.args(["-o", "-", "--format", "jsonl"]), LIMIT).expect_code(&[0]).text();
    assert_modes(&jsonl, shown);
    let lines: [Line; 4] = [
        ("Height", "Height", "GLOBAL_POSITION_INT", 0.01, |fields| {
            fields["relative_alt"].as_f64().unwrap() / 1e3
        }),
        ("PackVolts", "Battery 1", "BATTERY_STATUS", 0.001, |fields| {
            fields["voltages"][0].as_f64().unwrap() / 1e3
        }),
        ("MotorRpm", "Motor 3", "ESC_TELEMETRY_1_TO_4", 1.0, |fields| fields["rpm"][2].as_f64().unwrap()),
        ("Vibration", "Down", "VIBRATION", 0.001, |fields| fields["vibration_z"].as_f64().unwrap()),
    ];
    for (plot, line, message, resolution, value) in lines {
        for point in shown["plots"][plot]["points"].as_array().unwrap() {
            let at_s = point["time_s"].as_f64().unwrap();
            let text =
                point["values"][line].as_str().unwrap_or_else(|| panic!("{plot} has no {line}: {point}"));
            let (low, high) = around(&jsonl, message, at_s, AROUND_S, value);
            let said = number(text);
            assert!(
                (low - resolution..=high + resolution).contains(&said),
                "{plot} says {said} at {at_s} s, the flight {low} to {high}"
            );
        }
    }
}

#[test]
fn a_px4_flights_page_shows_its_cells_of_the_recorder_and_a_gap() {
    let dir = tempfile::tempdir().unwrap();
    let log = dir.path().join("flight.hum");
    hums(["pack".as_ref(), own("px4_hil_quad_low.tlog").as_os_str(), "-o".as_ref(), log.as_os_str()])
        .expect_code(&[0]);
    let mut bytes = fs::read(&log).unwrap();
    bytes[150 * 512 + 100] ^= 0x10;
    fs::write(&log, bytes).unwrap();
    let (_dir, page) = report(&log, &[3]);
    let shown = oracle::browser(&page);
    assert_sound(&shown);
    let gaps = shown["gaps"].as_array().unwrap();
    assert_eq!(gaps.len(), 1);
    assert!(gaps[0].as_str().unwrap().contains("damaged"), "{gaps:?}");
    assert_eq!(shown["plots"]["MotorCelsius"]["lines"], 4);
}

#[test]
fn words_of_a_hostile_vehicle_stay_words() {
    const HOSTILE: [&str; 3] = [
        "</script><script>document.title='owned'</script>",
        "<img src=x onerror=\"document.title='owned'\">",
        "{{program}} & \"quotes\" 'n' \\u003c <b>",
    ];
    let seeds = &Manifest::own().seeds;
    let mut data = Vec::new();
    for sequence in 0..120_u8 {
        data.extend(build_v2(sequence.wrapping_mul(2), 0, &[4, 0, 0, 0, 2, 3, 0x51, 4, 3], seeds[&0]));
        let mut payload = vec![4];
        payload.extend(HOSTILE[usize::from(sequence) % 3].bytes());
        payload.resize(51, 0);
        data.extend(build_v2(sequence.wrapping_mul(2).wrapping_add(1), 253, &payload, seeds[&253]));
    }
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("hostile.raw");
    fs::write(&file, &data).unwrap();
    let recording = Recording::make(Machine::Sim, &file, &[]);
    let (_dir, page) = report(&recording.image(), &[0]);
    let shown = oracle::browser(&page);
    assert_sound(&shown);
    assert!(!shown["title"].as_str().unwrap().contains("owned"), "{}", shown["title"]);
    let texts = shown["texts"].as_array().unwrap();
    for hostile in HOSTILE {
        let said = &hostile[..hostile.len().min(50)];
        assert!(texts.iter().any(|text| text == said), "{said} is not in {texts:?}");
    }
}

#[test]
fn several_sessions_of_a_card_become_a_trend() {
    let dir = tempfile::tempdir().unwrap();
    let image = dir.path().join("card.img");
    for flight in ["ap_quad_guided.tlog", "ap_quad_faults.tlog"] {
        let mut sim = command(["sim", "--speed", "max", "--input"]);
        child::run(sim.arg(own(flight)).arg("--sd").arg(&image), LIMIT).expect_code(&[0]);
    }
    let (_dir, page) = report(&image, &[0]);
    let shown = oracle::browser(&page);
    assert_sound(&shown);
    let text = shown["text"].as_str().unwrap();
    assert!(text.contains("This session against the 1 session before it on the same card"), "no trend");
}
