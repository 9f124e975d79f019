//! The queries of the dashboards, sent to the available databases with a recent flight.

use std::time::{SystemTime, UNIX_EPOCH};

use serde_json::Value;

use super::database::Database;
use super::grafana::{INFLUXQL, Kind, VICTORIA, dashboards, panels};

/// Panels without data for an `ArduPilot` vehicle without `ESC_INFO`.
const OF_PX4: [&str; 3] = ["ESC Fails", "ESC currently failing", "Estimator, PX4"];

/// Start and end of a query, seconds since 1970.
type Span = [f64; 2];

fn lately() -> Span {
    let now_s = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64().round();
    [now_s - 300.0, now_s]
}

fn filled(query: &str, [vehicle, session]: [&str; 2], [from_s, to_s]: Span) -> String {
    let between = format!("time >= {} AND time <= {}", (from_s * 1e9) as u64, (to_s * 1e9) as u64);
    let replaced = query.replace("$timeFilter", &between).replace("$__interval", "1s");
    let replaced = replaced.replace("$__range", "1h").replace("$__rate_interval", "4s");
    replaced.replace("$vehicle", vehicle).replace("$session", session)
}

fn ask_all(kind: Kind, span: Span, ask: impl Fn(&Value, &dyn Fn(&str) -> String) -> Vec<Value>) -> usize {
    let mut asked = 0;
    for (name, dashboard) in dashboards(kind) {
        let mut chosen = [String::new(), String::new()];
        for (place, variable) in dashboard["templating"]["list"].as_array().unwrap().iter().enumerate() {
            let fill = |query: &str| filled(query, [&chosen[0], &chosen[1]], span);
            let values = ask(&variable["query"], &fill);
            let [one] = values.as_slice() else { panic!("{name}, {}: {values:?}", variable["name"]) };
            one.as_str().unwrap().clone_into(&mut chosen[place]);
        }
        for panel in panels(&dashboard) {
            for target in panel["targets"].as_array().into_iter().flatten() {
                let values = ask(target, &|query| filled(query, [&chosen[0], &chosen[1]], span));
                let title = panel["title"].as_str().unwrap();
                assert_eq!(values.is_empty(), OF_PX4.contains(&title), "{name}, {title}: {values:?}");
                if title == "Battery (V)" {
                    let volts = values.last().and_then(Value::as_f64).unwrap();
                    assert!((9.0..13.0).contains(&volts), "{name}: {values:?}");
                }
                asked += 1;
            }
        }
    }
    asked
}

pub(crate) fn assert_answered_by_influx(database: &Database) {
    let asked = ask_all(INFLUXQL, lately(), |query, fill| {
        let series = database.ask(&fill(query["query"].as_str().unwrap()));
        let rows = series.iter().flat_map(|one| one["values"].as_array().unwrap());
        rows.map(|row| row.as_array().unwrap()[1].clone()).collect()
    });
    assert!(asked > 40, "{asked}");
}

pub(crate) fn assert_answered_by_victoria(database: &Database) {
    let span = lately();
    let asked = ask_all(VICTORIA, span, |query, fill| {
        let Some(expression) = query["expr"].as_str() else {
            let variable = query["query"].as_str().unwrap();
            let inside = variable.strip_prefix("label_values(").and_then(|rest| rest.strip_suffix(')'));
            let (of, label) = inside.unwrap().rsplit_once(", ").unwrap_or(("", inside.unwrap()));
            return database.labels(label, &fill(of));
        };
        database.query(&fill(expression), span, query["instant"] == true)
    });
    assert!(asked > 40, "{asked}");
}
