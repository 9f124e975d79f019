//! The program of the check in a browser, `hums-check.html`.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};

use crate::repo::{self, BROWSER_TARGET};
use crate::setup::{self, Need};
use crate::shell::Shell;

/// Opens at once, also from a phone's storage.
pub(crate) const PAGE_BYTES_MAX: u64 = 6_000_000;

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
    check_size(&page)?;
    println!("{}", repo::shown(&page));
    Ok(())
}

pub(crate) fn check_size(page: &Path) -> Result<()> {
    let bytes = fs::metadata(page).with_context(|| page.display().to_string())?.len();
    if bytes > PAGE_BYTES_MAX {
        bail!("{}: has {bytes} bytes; at most {PAGE_BYTES_MAX} open at once", repo::shown(page));
    }
    Ok(())
}
