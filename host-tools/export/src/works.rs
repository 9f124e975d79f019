//! The logs of one command, and the names of their files.

use anyhow::Result;

use super::context::Formats;
use crate::logs::sessions::Sessions;
use crate::logs::side_by_side::side_by_side;
use crate::naming::{self, LogFileName, Traits};
use crate::outcome::usage as usage_error;
use crate::source::recording::LogPlace;

pub(super) struct NamedLog<'a> {
    pub(super) log: &'a LogPlace,
    pub(super) traits: Traits,
    pub(super) named: LogFileName,
    /// It has no MAVLink frames.
    pub(super) is_native: bool,
}

pub(super) fn works<'a>(logs: &'a [LogPlace], sessions: &Sessions) -> Result<Vec<NamedLog<'a>>> {
    let mut traits = Vec::new();
    // A log that cannot be read is named all the same: reading it says why.
    side_by_side(
        logs,
        |log| Traits::of(log).unwrap_or_default(),
        |found| {
            traits.push(found);
            Ok(())
        },
    )?;
    let logs: Vec<(&LogPlace, Traits)> = logs.iter().zip(traits).collect();
    let names = naming::names(&logs, sessions);
    let work = |((log, traits), named)| NamedLog { log, traits, named, is_native: false };
    Ok(logs.into_iter().zip(names).map(work).collect())
}

pub(super) fn check_forms(works: &mut [NamedLog<'_>], formats: &Formats) -> Result<()> {
    let (mut of_frames, mut first) = (works.is_empty(), None);
    for work in works {
        if work.log.is_standard() {
            return Err(usage_error("-: a recording is read twice here; give a file"));
        }
        let foreign = work.log.own().is_none().then(|| work.log.open()).transpose()?;
        work.is_native = foreign.is_some_and(|open| !open.format.is_of_link());
        of_frames |= !work.is_native;
        if work.is_native && first.is_none() {
            first = without_frames(work, formats)?;
        }
    }
    first.filter(|_| !of_frames).map_or(Ok(()), |why| Err(usage_error(why)))
}

pub(super) fn without_frames(work: &NamedLog<'_>, formats: &Formats) -> Result<Option<String>> {
    let Some(about) = formats.about().find(|about| work.is_native && about.is_of_frames) else {
        return Ok(None);
    };
    Ok(Some(format!(
        "{}: is {}, which has no MAVLink frames for a {}; --format csv, jsonl or parquet has all of it",
        work.log.title,
        work.log.open()?.format.with_article(),
        about.name
    )))
}
