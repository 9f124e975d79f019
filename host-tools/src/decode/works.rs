//! The logs of one command: what each is called, and which of them are what an earlier run has made of the others.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Result;

use super::context::Formats;
use super::naming::{self, Named, Traits};
use crate::files::FileId;
use crate::logs::sessions::Sessions;
use crate::logs::side_by_side::side_by_side;
use crate::outcome::usage as usage_error;
use crate::source::recording::Place;

/// A log, and what its files are called.
pub(super) struct Work<'a> {
    pub(super) log: &'a Place,
    pub(super) traits: Traits,
    pub(super) named: Named,
}

/// All logs of a command.
pub(super) struct Works<'a> {
    /// Those that are decoded.
    pub(super) works: Vec<Work<'a>>,
    /// Recordings that this command makes of another one, which stands behind: an earlier run has.
    pub(super) earlier: Vec<(&'a Path, &'a str)>,
}

impl<'a> Works<'a> {
    /// Names the logs. `tlog` is where the tlog of a name goes.
    pub(super) fn of(logs: &'a [Place], sessions: &Sessions, tlog: impl Fn(&str) -> PathBuf) -> Result<Self> {
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
        let logs: Vec<(&Place, Traits)> = logs.iter().zip(traits).collect();
        let target = |(log, traits): &(&Place, Traits)| FileId::of(&tlog(&traits.name(log))).ok();
        let targets: BTreeMap<FileId, &Place> =
            logs.iter().filter_map(|log| Some((target(log)?, log.0))).collect();
        let (mut earlier, mut named) = (Vec::new(), Vec::new());
        for (log, traits) in logs {
            let made = log.path().and_then(|path| Some((path, *targets.get(&FileId::of(path).ok()?)?)));
            match made.filter(|(_, of)| of.title != log.title) {
                Some((path, of)) => earlier.push((path, of.title.as_str())),
                None => named.push((log, traits)),
            }
        }
        let names = naming::names(&named, sessions);
        let works = named.into_iter().zip(names).map(|((log, traits), named)| Work { log, traits, named });
        Ok(Self { works: works.collect(), earlier })
    }
}

/// Whether any of these has messages of its own instead of MAVLink's; an error where one cannot become what is asked for.
pub(super) fn check_forms(works: &[Work<'_>], formats: Formats) -> Result<bool> {
    let mut native = false;
    for place in works.iter().map(|work| work.log).filter(|place| place.own().is_none()) {
        if place.is_standard() {
            return Err(usage_error("-: a recording is read twice here; give a file"));
        }
        let format = place.open()?.format;
        if !format.is_of_link() {
            native = true;
            if formats.tlog {
                return Err(usage_error(format!(
                    "{}: is {}, which has no MAVLink frames for a tlog; --format csv, jsonl or parquet has all of it",
                    place.title,
                    format.with_article()
                )));
            }
        }
    }
    Ok(native)
}
