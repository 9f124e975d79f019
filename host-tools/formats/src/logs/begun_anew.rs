//! Files that the recorder had just begun to rewrite when power failed.
//!
//! A full card's oldest file gets the next name before its first new sector is written. If power fails in
//! between, that file has the newest number and holds an old log. Its beginning shows this: it names the session
//! that was recorded just before it, and that one is older than all logs on the card.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};

use hums_blackbox::record::{Before, Found};

use super::groups::at_beginning;
use super::places::Log;

/// Number of files that a start looks at (`SEGMENTS_MAX` of the recorder). A power-on's first log is at most
/// this many numbers after the session that it names.
pub const LOOKED_AT_MAX: u32 = 3;

/// A file of a full card that the recorder has renamed to rewrite it, with its old content still in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BegunAnew {
    /// The number of the log that it held.
    pub of: u32,
    /// The next start found that content under the new name. Without it, files may have been renamed.
    pub is_confirmed: bool,
}

impl BegunAnew {
    /// Its description, as a part of a sentence.
    pub fn words(self) -> String {
        let Self { of, is_confirmed } = self;
        let end = if is_confirmed { "as the next start found it" } else { "or files were renamed" };
        format!(
            "the recorder had just begun to write this file anew when power went: it still holds session {of:05}, the oldest one; {end}"
        )
    }
}

/// A log of a card that has a number and sectors.
pub(super) struct Known<'a> {
    pub(super) number: u32,
    /// The session of its first sector.
    pub(super) session: u32,
    pub(super) log: &'a Log,
}

/// The files begun anew, by their new numbers; several after several power cuts. `numbers` are those of all
/// logs of a card, `known` the ones with sectors, ordered by number.
pub(super) fn find(numbers: &BTreeSet<u32>, known: &[Known<'_>]) -> BTreeMap<u32, BegunAnew> {
    let mut all = BTreeMap::new();
    let oldest = numbers.first().copied().unwrap_or(0);
    for one in known {
        let is_between = |other: &Known<'_>, before: u32| {
            (before + 1..one.number).contains(&other.number) && other.session != one.session
        };
        let is_older = |before: &Before| {
            before.number < oldest
                && (one.number - before.number > LOOKED_AT_MAX
                    || known.iter().any(|other| is_between(other, before.number)))
        };
        if let Some(before) = before(one.log).filter(is_older) {
            all.insert(one.number, BegunAnew { of: before.number + 1, is_confirmed: false });
        }
    }
    // The next start names the last one of a series. Each of the series holds the recording after the one before it.
    let mut later: Option<(u32, BegunAnew)> = None;
    for (one, next) in known.iter().zip(known.iter().skip(1)).rev() {
        let is_found =
            before(next.log).is_some_and(|found| (found.number, found.session) == (one.number, one.session));
        if let Some(anew) = all.get_mut(&one.number) {
            let is_in_series = |(number, after): (u32, BegunAnew)| {
                number == next.number && after.is_confirmed && anew.of < after.of
            };
            anew.is_confirmed = is_found || later.is_some_and(is_in_series);
            later = Some((one.number, *anew));
        }
    }
    all
}

/// The last record of a log's beginning about the session before it on its card. An earlier one may be about another card.
fn before(log: &Log) -> Option<Before> {
    let last = Cell::new(None);
    let _: Option<()> = at_beginning(log, |boot| {
        if boot.before.found != Found::Unknown {
            last.set(Some(boot.before));
        }
        None
    });
    last.get()
}
