//! Shared by the benches.

use std::env;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};

use crate::repo;

pub(super) fn on_one_core(program: &OsStr, one: bool) -> Command {
    if !one || Command::new("taskset").arg("--version").output().is_err() {
        return Command::new(program);
    }
    let mut command = Command::new("taskset");
    command.args(["-c", "0"]).arg(program);
    command
}

/// Sorts them.
pub(super) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Colons between: besides `tests/flights`, or instead of `tests`.
pub(super) fn folders(variable: &str, besides: bool) -> Vec<PathBuf> {
    let named = env::var_os(variable).unwrap_or_default();
    let named = env::split_paths(&named).filter(|folder| !folder.as_os_str().is_empty());
    let mut folders: Vec<PathBuf> = named.collect();
    if besides || folders.is_empty() {
        folders.push(repo::root().join(if besides { "tests/flights" } else { "tests" }));
    }
    folders
}

pub(super) fn files_below(folders: &[PathBuf], ends: &[&str]) -> Result<Vec<PathBuf>> {
    let (mut waiting, mut files) = (folders.to_vec(), Vec::new());
    while let Some(folder) = waiting.pop() {
        let entries = fs::read_dir(&folder).with_context(|| format!("cannot read {}", folder.display()))?;
        for entry in entries {
            let path = entry?.path();
            let name = path.to_string_lossy().to_ascii_lowercase();
            if path.is_dir() {
                waiting.push(path);
            } else if ends.iter().any(|end| name.ends_with(end)) {
                files.push(path);
            }
        }
    }
    files.sort();
    Ok(files)
}

pub(super) fn work_folder() -> Result<PathBuf> {
    let folder = repo::target().join("bench");
    fs::create_dir_all(&folder)?;
    Ok(folder)
}

pub(super) fn repeat(flight: &Path, bytes_min: f64, to: &Path) -> Result<()> {
    let tlog = fs::read(flight)?;
    let times = (bytes_min / tlog.len().max(1) as f64).ceil().max(1.0) as usize;
    fs::write(to, tlog.repeat(times)).with_context(|| to.display().to_string())
}
