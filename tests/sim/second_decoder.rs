//! The format document is sufficient for a decoder: `tests/oracle/hums_log`, in Python, shares no line with `hums`,
//! and gives the same frames, times and records.
#![cfg(feature = "oracle")]

use std::fs;
use std::path::{Path, PathBuf};

use hums_tests::child;
use hums_tests::flights::{OWN, own, root};
use hums_tests::program::{Decoded, LIMIT, Machine, Recording, command};
use hums_tests::{fat, oracle};
use serde_json::{Value, json};

/// Some thousands of frames over several groups, seconds of Python.
const RECORDING_BYTES: usize = 250_000;

const TABLES: [&str; 10] = [
    "HUMS_BOOT",
    "HUMS_VEHICLE",
    "HUMS_PARAM",
    "HUMS_CLOCK",
    "HUMS_FINDING",
    "HUMS_LOSS",
    "HUMS_STATS",
    "HUMS_FAULT",
    "HUMS_EVENT",
    "HUMS_NOTE",
];

/// Returns the number of frames and records.
#[track_caller]
fn compare(log: &Path, code: i32) -> (usize, usize) {
    let ours = Decoded::of(log, &[code]);
    let [ours] = ours.tlogs() else { panic!("{} logs", ours.tlogs().len()) };
    let dir = tempfile::tempdir().unwrap();
    let tlog = dir.path().join("their.tlog");
    let theirs = rows(&oracle::second_decoder(log, &tlog));
    let tlog = fs::read(tlog).unwrap();
    assert!(*ours == tlog, "{} and {} bytes of tlog", ours.len(), tlog.len());
    let frames = theirs.iter().filter(|row| row["frame"].is_string()).count();
    let mut decode = command(["decode".as_ref(), log.as_os_str()]);
    let text = child::run(decode.args(["--format", "jsonl", "-o", "-"]), LIMIT).expect_code(&[code]).stdout;
    let (theirs, ours) = (records(&theirs), records(&rows(&text)));
    for (theirs, ours) in theirs.iter().zip(&ours) {
        assert_eq!(theirs, ours);
    }
    assert_eq!(theirs.len(), ours.len());
    (frames, ours.len())
}

fn rows(text: &[u8]) -> Vec<Value> {
    let text = std::str::from_utf8(text).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

/// Numbers in single precision, in which most are stored.
fn records(rows: &[Value]) -> Vec<Value> {
    let mut found = Vec::new();
    for row in rows {
        let table = row["record"].as_str().unwrap_or_default();
        let fields = row["fields"].as_object();
        let Some(mut fields) = fields.filter(|_| TABLES.contains(&table) || table == "HUMS_USAGE").cloned()
        else {
            continue;
        };
        // Another document has the counters' names.
        fields.remove("counter");
        // A board's record lacks this field.
        fields.remove("checked_by");
        for value in fields.values_mut() {
            if let Some(number) = value.as_f64().filter(|_| value.is_f64()) {
                *value = json!(number as f32);
            }
        }
        found.push(json!([row["time_boot"].as_f64(), table, fields]));
    }
    found
}

#[test]
fn the_golden_file_reads_the_same() {
    let golden = root().join("firmware/blackbox/tests/golden/mixed-3.log");
    assert_eq!(compare(&golden, 0), (6012, 38));
}

#[test]
fn recordings_of_each_kind_read_the_same() {
    for path in OWN.map(own) {
        let flight = path.file_name().unwrap().to_string_lossy();
        let dir = tempfile::tempdir().unwrap();
        let short = dir.path().join(&*flight);
        let data = fs::read(&path).unwrap();
        fs::write(&short, &data[..RECORDING_BYTES.min(data.len())]).unwrap();
        // The record has one parameter.
        let params = dir.path().join("params.txt");
        fs::write(&params, "BAT_REM_WARN 25\n").unwrap();
        let flags = ["--params", params.to_str().unwrap()];
        let recording = Recording::attempt(Machine::Sim, &short, &flags).expect_code(&[0, 3]);
        let files = dir.path().join("card");
        fs::create_dir(&files).unwrap();
        fat::copy_files(&recording.image(), &files);
        let logs: Vec<PathBuf> = fs::read_dir(&files).unwrap().map(|entry| entry.unwrap().path()).collect();
        let [log] = &logs[..] else { panic!("files on the card: {logs:?}") };
        let (frames, records) = compare(log, 0);
        assert_eq!(frames as u64, recording.number("frames_logged"), "{flight}");
        assert!(frames > 2_000 && records > 20, "{flight}: {frames} frames, {records} records");
        if path == own(OWN[0]) {
            let mut bytes = fs::read(log).unwrap();
            for sector in [12, 65] {
                bytes[512 * sector..][..8 * 512].fill(0xff);
            }
            fs::write(log, bytes).unwrap();
            assert_eq!(compare(log, 3), (frames, records));
        }
    }
}
