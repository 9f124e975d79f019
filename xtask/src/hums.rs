//! The `hums` program, as users build it.

use std::path::PathBuf;

use anyhow::Result;

use crate::repo;
use crate::shell::Shell;

pub(crate) fn build() -> Result<()> {
    Shell::cargo().args(["build", "--release", "--package=hums"]).run()
}

pub(crate) fn program() -> PathBuf {
    repo::target().join("release/hums")
}
