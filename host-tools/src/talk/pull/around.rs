//! `hums pull --around`: over a slow radio a crash's minute first. The moment is found by random access ([`super::moment`]), and
//! what was recorded round it becomes a part of the log ([`super::part`]).

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{Entry, GroupDecoder, Header, Record, SECTOR_BYTES, Sector};
use hums_core::health::Level;
use hums_core::time::{Instant, Span};

use super::compare::{bytes_of, heading_of};
use super::ftp::Ftp;
use super::moment::{Sectors, Start, between, group_of};
use super::part::Part;
use crate::cli::Around;
use crate::utc::{When, moment};

/// A finding as a log tells it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) at: Instant,
    pub(super) check: String,
    pub(super) instance: u8,
    pub(super) level: &'static str,
}

/// What was brought.
#[derive(Debug)]
pub(super) struct Brought {
    /// The log's name on the board, and the part.
    pub(super) parts: Vec<(String, PathBuf)>,
    pub(super) at: Instant,
    pub(super) found: Option<Found>,
    /// Sectors of other sessions that came, and are in no part.
    pub(super) strange: u32,
}

/// Brings what these logs, segments of one session in their order, have round a moment: so much before and after it.
pub(super) fn pull(
    ftp: &mut Ftp,
    names: &[String],
    output: &Path,
    what: &Around,
    span: Span,
) -> Result<Brought> {
    let mut strange = 0;
    let (at, found) = match what {
        Around::Time(When::Seconds(micros)) => (Instant::from_micros(*micros), None),
        Around::Time(When::Utc(utc_us)) => (since_power_on(ftp, names, output, *utc_us)?, None),
        Around::Level(_) | Around::Check(_) => {
            let found = latest(ftp, names, output, what, &mut strange)?;
            note!("{}: {} at {}", found.check, found.level, moment(found.at));
            (found.at, Some(found))
        }
    };
    let from = Instant::from_micros(at.as_micros().saturating_sub(span.as_micros()));
    let to = at + span;
    let mut parts = Vec::new();
    for name in names.iter().rev() {
        let Some(mut log) = Remote::open(ftp, name, output)? else { continue };
        let first = group_of(&mut log, 0)?.map_or(Instant::ZERO, |start| start.at);
        if first > to {
            continue;
        }
        let range = between(&mut log, from, to)?;
        log.bring(range.start, range.end)?;
        strange += log.part.strange();
        parts.insert(0, (name.clone(), log.part.path().to_owned()));
        if first <= from {
            break;
        }
    }
    if parts.is_empty() {
        bail!("what the board has of this session begins after {}", moment(to));
    }
    Ok(Brought { parts, at, found, strange })
}

/// A time of day on the monitor's clock, by what the newest of these logs knows of it.
fn since_power_on(ftp: &mut Ftp, names: &[String], output: &Path, utc_us: u64) -> Result<Instant> {
    for name in names.iter().rev() {
        let Some(mut log) = Remote::open(ftp, name, output)? else { continue };
        let last = log.count().saturating_sub(1);
        let Some(Start { epoch_us: Some(epoch_us), .. }) = group_of(&mut log, last)? else { continue };
        let micros =
            utc_us.checked_sub(epoch_us).with_context(|| format!("{name}: the session began later"))?;
        return Ok(Instant::from_micros(micros));
    }
    bail!("nothing told this session the time of day; say the time since its beginning, as --around 4:20")
}

/// The latest finding that is wanted: the logs are read from their end backwards, group by group, until it comes.
fn latest(ftp: &mut Ftp, names: &[String], output: &Path, what: &Around, strange: &mut u32) -> Result<Found> {
    for name in names.iter().rev() {
        let Some(mut log) = Remote::open(ftp, name, output)? else { continue };
        let mut end = log.count();
        while let Some(last) = end.checked_sub(1) {
            let Some(start) = group_of(&mut log, last)? else { break };
            log.bring(start.place, end)?;
            if let Some(found) = log.findings(start.place, end, what)?.pop() {
                *strange += log.part.strange();
                return Ok(found);
            }
            end = start.place;
            note!("{name}: no such finding from {} on; looking before that", moment(start.at));
        }
        *strange += log.part.strange();
    }
    bail!("no such finding is in this session; what came stays for `hums pull`, which brings the rest")
}

/// A log on the board, and the part of it that is here.
struct Remote<'a> {
    ftp: &'a mut Ftp,
    name: &'a str,
    part: Part,
    sectors: u32,
}

impl<'a> Remote<'a> {
    /// Opens a log; none where nothing is in it yet.
    fn open(ftp: &'a mut Ftp, name: &'a str, output: &Path) -> Result<Option<Self>> {
        let length = ftp.open(name)?;
        let sectors = length / SECTOR_BYTES as u32;
        if sectors == 0 {
            return Ok(None);
        }
        let heading = heading_of(ftp, name, length)?;
        let whole = output.join(&heading.name);
        if whole.exists() {
            bail!(
                "{} is there already: `hums decode --from --to` shows a moment of it, and `hums pull` brings what it lacks",
                whole.display()
            );
        }
        let mut part = Part::open(&whole, sectors, &heading.sectors)?;
        for (place, sector) in (0..).zip(&heading.sectors) {
            // The card may have lost since what is here.
            if !part.has(place) {
                part.put(place, sector)?;
            }
        }
        Ok(Some(Self { ftp, name, part, sectors }))
    }

    /// Brings sectors that are not here yet.
    fn bring(&mut self, from: u32, to: u32) -> Result<()> {
        let mut place = from;
        while let Some(first) = self.part.next(place, false).filter(|first| *first < to) {
            let end = self.part.next(first, true).unwrap_or(to).min(to);
            let Self { ftp, part, .. } = self;
            let (mut next, mut waiting) = (first, Vec::new());
            let size = SECTOR_BYTES as u32;
            ftp.bring(first * size, end * size, |bytes| {
                waiting.extend_from_slice(bytes);
                while let Some((sector, rest)) = waiting.split_first_chunk::<SECTOR_BYTES>() {
                    part.put(next, &Sector::from_bytes(*sector))?;
                    next += 1;
                    waiting = rest.to_vec();
                }
                Ok(())
            })?;
            note!("{}: {} of {} sectors of the moment", self.name, end - from, to - from);
            place = end;
        }
        Ok(())
    }

    /// The findings that are wanted in a group, in order.
    fn findings(&mut self, from: u32, to: u32, what: &Around) -> Result<Vec<Found>> {
        let mut decoder = Box::new(GroupDecoder::new());
        let mut found = Vec::new();
        for place in from..to {
            let sector = self.part.read(place)?;
            let Ok(header) = Header::read(sector.bytes()) else { break };
            if decoder.push(&header, &sector).is_err() {
                break;
            }
            while let Some(Ok(entry)) = decoder.next_entry() {
                if let Entry::Record { record: Record::Finding(finding), .. } = entry
                    && is_wanted(what, finding.check, finding.level)
                {
                    let (check, instance) = (finding.check.to_owned(), finding.instance);
                    found.push(Found { at: finding.at, check, instance, level: finding.level.name() });
                }
            }
        }
        Ok(found)
    }
}

/// Whether a change of level is one that is asked for: that all is well again is none.
fn is_wanted(what: &Around, check: &str, level: Level) -> bool {
    let is_bad = matches!(level, Level::Warning | Level::Critical);
    match what {
        Around::Level(Level::Critical) => level == Level::Critical,
        Around::Level(_) => is_bad,
        Around::Check(name) => is_bad && check == name,
        Around::Time(_) => false,
    }
}

impl Sectors for Remote<'_> {
    fn count(&self) -> u32 {
        self.sectors
    }

    fn sector(&mut self, place: u32) -> Result<Option<(Header, Sector)>> {
        if !self.part.has(place) {
            let bytes = bytes_of(self.ftp, place * SECTOR_BYTES as u32, SECTOR_BYTES as u32)?;
            let sector = bytes.first_chunk().map_or(Sector::zeroed(), |bytes| Sector::from_bytes(*bytes));
            self.part.put(place, &sector)?;
        }
        let sector = self.part.read(place)?;
        Ok(Header::read(sector.bytes()).ok().map(|header| (header, sector)))
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
                [&critical, &warning, &check].map(|what| is_wanted(what, "motor_loss", level)),
                wanted
            );
        }
        assert!(!is_wanted(&check, "cell_voltage", Level::Critical));
    }
}
