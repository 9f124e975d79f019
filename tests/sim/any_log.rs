//! All commands that read recordings agree with `hums check` on logs of both autopilots.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use hums_tests::flights::root;
use hums_tests::live::Live;
use hums_tests::program::{hums, hums_with};
use serde_json::Value;

/// Results of its makers' own tools.
struct Known {
    path: &'static str,
    format: &'static str,
    modes: &'static [&'static str],
    table: (&'static str, usize),
    fault: &'static str,
}

const DATAFLASH: Known = Known {
    path: "tests/labelled/bin/f12_gps_jump.bin.gz",
    format: "dataflash",
    modes: &["GUIDED"],
    table: ("ATT", 916),
    fault: "gnss_alert",
};

const ULOG: Known = Known {
    path: "tests/labelled/px4/p23_motor_dead_quad.cut.ulg.gz",
    format: "ulog",
    modes: &["Takeoff", "Hold"],
    table: ("vehicle_attitude", 1642),
    fault: "roll_rate",
};

impl Known {
    fn path(&self) -> PathBuf {
        root().join(self.path)
    }

    fn checked(&self) -> Value {
        let path = self.path();
        let text = hums_with("check --json {}", &[&path]).expect_code(&[4]).text();
        let checked: Value = serde_json::from_str(&text).unwrap();
        assert!(findings(&checked).iter().any(|finding| finding.contains(self.fault)), "{checked}");
        checked
    }
}

fn findings(object: &Value) -> Vec<String> {
    let findings = object["findings"].as_array().unwrap();
    assert!(!findings.is_empty(), "a comparison of nothing");
    findings
        .iter()
        .map(|finding| line(&finding["time_s"], &finding["check"], &finding["instance"], &finding["level"]))
        .collect()
}

fn line(time_s: &Value, check: &Value, instance: &Value, level: &Value) -> String {
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    format!("{:.3} {} {instance} {}", time_s.as_f64().unwrap(), text(check), text(level))
}

fn agrees(log: &Value, known: &Known, checked: &Value) {
    assert_eq!((log["format"].as_str(), log["checked_by"].as_str()), (Some(known.format), Some("hums")));
    assert_eq!(findings(log), findings(checked));
    assert_eq!(log["findings_count"], checked["findings_count"]);
    for of in ["system", "autopilot", "type"] {
        assert_eq!(log["vehicle"][of], checked["vehicle"][of], "{of}");
    }
    assert_eq!(log["vehicle"]["firmware"], checked["vehicle"]["version"]);
    assert_eq!(log["start_utc"], checked["start_utc"]);
    assert_eq!((&log["start_s"], &log["end_s"]), (&checked["from_s"], &checked["to_s"]));
    assert_eq!(log["gaps_count"], 0);
    let (table, rows) = known.table;
    let messages = log["messages"].as_array().unwrap();
    let message = messages.iter().find(|message| message["name"] == table).unwrap();
    assert_eq!((&message["frames"], &message["id"]), (&rows.into(), &Value::Null));
}

fn info(known: &Known, checked: &Value) {
    let path = known.path();
    let text = hums_with("info --json {}", &[&path]).expect_code(&[0]).text();
    let json: Value = serde_json::from_str(&text).unwrap();
    agrees(&json["logs"][0], known, checked);
}

fn data(page: &str) -> Value {
    let (_, data) = page.split_once("<script type=\"application/json\" id=\"data\">").unwrap();
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

fn report(known: &Known, checked: &Value) {
    let (path, dir) = (known.path(), tempfile::tempdir().unwrap());
    let page = dir.path().join("page.html");
    hums_with("report {} -o {}", &[&path, &page]).expect_code(&[0]);
    let data = data(&fs::read_to_string(page).unwrap());
    agrees(&data["log"], known, checked);
    let flights = checked["flights"].as_array().unwrap();
    assert_eq!(data["flights"].as_array().unwrap().len(), flights.len());
    for (shown, flight) in data["flights"].as_array().unwrap().iter().zip(flights) {
        for of in ["from_s", "to_s", "air_s", "landed"] {
            assert_eq!(shown[of], flight[of], "{of}");
        }
        assert!(shown["height_max_m"].as_f64() > Some(20.0), "{shown}");
    }
    let flight = &data["flight"];
    let modes = flight["modes"][1].as_array().unwrap();
    let modes: Vec<&str> = modes.iter().map(|mode| mode[1].as_str().unwrap()).collect();
    assert_eq!(modes, known.modes);
    let notes = flight["notes"].as_array().unwrap();
    let found = notes.iter().filter(|note| note["kind"] == "finding");
    let found: Vec<String> =
        found.map(|note| line(&note["at_s"], &note["found"]["check"], &0.into(), &note["level"])).collect();
    assert_eq!(found, findings(checked));
    assert!(notes.iter().any(|note| note["kind"] == "text") && data["texts_count"].as_u64() > Some(5));
    assert!(flight["track"].as_array().unwrap().len() > 50, "where it flew");
    assert!(flight["parameters"].as_array().unwrap().len() > 500, "its parameters");
}

fn rows(table: &Path) -> Vec<String> {
    fs::read_to_string(table).unwrap().lines().skip(1).map(str::to_owned).collect()
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

fn decode(known: &Known, checked: &Value) {
    let (path, dir) = (known.path(), tempfile::tempdir().unwrap());
    let out = dir.path().join("out");
    let formats = ["csv", "jsonl", "influx", "parquet"].iter().flat_map(|format| ["--format", format]);
    let mut words = vec!["decode".as_ref(), path.as_os_str(), "-o".as_ref(), out.as_os_str()];
    words.extend(formats.map(AsRef::<std::ffi::OsStr>::as_ref));
    hums(words).expect_code(&[0]);

    let mut of: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for path in files(&out) {
        let kind = path.extension().map_or_else(String::new, |kind| kind.to_string_lossy().into_owned());
        of.entry(kind).or_default().push(path);
    }
    let names = |kind: &str| -> BTreeSet<String> {
        of[kind].iter().map(|path| path.file_stem().unwrap().to_string_lossy().into_owned()).collect()
    };
    let folders = of["parquet"].iter().map(|path| path.ancestors().nth(3).unwrap().file_name().unwrap());
    let mut folders: BTreeSet<String> = folders.map(|name| name.to_string_lossy().into_owned()).collect();
    assert!(folders.remove("sessions"));
    assert_eq!(names("csv"), folders, "both have the same tables");
    let table = |name: &str| {
        let mut paths = of["csv"].iter();
        rows(paths.find(|path| path.file_stem().is_some_and(|stem| stem == name)).unwrap())
    };
    assert_eq!(table(known.table.0).len(), known.table.1);
    let verdict = table("HUMS_CHECKED");
    let verdict: Vec<&str> = verdict[0].split(',').skip(2).take(3).collect();
    assert_eq!(
        verdict,
        ["hums", checked["verdict"].as_str().unwrap(), &checked["findings_count"].to_string()]
    );
    let found = table("HUMS_FINDING");
    let found = found.iter().map(|row| row.split(',').collect::<Vec<_>>());
    let found: Vec<String> = found
        .map(|cells| {
            line(
                &cells[2].parse::<f64>().unwrap().into(),
                &cells[4].into(),
                &cells[5].parse::<u64>().unwrap().into(),
                &cells[6].into(),
            )
        })
        .collect();
    assert_eq!(found, findings(checked));

    let all: usize = names("csv").iter().map(|name| table(name).len()).sum();
    let objects = fs::read_to_string(&of["jsonl"][0]).unwrap();
    assert_eq!(objects.lines().count(), all, "an object for each row");
    assert!(objects.lines().all(|object| serde_json::from_str::<Value>(object).is_ok()));
    let points = fs::read_to_string(&of["lp"][0]).unwrap();
    let count = points.lines().filter(|point| point.starts_with("HUMS_FINDING,")).count();
    assert_eq!(count, found.len());
}

fn live(known: &Known, checked: &Value) {
    let path = known.path();
    let live = Live::start(&[path.to_str().unwrap()]);
    let mut page = live.page().unwrap();
    let next = |page: &mut hums_tests::live::Page, kind: &str| loop {
        let message: Value = serde_json::from_str(&page.message()).unwrap();
        if message["t"] == kind {
            return message;
        }
    };
    let marks = next(&mut page, "timeline");
    let marks = marks["marks"]["1"].as_array().unwrap();
    let bad = ["warning", "critical"];
    let found: Vec<&Value> = checked["findings"].as_array().unwrap().iter().collect();
    let found = found.iter().filter(|finding| bad.contains(&finding["level"].as_str().unwrap()));
    let mut count = 0;
    for finding in found {
        let time_s = finding["time_s"].as_f64().unwrap();
        let near =
            |mark: &&Value| mark[1] == finding["level"] && (mark[0].as_f64().unwrap() - time_s).abs() < 0.2;
        assert!(marks.iter().any(|mark| near(&mark)), "{finding} is not in {marks:?}");
        count += 1;
    }
    assert!(count >= 3, "a comparison of nothing");
    let state = next(&mut page, "state");
    assert_eq!(
        (&state["armed"], state["firmware"].as_str()),
        (&true.into(), checked["vehicle"]["version"].as_str())
    );
    let (code, said) = live.interrupt(Duration::from_secs(20));
    assert_eq!(code, Some(0), "{said}");
}

#[test]
fn info_page_tables_and_time_line_of_an_autopilots_log_have_what_check_tells() {
    for known in [DATAFLASH, ULOG] {
        let checked = known.checked();
        for reader in [info, report, decode, live] {
            reader(&known, &checked);
        }
    }
}
