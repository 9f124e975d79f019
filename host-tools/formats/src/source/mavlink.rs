//! MAVLink recordings: tlog, and a port's raw bytes.

use std::collections::VecDeque;

use anyhow::Result;
use hums_core::clock::{Instant, Span};
use hums_link::framer::{Framer, FramerCounts};

use super::blocks::BlockFinder;
use super::booted::BootTimes;
use super::checksums::Checksums;
use super::counts::Counts;
use super::daytime::Daytime;
use super::input::Input;
use super::item::{Cause, Fact, FactKind, Gap, Item, ItemSink, Needs, Reader, RecordingSummary};
use super::pace::Pace;
use super::paced::PacedSource;
use super::raw::Raw;
use super::said::FrameReports;
use super::stream::Source as _;
use super::tlog::records::{Record, Records, TIME_BYTES};
use super::tlog::times::{Begins, Times};
use crate::plural::count;
use crate::utc::moment;

fn summary(counts: Counts) -> RecordingSummary {
    let (mut messages, other_messages) = counts.messages();
    for message in &mut messages {
        message.id = message.id.map(|(id, _)| (id, hums_dialect::message(id).is_some()));
    }
    RecordingSummary { messages, other_messages, ..RecordingSummary::default() }
}

/// A ground station's log.
pub struct TlogReader {
    records: Records<Input>,
}

impl TlogReader {
    /// Reads from `input`.
    pub fn new(input: Input) -> Self {
        Self { records: Records::ahead(input) }
    }
}

impl Reader for TlogReader {
    fn read(&mut self, want: Needs<'_>, take: &mut ItemSink<'_>) -> Result<RecordingSummary> {
        let (mut framer, mut said, mut counts) = (Framer::new(), FrameReports::default(), Counts::new());
        let mut times = Times::default();
        let mut checksums = Checksums::default();
        let (mut place, mut noise) = (0_u64, None::<Noise>);
        while let Some(record) = self.records.next_record()? {
            if let Record::Frame { .. } = record
                && let Some(noise) = noise.take()
            {
                noise.tell(take)?;
            }
            let bytes = match record {
                Record::Frame { time_us, bytes } => {
                    let told = times.take(time_us, &bytes, place, &self.records);
                    match told.begins {
                        Some(Begins::Recording) => {
                            // All earlier state is void.
                            said.end(take)?;
                            (framer, said) = (Framer::new(), FrameReports::default());
                            take(times.now(), Item::Joint)?;
                        }
                        Some(Begins::Clock) => take(times.now(), Item::Restart)?,
                        None => {}
                    }
                    if let Some(epoch_us) = told.epoch_us {
                        take(times.now(), Item::Epoch(epoch_us))?;
                    }
                    place += TIME_BYTES as u64;
                    checksums.begin(times.now(), place, &bytes);
                    bytes
                }
                Record::Noise(bytes) => {
                    let new = Noise { at: times.now(), place, bytes: 0, is_cut: false };
                    let noise = noise.get_or_insert(new);
                    noise.is_cut = noise.bytes == 0 && self.records.is_cut(&bytes);
                    noise.bytes += bytes.len();
                    bytes
                }
            };
            place += bytes.len() as u64;
            let now = times.now();
            push(&mut framer, &bytes, true, &mut |frame| {
                checksums.frame(&frame);
                counts.add(frame.id(), true, frame.bytes().len());
                said.frame(now, &frame, want, take)
            })?;
            if let Some(frame) = checksums.end(&bytes) {
                counts.add(frame.id(), true, bytes.len());
                said.frame(now, &frame, want, take)?;
            }
        }
        if let Some(noise) = noise {
            noise.tell(take)?;
        }
        if let Some(gap) = checksums.gap() {
            take(times.now(), Item::Gap(&gap))?;
        }
        if let Some(words) = checksums.words() {
            take(times.now(), Item::Fact(Fact { about: FactKind::Unchecked, words: &words }))?;
        }
        let summary = summary(counts);
        let frames = summary.messages.iter().map(|message| message.amount.count).sum();
        for gap in times.gaps().chain(times.none_of(frames)) {
            take(times.now(), Item::Gap(&gap))?;
        }
        said.end(take)?;
        Ok(summary)
    }
}

/// Outside of records, as one place.
struct Noise {
    at: Instant,
    place: u64,
    bytes: usize,
    is_cut: bool,
}

impl Noise {
    fn tell(self, take: &mut ItemSink<'_>) -> Result<()> {
        let (cause, what) = if self.is_cut {
            (Cause::Cut, "a record that the end cuts off")
        } else {
            (Cause::Damaged, "of no record of the tlog")
        };
        let words = format!("{what}: {}", count(self.bytes, "byte"));
        take(self.at, Item::Gap(&gap(self.at, cause, self.place, self.bytes, words)))
    }
}

/// A port's raw bytes, in the autopilot's time or a line's.
pub struct RawReader {
    bytes: PacedSource<Raw<Input>>,
}

impl RawReader {
    /// Reads from `input`, at `baud`.
    pub fn new(input: Input, baud: u32) -> Self {
        Self { bytes: PacedSource::new(Raw::new(input), baud) }
    }
}

impl Reader for RawReader {
    fn read(&mut self, want: Needs<'_>, take: &mut ItemSink<'_>) -> Result<RecordingSummary> {
        let (mut framer, mut said, mut counts) = (Framer::new(), FrameReports::default(), Counts::new());
        let mut line = Instant::ZERO;
        let (mut times, mut blocks) = (BootTimes::default(), BlockFinder::default());
        let (mut pace, mut bytes) = (Pace::default(), 0);
        let (mut daytime, mut strays) = (Daytime::default(), Strays::default());
        let now = std::cell::Cell::new(Instant::ZERO);
        let mut each = |line, frame: hums_link::Frame<'_>, take: &mut ItemSink<'_>| {
            counts.add(frame.id(), true, frame.bytes().len());
            let (at, begins) = times.at(line, &frame);
            now.set(at);
            match begins {
                Some(Begins::Recording) => {
                    said.end(take)?;
                    said = FrameReports::default();
                    pace.begin_another();
                    take(at, Item::Joint)?;
                }
                Some(Begins::Clock) => {
                    pace.fell(at);
                    take(at, Item::Restart)?;
                }
                None => {}
            }
            if begins.is_some() {
                daytime = Daytime::default();
            }
            if times.is_of(&frame)
                && let Some(epoch_us) = daytime.of(at, &frame)
            {
                take(at, Item::Epoch(epoch_us))?;
            }
            pace.at(at, bytes, frame.bytes().len() as u64);
            bytes += frame.bytes().len() as u64;
            said.frame(at, &frame, want, take)
        };
        while let Some(chunk) = self.bytes.next()? {
            line = Instant::from_micros(chunk.at_us);
            push(&mut framer, &chunk.bytes, false, &mut |frame| each(line, frame, take))?;
            strays.take(now.get(), blocks.place, &chunk.bytes, framer.counts());
            blocks.take(&chunk.bytes, framer.counts().frames);
        }
        let (held, frames) = (framer.held(), framer.counts().frames);
        push(&mut framer, &[], true, &mut |frame| each(line, frame, take))?;
        strays.take(now.get(), blocks.place, &[], framer.counts());
        let now = now.get();
        said.end(take)?;
        if let Some(gap) = pace.gap() {
            take(now, Item::Gap(&gap))?;
        }
        blocks.end();
        for gap in blocks.gaps(now) {
            take(now, Item::Gap(&gap))?;
        }
        let is_cut = held > 0 && framer.counts().frames == frames;
        let cut = if is_cut { held } else { 0 };
        if is_cut {
            let place = blocks.place.saturating_sub(held as u64);
            let words = format!("a frame that the end cuts off: {}", count(held, "byte"));
            take(now, Item::Gap(&gap(now, Cause::Cut, place, held, words)))?;
        }
        strays.tell(now, blocks.bytes() + cut as u64, take)?;
        Ok(summary(counts))
    }
}

/// Outside of frames: a booting autopilot's text, and noise.
#[derive(Default)]
struct Strays {
    /// Bytes before a frame, the first ones.
    latest: VecDeque<u8>,
    /// First frame.
    begun: Option<Instant>,
    /// Outside of frames, and harmless text among them.
    bytes: u64,
    words: u64,
    /// First time and place, last time.
    noise: Option<(Instant, u64, Instant)>,
}

/// Longer runs are not text of a boot, and it is over this long after its first frame.
const WORDS_BYTES_MAX: usize = 16 * 1024;
const BOOTS: Span = Span::from_secs(2);
/// A framer may hold them before its report.
const HELD_BYTES: usize = 512;

impl Strays {
    fn take(&mut self, at: Instant, place: u64, bytes: &[u8], counts: FramerCounts) {
        self.latest.extend(bytes);
        let kept = if self.begun.is_none() { WORDS_BYTES_MAX } else { HELD_BYTES };
        self.latest.drain(..self.latest.len().saturating_sub(kept));
        let new = counts.bytes_not_frames - self.bytes;
        let is_boot = match self.begun {
            None if counts.frames == 0 => return,
            None => true,
            Some(begun) => self.words > 0 && at.since(begun) <= BOOTS,
        };
        self.begun.get_or_insert(at);
        self.bytes = counts.bytes_not_frames;
        if new > 0 && is_boot && has_words(&self.latest, new) {
            self.words += new;
        } else if new > 0 {
            let (first, place, _) = self.noise.unwrap_or((at, place, at));
            self.noise = Some((first, place, at));
        }
    }

    fn tell(self, now: Instant, others: u64, take: &mut ItemSink<'_>) -> Result<()> {
        if self.words > 0 {
            let words = format!(
                "{} at its beginning are words and no frame, as of an autopilot that boots: nothing is lost",
                count(self.words, "byte")
            );
            take(now, Item::Fact(Fact { about: FactKind::Beginning, words: &words }))?;
        }
        let noise = self.bytes.saturating_sub(self.words + others);
        if noise > 0 {
            // A line's noise and a file's damage look alike.
            let (first, place, last) = self.noise.unwrap_or((now, 0, now));
            let until = if last > first { format!(", the last at {}", moment(last)) } else { String::new() };
            let words = format!("of no frame, noise on the line: {}{until}", count(noise, "byte"));
            let lost = Gap { bytes: noise, ..gap(first, Cause::Lost, place, 0, words) };
            take(now, Item::Gap(&lost))?;
        }
        Ok(())
    }
}

/// This many in a row.
fn has_words(bytes: &VecDeque<u8>, wanted: u64) -> bool {
    let mut run = 0;
    bytes.iter().any(|byte| {
        run = if matches!(byte, b' '..=b'~' | b'\r' | b'\n' | b'\t') { run + 1 } else { 0 };
        run >= wanted
    })
}

fn gap(at: Instant, cause: Cause, place: u64, bytes: usize, words: String) -> Gap {
    Gap { from: Some(at), to: None, cause, place: Some(place), bytes: bytes as u64, words, own: None }
}

/// With a fallible receiver of frames; `idle`: silence follows.
fn push(
    framer: &mut Framer,
    bytes: &[u8],
    idle: bool,
    each: &mut dyn FnMut(hums_link::Frame<'_>) -> Result<()>,
) -> Result<()> {
    let mut result = Ok(());
    let mut sink = |frame: hums_link::Frame<'_>| {
        if result.is_ok() {
            result = each(frame);
        }
    };
    framer.push(bytes, &mut sink);
    if idle {
        framer.idle(&mut sink);
    }
    result
}

#[cfg(test)]
mod tests;
