//! The program of the check in a browser, `hums-check.html`.

use std::path::{Path, PathBuf};

use anyhow::Result;

use crate::repo::{self, BROWSER_TARGET};
use crate::setup::{self, Need};
use crate::shell::Shell;

/// Of a release.
pub(crate) const SHIPPED: &str = "--profile=browser";
/// Unoptimised like the tools: it is built in a third of the time.
pub(crate) const TESTED: &str = "--profile=dev";

/// Of cargo.
pub(crate) const fn arguments(profile: &str) -> [&str; 6] {
    ["build", "--package=hums-browser", "--bin=hums-browser", "--target", BROWSER_TARGET, profile]
}

pub(crate) fn shipped(target: &Path) -> PathBuf {
    target.join(BROWSER_TARGET).join("browser/hums-browser.wasm")
}

pub(crate) fn tested() -> PathBuf {
    repo::target().join(BROWSER_TARGET).join("debug/hums-browser.wasm")
}

pub(crate) fn build(profile: &str) -> Result<()> {
    Shell::cargo().args(arguments(profile)).run()
}

pub(crate) fn page() -> Result<()> {
    setup::require(&[Need::Linker, Need::BrowserTarget])?;
    build(SHIPPED)?;
    let page = repo::target().join("hums-check.html");
    let maker = ["run", "--quiet", "--package=hums-browser", "--bin=hums-check-page", "--"];
    Shell::cargo().args(maker).arg(shipped(&repo::target())).arg(&page).run()?;
    println!("{}", repo::shown(&page));
    Ok(())
}
