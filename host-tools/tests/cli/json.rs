//! `--json` of every command that prints: its object, and that `docs/json.md` has every name in it.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::support::{attempt, recorded, run, text};

/// Members whose own names are data: counters, messages' fields, parameters.
const MAPS: [&str; 5] = ["usage", "lifetime", "cycles", "stack_by_urgency", "counts"];

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

/// Objects in several schemas: a row that links to one has all of its names.
const SHARED: [&str; 5] = ["image", "end", "blocks", "finding", "exceedance"];

/// Adds the names in the document's section with this heading, below `around`: the first column of its table.
fn documented(document: &str, heading: &str, around: &str, names: &mut BTreeSet<String>) {
    let start = format!("\n## {heading}\n");
    let section = document.split_once(&start).unwrap_or_else(|| panic!("no section {heading}")).1;
    let section = section.split("\n## ").next().unwrap_or_default();
    for row in section.lines().filter_map(|line| line.strip_prefix("| ")) {
        let (first, content) = row.split_once(" | ").unwrap_or((row, ""));
        for name in first.split(", ").filter_map(|name| name.strip_prefix('`')?.strip_suffix('`')) {
            let path = format!("{around}{name}");
            if let Some(shared) = SHARED.iter().find(|shared| content.contains(&format!("(#{shared})"))) {
                documented(document, &format!("`{shared}`"), &format!("{path}."), names);
            }
            names.insert(path.trim_end_matches("[]").to_owned());
        }
    }
}

#[test]
fn every_object_says_which_one_it_is_and_the_document_has_all_of_its_names() {
    let dir = recorded();
    std::fs::write(dir.path().join("parts.param"), "CMP1_KIND 1\nCMP1_HOURS 50\n").expect("a file");
    run(dir.path(), "sim PX4 --sd parts.img --params parts.param", 0);
    run(dir.path(), "sim PX4 --sd second.img --noise 0.001 --stall 2500@20", 0);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/json.md");
    let document = std::fs::read_to_string(path).expect("the document");
    let mut schemas = BTreeSet::new();
    for line in [
        "info --list --json card.img PX4",
        "due --json parts.img",
        "info --json card.img",
        "info --json PX4",
        "info --json second.img",
        "info --verify --json card.img",
        "decode card.img -o out --format tlog,csv,thesis,parquet --json",
        "report card.img -o pages/ --json",
        "decode --format hum PX4 -o packed.hum --json",
        "sim PX4 --sd another.img --json --cut-after-writes 900",
    ] {
        let output = attempt(dir.path(), line);
        let object: Value = serde_json::from_slice(&output.stdout)
            .unwrap_or_else(|_| panic!("hums {line}: {}", text(&output)));
        let schema = object["schema"].as_str().unwrap_or_else(|| panic!("hums {line}: no schema"));
        let version = object["version"].as_u64().expect("a version");
        let mut names = BTreeSet::new();
        members(&object, "", &mut names);
        let mut known = BTreeSet::new();
        documented(&document, &format!("`{schema}` {version}"), "", &mut known);
        let missing: Vec<_> = names
            .iter()
            .filter(|name| !["schema", "version"].contains(&name.as_str()) && !known.contains(*name))
            .collect();
        assert!(missing.is_empty(), "{schema}: docs/json.md does not have {missing:#?}");
        schemas.insert(schema.to_owned());
    }
    assert_eq!(schemas.len(), 7, "{schemas:?}");
}

#[test]
fn a_session_alone_is_what_it_is_among_all() {
    let dir = recorded();
    for seed in 1..=5 {
        // The place of the power cut in the flight depends on the size of the log.
        attempt(dir.path(), &format!("sim PX4 --sd card.img --seed {seed} --cut-after-writes 400"));
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
