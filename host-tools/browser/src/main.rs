//! `hums check` and `hums report` in a browser.
//!
//! A worker of the page (`worker.js`) runs this program with WASI, the system interface of WebAssembly. The dropped files are
//! its files, read in slices. So the readers, the checks and the report are those of `hums`.
//!
//! ```text
//! hums-browser check INPUT...      two lines for each log: {"screen": TEXT}, then the object of `hums check --json`
//! hums-browser report INPUT...     a line for each page: {"page": FILE, "log": LOG or null, "system": ID or null, "html": TEXT}
//! hums-browser compare INPUT...    the same with the flights side by side
//! ```
//!
//! Remarks and errors go to standard error.

use std::env;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Result;
use hums_analysis::check::{self, text};
use hums_base::colour::shown;
use hums_base::outcome::{Outcome, exit_code, usage};
use hums_base::{output, printable};
use hums_report::report::{self, What};
use serde_json::json;

fn main() -> ExitCode {
    exit_code(run(env::args_os().skip(1)))
}

fn run(mut arguments: impl Iterator<Item = OsString>) -> Result<Outcome> {
    let command = arguments.next().unwrap_or_default();
    let inputs: Vec<PathBuf> = arguments.map(PathBuf::from).collect();
    match command.to_str() {
        Some("check") => check(&inputs),
        Some("report") => report(&inputs, false),
        Some("compare") => report(&inputs, true),
        _ => Err(usage("the first argument is check, report or compare")),
    }
}

fn check(inputs: &[PathBuf]) -> Result<Outcome> {
    let request = check::Request {
        inputs,
        params: None,
        past: &[],
        session: None,
        system: None,
        verbose: false,
        salvage: false,
        json: true,
    };
    check::run_showing(&request, |checked| {
        output::json_line(
            &json!({ "screen": shown(&printable::lines(&text::screen(checked, false)), false) }).to_string(),
        )
    })
}

fn report(inputs: &[PathBuf], compare: bool) -> Result<Outcome> {
    let output = Some(Path::new("pages/"));
    let request = report::Request {
        inputs,
        output,
        session: None,
        compare,
        system: None,
        map: None,
        force: false,
        json: false,
    };
    report::run_into(&request, &mut |path, what, html, _| {
        let (log, system) = if let What::Session(place, system) = what {
            (Some(&place.title), *system)
        } else {
            (None, None)
        };
        output::json_line(
            &json!({ "page": path.file_name().map(Path::new), "log": log, "system": system, "html": html })
                .to_string(),
        )
    })
}
