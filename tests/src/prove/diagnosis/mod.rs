//! The judge of the diagnosis: what the monitor finds of known faults, how fast, and how often it alarms for nothing.
//!
//! Flights are recordings with labels (`labels`), kept apart in sets by who knew them when the limits were chosen (`sets`).
//! Each is judged by the monitor as `hums check` runs it (`outcome`); what comes of all of them are the tables of
//! `docs/diagnosis.md` (`document`). Recordings of other people have no labels; of those that were judged by hand `verdicts` knows what
//! was true. It is no campaign of `docs/proof.md`: those try what is promised, and this one measures
//! what is not perfect.

mod alarms;
mod bound;
mod by_hand;
mod causes;
mod document;
mod faults;
mod judged;
mod labels;
mod options;
mod outcome;
mod rates;
mod sets;
mod short;
mod summary;
mod table;
mod verdicts;

use std::fs;

use anyhow::{Context as _, Result};

use crate::flights::root;
use judged::judge_all;
pub use options::Flights;

/// What `prove` calls it.
pub const DIAGNOSIS: &str = "diagnosis";
/// What it does, for a list.
pub const ABOUT: &str = "faults found and false alarms, on labelled flights";

/// Judges flights; the text to print. `commit` is asked for the commit where the
/// document is written.
pub fn run(flights: &Flights, commit: impl FnOnce() -> Result<String>) -> Result<String> {
    if flights.short {
        return short::run();
    }
    let commit = if flights.write { Some(commit()?) } else { None };
    let judged = sets::find_all(flights)?.iter().map(judge_all).collect::<Result<Vec<_>>>()?;
    let text = document::text(&judged);
    if let Some(commit) = commit {
        let path = root().join("docs/diagnosis.md");
        let whole = format!("{}\nCommit {commit}.\n\n{text}", document::HEAD);
        fs::write(&path, whole).with_context(|| path.display().to_string())?;
    }
    Ok(format!("{text}\n{}", document::details(&judged)))
}
