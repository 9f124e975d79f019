//! What came, judged as `hums verify` judges it, in one reading.
//!
//! Of a session of which only some logs were asked for, those that follow each other are one log: what is missing before it and
//! after it was left out on purpose.

use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::Result;
use serde::Serialize;

use crate::logs::{self, segment_name};
use crate::outcome::Outcome;
use crate::summary::Overview;
use crate::verify::{Extent, failed, verify_each};

/// A log that came, or was there already.
#[derive(Debug, Serialize)]
pub(super) struct LogJson {
    /// As the board calls it.
    pub(super) name: String,
    pub(super) path: PathBuf,
    /// It was not there already.
    pub(super) is_new: bool,
    /// `hums verify` finds no fault with the logs of its session that came and follow each other.
    pub(super) whole: bool,
}

/// Logs of a session that follow each other.
#[derive(Debug)]
struct Run {
    /// The session's number on its card, where they have the names of a card's logs.
    session: Option<u32>,
    /// Which of those that came.
    logs: Range<usize>,
    extent: Extent,
}

/// Judges logs, in the order of their names, with what they tell of each other, and says what is wrong with them; `all` are those of
/// the board.
pub(super) fn judge(all: &[String], pulled: &mut [LogJson]) -> Result<Outcome> {
    let mut rest = runs(all, pulled);
    let mut outcome = Outcome::Done;
    // Of a session only one run at once: what is missing between two would be missing in it.
    while !rest.is_empty() {
        let (mut now, mut later) = (Vec::<Run>::new(), Vec::new());
        for run in rest {
            let is_second = run.session.is_some() && now.iter().any(|other| other.session == run.session);
            if is_second { &mut later } else { &mut now }.push(run);
        }
        outcome = outcome.and(judge_at_once(&now, pulled)?);
        rest = later;
    }
    Ok(outcome)
}

fn judge_at_once(runs: &[Run], pulled: &mut [LogJson]) -> Result<Outcome> {
    let of = |run: &Run| pulled.get(run.logs.clone()).unwrap_or_default().iter().map(|log| log.path.clone());
    let paths: Vec<PathBuf> = runs.iter().flat_map(of).collect();
    let found = match (logs::find(&paths, false), runs) {
        (Ok(found), _) => found,
        // One of them is no log.
        (Err(error), [run]) => {
            note!("{error:#}");
            return Ok(tell(run, pulled, &[]));
        }
        (Err(_), _) => {
            return runs.iter().try_fold(Outcome::Done, |all, run| {
                Ok(all.and(judge_at_once(std::slice::from_ref(run), pulled)?))
            });
        }
    };
    let mut outcome = Outcome::Done;
    let unread = verify_each(&found, |overview| {
        let Some(run) = runs.iter().find(|run| is_of(overview, run, pulled)) else { return Ok(()) };
        let failed = failed(overview, run.extent);
        if !failed.is_empty() {
            outcome = tell(run, pulled, &failed);
        }
        Ok(())
    })?;
    Ok(outcome.and(Outcome::lossy(unread > 0)))
}

/// Whether a log that was read is this run.
fn is_of(overview: &Overview, run: &Run, pulled: &[LogJson]) -> bool {
    let names = || overview.ending.files.iter().map(|file| Path::new(file).file_name());
    pulled
        .get(run.logs.clone())
        .unwrap_or_default()
        .iter()
        .any(|log| names().any(|name| name == log.path.file_name()))
}

/// Says what is wrong with a run.
fn tell(run: &Run, pulled: &mut [LogJson], failed: &[(&'static str, String)]) -> Outcome {
    let logs = pulled.get_mut(run.logs.clone()).unwrap_or_default();
    let name = logs.last().map_or("", |log| &log.name);
    for (check, why) in failed {
        note!("{name}: {check}: {why}; `hums verify` says more");
    }
    for log in logs {
        log.whole = false;
    }
    Outcome::Losses
}

fn runs(all: &[String], pulled: &[LogJson]) -> Vec<Run> {
    let named = |name: &str| segment_name(Path::new(name)).map(|name| (name.session, name.segment));
    let last_of = |session| all.iter().filter_map(|name| named(name)).filter(|name| name.0 == session).max();
    let mut runs: Vec<Run> = Vec::new();
    let mut before = None;
    for (at, log) in pulled.iter().enumerate() {
        let name = named(&log.name);
        let is_next = before.zip(name).is_some_and(|(before, name): ((u32, u32), (u32, u32))| {
            before.0 == name.0 && before.1.checked_add(1) == Some(name.1)
        });
        before = name;
        let to_end = name.is_none_or(|name| last_of(name.0) <= Some(name));
        if let Some(run) = runs.last_mut().filter(|_| is_next) {
            (run.logs.end, run.extent.to_end) = (at + 1, to_end);
        } else {
            let from_start = name.is_none_or(|name| name.1 == 0);
            let (session, extent) = (name.map(|name| name.0), Extent { from_start, to_end });
            runs.push(Run { session, logs: at..at + 1, extent });
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::compare::heading_here;
    use super::super::tests::packed;
    use super::*;

    const NAME: &str = "00001_00.HUM";
    const SECTOR: usize = 512;
    const GROUP: usize = 64 * SECTOR;

    /// Judges these bytes as the board's log of this name, which the board has besides others.
    fn judged(bytes: &[u8], name: &str, others: &[&str]) -> (Outcome, bool) {
        let dir = tempfile::tempdir().expect("a folder");
        let came = dir.path().join("came");
        fs::write(&came, bytes).expect("written");
        let own = heading_here(&came, name, bytes.len() as u32).expect("it reads").name;
        let path = dir.path().join(own);
        fs::rename(&came, &path).expect("renamed");
        let all: Vec<String> = [name].iter().chain(others).map(|name| (*name).to_owned()).collect();
        let mut logs = [LogJson { name: name.to_owned(), path, is_new: true, whole: true }];
        let outcome = judge(&all, &mut logs).expect("it reads");
        (outcome, logs[0].whole)
    }

    const HOLDS: (Outcome, bool) = (Outcome::Done, true);
    const FAILS: (Outcome, bool) = (Outcome::Losses, false);

    #[test]
    fn a_log_is_whole_where_verify_says_so() {
        let dir = tempfile::tempdir().expect("a folder");
        let whole = packed(dir.path(), "px4_hil_quad_low.tlog");
        let cut = &whole[..80 * SECTOR];
        assert_eq!(judged(&whole, NAME, &[]), HOLDS);
        assert_eq!(judged(cut, NAME, &[]), FAILS, "it has no end");
        assert_eq!(judged(&[cut, &[0x5a; 4096]].concat(), NAME, &[]), FAILS);
        assert_eq!(judged(cut, NAME, &["00001_01.HUM"]), HOLDS, "its end is in another one");
        assert_eq!(judged(b"no log at all", NAME, &[]), FAILS);
    }

    #[test]
    fn what_a_recycled_file_held_before_is_no_damage_and_what_is_in_the_middle_is() {
        let dir = tempfile::tempdir().expect("a folder");
        let new = packed(dir.path(), "px4_hil_quad_low.tlog");
        let old = packed(dir.path(), "ap_quad_guided.tlog");
        let first = |bytes: &[u8]| judged(bytes, NAME, &[]);
        assert_eq!(first(&[&new[..], &old[new.len()..]].concat()), HOLDS);
        // A further segment does not begin with the session's first sector; a first one does.
        let further = |bytes: &[u8]| judged(bytes, "00001_01.HUM", &[NAME]);
        assert_eq!(further(&new[2 * GROUP..]), HOLDS);
        assert_eq!(first(&new[2 * GROUP..]), FAILS);
        let middle = new.len() / 1024 * SECTOR;
        for spoiled in [&old[middle..middle + GROUP], &vec![0; GROUP]] {
            let mut mixed = new.clone();
            mixed[middle..middle + GROUP].copy_from_slice(spoiled);
            assert_eq!(first(&mixed), FAILS);
            assert_eq!(further(&mixed[2 * GROUP..]), FAILS);
            // At its beginning: that is none of what was not asked for.
            let mut begins_later = new[2 * GROUP..].to_vec();
            begins_later[..GROUP].copy_from_slice(spoiled);
            assert_eq!(further(&begins_later), FAILS);
        }
    }

    #[test]
    fn logs_of_a_session_that_follow_each_other_are_one_run() {
        let named = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
        let all =
            named(&["00001_00.HUM", "00001_01.HUM", "00001_02.HUM", "00001_03.HUM", "00002_04.HUM", "x"]);
        let runs_of = |names: &[&str]| -> Vec<_> {
            let log = |name| LogJson { path: PathBuf::from(&name), name, is_new: true, whole: true };
            let logs: Vec<_> = named(names).into_iter().map(log).collect();
            let extent = |run: Run| (run.logs, run.extent.from_start, run.extent.to_end);
            runs(&all, &logs).into_iter().map(extent).collect()
        };
        let whole = ["00001_00.HUM", "00001_01.HUM", "00001_02.HUM", "00001_03.HUM", "00002_04.HUM", "x"];
        assert_eq!(runs_of(&whole), [(0..4, true, true), (4..5, false, true), (5..6, true, true)]);
        let some = ["00001_00.HUM", "00001_02.HUM", "00001_03.HUM"];
        assert_eq!(runs_of(&some), [(0..1, true, false), (1..3, false, true)]);
    }
}
