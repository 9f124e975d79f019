//! The judge of the monitor's diagnosis.
//!
//! Flights are recordings with labels (`labels`), in sets by whether they were known when the limits were chosen (`sets`); `real`
//! judges real flights, whose findings have labels.

mod alarms;
mod bound;
mod causes;
mod document;
mod faults;
mod judged;
mod labels;
mod options;
mod outcome;
mod rates;
mod real;
mod sets;
mod short;
mod summary;
mod table;

use std::fs;

use anyhow::{Context as _, Result};

use crate::flights::root;
use judged::judge_all;
pub use options::Flights;

/// Its name for `prove`.
pub const DIAGNOSIS: &str = "diagnosis";
/// Its description for a list.
pub const ABOUT: &str = "faults found and false alarms, on labelled flights";

/// Returns the text to print. `commit` is called if the document is written.
pub fn run(flights: &Flights, commit: impl FnOnce() -> Result<String>) -> Result<String> {
    if flights.short {
        return short::run();
    }
    let commit = if flights.write { Some(commit()?) } else { None };
    let (sets, reals) = sets::find_all(flights)?;
    let real = reals.iter().map(real::judge).collect::<Result<Vec<_>>>()?;
    let judged = sets.iter().map(judge_all).collect::<Result<Vec<_>>>()?;
    let text = document::text(&real, &judged);
    if let Some(commit) = commit {
        let path = root().join("docs/diagnosis.md");
        let whole =
            format!("{}\nCommit {commit} judged the flights of simulators.\n\n{text}", document::HEAD);
        fs::write(&path, whole).with_context(|| path.display().to_string())?;
    }
    Ok(format!("{text}\n{}", document::details(&real, &judged)))
}
