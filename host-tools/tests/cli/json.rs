//! `--json` of every command that prints: which object it is, and that `docs/json.md` has every name in it.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::support::{attempt, recorded, run, text};

/// Members whose own names are data: counters, messages' fields, parameters.
const MAPS: [&str; 4] = ["usage", "lifetime", "cycles", "stack_by_urgency"];

/// The names of all members, with those around them: `logs[].vehicle.system`.
fn members(value: &Value, around: &str, names: &mut BTreeSet<String>) {
    match value {
        Value::Object(object) => {
            for (name, value) in object {
                let path = if around.is_empty() { name.clone() } else { format!("{around}.{name}") };
                if !MAPS.contains(&name.as_str()) {
                    members(value, &path, names);
                }
                names.insert(path);
            }
        }
        Value::Array(values) => values.iter().for_each(|value| members(value, &format!("{around}[]"), names)),
        _ => {}
    }
}

/// The names in the section of a schema in the document: the first column of its table.
fn documented(schema: &str, version: u64) -> BTreeSet<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/json.md");
    let document = std::fs::read_to_string(path).expect("the document");
    let heading = format!("\n## `{schema}` {version}\n");
    let section = document.split_once(&heading).unwrap_or_else(|| panic!("no section {heading}")).1;
    let section = section.split("\n## ").next().unwrap_or_default();
    let rows = section.lines().filter_map(|line| line.strip_prefix("| "));
    let names = rows.filter_map(|row| row.split(" | ").next());
    names
        .flat_map(|names| names.split(", "))
        .filter_map(|name| Some(name.strip_prefix('`')?.strip_suffix('`')?.to_owned()))
        .collect()
}

#[test]
fn every_object_says_which_one_it_is_and_the_document_has_all_of_its_names() {
    let dir = recorded();
    run(dir.path(), "sim --input PX4 --sd second.img --noise 0.001 --stall 2500@20", 0);
    let mut schemas = BTreeSet::new();
    for line in [
        "info --list --json card.img PX4",
        "info --json card.img",
        "info --json PX4",
        "info --json second.img",
        "info --verify --json card.img",
        "decode card.img -o out --format tlog,csv,thesis,parquet --json",
        "report card.img -o pages/ --json",
        "decode --format hum PX4 -o packed.hum --json",
        "sim --input PX4 --sd another.img --json --cut-after-writes 900",
    ] {
        let output = attempt(dir.path(), line);
        let object: Value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|_| panic!("hums {line}: {}", text(&output)));
        let schema = object["schema"].as_str().unwrap_or_else(|| panic!("hums {line}: no schema"));
        let version = object["version"].as_u64().expect("a version");
        let mut names = BTreeSet::new();
        members(&object, "", &mut names);
        let documented = documented(schema, version);
        let missing: Vec<_> = names
            .iter()
            .filter(|name| !["schema", "version"].contains(&name.as_str()) && !documented.contains(*name))
            .collect();
        assert!(missing.is_empty(), "{schema}: docs/json.md does not have {missing:#?}");
        schemas.insert(schema.to_owned());
    }
    assert_eq!(schemas.len(), 6, "{schemas:?}");
}

#[test]
fn a_session_alone_is_what_it_is_among_all() {
    let dir = recorded();
    for seed in 1..=5 {
        // Where power goes in the flight depends on how small the log is.
        attempt(dir.path(), &format!("sim --input PX4 --sd card.img --seed {seed} --cut-after-writes 400"));
    }
    let all: Value =
        serde_json::from_slice(&attempt(dir.path(), "info --json card.img").stdout).expect("JSON");
    for log in all["logs"].as_array().expect("logs") {
        let name = log["name"].as_str().expect("a name");
        let alone = attempt(dir.path(), &format!("info --json card.img --session {name}"));
        let alone: Value = serde_json::from_slice(&alone.stdout).expect("JSON");
        assert_eq!(alone["logs"].as_array().map(Vec::as_slice), Some(std::slice::from_ref(log)), "{name}");
    }
    run(dir.path(), "info card.img --session 00009", 2);
}
