//! Reading a log: blocks in, items out, in bounded memory and without I/O.
//!
//! ```text
//! loop { reader.feed(&block); while let Some(item) = reader.next() { … } }
//! reader.end(); while let Some(item) = reader.next() { … }      // the last item is `End`
//! ```
//! An unreadable part is an item too: a `Gap` with its times and its cause. After a gap, reading continues at the start of the
//! next group. Before a gap with [`Cause::Altered`], up to one sector's entries may be wrong.

use hums_core::clock::Instant;

use crate::assemble::{Assembler, BlockCounts, Step};
use crate::group::{Entry, GroupDecoder, GroupError};
use crate::preamble::Preamble;
use crate::record::Record;
use crate::sector::{Header, SECTOR_BYTES};

/// An item of a log, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Item<'a> {
    /// A frame.
    Frame {
        /// Reception on the monitor's clock, whole milliseconds.
        at: Instant,
        /// UTC, microseconds since 1970, if known.
        utc_micros: Option<u64>,
        /// Bit for bit.
        bytes: &'a [u8],
        /// The checksum matches the monitor's definition.
        verified: bool,
    },
    /// A record of the monitor's own.
    Record {
        /// Time on the monitor's clock, whole milliseconds.
        at: Instant,
        /// UTC, microseconds since 1970, if known.
        utc_micros: Option<u64>,
        /// The record.
        record: Record<'a>,
    },
    /// A missing part.
    Gap(Gap),
    /// End of the input.
    End(Summary),
}

/// The reason that a part is unreadable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Cause {
    /// Missing sectors: never written, overwritten or lost.
    Missing,
    /// Sectors with a wrong checksum.
    Damaged,
    /// The group uses message layouts of this unknown hash.
    UnknownLayouts(u32),
    /// Valid sectors with contents that no writer produces.
    Corrupt,
    /// Valid sectors with altered entries: the recorder's memory had changed.
    Altered,
    /// The vehicle was disarmed and is recorded by arming: sectors were dropped on purpose, by a record.
    Disarmed,
}

impl Cause {
    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::Damaged => "damaged",
            Self::UnknownLayouts(_) => "unknown_layouts",
            Self::Corrupt => "corrupt",
            Self::Altered => "altered",
            Self::Disarmed => "disarmed",
        }
    }
}

/// A part of the log that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The last entry before it; `None`: nothing was read before it.
    pub from: Option<Instant>,
    /// The first entry after it; `None`: nothing is readable after it.
    pub to: Option<Instant>,
    /// Why.
    pub cause: Cause,
    /// Sectors missing or damaged.
    pub sectors_lost: u32,
    /// Sound sectors of the same group that cannot be decoded without those.
    pub sectors_skipped: u32,
    /// Missing frames, if the counts on both sides are known; at a log's end only those of the skipped sectors.
    pub frames: Option<u32>,
}

/// Totals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Summary {
    /// The log's session.
    pub session: Option<u32>,
    /// The session ended in order; otherwise power failed or the log continues in another file.
    pub closed: bool,
    /// Frames given out.
    pub frames: u64,
    /// Their bytes.
    pub frame_bytes: u64,
    /// Records given out.
    pub records: u64,
    /// Groups begun.
    pub groups: u64,
    /// Gaps given out.
    pub gaps: u64,
    /// Frames known to be missing.
    pub frames_missing: u64,
    /// Blocks by kind.
    pub blocks: BlockCounts,
}

/// Reader of one log. It is large (see `size_of`): box it.
pub struct LogReader {
    assembler: Assembler,
    decoder: GroupDecoder,
    open_gap: Option<Gap>,
    /// A gap to return before the entries of the group that ended it.
    gap_due: Option<Gap>,
    /// The last sector was partial, and its successor is still unknown.
    cut: bool,
    last_at: Option<Instant>,
    /// Frames of the session up to here, while the count is unbroken.
    frames_expected: Option<u32>,
    epoch_micros: Option<u64>,
    /// Damaged blocks at the place of the last, partial sector: one may have been the whole one.
    damaged_partial: u32,
    /// Damaged blocks after the last sector were given out as a gap.
    counted_end: bool,
    summary: Summary,
    state: State,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum State {
    Reading,
    Ending,
    Ended,
}

impl LogReader {
    /// Reads the session of the first sound sector.
    pub fn new() -> Self {
        Self::with(Assembler::new())
    }

    /// Reads this session only, for instance out of a whole card image.
    pub fn for_session(session: u32) -> Self {
        Self::with(Assembler::for_session(session))
    }

    fn with(assembler: Assembler) -> Self {
        Self {
            assembler,
            decoder: GroupDecoder::new(),
            open_gap: None,
            gap_due: None,
            cut: false,
            last_at: None,
            frames_expected: None,
            epoch_micros: None,
            damaged_partial: 0,
            counted_end: false,
            summary: Summary::default(),
            state: State::Reading,
        }
    }

    /// UTC at power-on, microseconds since 1970, if known by now.
    pub const fn epoch_micros(&self) -> Option<u64> {
        self.epoch_micros
    }

    /// Before each block, call `next` until it returns `None`: entries not fetched are lost.
    pub fn feed(&mut self, block: &[u8; SECTOR_BYTES]) {
        self.assembler.feed(block);
    }

    /// Ends the input: `next` returns the remaining items, then `End`.
    pub fn end(&mut self) {
        if self.state != State::Reading {
            return;
        }
        self.assembler.end();
        self.state = State::Ending;
    }

    /// The next item; `None`: feed the next block.
    #[expect(clippy::should_implement_trait, reason = "the items borrow from the reader")]
    pub fn next(&mut self) -> Option<Item<'_>> {
        loop {
            if let Some(gap) = self.gap_due.take() {
                return Some(self.give(gap));
            }
            match self.decoder.advance() {
                Some(Ok(())) => return Some(self.item()),
                Some(Err(error)) => {
                    self.open(error.into());
                }
                None => {}
            }
            match self.assembler.next() {
                Some(step) => self.step(&step),
                None => break,
            }
        }
        if self.state != State::Ending {
            return None;
        }
        if !self.counted_end {
            self.counted_end = true;
            let damaged = self.assembler.damaged_since().saturating_add(self.damaged_partial);
            if damaged > 0 && self.open_gap.is_none() {
                self.open(Cause::Damaged).sectors_lost = damaged;
            }
        }
        if let Some(gap) = self.open_gap.take() {
            return Some(self.give(gap));
        }
        self.state = State::Ended;
        self.summary.session = self.assembler.session();
        self.summary.blocks = self.assembler.counts();
        Some(Item::End(self.summary))
    }

    fn give(&mut self, gap: Gap) -> Item<'static> {
        self.summary.gaps += 1;
        self.summary.frames_missing += u64::from(gap.frames.unwrap_or(0));
        Item::Gap(gap)
    }

    fn open(&mut self, cause: Cause) -> &mut Gap {
        self.decoder.abandon();
        self.open_gap.get_or_insert(Gap {
            from: self.last_at,
            to: None,
            cause,
            sectors_lost: 0,
            sectors_skipped: 0,
            frames: None,
        })
    }

    fn step(&mut self, step: &Step) {
        let header = &step.header;
        // A partial sector without a full one: later entries of that sector are lost.
        let cut = core::mem::replace(&mut self.cut, header.partial);
        self.damaged_partial = if header.partial { step.damaged } else { 0 };
        if step.missing > 0 || cut {
            let cause = if step.damaged > 0 { Cause::Damaged } else { Cause::Missing };
            let gap = self.open(cause);
            gap.sectors_lost = gap.sectors_lost.saturating_add(step.missing.max(u32::from(cut)));
        }
        self.summary.closed |= header.closed;
        match self.decoder.push(header, &step.sector) {
            Ok(()) if header.starts_group() => self.started(),
            Ok(()) => {}
            Err(error) => self.skipped(header, error),
        }
    }

    fn skipped(&mut self, header: &Header, error: GroupError) {
        let gap = self.open(error.into());
        gap.sectors_skipped = gap.sectors_skipped.saturating_add(1);
        gap.frames = Some(gap.frames.unwrap_or(0).saturating_add(u32::from(header.frames)));
    }

    fn started(&mut self) {
        let Preamble { start_ms, frames_before, epoch_micros, .. } = self.decoder.preamble();
        let missing = self.frames_expected.map(|expected| frames_before.wrapping_sub(expected));
        let missing = missing.filter(|&missing| missing < 1 << 31);
        if missing.is_some_and(|missing| missing > 0) && self.open_gap.is_none() {
            let gap = Gap {
                from: self.last_at,
                to: None,
                cause: Cause::Missing,
                sectors_lost: 0,
                sectors_skipped: 0,
                frames: None,
            };
            self.open_gap = Some(gap);
        }
        if let Some(mut gap) = self.open_gap.take() {
            gap.to = Some(Instant::from_millis(start_ms));
            gap.frames = missing;
            self.gap_due = Some(gap);
        }
        self.frames_expected = Some(frames_before);
        self.epoch_micros = epoch_micros.or(self.epoch_micros);
        self.summary.groups += 1;
    }

    fn item(&mut self) -> Item<'_> {
        let utc = |at: Instant, epoch: Option<u64>| epoch.map(|epoch| epoch.saturating_add(at.as_micros()));
        match self.decoder.entry() {
            Entry::Frame { at, bytes, verified } => {
                self.summary.frames += 1;
                self.summary.frame_bytes += bytes.len() as u64;
                self.frames_expected = self.frames_expected.map(|count| count.wrapping_add(1));
                self.last_at = Some(at);
                Item::Frame { at, utc_micros: utc(at, self.epoch_micros), bytes, verified }
            }
            Entry::Record { at, record } => {
                self.summary.records += 1;
                self.last_at = Some(at);
                if let Record::Clock(clock) = record {
                    self.epoch_micros = Some(clock.epoch_micros());
                }
                Item::Record { at, utc_micros: utc(at, self.epoch_micros), record }
            }
        }
    }
}

impl From<GroupError> for Cause {
    fn from(error: GroupError) -> Self {
        match error {
            GroupError::OutOfOrder => Self::Missing,
            GroupError::UnknownLayouts(hash) => Self::UnknownLayouts(hash),
            GroupError::Corrupt => Self::Corrupt,
            GroupError::Altered => Self::Altered,
        }
    }
}
