//! Verifies downloaded logs as `hums info --verify` does their folder. A file left out on purpose is not
//! missing.

use std::path::{Path, PathBuf};
use std::slice;

use anyhow::Result;
use serde::Serialize;

use super::number;
use crate::ending::EndJson;
use crate::logs;
use crate::outcome::Outcome;
use crate::summary::Overview;
use crate::verify::{failed, verify_each};

const NEED_ALL_FILES: [&str; 5] = ["sector sequence", "group decoding", "frames missing", "files", "end"];
const NEEDS_LOG_BEFORE: &str = "session before";

#[derive(Debug, Serialize)]
pub(super) struct LogJson {
    /// Name on the box.
    pub(super) name: String,
    /// The file.
    pub(super) path: PathBuf,
    /// Downloaded in this run.
    pub(super) is_new: bool,
    /// `hums info --verify` finds no fault, and the end is proved if all files of the log were requested; false for a part.
    pub(super) whole: bool,
    /// In the last file of a log, if all of its files were requested.
    pub(super) end: Option<EndJson>,
}

impl LogJson {
    /// The other fields are for [`judge`].
    pub(super) const fn new(name: String, path: PathBuf, is_new: bool) -> Self {
        Self { name, path, is_new, whole: false, end: None }
    }
}

/// Prints faults and missing proofs. `left_out`: not requested.
pub(super) fn judge(left_out: &[String], pulled: &mut [LogJson]) -> Result<Outcome> {
    let (mut outcome, mut paths) = (Outcome::Done, Vec::new());
    for log in &*pulled {
        match logs::find(slice::from_ref(&log.path), false) {
            Ok(_) => paths.push(log.path.clone()),
            Err(error) => {
                note!("{error:#}");
                outcome = Outcome::Losses;
            }
        }
    }
    let found = logs::find(&paths, false)?;
    for remark in &found.remarks {
        note!("{remark}");
    }
    let unread = verify_each(&found, |overview| {
        outcome = outcome.and(tell(overview, left_out, pulled));
        Ok(())
    })?;
    Ok(outcome.and(Outcome::lossy(unread > 0)))
}

fn tell(overview: &Overview, left_out: &[String], pulled: &mut [LogJson]) -> Outcome {
    let ending = &overview.ending;
    let is_of = |log: &&mut LogJson| {
        let mut names = ending.files.iter().map(|file| Path::new(file).file_name());
        names.any(|name| name == log.path.file_name())
    };
    let mut files: Vec<&mut LogJson> = pulled.iter_mut().filter(is_of).collect();
    let Some(own) = files.first().and_then(|log| number(&log.name)) else { return Outcome::Done };
    let has_all_files = left_out.iter().all(|name| number(name) != Some(own));
    let has_log_before = left_out.iter().all(|name| number(name).is_none_or(|number| number > own));
    let is_judged = |check: &str| match check {
        NEEDS_LOG_BEFORE => has_log_before,
        check => has_all_files || !NEED_ALL_FILES.contains(&check),
    };
    let mut faults = failed(overview);
    faults.retain(|(check, _)| is_judged(check));
    let is_proved = !has_all_files || ending.proof.is_whole() || ending.aside().is_some();
    for log in &mut files {
        log.whole = faults.is_empty();
    }
    if has_log_before && ending.is_without_earlier() {
        note!("{}: the logs that were recorded before it on this card did not come", ending.name);
    }
    if let Some(last) = files.last_mut() {
        for (check, why) in &faults {
            note!("{}: {check}: {why}; `hums info --verify` says more", last.name);
        }
        if faults.is_empty() && !is_proved {
            note!("{}: {}", last.name, ending.words());
            last.whole = false;
        }
        last.end = has_all_files.then(|| EndJson::new(ending));
    }
    Outcome::lossy(!faults.is_empty())
}
