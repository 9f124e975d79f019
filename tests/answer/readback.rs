//! Every field and the times of every message in every format, against pymavlink and the tlog's own times.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use hums_tests::flights::{Manifest, OWN, further, own};
use hums_tests::program::hums_with;
use hums_tests::{child, oracle};

#[track_caller]
fn compare(recording: &Path) {
    let dir = tempfile::tempdir().unwrap();
    let (log, out) = (dir.path().join("log.hum"), dir.path().join("out"));
    let packed = hums_with("decode --format hum {} -o {}", &[&recording, &log]).expect_code(&[0, 3]);
    let mut command =
        hums_tests::program::command(["decode".as_ref(), log.as_os_str(), "-o".as_ref(), out.as_os_str()]);
    child::run(command.args(["--format", "csv,jsonl,influx,parquet"]), hums_tests::program::LIMIT)
        .expect_code(if packed.code == Some(0) { &[0] } else { &[0, 3] });
    let found = oracle::readback(recording, &out);
    let name = recording.file_name().unwrap_or_default().display();
    eprintln!("{name}: {found}");
    assert_eq!(found["differences"], serde_json::json!([]), "{name}");
    let values = &found["values"];
    assert!(values["csv"].as_u64().unwrap() > 4 * found["messages"].as_u64().unwrap(), "{name}: {found}");
    for format in ["jsonl", "parquet", "influx"] {
        assert_eq!(values[format], values["csv"], "{name}: {format} has other values than csv");
    }
    for format in ["csv", "jsonl", "parquet", "influx"] {
        assert_eq!(
            found["times"][format], found["messages"],
            "{name}: not each time in {format} was compared"
        );
    }
    // Besides its frames, the line protocol has the reference system's quantities.
    assert!(found["points"].as_u64() > found["messages"].as_u64(), "{name}: {found}");
}

/// Frames of each id from all of the flight: pymavlink needs seconds for some ten thousand.
fn thinned(name: &str, dir: &Path) -> PathBuf {
    const OF_AN_ID: usize = 250;
    let (path, data, manifest) = (own(name), fs::read(own(name)).unwrap(), Manifest::own());
    let frames = manifest.frames_of(&path, &data);
    let (mut all, mut seen) = (BTreeMap::<u32, usize>::new(), BTreeMap::<u32, usize>::new());
    for frame in &frames {
        *all.entry(frame.id).or_default() += 1;
    }
    let mut thin = Vec::new();
    for frame in frames {
        let number = seen.entry(frame.id).or_default();
        if number.is_multiple_of(all[&frame.id].div_ceil(OF_AN_ID)) {
            thin.extend(frame.time_us.into_iter().flat_map(u64::to_be_bytes));
            thin.extend(frame.bytes);
        }
        *number += 1;
    }
    let thinned = dir.join(name);
    fs::write(&thinned, thin).unwrap();
    thinned
}

#[test]
fn every_field_of_every_message_of_our_recordings_reads_back_the_same() {
    let dir = tempfile::tempdir().unwrap();
    for name in OWN {
        compare(&thinned(name, dir.path()));
    }
}

#[test]
#[ignore = "further recordings (HUMS_FLIGHTS names no folder of them)"]
fn every_field_of_every_message_of_further_recordings_reads_back_the_same() {
    for path in further() {
        compare(&path);
    }
}
