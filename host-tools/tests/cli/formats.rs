//! The formats for databases and for the reference system, read back.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use tempfile::TempDir;

use super::support::{end_of, flight, named, run, stderr, text};

/// The text on both output streams.
#[track_caller]
fn hums(dir: &Path, line: &str, code: i32) -> String {
    let output = run(dir, line, code);
    text(&output) + &stderr(&output)
}

fn read(path: &Path) -> SerializedFileReader<File> {
    SerializedFileReader::new(File::open(path).expect("a file")).expect("Parquet")
}

fn packed(names: &[&str]) -> TempDir {
    packed_from(names, |name, _| flight(name))
}

fn packed_from(names: &[&str], from: fn(&str, &Path) -> PathBuf) -> TempDir {
    let (dir, made) = [(); 2].map(|()| tempfile::tempdir().expect("a directory")).into();
    for name in names {
        let (from, stem) = (from(name, made.path()), name.split('.').next().unwrap_or(name));
        hums(dir.path(), &format!("decode --format hum {} -o {stem}.hum", from.display()), 0);
    }
    dir
}

fn files(dir: &Path, ending: &str) -> BTreeMap<String, PathBuf> {
    let mut found = BTreeMap::new();
    let mut waiting = vec![dir.to_owned()];
    while let Some(dir) = waiting.pop() {
        for entry in fs::read_dir(dir).expect("a directory") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                waiting.push(path);
            } else if let Some(name) = path.file_name().and_then(|name| name.to_str()?.strip_suffix(ending)) {
                // Parquet files are in the folder of their table.
                let table = path.ancestors().nth(3).and_then(|table| table.file_name()?.to_str());
                let name = table.filter(|_| ending == ".parquet").unwrap_or(name);
                found.insert(name.to_owned(), path);
            }
        }
    }
    found
}

fn shape(line: &str) -> String {
    let mut out = String::new();
    let mut rest = line;
    while let Some(c) = rest.chars().next() {
        let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
        let sign = usize::from(c == '-');
        let whole = digits(&rest[sign..]);
        if whole == 0 {
            out.push(c);
            rest = &rest[c.len_utf8()..];
            continue;
        }
        rest = &rest[sign + whole..];
        out.push('N');
        let decimals = rest.strip_prefix('.').map_or(0, digits);
        if decimals > 0 {
            out.push('.');
            out += &decimals.to_string();
            rest = &rest[1 + decimals..];
        }
    }
    out
}

/// From the thesis, with the seven decimals of our positions.
const EXAMPLE: &str = "15s; 93 %; 15.78 V; 11.77 C; 954.92 hPa; 3.62, 0.08, -0.08 m/s; 3.62 m/s; 3.19 m/s; \
     -1.13, 0.07, -9.64 m/s2; 9.71 m/s2; 488.13 m; 47.4000000 deg; 8.5500000 deg";

#[test]
fn a_second_of_flight_has_the_format_of_the_reference_systems_example() {
    for name in ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"] {
        let dir = packed(&[name]);
        let stem = name.split('.').next().expect("a stem");
        hums(dir.path(), &format!("decode {stem}.hum -o out --format thesis"), 0);
        let tables = files(&dir.path().join("out"), ".csv");
        let rows = |name: &str| -> Vec<String> {
            fs::read_to_string(&tables[name]).expect(name).lines().map(str::to_owned).collect()
        };
        let values = rows("flightvalues");
        let flying = values.iter().filter(|row| shape(row) == shape(EXAMPLE)).count();
        assert!(flying > 200, "{name}: {flying} of {} rows", values.len());
        assert!(values.iter().all(|row| row.split("; ").count() == 13), "{name}");
        let seconds: Vec<u64> = values[1..]
            .iter()
            .map(|row| row.split_once('s').expect("a time").0.parse().expect("seconds"))
            .collect();
        assert!(seconds.windows(2).all(|pair| pair[1] == pair[0] + 1), "{name}: {seconds:?}");
        for (table, columns) in [("esc_status", 12), ("esc_info", 12), ("vfr_hud", 6)] {
            let table = rows(table);
            assert_eq!(table.len(), values.len(), "{name}");
            assert!(table.iter().all(|row| row.split("; ").count() == columns), "{name}");
        }
        assert_eq!(
            shape(&rows("esc_status")[100]),
            "N; N; N; N; N.2; N.2; N.2; N.2; N.2; N.2; N.2; N.2",
            "{name}"
        );
    }
}

fn point(line: &str) -> (String, BTreeMap<String, String>, BTreeMap<String, String>, u64) {
    let (mut parts, mut part, mut quoted, mut escaped) = (Vec::new(), String::new(), false, false);
    for c in line.chars() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => quoted = !quoted,
            ' ' if !quoted => {
                parts.push(std::mem::take(&mut part));
                continue;
            }
            _ => {}
        }
        part.push(c);
    }
    parts.push(part);
    let [head, fields, time] = parts.try_into().expect("measurement and tags, fields, time");
    let (mut pieces, mut piece, mut quoted, mut escaped) = (Vec::new(), String::new(), false, false);
    for c in (fields + ",").chars() {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => quoted = !quoted,
            ',' if !quoted => {
                pieces.push(std::mem::take(&mut piece));
                continue;
            }
            _ => {}
        }
        piece.push(c);
    }
    let pair = |text: &str| {
        let (key, value) = text.split_once('=').expect("key=value");
        (key.replace('\\', ""), value.to_owned())
    };
    let mut head = head.split(',');
    let name = head.next().expect("a measurement").to_owned();
    (
        name,
        head.map(pair).collect(),
        pieces.iter().map(|piece| pair(piece)).collect(),
        time.parse().expect("ns"),
    )
}

#[test]
fn the_reference_systems_field_names_are_kept_for_both_autopilots() {
    const BOTH: &str = "Flight Time|Battery (%)|Battery (V)|Temp|Air Pressure|Front Accel|Right Accel|Down Accel|\
        Accel Module|North Velocity|East Velocity|Down Velocity|Velocity Module|Velocity|Altitude|\
        Latitude|Longitude|Throttle (%)|Climb Rate (m/s)|groundspeed|heading|esc_rpm0|esc_voltage3";
    for (name, own) in [
        ("px4_hil_quad_low.tlog", &["esc_fail0", "esc3_fails", "esc_temperature2", "esc_current1"][..]),
        ("ap_quad_guided.tlog", &["Air Speed (m/s)", "esc_current3"]),
    ] {
        let dir = packed_from(&[name], end_of);
        let stem = name.split('.').next().expect("a stem");
        hums(dir.path(), &format!("decode {stem}.hum -o out.lp --format influx"), 0);
        let text = fs::read_to_string(dir.path().join("out.lp")).expect("points");
        let (mut seen, mut times) = (BTreeSet::new(), BTreeSet::new());
        for line in text.lines() {
            let (measurement, tags, fields, time) = point(line);
            assert!(tags["session"].starts_with('s') && tags["vehicle"].starts_with("system-1-"), "{line}");
            if measurement == "HUMS" {
                seen.extend(fields.into_keys());
            }
            assert!(times.insert((measurement, tags, time)), "a point would replace another: {line}");
        }
        for field in BOTH.split('|').chain(own.iter().copied()) {
            assert!(seen.contains(field), "{name}: {field} is not in {seen:?}");
        }
    }
}

#[test]
fn a_motors_points_say_which_motor() {
    let dir = packed(&["px4_hil_quad_low.tlog"]);
    let text = hums(dir.path(), "decode px4_hil_quad_low.hum -o - --format influx", 0);
    let lines: Vec<_> = text.lines().filter(|line| line.starts_with("HUMS,")).map(point).collect();
    for motor in 0..4 {
        let field = format!("esc_rpm{motor}");
        let of_motor: Vec<_> = lines.iter().filter(|(_, _, fields, _)| fields.contains_key(&field)).collect();
        assert!(of_motor.len() > 1000, "{field}");
        assert!(of_motor.iter().all(|(_, tags, _, _)| tags["motor"] == motor.to_string()), "{field}");
    }
}

#[test]
fn parquet_keeps_types_units_and_every_value() {
    let dir = packed(&["px4_hil_quad_low.tlog"]);
    hums(dir.path(), "decode px4_hil_quad_low.hum -o out --format parquet,csv", 0);
    let tables = files(&dir.path().join("out"), ".parquet");
    let path = tables["ATTITUDE"].to_string_lossy().into_owned();
    assert!(path.contains("/ATTITUDE/date=2026-11-20/bucket="), "{path}");
    let csv = {
        let out = dir.path().join("out");
        let name = named(&out, "px4_hil_quad_low");
        fs::read_to_string(out.join(name).join("ATTITUDE.csv")).expect("the same as CSV")
    };
    let rows: Vec<Vec<&str>> = csv.lines().skip(1).map(|line| line.split(',').collect()).collect();
    let reader = read(Path::new(&path));
    let metadata = reader.metadata().file_metadata().key_value_metadata().expect("what is known of it");
    let roll = metadata.iter().find(|known| known.key == "units.roll").expect("its unit");
    assert_eq!(roll.value.as_deref(), Some("rad"));
    let mut at = 0;
    for row in reader.get_row_iter(None).expect("rows") {
        let row = row.expect("a row");
        let of =
            |name: &str| row.get_column_iter().find(|(known, _)| *known == name).expect("a column").1.clone();
        let (Field::UInt(time), Field::Float(roll)) = (of("time_boot_ms"), of("roll")) else {
            panic!("their types are as they were sent: {row}")
        };
        assert_eq!((rows[at][4].parse(), rows[at][5].parse()), (Ok(time), Ok(roll)));
        at += 1;
    }
    assert_eq!(at, rows.len());
    for (name, csv) in files(&dir.path().join("out"), ".csv") {
        let parquet = read(&tables[&name]).metadata().file_metadata().num_rows();
        let lines = fs::read_to_string(csv).expect("text").lines().count() as i64 - 1;
        assert!(parquet == lines || name == "STATUSTEXT", "{name}: {parquet} and {lines}");
    }
}

#[test]
fn subtitles_begin_with_the_video_and_a_format_says_what_it_leaves_out() {
    let dir = tempfile::tempdir().expect("a directory");
    let decode = |more: &str| {
        let log = flight("ap_quad_guided.tlog");
        let told =
            hums(dir.path(), &format!("decode {} -o flight --force --format {more}", log.display()), 0);
        assert!(
            told.contains(&format!("{} cannot hold ", more.split(' ').next().expect("a name"))),
            "{more}: {told}"
        );
        String::from_utf8_lossy(&fs::read(dir.path().join("flight")).expect("written")).into_owned()
    };
    for format in ["ulog", "kml", "gpx"] {
        decode(format);
    }
    let words = |subtitles: &str, number| {
        subtitles.split("\n\n").nth(number).and_then(|cue| Some(cue.splitn(3, '\n').nth(2)?.to_owned()))
    };
    let (same, later, earlier) = (decode("srt"), decode("srt --offset 10"), decode("srt --offset -10"));
    assert!(same.starts_with("1\n00:00:00,000 --> ") && later.starts_with("1\n00:00:00,000 --> "));
    assert!(earlier.starts_with("1\n00:00:10,000 --> "), "{}", &earlier[..40]);
    assert!(words(&same, 0) == words(&earlier, 0) && words(&same, 10) == words(&later, 0));
    assert!(words(&later, 0).is_some_and(|later| later.contains("battery")));
}

#[test]
fn several_logs_side_by_side_are_what_each_is_alone() {
    let dir = packed_from(&["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"], end_of);
    fs::copy(dir.path().join("px4_hil_quad_low.hum"), dir.path().join("zz_again.hum")).expect("copied");
    let said = hums(dir.path(), "decode . -o all --format csv,influx,parquet", 0);
    assert!(said.contains("zz_again: is a copy of px4_hil_quad_low (not counted)"), "{said}");
    let all_in = dir.path().join("all");
    for stem in ["px4_hil_quad_low", "ap_quad_guided"] {
        hums(dir.path(), &format!("decode {stem}.hum -o alone/{stem} --format csv,influx"), 0);
        let alone_in = dir.path().join("alone").join(stem);
        let name = named(&all_in, stem);
        assert_eq!(name, named(&alone_in, stem));
        let (all, alone) = (files(&all_in.join(&name), ".csv"), files(&alone_in.join(&name), ".csv"));
        assert!(alone.len() > 30, "{stem}");
        assert_eq!(all.keys().collect::<Vec<_>>(), alone.keys().collect::<Vec<_>>(), "{stem}");
        for (name, path) in alone {
            assert!(fs::read(path).expect("text") == fs::read(&all[&name]).expect("text"), "{stem}/{name}");
        }
        // Frames and their quantities alternate by parts of a group, which are smaller with more formats. The points
        // are the same, but their order may differ.
        let lines = |dir: &Path| {
            let text = fs::read_to_string(dir.join(format!("{name}.lp"))).expect("points");
            let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
            lines.sort_unstable();
            lines
        };
        assert!(lines(&all_in) == lines(&alone_in), "{stem}");
    }
    let sessions: BTreeSet<_> =
        files(&all_in, ".parquet").values().map(|path| path.parent().map(Path::to_owned)).collect();
    assert!(!sessions.is_empty());
}

fn frame_of(id: u32, sequence: u8) -> Vec<u8> {
    let [low, middle, high, _] = id.to_le_bytes();
    let mut frame = vec![0xfd, 4, 0, 0, sequence, 1, 1, low, middle, high, 1, 2, 3, sequence];
    let extra = if id == 0 { 50 } else { 77 };
    let crc = frame[1..].iter().chain(&[extra]).fold(0xffff_u16, |crc, byte| {
        let x = byte ^ (crc as u8);
        let x = u16::from(x ^ (x << 4));
        (crc >> 8) ^ (x << 8) ^ (x << 3) ^ (x >> 4)
    });
    frame.extend(crc.to_le_bytes());
    frame
}

#[test]
fn more_ids_than_files_can_be_open_lose_nothing() {
    const IDS: u32 = 600;
    const FIRST: u32 = 0x00ab_0000;
    let mut tlog = Vec::new();
    let mut time_us = 1_700_000_000_000_000_u64;
    for round in 0..3 {
        // A heartbeat: by private messages alone nothing is a recording.
        for id in std::iter::once(0).chain(FIRST..FIRST + IDS) {
            time_us += 1000;
            tlog.extend(time_us.to_be_bytes());
            tlog.extend(frame_of(id, (round * IDS + id) as u8));
        }
    }
    let dir = tempfile::tempdir().expect("a directory");
    fs::write(dir.path().join("private.tlog"), tlog).expect("written");
    hums(dir.path(), "decode --format hum private.tlog -o private.hum", 0);
    hums(dir.path(), "decode private.hum -o out --format csv,parquet", 0);
    let tables = files(&dir.path().join("out"), ".csv");
    let shared = fs::read_to_string(&tables["UNKNOWN"]).expect("their table");
    let ids = shared.lines().map(|line| line.split(',').nth(4).expect("a cell").to_owned());
    let expected = (0..3 * IDS).map(|frame| (FIRST + frame % IDS).to_string());
    assert!(ids.eq(std::iter::once("id".to_owned()).chain(expected)), "{shared}");
    let parquet = files(&dir.path().join("out"), ".parquet");
    let rows = read(&parquet["UNKNOWN"]).metadata().file_metadata().num_rows();
    assert_eq!(rows, i64::from(3 * IDS));
}
