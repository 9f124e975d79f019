//! The program of the check in a browser, `hums-check.html`.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::repo::{self, BROWSER_TARGET};
use crate::setup::{self, Need};
use crate::shell::Shell;

pub(crate) const BUILD: [&str; 6] = [
    "build",
    "--profile=browser",
    "--package=hums-browser",
    "--bin=hums-browser",
    "--target",
    BROWSER_TARGET,
];

pub(crate) fn program(target: &Path) -> PathBuf {
    target.join(BROWSER_TARGET).join("browser/hums-browser.wasm")
}

/// Builds the program.
pub(crate) fn build() -> Result<()> {
    Shell::cargo().args(BUILD).run()
}

pub(crate) fn page() -> Result<()> {
    setup::require(&[Need::Linker, Need::BrowserTarget])?;
    build()?;
    let page = repo::target().join("hums-check.html");
    let maker = ["run", "--quiet", "--package=hums-browser", "--bin=hums-check-page", "--"];
    Shell::cargo().args(maker).arg(program(&repo::target())).arg(&page).run()?;
    println!("{}", repo::shown(&page));
    Ok(())
}
