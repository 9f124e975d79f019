//! The logs of one command, and the names of their files.

use anyhow::Result;

use super::context::Formats;
use crate::logs::sessions::Sessions;
use crate::logs::side_by_side::side_by_side;
use crate::naming::{self, Named, Traits};
use crate::outcome::usage as usage_error;
use crate::source::recording::LogPlace;

pub(super) struct NamedLog<'a> {
    pub(super) log: &'a LogPlace,
    pub(super) traits: Traits,
    pub(super) named: Named,
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
    Ok(logs.into_iter().zip(names).map(|((log, traits), named)| NamedLog { log, traits, named }).collect())
}

/// Whether any of these has messages of its own instead of MAVLink's; an error if one cannot become the
/// requested format.
pub(super) fn check_forms(works: &[NamedLog<'_>], formats: &Formats) -> Result<bool> {
    let mut native = false;
    for place in works.iter().map(|work| work.log).filter(|place| place.own().is_none()) {
        if place.is_standard() {
            return Err(usage_error("-: a recording is read twice here; give a file"));
        }
        let format = place.open()?.format;
        if !format.is_of_link() {
            native = true;
            if let Some(about) = formats.about().find(|about| about.is_of_frames) {
                return Err(usage_error(format!(
                    "{}: is {}, which has no MAVLink frames for a {}; --format csv, jsonl or parquet has all of it",
                    place.title,
                    format.with_article(),
                    about.name
                )));
            }
        }
    }
    Ok(native)
}
