//! `hums pull --around`: over a slow radio a crash's minute first. The moment is found by random access ([`super::moment`]), and
//! what was recorded round it becomes a part of the log ([`super::part`]). What cannot be read of it, or of what was searched, is told.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_core::health::Level;
use hums_core::time::{Instant, Span};

use super::ftp::Ftp;
use super::moment::{Sectors as _, between, first_group, group_before, group_of};
use super::remote::Remote;
use super::stretch::{Reading, Stretch, Unread, by_number};
use crate::cli::Around;
use crate::outcome::Outcome;
use crate::summary::FindingLine;
use crate::utc::{When, date_and_time, moment};

/// What was brought.
#[derive(Debug)]
pub(super) struct Brought {
    /// The log's name on the board, and the part.
    pub(super) parts: Vec<(String, PathBuf)>,
    /// None where no finding that is wanted is in what could be read.
    pub(super) at: Option<Instant>,
    /// The finding, where one was asked for.
    pub(super) found: Option<FindingLine>,
    /// Sectors of other sessions that came, and are in no part.
    pub(super) strange: u64,
    /// Whether all that was asked for could be read. What could not is told.
    pub(super) outcome: Outcome,
}

/// Brings what these logs, those of one session in their order, have round a moment: so much before and after it.
pub(super) fn pull(
    ftp: &mut Ftp,
    names: &[String],
    output: &Path,
    what: &Around,
    span: Span,
) -> Result<Brought> {
    let mut board = Board { ftp, names, output, strange: BTreeSet::new() };
    let (mut outcome, mut found, mut epoch_us) = (Outcome::Done, None, None);
    let at = match what {
        Around::Time(When::Seconds(micros)) => Instant::from_micros(*micros),
        Around::Time(When::Utc(utc_us)) => {
            let began = board.epoch_us()?;
            epoch_us = Some(began);
            let micros = utc_us.checked_sub(began).with_context(|| {
                format!(
                    "the newest session began later, {} UTC; name the logs of another one",
                    date_and_time(began)
                )
            })?;
            Instant::from_micros(micros)
        }
        Around::Level(_) | Around::Check(_) => {
            let searched = board.latest(what)?;
            outcome = searched.tell();
            let Some(latest) = searched.found else {
                let parts = parts_of(&searched.stretches);
                return Ok(Brought {
                    parts,
                    at: None,
                    found: None,
                    strange: board.strange.len() as u64,
                    outcome,
                });
            };
            found.insert(latest).at
        }
    };
    let (from, to) = (Instant::from_micros(at.as_micros().saturating_sub(span.as_micros())), at + span);
    let stretches = board.bring(from, to)?;
    if stretches.is_empty() {
        bail!("what the board gives of this session begins after {}", moment(to));
    }
    let readings = by_number(&stretches).map(Reading::of).collect::<Result<Vec<_>>>()?;
    outcome = outcome.and(check_recorded(at, &readings, names, epoch_us)?);
    for reading in &readings {
        // The moment goes on behind all that the board has.
        let to_end = reading.is_to_end(names) && reading.span().is_none_or(|(_, end)| end < to);
        for fault in reading.faults(to_end) {
            note!("{}: of the moment: {fault}; `hums verify` says more", reading.name());
            outcome = Outcome::Losses;
        }
    }
    Ok(Brought {
        parts: parts_of(&stretches),
        at: Some(at),
        found,
        strange: board.strange.len() as u64,
        outcome,
    })
}

fn parts_of(stretches: &[Stretch]) -> Vec<(String, PathBuf)> {
    stretches.iter().map(|stretch| (stretch.name.clone(), stretch.path.clone())).collect()
}

/// Refuses a moment at which nothing was recorded. Where something cannot be read, it may be that: then it is told.
fn check_recorded(
    at: Instant,
    readings: &[Reading],
    names: &[String],
    epoch_us: Option<u64>,
) -> Result<Outcome> {
    let spans = || readings.iter().filter_map(|reading| Some((reading.span()?, reading.goes_on(names))));
    if spans().any(|((first, last), goes_on)| first <= at && (at <= last || goes_on)) {
        return Ok(Outcome::Done);
    }
    let words = |at: Instant| {
        let utc = epoch_us.map(|epoch_us| format!(" ({} UTC)", date_and_time(epoch_us + at.as_micros())));
        moment(at) + &utc.unwrap_or_default()
    };
    let before = spans().map(|((_, last), _)| last).filter(|last| *last < at).max();
    let after = spans().map(|((first, _), _)| first).filter(|first| *first > at).min();
    let why = match (before, after) {
        (Some(end), None) => format!("what the board gives of this session ends at {}", words(end)),
        (None, Some(start)) => format!("what the board gives of this session begins at {}", words(start)),
        (Some(end), Some(start)) => {
            format!("nothing is recorded between {} and {}", words(end), words(start))
        }
        (None, None) => "nothing of the moment can be read".to_owned(),
    };
    if readings.iter().all(|reading| reading.unread().is_none()) {
        bail!("{why}; for another session name its logs");
    }
    note!("nothing that can be read was recorded at {}: {why}", words(at));
    Ok(Outcome::Losses)
}

/// What a search has found.
struct Searched {
    found: Option<FindingLine>,
    /// What was looked at and could not be read.
    unread: Option<Unread>,
    /// All that was looked at.
    stretches: Vec<Stretch>,
}

impl Searched {
    /// Says what was found, and what it does not know.
    fn tell(&self) -> Outcome {
        let unread = self.unread.as_ref().map(Unread::words);
        if let Some(FindingLine { check, level, at, .. }) = &self.found {
            note!("{check}: {level} at {}", moment(*at));
        }
        if let Some(unread) = &unread {
            let what = if self.found.is_some() { "that is the latest" } else { "no such finding is" };
            note!("{what} in what could be read: {unread}, where one may be");
        }
        Outcome::lossy(unread.is_some())
    }
}

/// The logs of a session on a board.
struct Board<'a> {
    ftp: &'a mut Ftp,
    names: &'a [String],
    output: &'a Path,
    /// Sectors of other sessions that came, by their logs and places.
    strange: BTreeSet<(String, u32)>,
}

impl Board<'_> {
    /// Brings what was recorded from one time to the other.
    fn bring(&mut self, from: Instant, to: Instant) -> Result<Vec<Stretch>> {
        let mut stretches = Vec::new();
        for name in self.names.iter().rev() {
            let mut log = Remote::open(self.ftp, name, self.output)?;
            let first = first_group(&mut log)?;
            // A group may begin in the log before: the first sectors of this one are its last ones.
            if first.is_some_and(|first| first.place == 0 && first.at > to) && stretches.is_empty() {
                continue;
            }
            let places = between(&mut log, from, to)?;
            stretches.insert(0, log.bring(places)?);
            log.add_strange(&mut self.strange);
            if first.is_some_and(|first| first.at <= from) {
                break;
            }
        }
        Ok(stretches)
    }

    /// UTC at power-on, microseconds since 1970, by what the newest of the logs that knows it learned last.
    fn epoch_us(&mut self) -> Result<u64> {
        for name in self.names.iter().rev() {
            let mut log = Remote::open(self.ftp, name, self.output)?;
            let count = log.count();
            let start = group_of(&mut log, count.saturating_sub(1))?;
            if let Some(epoch_us) = start.and_then(|start| start.epoch_us) {
                return Ok(epoch_us);
            }
            // It may have been learned since the group began.
            let Some(start) = start else { continue };
            let group = log.bring(start.place..count)?;
            if let Some(epoch_us) = Reading::of(&[group])?.epoch_us() {
                return Ok(epoch_us);
            }
        }
        bail!(
            "nothing that can be read told this session the time of day; say the time since its beginning, as --around 4:20"
        )
    }

    /// The latest finding that is wanted: the logs are read from their end backwards, group by group, until it comes.
    fn latest(&mut self, what: &Around) -> Result<Searched> {
        let (mut found, mut stretches) = (None, Vec::new());
        for name in self.names.iter().rev() {
            let mut log = Remote::open(self.ftp, name, self.output)?;
            let count = log.count();
            let mut end = count;
            while end > 0 && found.is_none() {
                let place = group_before(&mut log, end)?;
                let group = Reading::of(&[log.bring(place..end)?])?;
                found = wanted(&group, what);
                end = place;
                if let (None, Some((first, _))) = (&found, group.span()) {
                    note!("{name}: none in what can be read from {} on; looking before that", moment(first));
                }
            }
            stretches.insert(0, log.stretch(end..count));
            log.add_strange(&mut self.strange);
            if found.is_some() {
                break;
            }
        }
        // All of it once more: a group may begin in one log and end in the next one.
        let mut unread: Option<Unread> = None;
        for stretches in by_number(&stretches) {
            let reading = Reading::of(stretches)?;
            unread =
                unread.map_or(reading.unread(), |all| Some(reading.unread().map_or(all, |one| all.and(one))));
            found = found.into_iter().chain(wanted(&reading, what)).max_by_key(|found| found.at);
        }
        Ok(Searched { found, unread, stretches })
    }
}

/// The latest finding in what was read that is asked for.
fn wanted(reading: &Reading, what: &Around) -> Option<FindingLine> {
    reading.findings().iter().rfind(|finding| is_wanted(what, &finding.check, finding.level)).cloned()
}

/// Whether a change of level is one that is asked for: that all is well again is none.
fn is_wanted(what: &Around, check: &str, level: &str) -> bool {
    let is_bad = [Level::Warning, Level::Critical].map(Level::name).contains(&level);
    match what {
        Around::Level(Level::Critical) => level == Level::Critical.name(),
        Around::Level(_) => is_bad,
        Around::Check(name) => is_bad && check == name,
        Around::Time(_) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finding_that_is_asked_for_is_one_that_is_bad() {
        let critical: Around = "critical".parse().expect("good");
        let warning: Around = "warning".parse().expect("good");
        let check: Around = "motor_loss".parse().expect("good");
        for (level, wanted) in [
            (Level::Ok, [false, false, false]),
            (Level::Advisory, [false, false, false]),
            (Level::Warning, [false, true, true]),
            (Level::Critical, [true, true, true]),
            (Level::Stale, [false, false, false]),
        ] {
            assert_eq!(
                [&critical, &warning, &check].map(|what| is_wanted(what, "motor_loss", level.name())),
                wanted
            );
        }
        assert!(!is_wanted(&check, "cell_voltage", Level::Critical.name()));
    }
}
