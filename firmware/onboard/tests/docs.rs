//! Every text for a user is in the documents.

use std::fs;
use std::path::Path;

use hums_link::statustext::TEXT_BYTES_MAX;

fn texts(folder: &Path, found: &mut Vec<String>) {
    for entry in fs::read_dir(folder).expect("readable").flatten() {
        let path = entry.path();
        if path.is_dir() {
            texts(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") && !path.ends_with("tests.rs") {
            let source = fs::read_to_string(&path).expect("readable");
            let source = source.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
            let literals = source.split("\"HUMS: ").skip(1).filter_map(|rest| rest.split('"').next());
            found.extend(literals.map(str::to_owned));
        }
    }
}

fn all_texts() -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut found = Vec::new();
    for folder in ["core/src", "link/src", "onboard/src", "recorder/src", "app/src"] {
        texts(&root.join("firmware").join(folder), &mut found);
    }
    assert!(found.len() > 20, "{found:?}");
    found
}

#[test]
fn every_text_that_a_pilot_may_read_is_one_message() {
    for text in all_texts().iter().filter(|text| !text.contains('{')) {
        assert!("HUMS: ".len() + text.len() <= TEXT_BYTES_MAX, "{text}");
    }
}

#[test]
fn every_text_that_a_pilot_may_read_is_in_the_runbook() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let read = |name: &str| fs::read_to_string(root.join("docs").join(name)).expect("readable");
    let known = read("runbook.md") + &read("cards.md").replace("| ", "card: ");
    for text in all_texts() {
        let pieces = text.split('{').map(|piece| piece.rsplit('}').next().unwrap_or_default().trim());
        for piece in pieces.filter(|piece| piece.chars().filter(char::is_ascii_alphabetic).count() > 3) {
            let piece = piece.trim_matches([':', '(', ',', ' ']);
            assert!(known.contains(piece), "docs/runbook.md does not tell of {piece:?} in {text:?}");
        }
    }
}
