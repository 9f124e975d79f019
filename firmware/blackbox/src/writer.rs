//! Writer: frames and records in, sectors out. It allocates nothing, never waits, and keeps its stream decodable
//! after any failure of the storage.
//!
//! *Admission:* before an entry is encoded the sink must have room for `ENTRY_SECTORS_MAX`; otherwise the writer
//! returns `Full` and its state is as before. *Groups* end after `GROUP_SECTORS`. The entry that no longer fits is
//! undone (the coder's earlier state is stored), and becomes the first one of the next group.

use hums_core::clock::Instant;
use hums_dialect::wire::FRAME_BYTES_MAX;
use zerocopy::FromZeros;

use crate::bytes::copy_few;
use crate::chain;
use crate::codec::{CODED_BYTES_MAX, CodedEntry, Frame, Kind, Model, Out};
use crate::coder::{Encoder, FLUSH_MAX, LOOKAHEAD};
use crate::layouts;
use crate::preamble::{PREAMBLE_BYTES, Preamble};
use crate::record::{Mark, MarkReason, RECORD_BYTES_MAX, Record};
use crate::sector::{BODY_BYTES, GROUP_SECTORS, Header, RECORDS_MAX, Sector};
use crate::zeros;

/// Maximum sectors that one entry completes: the last of the old group, and those of a longest entry with the
/// preamble before it.
pub const ENTRY_SECTORS_MAX: usize = 1 + (PREAMBLE_BYTES + CODED_BYTES_MAX + FLUSH_MAX).div_ceil(BODY_BYTES);

/// Minimum bytes of a sector in the middle of a group: it is closed when no stream could end in it.
const BODY_CLOSED_MIN: usize = BODY_BYTES + 1 - FLUSH_MAX;

/// Sink of finished sectors: a bounded queue.
pub trait SectorSink {
    /// Number of sectors that it can take now.
    fn room(&self) -> usize;
    /// Called at most `room` times; not sealed yet.
    fn put(&mut self, sector: &Sector);
}

/// A refused entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Full {
    /// The sink has no room for it.
    NoRoom,
    /// It is longer than an entry may be: no frame, or a record beyond `RECORD_BYTES_MAX`.
    TooLong,
}

impl core::fmt::Display for Full {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::NoRoom => "the sector queue is full",
            Self::TooLong => "the entry is longer than an entry may be",
        })
    }
}

impl core::error::Error for Full {}

/// Counters of the writer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromZeros)]
pub struct Counters {
    /// Frames taken.
    pub frames: u64,
    /// Sectors finished.
    pub sectors: u64,
}

/// The writer with the model, the sector in progress and room for one coded entry.
pub struct Writer {
    model: Model,
    frame: Frame,
    coder: Encoder,
    scratch: Out,
    sector: Sector,
    header: Header,
    /// Entries that ended too close to the end of the sector before: the next one completes them.
    ended: EndedSector,
    /// Over all entries of the session.
    chain: u32,
    /// Its value at the end of the previous group.
    chain_before: u32,
    in_group: bool,
    /// An entry that no copy has.
    changed: bool,
    last_ms: u64,
    epoch_micros: Option<u64>,
    counters: Counters,
}

#[derive(Clone, Copy, Default, FromZeros)]
struct EndedSector {
    frames: u16,
    records: u8,
}

impl Writer {
    /// A writer at the start of a session. All its bytes are zeros, so that a board needs no image of it in flash: each
    /// group begins with a model made anew.
    pub const fn new() -> Self {
        Self {
            model: zeros(),
            frame: zeros(),
            coder: zeros(),
            scratch: zeros(),
            sector: Sector::zeroed(),
            header: zeros(),
            ended: zeros(),
            chain: 0,
            chain_before: 0,
            in_group: false,
            changed: false,
            last_ms: 0,
            epoch_micros: None,
            counters: zeros(),
        }
    }

    /// Adds a frame as it was received. `verified`: its checksum matched our definition; it is not checked again. If memory
    /// changed since, the frame decodes with the correct checksum, and a reader rejects it.
    pub fn frame(
        &mut self,
        at: Instant,
        bytes: &[u8],
        verified: bool,
        sink: &mut impl SectorSink,
    ) -> Result<(), Full> {
        if bytes.len() > FRAME_BYTES_MAX {
            return Err(Full::TooLong);
        }
        self.entry(at, Kind::Frame { verified }, bytes, sink)?;
        self.counters.frames += 1;
        Ok(())
    }

    /// Adds a record of the monitor's own.
    pub fn record(
        &mut self,
        at: Instant,
        record: &Record<'_>,
        sink: &mut impl SectorSink,
    ) -> Result<(), Full> {
        let mut stored = [0; RECORD_BYTES_MAX];
        let Some(stored) = record.store(&mut stored).ok().and_then(|len| stored.get(..len)) else {
            return Err(Full::TooLong);
        };
        self.entry(at, Kind::Record, stored, sink)?;
        if let Record::Clock(clock) = record {
            self.epoch_micros = Some(clock.epoch_micros());
        }
        Ok(())
    }

    /// Adds an end mark: the vehicle rests, and the log is whole up to here. Give storage [`Self::partial`] next.
    pub fn mark(&mut self, at: Instant, why: MarkReason, sink: &mut impl SectorSink) -> Result<(), Full> {
        let mark = Mark { why, sector: self.header.number, frames: self.counters.frames as u32 };
        self.record(at, &Record::Mark(mark), sink)
    }

    /// A copy of the sector in progress that decodes up to the last entry; `false` if the sector has no entry that is not in a
    /// full sector or an earlier copy. The full sector supersedes it.
    pub fn partial(&mut self, out: &mut Sector) -> bool {
        if !core::mem::take(&mut self.changed) {
            return false;
        }
        *out = self.sector;
        let mut header = self.header;
        header.partial = true;
        self.end_stream(&mut header, out);
        true
    }

    /// Ends the group: the next entry begins a new one, for example in a new file or after lost sectors. Does nothing
    /// while the sink has no room; it may be called again.
    pub fn restart(&mut self, sink: &mut impl SectorSink) -> bool {
        self.end_group(false, sink)
    }

    /// Ends the session in order; the next entry would begin a new group. `false` while the sink has no room.
    pub fn finish(&mut self, sink: &mut impl SectorSink) -> bool {
        if !self.in_group {
            // An empty group, so that there is a sector to carry the mark.
            if sink.room() == 0 {
                return false;
            }
            self.begin_group(self.last_ms);
        }
        self.end_group(true, sink)
    }

    /// Counters of the writer.
    pub const fn counters(&self) -> Counters {
        self.counters
    }

    fn entry(
        &mut self,
        at: Instant,
        kind: Kind,
        bytes: &[u8],
        sink: &mut impl SectorSink,
    ) -> Result<(), Full> {
        if sink.room() < ENTRY_SECTORS_MAX {
            return Err(Full::NoRoom);
        }
        self.last_ms = self.last_ms.max(self.millis(at));
        let entry = CodedEntry { kind, at_ms: self.last_ms, bytes };
        let value = chain::value_of(&entry);
        if !self.in_group {
            self.begin_group(entry.at_ms);
        } else if self.append(&entry, value, false, sink) {
            return Ok(());
        } else {
            self.end_group(false, sink);
            self.begin_group(entry.at_ms);
        }
        if !self.append(&entry, value, false, sink) {
            // The model makes it longer: uncoded it always fits.
            self.begin_group(entry.at_ms);
            self.append(&entry, value, true, sink);
        }
        Ok(())
    }

    /// Milliseconds of a time that is hardly ever far from the last one: a short division instead of a long one.
    fn millis(&self, at: Instant) -> u64 {
        match u32::try_from(at.as_micros().wrapping_sub(self.last_ms.wrapping_mul(1_000))) {
            Ok(ahead) => self.last_ms + u64::from(ahead / 1_000),
            Err(_) => at.as_millis(),
        }
    }

    /// `value`: in the chain; `false` (the model is spoilt, the stream is not): no room in the group, or too long a code.
    fn append(
        &mut self,
        entry: &CodedEntry<'_>,
        value: u32,
        plain: bool,
        sink: &mut impl SectorSink,
    ) -> bool {
        let Some(len) = self.encode(entry, plain) else { return false };
        let mut done = self.add(0, len);
        while done < len {
            self.next_sector(sink);
            done = self.add(done, len);
        }
        self.chain = chain::after(self.chain, value);
        self.count(entry.kind);
        self.changed = true;
        // A partial copy needs room to end the stream; a sector that is too full for that is closed early.
        if self.header.body_bytes + FLUSH_MAX > BODY_BYTES {
            self.next_sector(sink);
        }
        // The header's counts are full: real entries never reach that.
        if self.header.records >= RECORDS_MAX - 1 || self.header.frames >= u16::MAX - 1 {
            self.end_group(false, sink);
        }
        true
    }

    // Apart from `append`, which is compiled with the sink's crate, and for size there.
    #[inline(never)]
    fn encode(&mut self, entry: &CodedEntry<'_>, plain: bool) -> Option<usize> {
        let before = self.coder;
        self.scratch.clear();
        self.model.encode(entry, plain, &mut self.frame, &mut self.coder, &mut self.scratch);
        // Flipped counts end the group.
        let sectors_after = (GROUP_SECTORS - 1).saturating_sub(usize::from(self.header.since_first));
        let room = sectors_after * BODY_BYTES + BODY_BYTES.saturating_sub(self.header.body_bytes);
        let len = self.scratch.bytes().map(<[u8]>::len).filter(|len| len + LOOKAHEAD + FLUSH_MAX <= room);
        if len.is_none() {
            self.coder = before;
        }
        len
    }

    #[inline(never)]
    fn add(&mut self, done: usize, len: usize) -> usize {
        let at = self.header.body_bytes;
        let end = len.min(done + BODY_BYTES.saturating_sub(at));
        let places = self.sector.body_mut().get_mut(at..);
        let bytes = self.scratch.bytes().and_then(|bytes| bytes.get(done..end));
        if let (Some(places), Some(bytes)) = (places, bytes) {
            // Most entries have at most eight bytes. Further copied bytes have no meaning yet.
            match places.first_chunk_mut() {
                Some(place) if end <= 8 && done == 0 => *place = self.scratch.first(),
                _ => copy_few(bytes, places),
            }
        }
        self.header.body_bytes += end - done;
        end
    }

    fn count(&mut self, kind: Kind) {
        let complete = self.header.body_bytes + LOOKAHEAD <= BODY_CLOSED_MIN;
        match (kind, complete) {
            (Kind::Frame { .. }, true) => self.header.frames = self.header.frames.saturating_add(1),
            (Kind::Frame { .. }, false) => self.ended.frames = self.ended.frames.saturating_add(1),
            (Kind::Record, true) => self.header.records = self.header.records.saturating_add(1),
            (Kind::Record, false) => self.ended.records = self.ended.records.saturating_add(1),
        }
        if complete {
            self.header.check = self.chain;
        }
    }

    fn begin_group(&mut self, at_ms: u64) {
        let preamble = Preamble {
            layouts: layouts::CURRENT,
            start_ms: at_ms,
            frames_before: self.counters.frames as u32,
            epoch_micros: self.epoch_micros,
            chain: self.chain_before,
        }
        .store();
        self.chain = chain::begun(&preamble);
        (self.header.since_first, self.header.check) = (0, self.chain);
        self.sector.body_mut()[..PREAMBLE_BYTES].copy_from_slice(&preamble);
        self.header.body_bytes = PREAMBLE_BYTES;
        self.model.reset(at_ms);
        self.coder = Encoder::new();
        self.in_group = true;
    }

    fn end_group(&mut self, closed: bool, sink: &mut impl SectorSink) -> bool {
        if !self.in_group {
            return true;
        }
        if sink.room() == 0 {
            return false;
        }
        let mut header = self.header;
        header.closed = closed;
        let mut sector = self.sector;
        self.end_stream(&mut header, &mut sector);
        self.header = header;
        self.sector = sector;
        self.ended = EndedSector::default();
        self.chain_before = self.chain;
        self.next_sector(sink);
        self.header.closed = false;
        self.in_group = false;
        self.changed = false;
        true
    }

    /// Completes all entries.
    fn end_stream(&self, header: &mut Header, sector: &mut Sector) {
        let (bytes, len) = self.coder.flush();
        let at = header.body_bytes;
        if let Some(place) = sector.body_mut().get_mut(at..at + len) {
            place.copy_from_slice(&bytes[..len]);
        }
        header.body_bytes = (at + len).min(BODY_BYTES);
        header.frames = header.frames.saturating_add(self.ended.frames);
        header.records = header.records.saturating_add(self.ended.records);
        header.check = self.chain;
        sector.set_header(header);
    }

    fn next_sector(&mut self, sink: &mut impl SectorSink) {
        self.sector.set_header(&self.header);
        sink.put(&self.sector);
        self.counters.sectors += 1;
        self.header.number = self.header.number.wrapping_add(1);
        self.header.since_first = self.header.since_first.saturating_add(1);
        self.header.body_bytes = 0;
        self.header.frames = self.ended.frames;
        self.header.records = self.ended.records;
        self.header.check = self.chain;
        self.changed = self.ended.frames != 0 || self.ended.records != 0;
        self.ended = EndedSector::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Starts(Vec<bool>);

    impl SectorSink for Starts {
        fn room(&self) -> usize {
            usize::MAX
        }

        fn put(&mut self, sector: &Sector) {
            self.0.push(sector.starts_group());
        }
    }

    #[test]
    fn a_flip_of_the_counts_that_end_a_group_costs_that_group_only() {
        for flip in 0..20 {
            let (mut writer, mut sink) = (Box::new(Writer::new()), Starts(Vec::new()));
            for number in 0..10_000_u32 {
                if number == 500 {
                    match flip {
                        0..8 => writer.header.since_first ^= 1 << flip,
                        _ => writer.header.body_bytes ^= 1 << (flip - 8),
                    }
                }
                let mut bytes = [0; 40];
                bytes.as_chunks_mut().0.iter_mut().fold(number, |last, chunk| {
                    let next = last.wrapping_mul(0x9E37_79B9) ^ last >> 15;
                    *chunk = next.to_le_bytes();
                    next
                });
                let at = Instant::from_millis(u64::from(number));
                writer.frame(at, &bytes, false, &mut sink).unwrap();
            }
            let groups = sink.0.iter().filter(|starts| **starts).count();
            assert!(sink.0.len() > 300 && groups > sink.0.len() / 80, "{flip}: {groups} of {}", sink.0.len());
        }
    }
}
