//! Lines of Rust by folder against `budgets.toml`, without blanks and comments.

use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result, bail};

use crate::budgets::Budgets;
use crate::repo;
use crate::shell::Shell;

/// Prints the counts; fails over a limit.
pub(crate) fn check() -> Result<()> {
    println!("{:<16} {:>7} {:>7}   {:>7} {:>7}", "folder", "code", "limit", "tests", "limit");
    let mut over = Vec::new();
    for (folder, limit) in Budgets::read()?.lines {
        let (mut code, mut tests) = (0, 0);
        let files = Shell::new("git").args(["ls-files", &folder]).within(repo::root()).ask();
        let files = files
            .with_context(|| format!("git knows no files of {folder}; correct the folder in budgets.toml"))?;
        for file in files.lines() {
            if Path::new(file).extension().is_none_or(|extension| extension != "rs") {
                continue;
            }
            let text = fs::read_to_string(repo::root().join(file)).with_context(|| file.to_owned())?;
            let count = count(file, &text);
            (code, tests) = (code + count.0, tests + count.1);
        }
        println!("{folder:<16} {code:>7} {:>7}   {tests:>7} {:>7}", limit.code_max, limit.tests_max);
        if code > limit.code_max || tests > limit.tests_max {
            over.push(folder);
        }
    }
    if over.is_empty() { Ok(()) } else { bail!("over the limit of lines: {}", over.join(", ")) }
}

/// Of code and tests, which are a file's last module.
fn count(file: &str, text: &str) -> (usize, usize) {
    let is_of_tests = file.starts_with("tests/")
        || ["/tests/", "/benches/"].iter().any(|part| file.contains(part))
        || ["/tests.rs", "_tests.rs"].iter().any(|end| file.ends_with(end));
    let is_code = |line: &&str| !line.is_empty() && !line.starts_with("//");
    let lines: Vec<&str> = text.lines().map(str::trim).filter(is_code).collect();
    let begins_tests =
        |pair: &[&str]| pair[0] == "#[cfg(test)]" && pair[1].starts_with("mod ") && pair[1].ends_with('{');
    let tests = if is_of_tests { Some(0) } else { lines.windows(2).position(begins_tests) };
    let code = tests.unwrap_or(lines.len());
    (code, lines.len() - code)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blanks_and_comments_do_not_count_and_tests_count_apart() {
        let text = "//! A file.\n\nfn code() {\n    // It does nothing.\n}\n\n#[cfg(test)]\nmod tests {\n    fn test() {}\n}\n";
        assert_eq!(count("firmware/core/src/file.rs", text), (2, 4));
        for file in ["tests/sim/file.rs", "firmware/core/tests/file.rs", "firmware/core/src/file/tests.rs"] {
            assert_eq!(count(file, text), (0, 6), "{file}");
        }
        assert_eq!(count("xtask/src/file.rs", "#[cfg(test)]\nmod tests;\nfn code() {}\n"), (3, 0));
    }
}
