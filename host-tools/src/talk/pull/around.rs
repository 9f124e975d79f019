//! `hums box pull --around`: over a slow radio the minute of a crash first. Random access finds the moment
//! ([`super::moment`]), and the sectors around it become a part of the log ([`super::part`]). Unreadable
//! sectors in the part or in the search are reported.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::slice;

use anyhow::{Context as _, Result, bail};
use hums_core::clock::{Instant, Span};
use hums_core::health::Level;

use super::ftp::Ftp;
use super::moment::{Sectors as _, between, first_group, group_before};
use super::part::Part;
use super::remote::Remote;
use super::session::number as number_of;
use super::stretch::{Reading, Stretch, Unread, by_number};
use crate::cli::Around;
use crate::outcome::Outcome;
use crate::summary::FindingLine;
use crate::utc::{When, date_and_time, moment};

/// The result of a download.
#[derive(Debug)]
pub(super) struct Brought {
    /// The log's name on the board, and the part.
    pub(super) parts: Vec<(String, PathBuf)>,
    /// `None` if the readable sectors hold no such finding.
    pub(super) at: Option<Instant>,
    /// The finding, if one was requested.
    pub(super) found: Option<FindingLine>,
    /// Sectors of other sessions that came, and are not kept.
    pub(super) strange: u64,
    /// Whether all requested sectors were read. Unread ones are reported.
    pub(super) outcome: Outcome,
}

/// Downloads this span around a moment from the logs of one session, in their order. Other logs of the board
/// were left out on purpose.
pub(super) fn pull(
    ftp: &mut Ftp,
    names: &[String],
    left_out: &[String],
    output: &Path,
    (what, span): (&Around, Span),
) -> Result<Brought> {
    let mut board = Board::new(ftp, names, left_out, output);
    let (mut outcome, mut found, mut epoch_us) = (Outcome::Done, None, None);
    let at = match what {
        Around::Time(When::Seconds(micros)) => Instant::from_micros(*micros),
        Around::Time(When::Utc(utc_us)) => {
            let clock = board.clock(*utc_us)?;
            outcome = clock.tell();
            epoch_us = Some(clock.epoch_us);
            let micros = utc_us.checked_sub(clock.epoch_us).with_context(|| {
                format!(
                    "the newest session began later, {} UTC; name the logs of another one",
                    date_and_time(clock.epoch_us)
                )
            })?;
            Instant::from_micros(micros)
        }
        Around::Level(_) | Around::Check(_) => {
            let searched = board.latest(what)?;
            outcome = searched.tell();
            let Some(latest) = searched.found else {
                return Ok(Brought {
                    parts: Vec::new(),
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
    outcome = outcome.and(check_recorded(at, &readings, &board, epoch_us)?);
    if let Some(missing) = board.missing {
        note!("of the moment: {}: no log that the board gives has them", missing.words());
        outcome = Outcome::Losses;
    }
    let mut is_over = false;
    for reading in &readings {
        // Logs after one that goes beyond the moment do not count.
        let is_of_it = |unread: &Unread| !is_over && unread.is_within(from, to);
        // The board's logs end within the requested span.
        let to_end = reading.is_to_end(names) && reading.span().is_none_or(|(_, end)| end < to);
        for fault in reading.faults_of(is_of_it, to_end) {
            note!("{}: of the moment: {fault}; `hums info --verify` says more", reading.name());
            outcome = Outcome::Losses;
        }
        is_over |= reading.span().is_some_and(|(_, end)| end > to);
        if let Some(words) = reading.unproved_end().filter(|_| to_end) {
            note!("{}: {words}", reading.name());
        }
    }
    Ok(Brought {
        parts: board.finish(&stretches)?,
        at: Some(at),
        found,
        strange: board.strange.len() as u64,
        outcome,
    })
}

/// Refuses a moment without a recording. If a sector is unreadable, the recording may be there; then this is
/// reported.
fn check_recorded(
    at: Instant,
    readings: &[Reading],
    board: &Board<'_>,
    epoch_us: Option<u64>,
) -> Result<Outcome> {
    let Board { names, left_out, missing, next, .. } = board;
    let spans = || readings.iter().filter_map(|reading| Some((reading, reading.span()?)));
    if spans().any(|(log, (first, last))| first <= at && (at <= last || log.goes_on(names))) {
        return Ok(Outcome::Done);
    }
    let words = |at: Instant| {
        let utc = epoch_us
            .map(|epoch_us| format!(" ({} UTC)", date_and_time(epoch_us.saturating_add(at.as_micros()))));
        moment(at) + &utc.unwrap_or_default()
    };
    let before = spans().map(|(log, (_, last))| (last, log.name())).filter(|(last, _)| *last < at).max();
    let starts = spans().map(|(log, (first, _))| (first, log.first_name()));
    let starts = starts.chain(next.iter().map(|(name, first)| (*first, name.as_str())));
    let after = starts.filter(|(first, _)| *first > at).min();
    let is_read = missing.is_none() && readings.iter().all(|reading| reading.unread().is_none());
    let why = match (before, after) {
        (Some((end, earlier)), Some((start, later))) => {
            let is_between = |name: &String| (earlier..later).contains(&name.as_str());
            if is_read && !left_out.iter().any(is_between) {
                bail!(
                    "nothing was recorded between {}, where {earlier} ends, and {}, where {later} begins",
                    words(end),
                    words(start)
                );
            }
            let between = format!("nothing between {} and {}", words(end), words(start));
            format!("what the board gives of this session, as far as it was asked for, has {between}")
        }
        (Some((end, _)), None) => format!("what the board gives of this session ends at {}", words(end)),
        (None, Some((start, _))) => {
            format!("what the board gives of this session begins at {}", words(start))
        }
        (None, None) => "nothing of the moment can be read".to_owned(),
    };
    if is_read {
        bail!("{why}; for another session name its logs");
    }
    note!("nothing that can be read was recorded at {}: {why}", words(at));
    Ok(Outcome::Losses)
}

/// The result of a search.
struct Searched {
    found: Option<FindingLine>,
    /// Unreadable sectors in the search.
    unread: Option<Unread>,
}

impl Searched {
    /// Prints the finding and the gaps of the search.
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

/// UTC at power-on, by a log's clock.
#[derive(Clone, Copy)]
struct Clock {
    /// Microseconds since 1970.
    epoch_us: u64,
    /// Unreadable sectors after the last clock record: the clock may have been set again there.
    unread: Option<Unread>,
}

impl Clock {
    /// Prints the gaps of the search.
    fn tell(&self) -> Outcome {
        if let Some(unread) = &self.unread {
            note!(
                "UTC goes by the last clock record that could be read (power-on at {}): {}, where one may be",
                date_and_time(self.epoch_us),
                unread.words()
            );
        }
        Outcome::lossy(self.unread.is_some())
    }
}

/// The logs of a session on a board.
struct Board<'a> {
    ftp: &'a mut Ftp,
    names: &'a [String],
    left_out: &'a [String],
    output: &'a Path,
    /// The parts of logs read so far, by their names.
    parts: BTreeMap<String, Part>,
    /// Sectors of other sessions, by their logs and places.
    strange: BTreeSet<(String, u32)>,
    /// Data recorded between the searched logs or before them, and in none of them, as the sectors' numbers
    /// show.
    missing: Option<Unread>,
    /// The first log that begins after the requested span, and its start.
    next: Option<(String, Instant)>,
}

/// Beginning of a log of the session.
struct Begin<'a> {
    name: &'a str,
    /// The number of its first sector.
    number: Option<u32>,
    at: Option<Instant>,
    /// Its beginning was downloaded. A gap between it and a log of the same number is found when both are
    /// read.
    is_read: bool,
}

impl<'a> Board<'a> {
    fn new(ftp: &'a mut Ftp, names: &'a [String], left_out: &'a [String], output: &'a Path) -> Self {
        let (parts, strange) = (BTreeMap::new(), BTreeSet::new());
        Self { ftp, names, left_out, output, parts, strange, missing: None, next: None }
    }

    /// Names the parts with these stretches; deletes the others.
    fn finish(&mut self, stretches: &[Stretch]) -> Result<Vec<(String, PathBuf)>> {
        let of = |stretch: &Stretch| Some((stretch.name.clone(), self.parts.remove(&stretch.name)?));
        let parts: Vec<_> = stretches.iter().filter_map(of).collect();
        parts.into_iter().map(|(name, part)| Ok((name, part.finish()?))).collect()
    }

    /// Downloads the recording between these times.
    fn bring(&mut self, from: Instant, to: Instant) -> Result<Vec<Stretch>> {
        let (mut stretches, mut later) = (Vec::new(), None);
        // Sectors of a group whose beginning is still to be found, with their logs.
        let mut tails: Vec<(&String, u32)> = Vec::new();
        for name in self.names.iter().rev() {
            let mut log = Remote::open(self.ftp, &mut self.parts, name, self.output)?;
            let first = first_group(&mut log)?;
            let (at, number) = (first.map(|first| first.at), log.first_number());
            let is_further =
                self.names.iter().any(|other| other < name && number_of(other) == number_of(name));
            // A group may begin in the log before: then the first sectors of this one are its last.
            let is_later =
                first.map_or(is_further, |first| first.at > to && (first.place == 0 || is_further));
            if is_later && stretches.is_empty() {
                if let Some(first) = first {
                    tails.clear();
                    self.next = Some((name.clone(), first.at));
                }
                tails.insert(0, (name, first.map_or(log.count(), |first| first.place)));
                later = Some(Begin { name, number, at, is_read: false });
                continue;
            }
            let places = between(&mut log, from, to)?;
            let begin = Begin { name, number, at, is_read: places.start == 0 };
            let stretch = log.bring(places)?;
            log.add_strange(&mut self.strange);
            if let Some(later) = &mut later {
                for (name, end) in std::mem::take(&mut tails) {
                    if end > 0 && stretch.places.end == stretch.sectors {
                        let mut log = Remote::open(self.ftp, &mut self.parts, name, self.output)?;
                        stretches.push(log.bring(0..end)?);
                        log.add_strange(&mut self.strange);
                        later.is_read = true;
                    }
                }
                self.hold_against(Some(&stretch), number, later, to)?;
            }
            stretches.insert(0, stretch);
            if at.is_some_and(|at| at <= from) {
                return Ok(stretches);
            }
            later = Some(begin);
        }
        if let Some(first) = later.filter(|_| !stretches.is_empty()) {
            self.hold_against(None, None, &first, to)?;
        }
        Ok(stretches)
    }

    /// Notes the gap between the end of a downloaded log and the next log, whose first sector has this
    /// number. Without a log, it is the gap before the next one. Data after the time `to` do not count.
    fn hold_against(
        &mut self,
        before: Option<&Stretch>,
        number: Option<u32>,
        later: &Begin<'_>,
        to: Instant,
    ) -> Result<()> {
        let is_between =
            |name: &String| before.is_none_or(|before| *name > before.name) && name.as_str() < later.name;
        if self.left_out.iter().any(is_between) {
            return Ok(());
        }
        let is_one_log = before.is_some_and(|before| number_of(&before.name) == number_of(later.name));
        let end = match before {
            Some(before) if before.places.end < before.sectors || is_one_log && later.is_read => {
                return Ok(());
            }
            Some(before) => number.map(|number| number.saturating_add(before.sectors)),
            None => Some(0),
        };
        let Some((end, begins)) = end.zip(later.number).filter(|(end, begins)| begins > end) else {
            return Ok(());
        };
        let last = before.map(|before| Reading::of(slice::from_ref(before))).transpose()?;
        let last = last.and_then(|last| last.span()).map(|(_, last)| last);
        if last.is_none_or(|last| last < to) {
            let sectors = u64::from(begins - end);
            self.missing = Unread::all(Some(Unread { sectors, from: last, to: later.at }), self.missing);
        }
        Ok(())
    }

    /// The clock of the log that contains a time of day. Every reader dates a log by the last clock record in
    /// it. The log is the newest one that began before that time by its own clock. A log without a clock uses
    /// the next log's.
    fn clock(&mut self, utc_us: u64) -> Result<Clock> {
        let mut clock = None;
        for logs in self.names.chunk_by(|one, next| number_of(one) == number_of(next)).rev() {
            clock = self.last_clock(logs)?.or(clock);
            let Some(found) = clock else { continue };
            let mut first = Remote::open(self.ftp, &mut self.parts, &logs[0], self.output)?;
            let began = first_group(&mut first)?.map(|first| first.at);
            if began.is_some_and(|began| found.epoch_us.saturating_add(began.as_micros()) <= utc_us) {
                break;
            }
        }
        clock.context(
            "nothing that can be read told this session the time of day; say the time since its beginning, as --around 4:20",
        )
    }

    /// A log's last clock record, from its last readable group.
    fn last_clock(&mut self, names: &[String]) -> Result<Option<Clock>> {
        let mut stretches = Vec::new();
        for name in names.iter().rev() {
            let mut log = Remote::open(self.ftp, &mut self.parts, name, self.output)?;
            let count = log.count();
            let place = group_before(&mut log, count)?;
            stretches.insert(0, log.bring(place..count)?);
            log.add_strange(&mut self.strange);
            let reading = Reading::of(&stretches)?;
            if let Some(epoch_us) = reading.epoch_us() {
                return Ok(Some(Clock { epoch_us, unread: reading.unread() }));
            }
        }
        Ok(None)
    }

    /// The latest matching finding: the logs are read from their end backwards, group by group, until it
    /// comes.
    fn latest(&mut self, what: &Around) -> Result<Searched> {
        let (mut found, mut stretches, mut later) = (None, Vec::new(), None);
        let never = Instant::from_micros(u64::MAX);
        for name in self.names.iter().rev() {
            let mut log = Remote::open(self.ftp, &mut self.parts, name, self.output)?;
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
            let stretch = log.stretch(end..count);
            log.add_strange(&mut self.strange);
            let (at, number) = (first_group(&mut log)?.map(|first| first.at), log.first_number());
            if let Some(later) = &later {
                self.hold_against(Some(&stretch), number, later, never)?;
            }
            stretches.insert(0, stretch);
            if found.is_some() {
                later = None;
                break;
            }
            later = Some(Begin { name, number, at, is_read: true });
        }
        if let Some(first) = &later {
            self.hold_against(None, None, first, never)?;
        }
        // All of it again: a group may begin in one log and end in the next one.
        let mut unread = None;
        for stretches in by_number(&stretches) {
            let reading = Reading::of(stretches)?;
            unread = Unread::all(unread, reading.unread());
            found = found.into_iter().chain(wanted(&reading, what)).max_by_key(|found| found.at);
        }
        Ok(Searched { found, unread: Unread::all(unread, self.missing.take()) })
    }
}

/// The latest matching finding in the data read.
fn wanted(reading: &Reading, what: &Around) -> Option<FindingLine> {
    reading.findings().iter().rfind(|finding| is_wanted(what, &finding.check, finding.level)).cloned()
}

/// Whether a change of level matches the request. A return to normal does not.
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
