//! A flight is written during the flight; the database goes away in the middle and comes back.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::net::TcpListener;
use std::process::Command;
use std::time::{Duration, Instant};

use hums_tests::flights::{Manifest, own, root};
use hums_tests::frames::of_tlog;
use hums_tests::live::{Live, send};
use hums_tests::{child, program};

use super::answers;
use super::database::{Database, Kind};

const RATE: f64 = 2_000.0;
/// Twelve seconds.
const FRAMES: usize = 24_000;
const GOES_AT: u64 = 8_000;
const BACK_AT: u64 = 16_000;

fn flight() -> (Vec<Vec<u8>>, BTreeMap<u32, u64>) {
    let data = fs::read(own("ap_quad_faults.tlog")).unwrap();
    let frames = of_tlog(&data, &Manifest::own().seeds, false);
    let frames: Vec<_> = frames.into_iter().skip(40_000).take(FRAMES).collect();
    let mut counts = BTreeMap::new();
    for frame in frames.iter().filter(|frame| frame.verified) {
        *counts.entry(frame.id).or_insert(0) += 1;
    }
    (frames.into_iter().map(|frame| frame.bytes.to_vec()).collect(), counts)
}

#[track_caller]
fn fly(database: &mut Database, flags: &[&str]) -> (u64, BTreeMap<u32, u64>) {
    let (frames, counts) = flight();
    let vehicle = TcpListener::bind("127.0.0.1:0").unwrap();
    let (input, url) =
        (format!("tcp:{}", vehicle.local_addr().unwrap()), format!("http://127.0.0.1:{}", database.port));
    let live = Live::start(&[&[&input, "--influx", &url][..], flags].concat());
    let (mut stream, _) = vehicle.accept().unwrap();
    let put = |frame: &[u8]| stream.write_all(frame).unwrap();
    send(frames.iter().map(Vec::as_slice), RATE, put, |gone| match gone {
        GOES_AT => database.end(),
        BACK_AT => database.again(),
        _ => {}
    });
    std::thread::sleep(Duration::from_secs(1));
    let (code, words) = live.interrupt(Duration::from_mins(1));
    assert_eq!(code, Some(0), "{words}");
    let written = words.split_whitespace().next().and_then(|word| word.parse().ok());
    (written.unwrap_or_else(|| panic!("no count: {words}")), counts)
}

#[test]
fn influxdb_is_killed_in_flight_and_has_every_point_in_the_end() {
    let mut database = Database::start(Kind::Influx);
    let (written, counts) = fly(&mut database, &[]);
    let mut in_all = 0;
    for measurement in database.measurements() {
        in_all += database.points(&measurement);
    }
    assert_eq!(in_all, written, "points that hums says it wrote");
    let names = hums_names();
    for (id, count) in counts {
        assert_eq!(database.points(&names[&id]), count, "{}", names[&id]);
    }
    let tags: Vec<_> = database.ask("SHOW TAG KEYS FROM \"HUMS\"");
    let keys = tags[0]["values"].as_array().unwrap().iter().map(|key| key[0].as_str().unwrap().to_owned());
    assert_eq!(keys.collect::<Vec<_>>(), ["motor", "session", "vehicle"]);
    let volts = database.ask("SELECT last(\"Battery (V)\") FROM \"HUMS\"");
    assert!(volts[0]["values"][0][1].as_f64().is_some_and(|volts| (9.0..13.0).contains(&volts)), "{volts:?}");
    answers::assert_answered_by_influx(&database);
    write_as_documented(&database);
}

fn write_as_documented(database: &Database) {
    let docs = fs::read_to_string(root().join("docs/decode.md")).unwrap();
    let is_command = |line: &&str| {
        line.starts_with("curl --data-urlencode 'q=CREATE DATABASE")
            || line.starts_with("hums decode card.img -o - --format influx |")
    };
    let commands: Vec<&str> = docs.lines().filter(is_command).collect();
    assert_eq!(commands.len(), 2, "{commands:?}");
    let log = own("px4_hil_quad_low.tlog");
    let mut script = commands.join("\n");
    for (documented, here) in [
        ("hums decode", format!("'{}' decode", program::path().display())),
        ("card.img", format!("'{}'", log.display())),
        ("localhost:8086", format!("127.0.0.1:{}", database.port)),
        ("-C 20M", "-C 1M".to_owned()),
    ] {
        assert!(script.contains(documented), "{documented}: {script}");
        script = script.replace(documented, &here);
    }
    let decode = ["decode", &log.display().to_string(), "-o", "-", "--format", "influx"];
    let lines = program::hums(decode).expect_code(&[0]).text();
    assert!(lines.len() > 2 << 20, "several pieces");
    let measurements = ["ATTITUDE", "BATTERY_STATUS", "HUMS"];
    let points = |name: &&str| database.points(name);
    let before: Vec<u64> = measurements.iter().map(points).collect();
    child::run(Command::new("sh").args(["-ec", &script]), Duration::from_mins(1)).expect_code(&[0]);
    for (name, before) in measurements.iter().zip(before) {
        let lines = lines.lines().filter(|line| line.starts_with(&format!("{name},"))).count() as u64;
        assert!(lines > 0, "{name}");
        assert_eq!(points(name) - before, lines, "{name}");
    }
}

#[test]
fn victoriametrics_is_restarted_in_flight_and_has_every_sample_in_the_end() {
    let mut database = Database::start(Kind::Victoria);
    let (written, counts) = fly(&mut database, &["--org", "anything", "--bucket", "hums"]);
    assert!(written > FRAMES as u64);
    for (id, field) in [
        (30, "ATTITUDE_roll"),
        (74, "VFR_HUD_throttle"),
        (24, "GPS_RAW_INT_lat"),
        (241, "VIBRATION_vibration_x"),
    ] {
        let samples = database.samples(field);
        assert!(
            (counts[&id]..counts[&id] + 200).contains(&samples),
            "{field}: {samples}, sent {}",
            counts[&id]
        );
    }
    answers::assert_answered_by_victoria(&database);
}

#[test]
fn a_bad_point_costs_itself_and_what_the_database_wrote_is_not_counted_as_refused() {
    let database = Database::start(Kind::Influx);
    let data = fs::read(own("px4_hil_quad_low.tlog")).unwrap();
    let frames = of_tlog(&data, &Manifest::own().seeds, false);
    let count_of = |id| frames.iter().filter(|frame| frame.verified && frame.id == id).count() as u64;
    let flight = |database: &Database| {
        let url = format!("http://127.0.0.1:{}", database.port);
        let recording = own("px4_hil_quad_low.tlog");
        let live = Live::start(&[recording.to_str().unwrap(), "--influx", &url]);
        let given_up = Instant::now() + Duration::from_mins(1);
        while database.points("VFR_HUD") < count_of(74) && Instant::now() < given_up {
            std::thread::sleep(Duration::from_millis(200));
        }
        // The last points are on their way.
        std::thread::sleep(Duration::from_secs(1));
        live.terminate(Duration::from_mins(1))
    };
    let at_us = frames[0].time_us.expect("a tlog's frames have times");
    database.write(&format!("ATTITUDE,vehicle=x,session=x roll=\"text\" {at_us}000"));
    let (code, words) = flight(&database);
    assert_eq!(code, Some(3), "{words}");
    let count = |what: &str| -> u64 {
        let line =
            words.lines().find(|line| line.contains(what)).unwrap_or_else(|| panic!("no {what}: {words}"));
        line.split_whitespace().next().unwrap().parse().unwrap()
    };
    let (written, refused) = (count("points written"), count("refused by the database"));
    assert_eq!(refused, count_of(30), "{words}");
    let points: u64 = database.measurements().iter().map(|measurement| database.points(measurement)).sum();
    assert_eq!(points, written + 1, "and the one that was there before");
}

fn hums_names() -> BTreeMap<u32, String> {
    let definitions = hums_dialect::messages().iter();
    definitions.map(|message| (message.id, message.name.to_owned())).collect()
}
