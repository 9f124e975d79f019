//! The dashboards of `host-tools/grafana` are valid by Grafana's schema, and query existing fields. `writes` asks
//! real databases.
#![cfg(feature = "oracle")]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use hums_tests::flights::{own, root};
use hums_tests::oracle;
use hums_tests::program::hums;
use serde_json::{Value, json};

#[path = "../../host-tools/grafana/resolve.rs"]
mod resolve;

/// The type of the data source, the member with the query, and the members of each query.
pub(crate) type Kind = (&'static str, &'static str, &'static str, &'static [&'static str]);
const FLUX: Kind =
    ("flux", "influxdb", "query", &["v.defaultBucket", "v.timeRangeStart", "${vehicle}", "${session}"]);
pub(crate) const INFLUXQL: Kind =
    ("influxql", "influxdb", "query", &["$timeFilter", "'$vehicle'", "'$session'"]);
pub(crate) const VICTORIA: Kind =
    ("victoriametrics", "prometheus", "expr", &["[$__ra", "vehicle=\"$vehicle\"", "session=\"$session\""]);
const KINDS: [Kind; 3] = [FLUX, INFLUXQL, VICTORIA];

/// A slip in a unit shows as plain text on the panel.
const UNITS: [&str; 14] = [
    "none",
    "s",
    "percent",
    "volt",
    "amp",
    "pressurehpa",
    "celsius",
    "rotrpm",
    "velocityms",
    "degree",
    "lengthm",
    "accMS2",
    "watth",
    "short",
];
const TYPES: [&str; 6] = ["row", "stat", "gauge", "bargauge", "timeseries", "table"];
const PANELS: [&str; 22] = [
    "Flight Time",
    "Battery (%)",
    "Battery (V)",
    "Air Pressure",
    "Temperature",
    "ESC RPM",
    "ESC Currents",
    "ESC Voltages",
    "ESC Fails",
    "ESC currently failing",
    "Air Speed",
    "Ground Speed",
    "Heading",
    "Throttle",
    "Velocity Module",
    "Climb Rate",
    "Altitude",
    "NED Velocity",
    "Latitude",
    "Longitude",
    "FRD Acceleration",
    "Accel Module",
];

const NAMES: [&str; 2] = ["flight.json", "health.json"];

fn read(name: &str) -> String {
    fs::read_to_string(root().join("host-tools/grafana").join(name)).unwrap()
}

pub(crate) fn dashboards(kind: Kind) -> Vec<(String, Value)> {
    let database = resolve::DATABASES.into_iter().find(|(database, _)| *database == kind.0).unwrap();
    let made = |name| resolve::resolve(&serde_json::from_str(&read(name)).unwrap(), database).unwrap();
    NAMES.map(|name| (format!("{}/{name}", kind.0), made(name))).to_vec()
}

pub(crate) fn panels(dashboard: &Value) -> &Vec<Value> {
    dashboard["panels"].as_array().unwrap()
}

fn queries(kind: Kind, panel: &Value) -> impl Iterator<Item = &str> {
    panel["targets"].as_array().into_iter().flatten().map(move |target| target[kind.2].as_str().unwrap())
}

#[test]
fn grafanas_own_model_takes_every_member_of_the_dashboards() {
    let dir = tempfile::tempdir().unwrap();
    let all = KINDS.map(dashboards).concat();
    let write = |(name, dashboard): &(String, Value)| {
        let path = dir.path().join(name.replace('/', "-"));
        fs::write(&path, dashboard.to_string()).unwrap();
        path
    };
    let paths: Vec<_> = all.iter().map(write).collect();
    let said = oracle::grafana(&paths);
    assert_eq!(said["told"], json!([]), "Grafana has other members or types");
    let count: usize = all.iter().map(|(_, dashboard)| panels(dashboard).len()).sum();
    assert_eq!(said["panels"], count);

    let (_, whole) = dashboards(FLUX).swap_remove(0);
    let place = panels(&whole).iter().position(|panel| panel["type"] == "stat").unwrap();
    let slips: [(&str, Value); 6] = [
        ("/transformations", json!([{ "id": "merge", "option": {} }])),
        ("/options/graphMode", json!("sparkle")),
        ("/options/reduceOptions/calcs", json!("last")),
        ("/fieldConfig/defaults/thresholds/mode", json!("relative")),
        ("/gridPos/h", json!("6")),
        ("/type", json!("speedometer")),
    ];
    for (member, value) in slips {
        let mut slip = whole.clone();
        let panel = &mut slip["panels"][place];
        match panel.pointer_mut(member) {
            Some(place) => *place = value,
            None => panel[&member[1..]] = value,
        }
        let path = dir.path().join("slip.json");
        fs::write(&path, slip.to_string()).unwrap();
        assert_ne!(oracle::grafana(&[path])["told"], json!([]), "{member}");
    }
    // The release in the compose file.
    let model = fs::read_to_string(root().join("tests/oracle/requirements.txt")).unwrap();
    let release = model.lines().find_map(|line| line.strip_prefix("grafana-foundation-sdk==")).unwrap();
    let release = release.split('!').next_back().unwrap();
    assert!(compose().contains(&format!("grafana/grafana:{release}")), "the model is of {release}");
}

fn compose() -> String {
    read("compose.yaml")
}

#[test]
fn the_dashboards_are_whole() {
    for kind in KINDS {
        are_whole(kind);
    }
}

fn are_whole(kind: Kind) {
    let source = json!({ "type": kind.1, "uid": "hums" });
    let file = read(&format!("{}/datasource.yaml", kind.0));
    assert!(file.contains("uid: hums\n") && file.contains(&format!("type: {}\n", kind.1)), "{}", kind.0);
    let mut uids = BTreeSet::new();
    for (name, dashboard) in dashboards(kind) {
        assert!(uids.insert(dashboard["uid"].as_str().unwrap().to_owned()), "{name}: its uid is another's");
        assert!(dashboard["schemaVersion"].as_u64().is_some_and(|version| version >= 36), "{name}");
        assert!(dashboard["title"].as_str().is_some_and(|title| !title.is_empty()), "{name}");
        let mut ids = BTreeSet::new();
        let mut taken = BTreeMap::new();
        for panel in panels(&dashboard) {
            let title = panel["title"].as_str().unwrap();
            assert!(ids.insert(panel["id"].as_u64().unwrap()), "{name}, {title}: its id is another's");
            let drawn = panel["type"].as_str().unwrap();
            assert!(TYPES.contains(&drawn), "{name}, {title}: {drawn}");
            let [x, y, w, h] = ["x", "y", "w", "h"].map(|side| panel["gridPos"][side].as_u64().unwrap());
            assert!(x + w <= 24 && w > 0 && h > 0, "{name}, {title} is beyond the page's 24 columns");
            for place in (x..x + w).flat_map(|x| (y..y + h).map(move |y| (x, y))) {
                if let Some(other) = taken.insert(place, title) {
                    panic!("{name}: {title} lies on {other}");
                }
            }
            if drawn == "row" {
                continue;
            }
            assert_eq!(panel["datasource"], source, "{name}, {title}");
            let unit = panel["fieldConfig"]["defaults"]["unit"].as_str().unwrap();
            assert!(UNITS.contains(&unit), "{name}, {title}: unit {unit}");
            let steps = panel["fieldConfig"]["defaults"]["thresholds"]["steps"].as_array().unwrap();
            assert!(steps[0]["value"].is_null(), "{name}, {title}: the first step has no lower end");
            let mut letters = BTreeSet::new();
            for target in panel["targets"].as_array().unwrap() {
                assert!(letters.insert(target["refId"].as_str().unwrap()), "{name}, {title}: a letter twice");
                assert_eq!(target["datasource"], source, "{name}, {title}");
            }
            assert!(!letters.is_empty(), "{name}, {title} asks for nothing");
            for query in queries(kind, panel) {
                for part in kind.3 {
                    assert!(query.contains(part), "{name}, {title}: no {part} in {query}");
                }
                let balanced = |open, close| query.matches(open).count() == query.matches(close).count();
                assert!(balanced('(', ')') && balanced('{', '}') && balanced('[', ']'), "{name}, {title}");
            }
        }
    }
    assert_eq!(uids.len(), 2);
}

#[test]
fn every_panel_of_the_reference_system_is_there_in_its_row() {
    let (_, flight) = dashboards(FLUX).swap_remove(0);
    let titles: Vec<&str> = panels(&flight).iter().map(|panel| panel["title"].as_str().unwrap()).collect();
    let place =
        |title: &str| titles.iter().position(|other| *other == title).unwrap_or_else(|| panic!("no {title}"));
    let rows = ["General Information", "ESC Information", "Movement Information"].map(place);
    let order: Vec<usize> = PANELS.map(place).to_vec();
    assert!(order.is_sorted(), "in the reference's order: {titles:?}");
    assert_eq!([order[0], order[5], order[10]], rows.map(|row| row + 1));
    assert!(compose().contains("GF_DASHBOARDS_MIN_REFRESH_INTERVAL: 100ms"));
    assert!(flight["timepicker"]["refresh_intervals"].as_array().unwrap().contains(&"100ms".into()));
}

#[derive(Default)]
struct Points {
    fields: BTreeMap<String, BTreeSet<String>>,
    counters: BTreeSet<String>,
}

fn split(text: &str, at: char) -> Vec<String> {
    let (mut parts, mut quoted, mut escaped) = (vec![String::new()], false, false);
    for c in text.chars() {
        if c == at && !quoted && !escaped {
            parts.push(String::new());
            continue;
        }
        quoted ^= c == '"' && !escaped;
        escaped = c == '\\' && !escaped;
        if !escaped {
            parts.last_mut().unwrap().push(c);
        }
    }
    parts
}

impl Points {
    fn of(recording: &str, points: &mut Self) {
        let dir = tempfile::tempdir().unwrap();
        let (image, out) = (dir.path().join("card.img"), dir.path().join("out.lp"));
        let recording = own(recording);
        let sim = ["sim".as_ref(), recording.as_os_str(), "--sd".as_ref(), image.as_os_str()];
        hums(sim).expect_code(&[0]);
        let decode = ["decode".as_ref(), image.as_os_str(), "-o".as_ref(), out.as_os_str()];
        hums([&decode[..], &["--format".as_ref(), "influx".as_ref()]].concat()).expect_code(&[0]);
        for line in fs::read_to_string(out).unwrap().lines() {
            let parts = split(line, ' ');
            let head = split(&parts[0], ',');
            let fields = points.fields.entry(head[0].clone()).or_default();
            fields.extend(split(&parts[1], ',').iter().map(|field| split(field, '=')[0].clone()));
            points
                .counters
                .extend(head.iter().filter_map(|tag| tag.strip_prefix("counter=")).map(str::to_owned));
        }
    }
}

fn quoted<'a>(query: &'a str, before: &str) -> Vec<&'a str> {
    query.match_indices(before).map(|(at, _)| query[at + before.len()..].split('"').next().unwrap()).collect()
}

#[test]
fn whatever_a_panel_asks_for_is_in_the_points_of_the_recorded_flights() {
    let mut points = Points::default();
    for recording in ["ap_quad_faults.tlog", "px4_hil_quad_low.tlog"] {
        Points::of(recording, &mut points);
    }
    for (name, dashboard) in dashboards(FLUX) {
        for panel in panels(&dashboard) {
            for query in queries(FLUX, panel) {
                let place = format!("{name}, {}", panel["title"]);
                let measurement = quoted(query, "r._measurement == \"");
                let fields =
                    &points.fields.get(measurement[0]).unwrap_or_else(|| panic!("{place}: {measurement:?}"));
                for field in quoted(query, "r._field == \"") {
                    assert!(fields.contains(field), "{place}: no {field} in {}", measurement[0]);
                }
                for counter in quoted(query, "r.counter == \"") {
                    assert!(points.counters.contains(counter), "{place}: no counter {counter}");
                }
                for pattern in query.match_indices("=~ /^").map(|(at, _)| &query[at + 5..]) {
                    let (before, rest) = pattern.split_once("[0-9]+").unwrap();
                    let after = rest.split('$').next().unwrap();
                    let first = format!("{before}0{after}");
                    assert!(fields.contains(&first), "{place}: no {first}");
                }
            }
        }
    }
}
