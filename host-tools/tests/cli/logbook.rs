//! `hums logbook`: flights, totals, defects; and what people wrote stays.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::support::{contents, flight, json, run, text};

fn cards() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("directory");
    fs::create_dir(dir.path().join("cards")).expect("made");
    for name in ["ap_quad_guided.tlog", "ap_quad_faults.tlog"] {
        run(dir.path(), &format!("sim {} --sd cards/card.img --speed max", flight(name).display()), 0);
    }
    fs::copy(flight("px4_hil_quad_low.tlog"), dir.path().join("cards/px4.tlog")).expect("copied");
    dir
}

fn rows(path: &Path) -> Vec<Value> {
    let text = fs::read_to_string(path).expect("a CSV");
    let mut lines = text.lines();
    let heading: Vec<&str> = lines.next().expect("a heading").split(',').collect();
    let object = |line: &str| {
        let parts = line.split('"').enumerate();
        let line: String = parts
            .map(|(index, part)| if index % 2 == 1 { part.replace(',', ";") } else { part.to_owned() })
            .collect();
        let cells = line.split(',').map(Value::from);
        heading.iter().map(|name| (*name).to_owned()).zip(cells).collect()
    };
    lines.map(object).collect()
}

fn number(value: &Value) -> f64 {
    value.as_str().expect("text").parse().expect("a number")
}

#[test]
fn totals_are_the_counters_on_board_and_a_card_that_is_there_twice_counts_once() {
    let dir = cards();
    run(dir.path(), "logbook cards -o book.csv", 0);
    let once = fs::read(dir.path().join("book.csv")).expect("a CSV");
    fs::copy(dir.path().join("cards/card.img"), dir.path().join("cards/again.img")).expect("copied");
    let said = run(dir.path(), "logbook cards -o twice.csv -o book.html", 0);
    assert!(text(&said).contains("book.html: 2 aircraft, 3 flights"), "{}", text(&said));
    let strip = |text: Vec<u8>| String::from_utf8(text).expect("text").replace("again.img", "card.img");
    assert_eq!(strip(fs::read(dir.path().join("twice.csv")).expect("a CSV")), strip(once));

    let info = json(&run(dir.path(), "info --json cards/card.img cards/px4.tlog", 0));
    let of = |name: &str| -> f64 {
        info["logs"]
            .as_array()
            .expect("logs")
            .iter()
            .map(|log| log["usage"][name].as_f64().expect(name))
            .sum()
    };
    let rows = rows(&dir.path().join("book.csv"));
    assert_eq!(rows.len(), of("flights").round() as usize);
    let last = |kind: &str| {
        rows.iter().rfind(|row| row["aircraft"].as_str().is_some_and(|name| name.contains(kind)))
    };
    let total = |kind| number(&last(kind).expect(kind)["total_hours"]);
    let hours = total("ArduPilot") + total("PX4");
    assert!((hours * 3600.0 - of("flight_time_s")).abs() < 3.0, "{hours} h, {} s", of("flight_time_s"));
    let defects: Vec<&str> = rows.iter().filter_map(|row| row["defects"].as_str()).collect();
    assert_eq!(
        defects.iter().filter(|words| words.contains("critical: battery 1 cell low: 3.4 V")).count(),
        1
    );
    assert!(
        rows.iter().filter(|row| number(&row["take_off_latitude_deg"]).abs() > 1.0).count() >= 2,
        "{rows:?}"
    );

    let page = fs::read_to_string(dir.path().join("book.html")).expect("a page");
    assert!(page.contains("size:A4") && page.contains("critical: battery 1 cell low"), "{page}");
    assert!(
        page.contains("Total in this logbook: 2 flights") && page.contains("Counters of the box"),
        "{page}"
    );
    assert!(!page.contains("<script") && !page.contains("http"), "{page}");
}

#[test]
fn what_people_wrote_stays_when_the_logbook_is_made_again() {
    let dir = cards();
    run(dir.path(), "logbook cards/card.img -o book.csv", 0);
    let path = dir.path().join("book.csv");
    let filled = fs::read_to_string(&path).expect("a CSV");
    let mut lines: Vec<String> = filled.lines().map(str::to_owned).collect();
    assert!(lines[1].ends_with(",,,,,,"), "{}", lines[1]);
    lines[1] = format!(
        "{}Model X,\"A. <Pilot>\",VLOS,done,\"cell, replaced\",fine",
        &lines[1][..lines[1].len() - 5]
    );
    fs::write(&path, lines.join("\n")).expect("written");
    run(dir.path(), "logbook cards/px4.tlog -o book.csv", 0);
    run(dir.path(), "logbook cards/card.img -o book.csv -o book.html -o flights/", 0);
    let again = fs::read_to_string(&path).expect("a CSV");
    assert_eq!(again.matches("A. <Pilot>").count(), 1, "{again}");
    assert!(again.contains("Model X,A. <Pilot>,VLOS,done,\"cell, replaced\",fine"), "{again}");
    assert_eq!(again.lines().count(), 4, "three flights: {again}");
    assert!(again.contains(",px4.tlog,") && !again.contains("cards/"), "folders stay private: {again}");
    let page = fs::read_to_string(dir.path().join("book.html")).expect("a page");
    assert!(page.contains("A. &lt;Pilot&gt;") && page.contains("Model X"), "{page}");
    let of_pilot = contents(&dir.path().join("flights")).into_iter().filter(|(_, bytes)| {
        let flight: Value = serde_json::from_slice(bytes).expect("JSON");
        flight["exchange"]["message"]["flight_data"]["operation"][0]["contact"] == "A. <Pilot>"
    });
    assert_eq!(of_pilot.count(), 1);
    run(dir.path(), "logbook cards/card.img -o book.html", 1);
    fs::write(dir.path().join("mine.csv"), "a,b\n1,2\n").expect("written");
    run(dir.path(), "logbook cards/card.img -o mine.csv", 1);
    assert_eq!(fs::read_to_string(dir.path().join("mine.csv")).expect("there"), "a,b\n1,2\n");
    run(dir.path(), "logbook cards/card.img -o book.pdf", 2);
    run(dir.path(), "logbook cards/card.img -o both.json", 2);
}

/// The fields that the protocol's document calls mandatory, their types, and its formats of times.
#[test]
fn gutmas_json_has_the_fields_of_the_protocol() {
    let dir = cards();
    run(dir.path(), "logbook cards -o flights/", 0);
    let flights = contents(&dir.path().join("flights"));
    assert_eq!(flights.len(), 3);
    for (name, bytes) in flights {
        let flight: Value = serde_json::from_slice(&bytes).expect("JSON");
        let exchange = &flight["exchange"];
        assert_eq!(exchange["exchange_type"], "flight_logging");
        let message = &exchange["message"];
        assert_eq!(message["message_type"], "flight_logging_submission");
        for field in ["manufacturer", "model", "serial_number", "firmware_version"] {
            assert!(message["flight_data"]["aircraft"][field].is_string(), "{name} {field}");
        }
        let path = &message["flight_logging_geojson"]["flight_path"];
        assert_eq!(path["type"], "FeatureCollection");
        let features = path["features"].as_array().expect("a list");
        assert!(features.len() > 100, "{name}: {}", features.len());
        let mut before = String::new();
        for feature in features {
            assert_eq!(
                (&feature["type"], &feature["geometry"]["type"]),
                (&"Feature".into(), &"Point".into())
            );
            let place = feature["geometry"]["coordinates"].as_array().expect("a place");
            assert!(
                place.len() == 2 && place.iter().all(|axis| axis.as_f64().expect("degrees").abs() <= 180.0)
            );
            let of = &feature["properties"];
            assert!(of["altitude"].is_number() && of["groundspeed"].is_number());
            let time = of["time"].as_str().expect("a time").to_owned();
            assert!(time.len() == "2017-05-16T13:19:22.250Z".len() && time.ends_with('Z'), "{time}");
            assert!(time > before, "{name}: {time} after {before}");
            before = time;
        }
        let fast = features.iter().filter_map(|feature| feature["properties"]["groundspeed"].as_f64());
        assert!(fast.fold(0.0, f64::max) > 3.0, "{name}");
        let logging = &message["flight_logging"];
        let keys = logging["flight_logging_keys"].as_array().expect("a list");
        let items = logging["flight_logging_items"].as_array().expect("a list");
        assert!(keys.contains(&"timestamp".into()) && items.len() == features.len());
        assert!(items.iter().all(|item| item.as_array().map(Vec::len) == Some(keys.len())));
        for of in [logging, &message["flight_logging_geojson"]] {
            assert!(["agl", "amsl", "sps", "WGS84"].contains(&of["altitude_system"].as_str().expect("text")));
            assert!(of["logging_start_dtg"].as_str().expect("a time").ends_with('Z'));
        }
        let events = logging["events"].as_array().expect("a list");
        assert_eq!(events.iter().filter(|event| event["event_info"] == "TAKE-OFF").count(), 1, "{name}");
        assert_eq!(events.iter().filter(|event| event["event_info"] == "LANDING").count(), 1, "{name}");
        assert_eq!(message["file"]["logging_type"], "GUTMA_DX_JSON");
    }
}
