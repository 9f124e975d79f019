//! Gives the program its version with the commit that it is built from, which `hums --version` prints.

use std::env;
use std::process::Command;

fn main() {
    let version = env::var("CARGO_PKG_VERSION").expect("cargo sets it");
    let commit =
        commit().map_or_else(|| "of no known commit".to_owned(), |commit| format!("commit {commit}"));
    println!("cargo::rustc-env=HUMS_VERSION={version} ({commit})");
}

/// The commit of the build; `None` without git.
fn commit() -> Option<String> {
    // The log of HEAD grows with every commit, so that the next build looks again.
    let log = git(&["rev-parse", "--git-path", "logs/HEAD"])?;
    println!("cargo::rerun-if-changed={log}");
    git(&["rev-parse", "--short=12", "HEAD"])
}

fn git(arguments: &[&str]) -> Option<String> {
    let output =
        Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
