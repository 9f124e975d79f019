//! Sizes of the house: told, not judged.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::source::Crate;

/// Crates, files, lines, the longest of each, and the lints that are allowed somewhere.
pub(super) fn table(crates: &[Crate]) -> String {
    let files: Vec<_> =
        crates.iter().flat_map(|krate| &krate.modules).filter(|module| module.lines > 0).collect();
    let lines: usize = files.iter().map(|module| module.lines).sum();
    let test_lines: usize = files.iter().map(|module| module.test_lines).sum();
    let longest_file = files.iter().max_by_key(|module| module.lines - module.test_lines);
    let longest_function = crates
        .iter()
        .flat_map(|krate| &krate.modules)
        .flat_map(|module| module.functions.iter().map(move |(name, lines)| (*lines, name, &module.file)))
        .max();
    let mut allowances: BTreeMap<&str, usize> = BTreeMap::new();
    for module in crates.iter().flat_map(|krate| &krate.modules) {
        for (lint, count) in &module.allowances {
            *allowances.entry(lint).or_default() += count;
        }
    }

    let mut text = String::new();
    let mut row = |name: &str, value: String| {
        let _ = writeln!(text, "{name:<21} {value}");
    };
    row("crates", crates.len().to_string());
    row("files", files.len().to_string());
    row("lines", format!("{lines}, of which {test_lines} are tests beside the code"));
    if let Some(module) = longest_file {
        let code = module.lines - module.test_lines;
        row("longest file", format!("{code} lines without tests, {}", module.file));
    }
    if let Some((lines, name, file)) = longest_function {
        row("longest function", format!("{lines} lines, {name} in {file}"));
    }
    let listed: Vec<String> = allowances.iter().map(|(lint, count)| format!("{lint} {count}")).collect();
    row("allowed lints", format!("{}: {}", allowances.values().sum::<usize>(), listed.join(", ")));
    text.pop();
    text
}
