//! MCAP, ULog, KML, GPX and SRT of each kind of recording, read by readers that are not ours.

use std::fs;
use std::path::Path;

use hums_tests::flights::root;
use hums_tests::oracle;
use hums_tests::program::hums_with;
use serde_json::json;

/// `at_least`: the least counts.
#[track_caller]
fn read(recording: &str, at_least: &[(&str, u64)]) {
    let dir = tempfile::tempdir().unwrap();
    let (input, out) = (root().join("tests").join(recording), dir.path());
    let log = out.join("log.hum");
    let input = if recording.contains(".tlog") {
        hums_with("decode {} -o {} --format hum", &[&input, &log]).expect_code(&[0, 3]);
        log
    } else {
        input
    };
    let files = out.join("files");
    let formats = "jsonl,mcap,ulog,kml,gpx,srt";
    hums_with("decode {} -o {} --format {}", &[&input, &files, &formats]).expect_code(&[0, 3]);
    let names = fs::read_dir(&files).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let jsonl =
        names.into_iter().find(|name| Path::new(name).extension().is_some_and(|end| end == "jsonl")).unwrap();
    let found = oracle::exports(&files, jsonl.strip_suffix(".jsonl").unwrap());
    eprintln!("{recording}: {found}");
    assert_eq!(found["wrong"], json!([]), "{recording}");
    for (pointer, least) in at_least {
        let count = found.pointer(pointer).and_then(serde_json::Value::as_u64);
        assert!(count >= Some(*least), "{recording} {pointer}: {count:?} of {least}");
    }
    assert_eq!(found["kml"], found["gpx"], "{recording}");
}

#[test]
fn a_vehicle_on_a_link_reads_back_from_each_format() {
    read(
        "flights/ap_quad_faults.tlog",
        &[
            ("/mcap/messages", 10_000),
            ("/mcap/~1position", 500),
            ("/mcap/~1pose", 500),
            ("/mcap/~1texts", 5),
            ("/mcap/~1battery~10", 100),
            ("/ulog/vehicle_attitude", 500),
            ("/ulog/battery_status", 100),
            ("/ulog/input_rc", 100),
            ("/ulog/texts", 5),
            ("/gpx/places", 500),
            ("/gpx/findings", 2),
            ("/places_compared", 500),
            ("/srt/cues", 200),
            ("/srt/findings", 2),
        ],
    );
}

#[test]
fn an_autopilots_own_log_reads_back_from_each_format() {
    read(
        "labelled/bin/f12_gps_jump.bin.gz",
        &[
            ("/mcap/messages", 10_000),
            ("/mcap/~1texts", 2),
            ("/ulog/vehicle_attitude", 500),
            ("/ulog/parameters", 500),
            ("/gpx/places", 100),
        ],
    );
    read(
        "labelled/px4/p23_motor_dead_quad.cut.ulg.gz",
        &[
            ("/mcap/messages", 10_000),
            ("/ulog/vehicle_attitude", 100),
            ("/ulog/parameters", 800),
            ("/gpx/places", 20),
        ],
    );
}
