//! `hums box pull --around`: over a slow radio the minute of a crash first.
//!
//! The files of a log count as one row of sectors. Groups begin with their times: each sector read halves the search. Whole
//! groups around the moment come into partial files, as long as the box's, with zeros for other sectors. They end in
//! `.part.HUM`, which every reader reports.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{GROUP_SECTORS, Header, SECTOR_BYTES, Sector};
use hums_core::clock::{Instant, Span};
use hums_core::health::Level;
use hums_recorder::card::SEGMENT_BYTES_MAX;
use tempfile::NamedTempFile;

use super::compare::{beginning_of, bytes_of, heading_of};
use super::ftp::Ftp;
use super::{Client, first_of_newest, number};
use crate::cli::LogMoment;
use crate::files::{begin, cannot_write};
use crate::logs::fat::Extent;
use crate::logs::naming::part_name;
use crate::logs::{Log, Piece};
use crate::loss;
use crate::outcome::{Outcome, exists};
use crate::plural::count;
use crate::source::told::Finding;
use crate::summary::Overview;
use crate::utc::{TimePoint, date_and_time, moment};

/// Backwards from an unreadable one, for a group's beginning.
const STEPS_BACK_MAX: u32 = 2 * GROUP_SECTORS as u32;
/// Twice the recorder's longest file: more would fill the disk.
const FILE_BYTES_MAX: u32 = 2 * SEGMENT_BYTES_MAX;
const SECTOR: u32 = SECTOR_BYTES as u32;

#[derive(Debug)]
pub(super) struct Brought {
    pub(super) files: Vec<(String, PathBuf)>,
    /// The moment.
    pub(super) at: Instant,
    pub(super) found: Option<Finding>,
    pub(super) outcome: Outcome,
}

pub(super) fn pull(
    ftp: &mut Ftp,
    files: &[(String, u32)],
    output: &Path,
    (what, span): (&LogMoment, Span),
) -> Result<Brought> {
    let mut log = RemoteLog::new(ftp, files, output)?;
    let (mut found, mut searched) = (None, Outcome::Done);
    let at = match what {
        LogMoment::Time(TimePoint::Seconds(micros)) => Instant::from_micros(*micros),
        LogMoment::Time(TimePoint::Utc(utc_us)) => {
            let power_on_us = log.power_on_us()?;
            let micros = utc_us.checked_sub(power_on_us);
            Instant::from_micros(micros.with_context(|| {
                format!(
                    "the log begins later, {} UTC; name the files of another log",
                    date_and_time(power_on_us)
                )
            })?)
        }
        LogMoment::Level(_) | LogMoment::Check(_) => {
            let latest;
            (latest, searched) = log.latest(what)?;
            found.insert(latest).at
        }
    };
    let (from, to) = (Instant::from_micros(at.as_micros().saturating_sub(span.as_micros())), at + span);
    let places = log.before(from)?.start..log.before(to)?.end;
    let overview = log.bring(places.clone())?;
    let is_to_end = places.end == log.count();
    if log.unread.is_empty() {
        check_recorded(at, &overview, is_to_end)?;
    }
    let outcome = log.tell_unread().and(tell_faults(&overview, is_to_end.then_some(to)));
    Ok(Brought { files: log.finish(&places)?, at, found, outcome: outcome.and(searched) })
}

/// The sectors of a group, which begins with the records of a start.
pub(in crate::talk) const WHOLE_GROUP: u32 = GROUP_SECTORS as u32;
/// Time in which a log that is recorded grows: the box writes every 0.2 s.
const GROWS: Duration = Duration::from_secs(5);
const LOOK_AGAIN: Duration = Duration::from_millis(500);

/// Both ends of the box's newest log, as logs in temporary files.
pub(in crate::talk) struct NewestLog {
    pub(in crate::talk) begin: Log,
    /// At least a whole group.
    pub(in crate::talk) end: Log,
    pub(in crate::talk) is_growing: bool,
}

/// Brings the newest log's first sectors and its last groups, and looks at them. `None` if no log has data.
pub(in crate::talk) fn newest<T>(
    client: Client,
    head_sectors: u32,
    look: impl FnOnce(&NewestLog) -> Result<T>,
) -> Result<Option<T>> {
    let mut ftp = Ftp::new(client)?;
    let (mut all, _) = ftp.list()?;
    all.sort();
    let newest = first_of_newest(&all, 1);
    let is_its = |(name, bytes): &&(String, u32)| *bytes > 0 && number(name) == Some(newest);
    let files: Vec<(String, u32)> = all.iter().filter(is_its).cloned().collect();
    if files.is_empty() {
        return Ok(None);
    }
    let folder = tempfile::tempdir()
        .context("a temporary folder cannot be made; TMPDIR names another place for it")?;
    let mut log = RemoteLog::new(&mut ftp, &files, folder.path())?;
    let count = log.count();
    let last = log.group_before(count)?.start;
    let end = log.group_before(last)?.start..count;
    let begin = 0..head_sectors.min(end.start);
    for places in [&begin, &end].into_iter().filter(|places| !places.is_empty()) {
        log.bring(places.clone())?;
    }
    let until = std::time::Instant::now() + GROWS;
    let is_growing = loop {
        let (mut now, _) = log.ftp.list()?;
        now.sort();
        if now != all || std::time::Instant::now() >= until {
            break now != all;
        }
        std::thread::sleep(LOOK_AGAIN);
    };
    let newest = NewestLog { begin: log.read_as_log(&begin), end: log.read_as_log(&end), is_growing };
    look(&newest).map(Some)
}

/// Refuses a moment without a recording.
fn check_recorded(at: Instant, overview: &Overview, is_to_end: bool) -> Result<()> {
    let summary = &overview.ending.summary;
    let (Some(first), Some(last)) = (summary.first, summary.last) else {
        bail!("no sector around {} can be read; read the card itself", moment(at));
    };
    let utc = |at: Instant| {
        let utc_us = summary.epoch_us.map(|epoch_us| epoch_us.saturating_add(at.as_micros()));
        moment(at) + &utc_us.map_or_else(String::new, |utc_us| format!(" ({} UTC)", date_and_time(utc_us)))
    };
    if at < first && summary.first_number != Some(0) {
        bail!("the box's files of this log begin at {}; for another log name its files", utc(first));
    }
    if at > last && is_to_end {
        bail!("the log ends at {}; for another log name its files", utc(last));
    }
    Ok(())
}

/// Reports losses within the brought sectors. At the log's end before `to`, the proof of that end counts too.
fn tell_faults(overview: &Overview, to: Option<Instant>) -> Outcome {
    let ending = &overview.ending;
    let mut faults: Vec<String> = Vec::new();
    // Those are not lost.
    let gaps = overview.contents.gaps.iter().filter(|gap| gap.from.is_some() || gap.sectors_skipped > 0);
    faults.extend(Some(gaps.count() as u64).filter(|gaps| *gaps > 0).map(|gaps| count(gaps, "gap")));
    if ending.summary.marks.lost > 0 {
        faults.extend(overview.contents.losses.values().map(loss::told));
    }
    let ends_within = to.is_some_and(|to| ending.summary.last.is_some_and(|last| last < to));
    if ends_within && !ending.proof.is_whole() {
        if ending.proof.holds() {
            note!("{}: {}", ending.name, ending.words());
        } else {
            faults.push(ending.words());
        }
    }
    for fault in &faults {
        note!("{}: of the moment: {fault}; `hums info --verify` says more", ending.name);
    }
    Outcome::lossy(!faults.is_empty())
}

/// A return to normal does not match.
fn is_wanted(what: &LogMoment, finding: &Finding) -> bool {
    match what {
        LogMoment::Level(Level::Critical) => finding.level == Level::Critical,
        LogMoment::Level(_) => finding.is_bad(),
        LogMoment::Check(name) => finding.is_bad() && finding.check == *name,
        LogMoment::Time(_) => false,
    }
}

struct RemoteLog<'a> {
    ftp: &'a mut Ftp,
    output: &'a Path,
    files: Vec<RemoteFile>,
    /// Open on the box.
    open: Option<usize>,
    /// No readable sector of the log.
    unread: BTreeSet<u32>,
    /// An empty file may have lost later findings.
    empty: Outcome,
}

struct RemoteFile {
    name: String,
    /// Place in the log; and number of sectors.
    first: u32,
    sectors: u32,
    partial: Option<PartialFile>,
}

impl<'a> RemoteLog<'a> {
    fn new(ftp: &'a mut Ftp, files: &[(String, u32)], output: &'a Path) -> Result<Self> {
        let mut log = Self {
            ftp,
            output,
            files: Vec::new(),
            open: None,
            unread: BTreeSet::new(),
            empty: Outcome::Done,
        };
        for (name, bytes) in files {
            if *bytes < SECTOR {
                note!("{name}: has no data, or its first sector cannot be read; left out");
                log.empty = Outcome::Losses;
                continue;
            }
            if *bytes > FILE_BYTES_MAX {
                bail!("{name}: no recorder makes a file of {bytes} bytes, as the box's directory says");
            }
            let (name, first, sectors) = (name.clone(), log.count(), bytes / SECTOR);
            log.files.push(RemoteFile { name, first, sectors, partial: None });
        }
        if log.files.is_empty() {
            bail!("the box has no log with data; record one first");
        }
        Ok(log)
    }

    fn count(&self) -> u32 {
        self.files.last().map_or(0, |last| last.first + last.sectors)
    }

    /// Opens it; with the place in it.
    fn file_at(&mut self, place: u32) -> Result<(&mut Ftp, &mut PartialFile, u32)> {
        let index = self.files.partition_point(|file| file.first <= place).saturating_sub(1);
        let file = self.files.get_mut(index).context("the log ends before this place; call again")?;
        if self.open.replace(index) != Some(index) {
            let length = self.ftp.open(&file.name)?;
            if length / SECTOR < file.sectors {
                bail!("{}: is shorter than the box's directory says; call again", file.name);
            }
            if file.partial.is_none() {
                let heading = heading_of(self.ftp, &file.name, length)?;
                let whole = self.output.join(&heading.name);
                if whole.exists() {
                    bail!(
                        "{} is there already: `hums decode --from --to` shows a moment of it, and `hums box pull` completes it",
                        whole.display()
                    );
                }
                file.partial = Some(PartialFile::begin(&whole, file.sectors, &heading.sectors)?);
            }
        }
        let partial = file.partial.as_mut().context("the file is not open on the box; call again")?;
        Ok((&mut *self.ftp, partial, place - file.first))
    }

    /// `None` if damaged or another's.
    fn sector(&mut self, place: u32) -> Result<Option<(Header, Sector)>> {
        let (ftp, partial, at) = self.file_at(place)?;
        if !partial.has(at) {
            let bytes = bytes_of(ftp, at * SECTOR, SECTOR)?;
            let sector = bytes.first_chunk().map_or(Sector::zeroed(), |bytes| Sector::from_bytes(*bytes));
            partial.put(at, &sector)?;
        }
        partial.sector(at)
    }

    /// Place and time of this sector's group; if unreadable, of the last readable one before.
    fn group_of(&mut self, place: u32) -> Result<Option<(u32, Instant)>> {
        let mut next = Some(place);
        for _ in 0..STEPS_BACK_MAX {
            let Some(place) = next else { break };
            next = match self.sector(place)? {
                Some((header, sector)) if header.starts_group() => {
                    let start = |start_ms| (place, Instant::from_millis(start_ms));
                    return Ok(sector.preamble().map(|preamble| start(preamble.start_ms)));
                }
                Some((header, _)) => place.checked_sub(u32::from(header.since_first)),
                None => place.checked_sub(1),
            };
        }
        Ok(None)
    }

    /// The group before, with unreadable sectors up to the place; from the log's beginning if no earlier one is readable.
    fn group_before(&mut self, end: u32) -> Result<Range<u32>> {
        let mut place = end;
        while let Some(last) = place.checked_sub(1) {
            if let Some((start, _)) = self.group_of(last)? {
                return Ok(start..end);
            }
            place = place.saturating_sub(STEPS_BACK_MAX);
        }
        Ok(0..end)
    }

    /// Places from a group that starts then or before, to one that starts later, or the end.
    fn before(&mut self, time: Instant) -> Result<Range<u32>> {
        let group = GROUP_SECTORS as u32;
        let (mut start, mut end) = (0, self.count());
        while end - start > group {
            // Never in the group that begins at `start`.
            let middle = start + ((end - start) / 2).max(group);
            match self.group_of(middle)? {
                Some((place, at)) if place > start && at <= time => start = place,
                Some((place, _)) if place > start => end = place,
                // The times before are unknown.
                _ => break,
            }
        }
        Ok(start..end)
    }

    /// UTC by the last clock record, microseconds since 1970.
    fn power_on_us(&mut self) -> Result<u64> {
        let last = self.group_before(self.count())?;
        let epoch_us = self.bring(last)?.ending.summary.epoch_us;
        epoch_us.context("the log has no time of day; give the time since power-on, as --around 4:20")
    }

    /// Group by group from the end; whether nothing was lost there.
    fn latest(&mut self, what: &LogMoment) -> Result<(Finding, Outcome)> {
        let (count, mut start, mut found) = (self.count(), self.count(), None);
        while start > 0 && found.is_none() {
            let places = self.group_before(start)?;
            start = places.start;
            let overview = self.bring(places)?;
            found = overview.contents.findings.into_iter().rfind(|finding| is_wanted(what, finding));
            if let (None, Some(first)) = (&found, overview.ending.summary.first) {
                note!("no such finding from {} on; searching before that", moment(first));
            }
        }
        // The numbers show a missing file.
        let outcome = tell_faults(&self.bring(start..count)?, None).and(self.empty);
        let Some(found) = found else {
            self.tell_unread();
            bail!("no such finding is in this log; for another log name its files");
        };
        note!("{}: {} at {}", found.check, found.level.name(), moment(found.at));
        Ok((found, outcome))
    }

    /// Reports unreadable sectors.
    fn tell_unread(&self) -> Outcome {
        if !self.unread.is_empty() {
            let sectors = count(self.unread.len() as u64, "sector");
            note!(
                "{sectors} around the moment, or in the search for it, cannot be read: data of it may be lost"
            );
        }
        Outcome::lossy(!self.unread.is_empty())
    }

    /// Downloads and reads the missing sectors.
    fn bring(&mut self, places: Range<u32>) -> Result<Overview> {
        let mut place = places.start;
        while place < places.end {
            let (ftp, partial, at) = self.file_at(place)?;
            let end = partial.end_of_missing(at, places.end - place + at);
            let (mut next, mut waiting) = (at, Vec::new());
            ftp.bring(at * SECTOR, end * SECTOR, |bytes| {
                waiting.extend_from_slice(bytes);
                let (sectors, rest) = waiting.as_chunks::<SECTOR_BYTES>();
                for sector in sectors {
                    partial.put(next, &Sector::from_bytes(*sector))?;
                    next += 1;
                }
                waiting = rest.to_vec();
                Ok(())
            })?;
            place += (end - at).max(1);
            if end > at {
                note!("{} of {} sectors came", place - places.start, places.len());
            }
        }
        for place in places.clone() {
            if self.sector(place)?.is_none() {
                self.unread.insert(place);
            }
        }
        Overview::verified(&self.read_as_log(&places))
    }

    fn read_as_log(&self, places: &Range<u32>) -> Log {
        let piece = |file: &RemoteFile| {
            let start = places.start.clamp(file.first, file.first + file.sectors) - file.first;
            let end = places.end.clamp(file.first, file.first + file.sectors) - file.first;
            let partial = file.partial.as_ref().filter(|_| start < end)?;
            let [start, length] = [start, end - start].map(|sectors| u64::from(sectors * SECTOR));
            Some(Piece { path: partial.file.path().to_owned(), extents: vec![Extent { start, length }] })
        };
        let name = self.files.first().map_or_else(String::new, |file| file.name.clone());
        let pieces = self.files.iter().filter_map(piece).collect();
        Log { name, pieces, ..Log::default() }
    }

    fn finish(self, places: &Range<u32>) -> Result<Vec<(String, PathBuf)>> {
        let is_in = |file: &RemoteFile| file.first < places.end && places.start < file.first + file.sectors;
        let files = self.files.into_iter().filter(is_in);
        let named = files.filter_map(|file| Some((file.name, file.partial?)));
        named.map(|(name, partial)| Ok((name, partial.finish()?))).collect()
    }
}

/// Zeros for missing sectors.
#[derive(Debug)]
struct PartialFile {
    file: NamedTempFile<File>,
    /// Its name, once complete.
    target: PathBuf,
    /// Downloaded sectors.
    has: Vec<bool>,
    session: Option<u32>,
    base: Option<u32>,
}

impl PartialFile {
    fn begin(whole: &Path, sectors: u32, head: &[Sector]) -> Result<Self> {
        let target = part_name(whole);
        if target.symlink_metadata().is_ok() {
            return Err(exists(&target, false));
        }
        let (session, base) = beginning_of(head);
        let open = |path: &Path| File::options().read(true).write(true).create_new(true).open(path);
        let bytes = u64::from(sectors) * SECTOR_BYTES as u64;
        let file = begin(&target, open).and_then(|file| file.as_file().set_len(bytes).map(|()| file));
        let file = file.with_context(|| cannot_write(&target))?;
        let mut partial = Self { file, target, has: vec![false; sectors as usize], session, base };
        (0..).zip(head).try_for_each(|(at, sector)| partial.put(at, sector))?;
        Ok(partial)
    }

    fn has(&self, at: u32) -> bool {
        self.has.get(at as usize).is_some_and(|has| *has)
    }

    fn end_of_missing(&self, at: u32, end: u32) -> u32 {
        let end = end.min(self.has.len() as u32);
        (at..end).find(|at| self.has(*at)).unwrap_or(end)
    }

    /// If it belongs here; a copy in progress may be one place further.
    fn header(&self, at: u32, sector: &Sector) -> Option<Header> {
        let header =
            Header::read(sector.bytes()).ok().filter(|header| self.session == Some(header.session))?;
        let number = self.base.map_or(header.number, |base| base.wrapping_add(at));
        let is_here = header.number == number || header.partial && header.number.wrapping_add(1) == number;
        is_here.then_some(header)
    }

    /// Zeros for another session's, whose log took the place.
    fn put(&mut self, at: u32, sector: &Sector) -> Result<()> {
        let header = Header::read(sector.bytes()).ok();
        self.session = self.session.or(header.map(|header| header.session));
        let is_other = header.is_some_and(|header| Some(header.session) != self.session);
        let zeros = Sector::zeroed();
        let sector = if is_other { &zeros } else { sector };
        self.seek(at)
            .and_then(|()| self.file.write_all(sector.bytes()))
            .with_context(|| cannot_write(&self.target))?;
        self.has.get_mut(at as usize).into_iter().for_each(|has| *has = true);
        Ok(())
    }

    fn sector(&mut self, at: u32) -> Result<Option<(Header, Sector)>> {
        let mut bytes = [0; SECTOR_BYTES];
        self.seek(at)
            .and_then(|()| self.file.read_exact(&mut bytes))
            .with_context(|| cannot_write(&self.target))?;
        let sector = Sector::from_bytes(bytes);
        Ok(self.header(at, &sector).map(|header| (header, sector)))
    }

    fn seek(&mut self, at: u32) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(u64::from(at) * SECTOR_BYTES as u64)).map(|_| ())
    }

    fn finish(self) -> Result<PathBuf> {
        self.file.persist_noclobber(&self.target).with_context(|| cannot_write(&self.target))?;
        Ok(self.target)
    }
}
