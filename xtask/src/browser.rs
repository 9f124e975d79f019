//! The program of the check in a browser, `hums-check.html`.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::repo::{self, BROWSER_TARGET};
use crate::setup::{self, Need};
use crate::shell::Shell;

const BUILD: [&str; 5] =
    ["build", "--package=hums-browser", "--bin=hums-browser", "--target", BROWSER_TARGET];

/// Of a release.
pub(crate) const SHIPPED: [&str; 6] = [BUILD[0], BUILD[1], BUILD[2], BUILD[3], BUILD[4], "--profile=browser"];

pub(crate) fn shipped(target: &Path) -> PathBuf {
    target.join(BROWSER_TARGET).join("browser/hums-browser.wasm")
}

/// Unoptimised like the tools: it is built in a third of the time.
pub(crate) fn tested() -> PathBuf {
    repo::target().join(BROWSER_TARGET).join("debug/hums-browser.wasm")
}

pub(crate) fn build_tested() -> Result<()> {
    Shell::cargo().args(BUILD).run()
}

pub(crate) fn build_shipped() -> Result<()> {
    Shell::cargo().args(SHIPPED).run()
}

pub(crate) fn page() -> Result<()> {
    setup::require(&[Need::Linker, Need::BrowserTarget])?;
    build_shipped()?;
    let page = repo::target().join("hums-check.html");
    let maker = ["run", "--quiet", "--package=hums-browser", "--bin=hums-check-page", "--"];
    Shell::cargo().args(maker).arg(shipped(&repo::target())).arg(&page).run()?;
    println!("{}", repo::shown(&page));
    Ok(())
}
