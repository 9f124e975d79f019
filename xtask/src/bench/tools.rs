//! Shared by the benches.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result};

use crate::repo;

/// A program on the first core only, where `taskset` is there to see to it.
pub(super) fn on_one_core(program: &OsStr, one: bool) -> Command {
    let pinned = one && Command::new("taskset").arg("--version").output().is_ok();
    if !pinned {
        return Command::new(program);
    }
    let mut command = Command::new("taskset");
    command.args(["-c", "0"]).arg(program);
    command
}

/// The middle of some values, which are put in order.
pub(super) fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Place of the measured files.
pub(super) fn work_folder() -> Result<PathBuf> {
    let folder = repo::target().join("bench");
    fs::create_dir_all(&folder)?;
    Ok(folder)
}

/// A recording, repeated to that many bytes.
pub(super) fn repeat(flight: &Path, bytes_min: f64, to: &Path) -> Result<()> {
    let tlog = fs::read(flight)?;
    let times = (bytes_min / tlog.len().max(1) as f64).ceil().max(1.0) as usize;
    fs::write(to, tlog.repeat(times)).with_context(|| to.display().to_string())
}
