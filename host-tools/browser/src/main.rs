//! `hums check` and `hums report` in a browser.
//!
//! A worker of the page (`worker.js`) runs this program with WASI, the system interface of WebAssembly. The dropped files are
//! its files, read in slices. So the readers, the checks and the report are those of `hums`.
//!
//! ```text
//! hums-browser check INPUT...          two lines for each log: {"screen": TEXT, "state": WORD, "reasons": TEXT}, of which
//!                                      the last is the list of checks without data; then the object of `hums check --json`
//! hums-browser report SYSTEM SESSION INPUT...
//!                                      a line for each page: {"page": FILE, "log": LOG or null, "html": TEXT}; SYSTEM is the
//!                                      id of one vehicle of a recording of several, SESSION one log of a card, or `-`
//! hums-browser compare INPUT...        the same of the flights side by side
//! ```
//!
//! Remarks and errors go to standard error.

use std::env;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Result;
use hums_analysis::check::{self, text, text::UnjudgedList};
use hums_base::colour::shown;
use hums_base::outcome::{Outcome, exit_code, usage};
use hums_base::{output, printable};
use hums_report::report::{self, PageKind};
use serde_json::json;

fn main() -> ExitCode {
    exit_code(run(env::args_os().skip(1)))
}

fn run(mut arguments: impl Iterator<Item = OsString>) -> Result<Outcome> {
    let command = arguments.next().unwrap_or_default();
    let inputs: Vec<PathBuf> = arguments.map(PathBuf::from).collect();
    match (command.to_str(), inputs.as_slice()) {
        (Some("check"), _) => check(&inputs),
        (Some("report"), [system, session, inputs @ ..]) => {
            let session = session.to_str().filter(|session| *session != "-");
            report(inputs, "pages/", system.to_str().and_then(|id| id.parse().ok()), session)
        }
        (Some("compare"), _) => report(&inputs, "flights.html", None, None),
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
        let plain = |text: &str| shown(&printable::lines(text), false).to_string();
        let screen = plain(&text::screen(checked, UnjudgedList::Counted("")));
        let reasons = plain(&text::reasons(&checked.judged));
        let line = json!({ "screen": screen, "state": text::state(checked), "reasons": reasons });
        output::json_line(&line.to_string())
    })
}

/// A folder is for a page of each session, a file for one of all side by side.
fn report(inputs: &[PathBuf], output: &str, system: Option<u8>, session: Option<&str>) -> Result<Outcome> {
    let request = report::Request {
        inputs,
        output: Some(output.as_ref()),
        session,
        compare: !output.ends_with('/'),
        system,
        map: None,
        force: false,
        json: false,
    };
    report::run_into(&request, &mut |path, what, html, _| {
        let log = if let PageKind::Session(place) = what { Some(&place.title) } else { None };
        let page = path.file_name().map(|name| name.to_string_lossy());
        output::json_line(&json!({ "page": page, "log": log, "html": html }).to_string())
    })
}
