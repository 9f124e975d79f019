//! Reads a log's blocks one by one, for tests: entries, and gaps with their causes. The host tools read groups side by side.
#![allow(dead_code, reason = "not each of its users needs all of it")]

use hums_blackbox::{
    Assembler, BlockCounts, Cause, Entry, Gap, GroupDecoder, Preamble, Record, SECTOR_BYTES, Step,
};
use hums_core::clock::Instant;

#[derive(Debug)]
pub(crate) enum Item<'a> {
    Entry(Entry<'a>),
    Gap(Gap),
}

/// Totals.
#[derive(Debug, Default)]
pub(crate) struct End {
    pub(crate) closed: bool,
    pub(crate) groups: usize,
    pub(crate) blocks: BlockCounts,
    /// UTC at power-on, microseconds since 1970.
    pub(crate) epoch_micros: Option<u64>,
}

/// Gives the log of the first sector's session to `take`, in order.
pub(crate) fn read<'a>(
    blocks: impl IntoIterator<Item = &'a [u8; SECTOR_BYTES]>,
    take: impl FnMut(Item<'_>),
) -> End {
    let mut assembler = Assembler::new();
    let mut reading = Reading {
        decoder: Box::new(GroupDecoder::new()),
        take,
        gap: None,
        cut: None,
        last_at: None,
        frames: None,
        end: End::default(),
    };
    for block in blocks.into_iter().map(Some).chain([None]) {
        match block {
            Some(block) => assembler.feed(block),
            None => assembler.end(),
        }
        while let Some(step) = assembler.next() {
            reading.step(&step);
        }
    }
    // The last sector may be partial, and a damaged block the whole one.
    let damaged = assembler.damaged_since() + reading.cut.unwrap_or(0);
    if damaged > 0 && reading.gap.is_none() {
        reading.open(Cause::Damaged).sectors_lost = damaged;
    }
    if let Some(gap) = reading.gap.take() {
        (reading.take)(Item::Gap(gap));
    }
    reading.end.blocks = assembler.counts();
    reading.end
}

struct Reading<F> {
    decoder: Box<GroupDecoder>,
    take: F,
    gap: Option<Gap>,
    /// The last sector was partial; damaged blocks before it.
    cut: Option<u32>,
    last_at: Option<Instant>,
    /// Of the session up to here.
    frames: Option<u32>,
    end: End,
}

impl<F: FnMut(Item<'_>)> Reading<F> {
    fn open(&mut self, cause: Cause) -> &mut Gap {
        let from = self.last_at;
        self.gap.get_or_insert(Gap {
            from,
            to: None,
            cause,
            sectors_lost: 0,
            sectors_skipped: 0,
            frames: None,
        })
    }

    fn step(&mut self, step: &Step) {
        let header = &step.header;
        let cut = std::mem::replace(&mut self.cut, header.partial.then_some(step.damaged)).is_some();
        if step.missing > 0 || cut {
            let cause = if step.damaged > 0 { Cause::Damaged } else { Cause::Missing };
            let gap = self.open(cause);
            gap.sectors_lost = gap.sectors_lost.saturating_add(step.missing.max(u32::from(cut)));
        }
        self.end.closed |= header.closed;
        match self.decoder.push(header, &step.sector) {
            Ok(()) if header.starts_group() => self.begin(self.decoder.preamble()),
            Ok(()) => {}
            Err(error) => {
                let gap = self.open(error.into());
                gap.sectors_skipped += 1;
                gap.frames = Some(gap.frames.unwrap_or(0).saturating_add(u32::from(header.frames)));
            }
        }
        self.entries();
    }

    fn begin(&mut self, preamble: Preamble) {
        let Preamble { start_ms, frames_before, epoch_micros, .. } = preamble;
        let missing = self.frames.map(|frames| frames_before.wrapping_sub(frames));
        let missing = missing.filter(|&missing| missing < 1 << 31);
        if missing.is_some_and(|missing| missing > 0) {
            self.open(Cause::Missing);
        }
        if let Some(gap) = self.gap.take() {
            (self.take)(Item::Gap(Gap { to: Some(Instant::from_millis(start_ms)), frames: missing, ..gap }));
        }
        self.frames = Some(frames_before);
        self.end.epoch_micros = epoch_micros.or(self.end.epoch_micros);
        self.end.groups += 1;
    }

    fn entries(&mut self) {
        while let Some(entry) = self.decoder.next_entry() {
            let entry = match entry {
                Ok(entry) => entry,
                Err(error) => {
                    self.open(error.into());
                    return;
                }
            };
            match entry {
                Entry::Frame { .. } => self.frames = self.frames.map(|frames| frames.wrapping_add(1)),
                Entry::Record { record: Record::Clock(clock), .. } => {
                    self.end.epoch_micros = Some(clock.epoch_micros());
                }
                Entry::Record { .. } => {}
            }
            let (Entry::Frame { at, .. } | Entry::Record { at, .. }) = entry;
            self.last_at = Some(at);
            (self.take)(Item::Entry(entry));
        }
    }
}
