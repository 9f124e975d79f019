//! `cargo xtask prove`: the campaigns, thousands of cases each; their results are `docs/proof.md`.
//!
//! They are in the tests' crate; this builds them. Apart: `diagnosis` (labelled flights, `docs/diagnosis.md`), `fleet` (20,000
//! sessions as tables), `storage` (object storage), `chip` (long tests on the model), `boards` (every board's image), `foreign` (foreign programs on the
//! model), `browser` (the check in a browser: time and memory).

use anyhow::Result;

use crate::browser;
use crate::firmware::{self, Board};
use crate::foreign;
use crate::hums;
use crate::oracle;
use crate::pc;
use crate::repo;
use crate::setup::{self, Need};
use crate::shell::Shell;

/// The campaigns' tools for cards.
pub(crate) const NEEDS: &[Need] = &[Need::Dosfstools];

/// Names, `--short`, `--seed N`, `--runs N`; `diagnosis`, `chip` and `foreign` have their own.
pub(crate) fn run(arguments: &[String]) -> Result<()> {
    match arguments.split_first().map(|(first, rest)| (first.as_str(), rest)) {
        Some(("chip", rest)) => return chip(&[firmware::default_board()], rest),
        Some(("boards", [])) => {
            return chip(&hums_boards::all().iter().collect::<Vec<_>>(), &["boards::".to_owned()]);
        }
        Some(("foreign", rest)) => return foreign::run(rest),
        Some(("browser", [])) => return in_browsers(),
        Some(("fleet", _)) => return fleet(arguments),
        Some(("storage", [])) => return storage(arguments),
        _ => {}
    }
    let is_diagnosis = arguments.first().is_some_and(|first| first == "diagnosis");
    let mut needs = if is_diagnosis { Vec::new() } else { NEEDS.to_vec() };
    needs.push(Need::Linker);
    setup::require(&needs)?;
    campaigns(arguments).run()
}

fn campaigns(arguments: &[String]) -> Shell {
    let run = ["run", "--release", "--quiet", "--package=hums-tests", "--bin", "prove", "--"];
    Shell::cargo().args(run).args(arguments)
}

/// The users' `hums`, DuckDB, and Spark if Java is there.
fn fleet(arguments: &[String]) -> Result<()> {
    setup::require(&[Need::Linker, Need::PythonVenv])?;
    oracle::prepare()?;
    if setup::ensure(&[Need::Java], false).has(Need::Java) {
        oracle::install("requirements-spark.txt")?;
    }
    let hums = hums::build_release()?;
    campaigns(arguments).env("HUMS_BIN", hums).env("HUMS_PYTHON", oracle::python()).run()
}

/// `hums` with its feature, which is linted here alone, and a server.
fn storage(arguments: &[String]) -> Result<()> {
    const FEATURE: [&str; 2] = ["--features", "hums/object-storage,hums-export/object-storage"];
    setup::require(&[Need::Linker, Need::PythonVenv, Need::Clippy])?;
    oracle::prepare()?;
    oracle::install("requirements-storage.txt")?;
    let lint = ["clippy", "--package=hums", "--package=hums-export", "--all-targets"];
    Shell::cargo().args(lint).args(FEATURE).args(["--", "-D", "warnings"]).run()?;
    Shell::cargo().args(["build", "--package=hums", "--features", "object-storage"]).run()?;
    campaigns(arguments).env("HUMS_BIN", hums::program()).env("HUMS_PYTHON", oracle::python()).run()
}

/// Proves some or all boards.
fn chip(boards: &[&'static Board], names: &[String]) -> Result<()> {
    let needs = [Need::Linker, Need::FirmwareTarget, Need::PythonVenv, Need::Dosfstools];
    setup::require(&needs)?;
    firmware::build_beside(boards.iter().copied(), pc::build)?;
    oracle::prepare()?;
    let names = names.iter().map(String::as_str);
    let names: Vec<&str> = if names.len() == 0 { vec!["chip::"] } else { names.collect() };
    pc::end_to_end(&[&["--ignored", "--nocapture"], &names[..]].concat())
}

/// Against the users' build of `hums`.
fn in_browsers() -> Result<()> {
    setup::require(&[Need::Linker, Need::BrowserTarget, Need::PythonVenv, Need::Chromium, Need::Firefox])?;
    hums::build_release()?;
    browser::build(browser::SHIPPED)?;
    oracle::prepare()?;
    pc::build()?;
    pc::end_to_end_with(&browser::shipped(&repo::target()), &["--ignored", "--nocapture", "browser::"])
}
