//! The `hums` program: one build for tests and demo, and the users' build for measurements.

use std::path::PathBuf;

use anyhow::Result;

use crate::repo;
use crate::shell::Shell;

/// Builds the program that the tests share (profile `dev`, optimised as in `Cargo.toml`); returns its path.
pub(crate) fn build() -> Result<PathBuf> {
    Shell::cargo().args(["build", "--package=hums"]).run()?;
    Ok(program())
}

/// The program's path after [`build`].
pub(crate) fn program() -> PathBuf {
    repo::target().join("debug/hums")
}

/// The build that users make, for measurements; returns the program's path.
pub(crate) fn build_release() -> Result<PathBuf> {
    Shell::cargo().args(["build", "--release", "--package=hums"]).run()?;
    Ok(repo::target().join("release/hums"))
}
