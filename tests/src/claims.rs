//! Each test and campaign that a document names exists.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use crate::flights::root;
use crate::prove::{CAMPAIGNS, diagnosis::DIAGNOSIS};

const DOCUMENTS: [&str; 2] = ["docs/safety.md", "docs/cards.md"];

fn functions(folder: &Path, found: &mut BTreeSet<String>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            functions(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            let names = text.split("fn ").skip(1).filter_map(|rest| rest.split(['(', '<']).next());
            found.extend(names.map(str::to_owned));
        }
    }
}

fn quoted(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// Tests have sentences as names.
fn is_test(word: &str) -> bool {
    word.matches('_').count() >= 3
        && word.chars().all(|letter| letter == '_' || letter.is_ascii_lowercase() || letter.is_ascii_digit())
}

#[test]
fn each_test_and_each_campaign_that_a_document_names_is_there() {
    let mut all = BTreeSet::new();
    for folder in ["firmware", "host-tools", "tests"] {
        functions(&root().join(folder), &mut all);
    }
    let mut tests = 0;
    for document in DOCUMENTS {
        let text = fs::read_to_string(root().join(document)).unwrap();
        for word in quoted(&text) {
            if is_test(word) {
                assert!(all.contains(word), "{document}: there is no test {word}");
                tests += 1;
            }
            if let Some(name) = word.strip_prefix("cargo xtask prove ") {
                let is_there = name == DIAGNOSIS || CAMPAIGNS.iter().any(|one| one.name == name);
                assert!(is_there, "{document}: there is no campaign {name}");
            }
        }
    }
    assert!(tests > 20, "{tests} tests");
}

#[test]
fn nothing_is_said_of_a_failure_that_nothing_shows() {
    let text = fs::read_to_string(root().join("docs/safety.md")).unwrap();
    let rows = text.lines().skip_while(|line| !line.starts_with("| fails |")).skip(2);
    let mut count = 0;
    for row in rows.take_while(|line| line.starts_with('|')) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 5, "{row}");
        assert!(quoted(cells[4]).any(|word| is_test(word) || word.starts_with("cargo xtask prove")), "{row}");
        count += 1;
    }
    assert!(count >= 8, "{count} rows");
}
