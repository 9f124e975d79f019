//! A dashboard of one kind of database, made of the description that all kinds share (`flight.json`, `health.json`).

use serde_json::{Value, json};

pub(crate) const DATABASES: [(&str, &str); 3] =
    [("flux", "influxdb"), ("influxql", "influxdb"), ("victoriametrics", "prometheus")];

/// The description with the values of one database: of `{"by database": {"flux": A, "influxql": B}}` its own one, or no member
/// if it has none; every `datasource` is the database's.
pub(crate) fn resolve(description: &Value, (database, source): (&str, &str)) -> Option<Value> {
    Some(match description {
        Value::Object(members) => {
            if let Some(values) = members.get("by database") {
                return resolve(values.get(database)?, (database, source));
            }
            let member = |(name, value): (&String, &Value)| {
                let value = match name.as_str() {
                    "datasource" => json!({ "type": source, "uid": "hums" }),
                    _ => resolve(value, (database, source))?,
                };
                Some((name.clone(), value))
            };
            Value::Object(members.iter().filter_map(member).collect())
        }
        Value::Array(values) => {
            Value::Array(values.iter().filter_map(|value| resolve(value, (database, source))).collect())
        }
        value => value.clone(),
    })
}
