//! Reads a log. Groups are decoded in parallel, and handed on in order with the gaps between them.
//!
//! Memory is bounded: two groups for each worker, 16 at most, of [`PART_BYTES`] and one entry at most. A
//! larger group (equal frames are coded 2,000 times smaller) is handed on in parts.

use std::cell::Cell;

use anyhow::Result;
use hums_blackbox::{BlockCounts, Cause, Entry, Gap, GroupDecoder, GroupError, Outline, Record};
use hums_core::clock::Instant;

use super::groups::{Group, Groups};
use super::in_order::{in_order, workers};
pub use super::marks::Marks;
use super::places::Log;
pub use super::repair::Evidence;
use super::strangers::ForeignSectors;
use crate::plural::count;

const GROUPS_PER_WORKER: usize = 2;
const GROUPS_MAX: usize = 16;
/// Bytes of a group's entries before they are handed on. A usual flight's group is smaller in any format (a
/// few megabytes as JSON lines).
pub const PART_BYTES: usize = 4 << 20;

/// Collects a group's entries, or a part of them.
pub trait EntryCollector: Send {
    /// Takes the next entry of the group.
    fn entry(&mut self, entry: &Entry<'_>);

    /// Bytes of memory, roughly. Beyond [`PART_BYTES`] it is handed on, and another one goes on.
    fn held_bytes(&self) -> usize;

    /// Whether `frame` gets well-formed frames in place of `entry`, which is cheaper.
    fn only_counts(&self) -> bool {
        false
    }

    /// Takes the next entry, a well-formed frame of this id and size.
    fn frame(&mut self, _at: Instant, _id: u32, _bytes: usize, _verified: bool) {}
}

/// Receives groups in order.
pub trait GroupReceiver<C> {
    /// Something is missing here.
    fn gap(&mut self, gap: &Gap) -> Result<()>;
    /// The next group, or the next part of one.
    fn group(&mut self, collected: C) -> Result<()>;
}

/// Totals of the reading.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LogSummary {
    /// The session that the sectors name.
    pub session: Option<u32>,
    /// Ended in order; otherwise power failed.
    pub closed: bool,
    /// It ends where its image ends.
    pub is_cut_by_image: bool,
    /// Frames read.
    pub frames: u64,
    /// Groups read.
    pub groups: u64,
    /// Gaps.
    pub gaps: u64,
    /// Reported losses.
    pub losses: u64,
    /// Missing frames.
    pub frames_missing: u64,
    /// Gaps with an unknown number.
    pub gaps_uncounted: u64,
    /// Groups that begin before the end of the one before.
    pub times_fell: u64,
    /// Earlier than the entry before, within a group.
    pub entries_fell: u64,
    /// Blocks by kind.
    pub blocks: BlockCounts,
    /// The first entry's time.
    pub first: Option<Instant>,
    /// The last entry's time.
    pub last: Option<Instant>,
    /// UTC at power-on, microseconds since 1970; the last value counts.
    pub epoch_us: Option<u64>,
    /// Facts from its records.
    pub marks: Marks,
    /// The number of the first sector.
    pub first_number: Option<u32>,
    /// The number of the last sector.
    pub last_number: Option<u32>,
    /// The last sector is only a copy of one in progress.
    pub ends_partial: bool,
    /// Modulo 2^32, up to the end.
    pub frames_end: Option<u32>,
    /// The check of all entries, by the last sector.
    pub check_end: Option<u32>,
    /// Groups that continue other entries than those before them.
    pub unchained: u64,
    /// Counts of the blocks after the last sector.
    pub behind: BlockCounts,
    /// Foreign blocks up to its files' end.
    pub foreign_at_end: u64,
    /// Evidence from its parity.
    pub parity: Evidence,
    /// Strange sectors in its files.
    pub strange: Vec<ForeignSectors>,
    /// Missing files before its first one.
    pub files_gone: u32,
}

impl LogSummary {
    /// The beginning of a phrase that goes on with `missing`.
    pub fn missing_words(&self) -> String {
        match (self.gaps_uncounted, self.frames_missing) {
            (0, number) => count(number, "frame"),
            (_, 0) => "an unknown number of frames".to_owned(),
            (_, number) => format!("{} and an unknown number more", count(number, "frame")),
        }
    }
}

/// `new` makes a group's collector, `deliver` gets them in order.
///
/// This thread reads, hands on and decodes.
pub fn read<C: EntryCollector>(
    log: &Log,
    new: impl Fn() -> C + Sync,
    deliver: &mut impl GroupReceiver<C>,
    mut progress: impl FnMut(u64),
) -> Result<LogSummary> {
    let mut groups = Groups::new(log);
    let mut stitch = Stitch { first_file: log.first_segment(), ..Stitch::default() };
    let workers = workers();
    let ahead_max = (workers * GROUPS_PER_WORKER).min(GROUPS_MAX);
    let next = || {
        let group = groups.next_group()?;
        progress(groups.counts().blocks);
        Ok(group)
    };
    in_order(
        workers,
        ahead_max,
        next,
        |group| decode_here(group, &new),
        |decoded| stitch.take(decoded, &new, deliver),
    )?;
    stitch.end(groups.damaged_at_end(), deliver)?;
    let mut summary = stitch.summary;
    summary.frames_end = stitch.expected;
    summary.check_end = stitch.check;
    summary.ends_partial = stitch.cut;
    summary.behind = groups.behind();
    summary.foreign_at_end = groups.foreign_at_end();
    summary.session = groups.session();
    summary.blocks = groups.counts();
    summary.parity = groups.evidence();
    summary.strange = groups.strange();
    Ok(summary)
}

/// Uses this thread's decoder, which is large; a waiting group keeps it.
///
/// A bad sector may complete an entry wrongly, found only later: such a group is decoded again, up to the
/// sector before.
fn decode_here<C: EntryCollector>(group: Group, new: &impl Fn() -> C) -> Decoded<C> {
    thread_local!(static DECODER: Cell<Option<Box<GroupDecoder>>> = const { Cell::new(None) });
    let decoder = DECODER.take().unwrap_or_else(|| Box::new(GroupDecoder::new()));
    let mut rest = Rest { decoder, end: group.len(), group, at: 0 };
    let (mut decoded, mut collected) = (Decoded::of(&rest.group), new());
    let mut whole = decoded.go_on(&mut rest, &mut collected);
    let mut failed = decoded.unsound(&rest);
    if !whole && failed.is_none() {
        // A sector's contents are handed on only once it is known to be sound.
        let mut probe = Decoded::of(&rest.group);
        let (decoder, group) = (Box::new(GroupDecoder::new()), rest.group.clone());
        let mut again = Rest { decoder, end: group.len(), group, at: 0 };
        probe.go_on(&mut again, &mut Uncollected);
        failed = probe.unsound(&again);
    }
    if let Some((error, sectors)) = failed {
        (rest.end, rest.at) = (sectors, 0);
        (decoded, collected) = (Decoded::of(&rest.group), new());
        whole = decoded.go_on(&mut rest, &mut collected);
        decoded.error = Some(error);
    }
    decoded.collected = Some(collected);
    if whole {
        DECODER.set(Some(rest.decoder));
    } else {
        decoded.rest = Some(rest);
    }
    decoded
}

/// Keeps no entries.
struct Uncollected;

impl EntryCollector for Uncollected {
    fn entry(&mut self, _entry: &Entry<'_>) {}

    fn held_bytes(&self) -> usize {
        0
    }

    fn only_counts(&self) -> bool {
        true
    }
}

struct Rest {
    decoder: Box<GroupDecoder>,
    group: Group,
    /// Decoded sectors.
    at: usize,
    /// Sectors to decode.
    end: usize,
}

struct Decoded<C> {
    collected: Option<C>,
    rest: Option<Rest>,
    /// Sectors missing before it; whether blocks there were damaged.
    missing: u32,
    damaged: bool,
    sectors: u32,
    number: u32,
    frames_said: u32,
    /// First time and frames before it; `None` if it cannot be decoded.
    begun: Option<(Instant, u32)>,
    check_before: Option<u32>,
    check_end: Option<u32>,
    frames: u32,
    last: Option<Instant>,
    /// Earlier than the one before.
    fell: u64,
    error: Option<GroupError>,
    ends_partial: bool,
    /// Damaged blocks at such an end, one perhaps the whole sector.
    damaged_partial: u32,
    closed: bool,
    marks: Marks,
    /// UTC by its last clock record, microseconds since 1970.
    epoch_us: Option<u64>,
}

impl<C: EntryCollector> Decoded<C> {
    /// The facts from its sectors' headers.
    fn of(group: &Group) -> Self {
        let (first, last) = (group.first(), group.last());
        Self {
            collected: None,
            rest: None,
            missing: first.map_or(0, |step| step.missing),
            damaged: first.is_some_and(|step| step.damaged > 0),
            sectors: group.len() as u32,
            number: first.map_or(0, |step| step.header.number),
            frames_said: group.iter().map(|step| u32::from(step.header.frames)).sum(),
            begun: None,
            check_before: None,
            check_end: last.map(|step| step.header.check),
            frames: 0,
            last: None,
            fell: 0,
            error: None,
            ends_partial: last.is_some_and(|step| step.header.partial),
            damaged_partial: last.filter(|step| step.header.partial).map_or(0, |step| step.damaged),
            closed: last.is_some_and(|step| step.header.closed),
            marks: Marks::default(),
            epoch_us: None,
        }
    }

    fn go_on(&mut self, rest: &mut Rest, collected: &mut C) -> bool {
        let Rest { decoder, group, at, end } = rest;
        let counts = collected.only_counts();
        loop {
            while let Some(outline) = next(decoder, counts) {
                match outline {
                    Ok(outline) => self.entry(outline, collected),
                    Err(why) => {
                        self.error = self.error.or(Some(why));
                        return true;
                    }
                }
                if collected.held_bytes() >= PART_BYTES {
                    return false;
                }
            }
            let Some(step) = group.get(*at).filter(|_| at < end) else { return true };
            *at += 1;
            if let Err(why) = decoder.push(&step.header, &step.sector) {
                self.error = self.error.or(Some(why));
                return true;
            }
            let preamble = decoder.preamble();
            self.begun.get_or_insert((Instant::from_millis(preamble.start_ms), preamble.frames_before));
            self.epoch_us = self.epoch_us.or(preamble.epoch_micros);
            self.check_before.get_or_insert(preamble.chain);
        }
    }

    /// The error, and the number of sound sectors.
    fn unsound(&self, rest: &Rest) -> Option<(GroupError, usize)> {
        let error = self.error.filter(|error| matches!(error, GroupError::Corrupt | GroupError::Altered))?;
        Some((error, rest.at.saturating_sub(1)))
    }

    fn time(&mut self, at: Instant) {
        self.fell += u64::from(self.last.is_some_and(|last| at < last));
        self.last = Some(at);
    }

    fn entry(&mut self, outline: Outline<'_>, collected: &mut C) {
        match outline {
            Outline::Frame { at, id, bytes, verified } => {
                self.time(at);
                self.frames += 1;
                collected.frame(at, id, bytes, verified);
            }
            Outline::Whole(entry) => {
                let (Entry::Frame { at, .. } | Entry::Record { at, .. }) = entry;
                self.time(at);
                self.frames += u32::from(matches!(entry, Entry::Frame { .. }));
                match entry {
                    Entry::Record { record: Record::Clock(clock), .. } => {
                        self.epoch_us = Some(clock.epoch_micros());
                    }
                    Entry::Record { record, .. } => {
                        let before = self.begun.map_or(0, |(_, frames_before)| frames_before);
                        self.marks.record(at, &record, before.wrapping_add(self.frames));
                    }
                    Entry::Frame { .. } => {}
                }
                collected.entry(&entry);
            }
        }
    }
}

fn next(decoder: &mut GroupDecoder, counts: bool) -> Option<Result<Outline<'_>, GroupError>> {
    if counts { decoder.next_outline() } else { Some(decoder.next_entry()?.map(Outline::Whole)) }
}

/// Joins groups and finds the gaps.
#[derive(Default)]
struct Stitch {
    summary: LogSummary,
    open: Option<Gap>,
    /// Modulo 2^32, while the count is unbroken.
    expected: Option<u32>,
    check: Option<u32>,
    cut: bool,
    damaged_partial: u32,
    first_file: Option<u32>,
}

impl Stitch {
    fn take<C: EntryCollector>(
        &mut self,
        mut group: Decoded<C>,
        new: &impl Fn() -> C,
        deliver: &mut impl GroupReceiver<C>,
    ) -> Result<()> {
        let begins_late = self.summary.groups == 0 && self.open.is_none() && group.number > 0;
        let cut = std::mem::replace(&mut self.cut, group.ends_partial);
        self.damaged_partial = group.damaged_partial;
        if group.missing > 0 || cut || begins_late {
            let cause = if group.damaged { Cause::Damaged } else { Cause::Missing };
            if begins_late && cause == Cause::Missing {
                self.summary.files_gone = self.first_file.unwrap_or(0);
            }
            let missing = if begins_late { group.number } else { group.missing.max(u32::from(cut)) };
            let gap = self.gap(cause);
            gap.sectors_lost = gap.sectors_lost.saturating_add(missing);
        }
        self.summary.closed = group.closed;
        self.summary.first_number.get_or_insert(group.number);
        self.summary.last_number = Some(group.number.wrapping_add(group.sectors).wrapping_sub(1));
        match group.begun {
            None => self.skip(&group),
            Some((start, frames_before)) => {
                let missing = self.frames_missing(frames_before);
                if missing != Some(0) {
                    self.gap(Cause::Missing);
                }
                // The session's first group continues from zero.
                let before = self.check.or((group.number == 0).then_some(0));
                if let (None, Some(before), Some(begun)) = (&self.open, before, group.check_before) {
                    self.summary.unchained += u64::from(before != begun);
                }
                if let Some(mut gap) = self.open.take() {
                    (gap.to, gap.frames) = (Some(start), missing);
                    self.close(gap, deliver)?;
                }
                self.summary.times_fell += u64::from(self.summary.last.is_some_and(|last| start < last));
                hand_on(&mut group, new, deliver)?;
                self.expected = Some(frames_before.wrapping_add(group.frames));
                self.summary.first = self.summary.first.or(Some(start));
                self.summary.last = group.last.or(self.summary.last);
                self.summary.groups += 1;
                self.summary.frames += u64::from(group.frames);
                // Counts by kind differ: a header is wrong.
                let is_other = group.frames != group.frames_said;
                if let Some(error) = group.error.or(is_other.then_some(GroupError::Corrupt)) {
                    let gap = self.gap(error.into());
                    gap.frames = Some(group.frames_said.saturating_sub(group.frames));
                    gap.sectors_skipped += 1;
                }
            }
        }
        self.check = group.check_end;
        self.summary.marks.add(&group.marks);
        self.summary.entries_fell += group.fell;
        self.summary.epoch_us = group.epoch_us.or(self.summary.epoch_us);
        Ok(())
    }

    fn frames_missing(&self, before: u32) -> Option<u32> {
        let missing = before.wrapping_sub(self.expected.unwrap_or(0));
        Some(missing).filter(|missing| *missing < 1 << 31)
    }

    fn skip<C>(&mut self, group: &Decoded<C>) {
        let gap = self.gap(group.error.map_or(Cause::Missing, Cause::from));
        gap.sectors_skipped = gap.sectors_skipped.saturating_add(group.sectors);
        gap.frames = Some(gap.frames.unwrap_or(0).saturating_add(group.frames_said));
    }

    fn gap(&mut self, cause: Cause) -> &mut Gap {
        let from = self.summary.last;
        let new = Gap { from, to: None, cause, sectors_lost: 0, sectors_skipped: 0, frames: None };
        self.open.get_or_insert(new)
    }

    fn close<C>(&mut self, gap: Gap, deliver: &mut impl GroupReceiver<C>) -> Result<()> {
        self.summary.gaps += 1;
        self.summary.frames_missing += u64::from(gap.frames.unwrap_or(0));
        self.summary.gaps_uncounted += u64::from(gap.frames.is_none());
        deliver.gap(&gap)
    }

    fn end<C>(&mut self, damaged: u32, deliver: &mut impl GroupReceiver<C>) -> Result<()> {
        let damaged = damaged.saturating_add(self.damaged_partial);
        if damaged > 0 {
            let gap = self.gap(Cause::Damaged);
            gap.sectors_lost = gap.sectors_lost.saturating_add(damaged);
        }
        match self.open.take() {
            Some(gap) => self.close(gap, deliver),
            None => Ok(()),
        }
    }
}

fn hand_on<C: EntryCollector>(
    group: &mut Decoded<C>,
    new: &impl Fn() -> C,
    deliver: &mut impl GroupReceiver<C>,
) -> Result<()> {
    if let Some(collected) = group.collected.take() {
        deliver.group(collected)?;
    }
    while let Some(mut rest) = group.rest.take() {
        let mut collected = new();
        if !group.go_on(&mut rest, &mut collected) {
            group.rest = Some(rest);
        }
        deliver.group(collected)?;
    }
    Ok(())
}

/// UTC at power-on, microseconds since 1970; the last value counts.
///
/// Decodes the last group that has its beginning; earlier values are in the preambles.
pub fn epoch(log: &Log) -> Result<Option<u64>> {
    let mut groups = Groups::new(log);
    let mut decoder = Box::new(GroupDecoder::new());
    let (mut epoch, mut last) = (None, Vec::new());
    while let Some(group) = groups.next_group()? {
        if let Some(first) = group.first()
            && decoder.push(&first.header, &first.sector).is_ok()
        {
            epoch = decoder.preamble().epoch_micros.or(epoch);
            last = group;
        }
    }
    // No preamble follows.
    for step in &last {
        if decoder.push(&step.header, &step.sector).is_err() {
            break;
        }
        while let Some(Ok(entry)) = decoder.next_entry() {
            if let Entry::Record { record: Record::Clock(clock), .. } = entry {
                epoch = Some(clock.epoch_micros());
            }
        }
    }
    Ok(epoch)
}
