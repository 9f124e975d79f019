//! Reads all found logs, one after the other.

use anyhow::{Result, bail};

use crate::check;
use crate::followed::{EndResolver, HELD_MAX};
use crate::logs::sessions::Sessions;
use crate::logs::side_by_side::side_by_side;
use crate::outcome::Outcome;
use crate::plural::count;
use crate::source::find::{FoundRecordings, sessions_of};
use crate::summary::Overview;

pub(super) struct Read {
    outcome: Outcome,
    failed: u64,
    all: usize,
}

impl Read {
    pub(super) fn end(self) -> Result<Outcome> {
        if self.failed > 0 {
            bail!("{} of {} could not be read", self.failed, count(self.all as u64, "log"));
        }
        Ok(self.outcome)
    }
}

/// Shows each with the others' evidence about its end, for which those beside one session are read too.
pub(super) fn each(
    found: &FoundRecordings,
    wanted: Option<usize>,
    mut show: impl FnMut(&Overview) -> Result<()>,
) -> Result<Read> {
    let beside = |index: usize| index.saturating_sub(HELD_MAX)..index.saturating_add(HELD_MAX + 1);
    let range = wanted.map_or(0..usize::MAX, beside);
    let places = found.places.get(range.start..range.end.min(found.places.len())).unwrap_or_default();
    let name = wanted.and_then(|wanted| found.places.get(wanted)).map(|place| &place.name);
    for remark in &found.remarks {
        note!("{remark}");
    }
    for (_, error) in &found.failed {
        note!("{error:#}");
    }
    let mut outcome = Outcome::lossy(found.is_lossy());
    let done = |overview: &Overview| {
        if name.is_some_and(|name| overview.ending.name != *name) {
            return Ok(());
        }
        outcome = outcome.and(Outcome::lossy(!overview.is_sound()));
        show(overview)
    };
    let inputs_failed = found.failed.len();
    let all = places.len() + inputs_failed;
    let failed = read_each(places, sessions_of(&found.places), check::overview, all == 1, done)?;
    Ok(Read { outcome, failed: failed + inputs_failed as u64, all })
}

/// Hands each log on in order, with the other logs' evidence about its end. Returns the number of unreadable logs, which
/// are reported. With `is_one` an unreadable log is an error.
pub fn read_each<P: Sync>(
    places: &[P],
    sessions: Sessions,
    read: impl Fn(&P) -> Result<Overview> + Sync,
    is_one: bool,
    mut done: impl FnMut(&Overview) -> Result<()>,
) -> Result<u64> {
    let (mut followed, mut failed) = (EndResolver::new(sessions), 0);
    side_by_side(places, read, |overview| match overview {
        Ok(overview) => followed.push(overview).iter().try_for_each(&mut done),
        Err(error) if is_one => Err(error),
        Err(error) => {
            failed += 1;
            note!("{error:#}");
            Ok(())
        }
    })?;
    followed.finish().try_for_each(|overview| done(&overview))?;
    Ok(failed)
}
