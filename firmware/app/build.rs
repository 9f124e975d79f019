//! Gives the linker the memory map and its scripts, and the program its commit. Only for the bare-metal target: a host
//! build of the workspace must not see them.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

fn main() {
    println!("cargo::rustc-env=HUMS_GIT={}", commit());
    println!("cargo::rerun-if-env-changed=DEFMT_LOG");
    if env::var_os("DEFMT_LOG").is_none() {
        // defmt's own default is errors only.
        println!("cargo::rustc-env=DEFMT_LOG=info");
    }
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    copy("../../memory.x", &out.join("memory.x"));
    let board = if env::var_os("CARGO_FEATURE_BOARD_F429").is_some() { "f429" } else { "f405" };
    copy(&format!("src/boards/{board}.x"), &out.join("board.x"));
    println!("cargo::rustc-link-search={}", out.display());
    let logs = env::var_os("CARGO_FEATURE_LOG").is_some();
    for argument in ["--nmagic", "-Tlink.x"].into_iter().chain(logs.then_some("-Tdefmt.x")) {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}

fn copy(from: &str, to: &Path) {
    println!("cargo::rerun-if-changed={from}");
    fs::copy(from, to).expect("the linker script is in the source tree");
}

/// The commit of the build; empty without git.
fn commit() -> String {
    // The log of HEAD grows with every commit, so that the next build looks again.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]) {
        println!("cargo::rerun-if-changed={log}");
    }
    git(&["rev-parse", "--short=12", "HEAD"]).unwrap_or_default()
}

fn git(arguments: &[&str]) -> Option<String> {
    let output =
        Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}
