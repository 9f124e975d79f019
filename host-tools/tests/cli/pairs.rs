//! One flight from its autopilot's log and from a telemetry port, through the program.

use std::collections::BTreeMap;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::support::{json, run, stderr, text};

fn labelled(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/labelled").join(name)
}

fn uncompressed(name: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let file = fs::File::open(labelled(name)).expect("a log");
    flate2::read::GzDecoder::new(file).read_to_end(&mut bytes).expect("read");
    bytes
}

/// Changes of findings of the vehicle, each with its seconds since the take-off.
fn findings(dir: &Path, name: &str) -> Vec<(String, u64, String, f64)> {
    let code = if name.contains("n03") { 0 } else { 4 };
    let checked = json(&run(dir, &format!("check --json {}", labelled(name).display()), code));
    assert_eq!(checked["damaged"], false, "{name}: {checked}");
    let take_off = checked["flights"][0]["from_s"].as_f64().expect("a flight");
    let word = |finding: &serde_json::Value, name: &str| finding[name].as_str().expect(name).to_owned();
    let one = |finding: &serde_json::Value| {
        let (instance, at) = (finding["instance"].as_u64(), finding["time_s"].as_f64());
        let since = at.expect("a time") - take_off;
        (word(finding, "check"), instance.expect("a number"), word(finding, "level"), since)
    };
    let all = checked["findings"].as_array().expect("findings").iter().map(one);
    // An autopilot's log has no link.
    let is_of_link = |check: &str| matches!(check, "heartbeat" | "frames_lost");
    let mut known = BTreeMap::new();
    // A level that is reported again is no change.
    let mut is_change = |(check, instance, level, _): &(String, u64, String, f64)| {
        known.insert((check.clone(), *instance), level.clone()).as_ref() != Some(level)
    };
    all.filter(|one| one.2 != "stale" && !is_of_link(&one.0) && is_change(one)).collect()
}

#[test]
fn an_autopilots_log_and_a_recording_of_the_same_flight_are_judged_alike() {
    let dir = tempfile::tempdir().expect("a directory");
    // The shock of a crash is shorter than the interval of samples in a recording. Rate setpoints in a fall come too
    // seldom there to be compared with each rate.
    for (log, recording, count, only_in_log) in [
        ("bin/f12_gps_jump.bin.gz", "f12_gps_jump.tlog.gz", 2, &[][..]),
        ("bin/n03_wind9_gusty.bin.gz", "n03_wind9_gusty.tlog.gz", 0, &[]),
        (
            "px4/p23_motor_dead_quad.cut.ulg.gz",
            "px4/p23_motor_dead_quad.tlog.gz",
            7,
            &["impact", "pitch_rate"],
        ),
    ] {
        let (own, told) = (findings(dir.path(), log), findings(dir.path(), recording));
        let (alone, mut own): (Vec<_>, Vec<_>) =
            own.into_iter().partition(|(check, ..)| only_in_log.contains(&check.as_str()));
        assert_eq!(alone.len(), only_in_log.len(), "{log}: {alone:?}");
        assert_eq!(own.len(), told.len(), "{log}: {own:?}\n{told:?}");
        assert!(told.len() >= count, "{recording}: {told:?}");
        for (check, instance, level, at) in &told {
            let same = |one: &(String, u64, String, f64)| {
                (&one.0, &one.1, &one.2) == (check, instance, level) && (one.3 - at).abs() <= 1.0
            };
            let place = own.iter().position(same);
            own.remove(place.unwrap_or_else(|| panic!("{check} at {at} s is not in {log}: {own:?}")));
        }
    }
}

#[test]
fn a_damaged_log_of_an_autopilot_is_read_around_the_damage_which_is_told_with_its_place() {
    let dir = tempfile::tempdir().expect("a directory");
    for (name, log) in
        [("flight.bin", "bin/f12_gps_jump.bin.gz"), ("flight.ulg", "px4/p23_motor_dead_quad.cut.ulg.gz")]
    {
        let mut bytes = uncompressed(log);
        let middle = bytes.len() / 2;
        bytes[middle..middle + 1_000].fill(0xff);
        fs::write(dir.path().join(name), bytes).expect("written");
        let checked = json(&run(dir.path(), &format!("check --json {name}"), 4));
        assert_eq!(checked["damaged"], true, "{name}");
        let gaps = checked["gaps"].as_array().expect("gaps");
        let place = |gap: &serde_json::Value| gap["place"].as_u64().unwrap_or(0);
        let is_there = |gap: &&serde_json::Value| place(gap).abs_diff(middle as u64) < 1_000;
        let gap = gaps.iter().find(is_there).unwrap_or_else(|| panic!("{name}: {gaps:?}"));
        assert!(gap["bytes"].as_u64() >= Some(800), "{name}: {gap}");
        let (from, to) = (checked["from_s"].as_f64(), checked["to_s"].as_f64());
        assert!(to.zip(from).is_some_and(|(to, from)| to - from > 60.0), "{name}: {checked}");
        let said = text(&run(dir.path(), &format!("check {name}"), 4));
        let is_crash = said.contains(": crashed at 1:14.1 (impact 27.73 g); first roll does not follow");
        assert_eq!(is_crash, name == "flight.ulg", "{said}");
        assert!(said.contains(&place(gap).to_string()), "{name}: its place is for people too: {said}");
    }
    fs::copy(labelled("f12_gps_jump.tlog.gz"), dir.path().join("flight.tlog.gz")).expect("a copy");
    let decode = |format: &str, code| {
        text(&run(dir.path(), &format!("decode . -o out --format {format} --force"), code))
    };
    assert!(decode("tlog", 0).contains(".tlog: "));
    assert!(decode("tlog,csv", 3).contains("flight.bin-"));
    run(dir.path(), "decode flight.bin flight.ulg -o out --format tlog", 2);
    fs::copy(labelled("bin/f12_gps_jump.bin.gz"), dir.path().join("whole.bin.gz")).expect("a copy");
    fs::copy(labelled("f12_gps_jump.tlog.gz"), dir.path().join("other.tlog.gz")).expect("a copy");
    for _ in 0..2 {
        let said = stderr(&run(dir.path(), "decode whole.bin.gz other.tlog.gz -o again --format parquet", 0));
        assert!(!said.contains("of loss"), "a skipped log has what it had: {said}");
    }
}
