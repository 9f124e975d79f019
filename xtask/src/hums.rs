//! `hums`: one build for tests, and the users' build.

use std::path::PathBuf;

use anyhow::Result;

use crate::repo;
use crate::shell::Shell;

/// Shared by the tests (profile `dev`); returns its path.
pub(crate) fn build() -> Result<PathBuf> {
    Shell::cargo().args(["build", "--package=hums"]).run()?;
    Ok(program())
}

/// The program's path after [`build`].
pub(crate) fn program() -> PathBuf {
    repo::target().join("debug/hums")
}

pub(crate) fn build_release() -> Result<PathBuf> {
    Shell::cargo().args(["build", "--release", "--package=hums"]).run()?;
    Ok(repo::target().join("release/hums"))
}
