//! HUMS logs as the one stream, read by [`crate::logs::reader`].

use anyhow::Result;
use hums_blackbox::record::{Loss, LossKind, Note, RECORD_BYTES_MAX};
use hums_blackbox::{Cause as OwnCause, Entry, Gap as OwnGap, Record, SECTOR_BYTES};
use hums_core::clock::Instant;
use hums_core::observation::{Observation, Source};
use hums_link::{Check, Frame, observe};

use super::checksums::wrong_checksums;
use super::counts::Counts;
use super::input::Progress;
use super::item::{Cause, Gap, Item, ItemSink, Needs, Reader, RecordingSummary};
use super::parts::{ItemCollector, PartReceiver};
use super::said::FrameReports;
use crate::ending::Ending;
use crate::logs::Log;
use crate::logs::reader::{self, epoch};
use crate::loss;
use crate::mavlink::ids::{HEARTBEAT, PARAM_VALUE, STATUSTEXT};
use crate::plural::{are, count};

/// A packed log's note: another recording goes on, because the input was joined.
pub const JOINED: &str = "another recording begins here: the input was joined of several";

/// A HUMS log's session.
pub struct OwnReader {
    log: Log,
    progress: Progress,
}

impl OwnReader {
    /// Reads `log`.
    pub fn new(log: Log) -> Self {
        let progress = Progress::default();
        progress.set_total(log.bytes());
        Self { log, progress }
    }

    /// Progress of reading.
    pub fn progress(&self) -> Progress {
        self.progress.clone()
    }

    /// Parts are groups; `seen` gets the bytes read.
    pub fn in_parts<C: ItemCollector>(
        &self,
        want: Needs<'_>,
        new: impl Fn() -> C + Sync,
        deliver: &mut impl PartReceiver<C>,
        mut seen: impl FnMut(u64),
    ) -> Result<RecordingSummary> {
        let Needs { frames, observations, .. } = want;
        let new = || Part { frames, observations, counts: Counts::new(), not_frames: 0, collected: new() };
        let mut parts = Parts { deliver, counts: Counts::new(), not_frames: 0 };
        let summary = reader::read(&self.log, new, &mut parts, |blocks| seen(blocks * SECTOR_BYTES as u64))?;
        let Parts { counts, not_frames, .. } = parts;
        let (messages, other_messages) = counts.messages();
        let ending = Ending::of(&self.log, summary);
        let reader::LogSummary { first, last, gaps, losses, .. } = ending.summary;
        let span = first.zip(last);
        Ok(RecordingSummary {
            messages,
            other_messages,
            not_frames,
            span,
            gaps,
            losses,
            ending: Some(ending),
        })
    }

    /// Reads in parts; also hands on all items in order, as [`Reader::read`]: one reading for both.
    pub fn in_parts_and_order<C: ItemCollector>(
        &self,
        want: Needs<'_>,
        new: impl Fn() -> C + Sync,
        deliver: &mut impl PartReceiver<C>,
        take: &mut ItemSink<'_>,
        seen: impl FnMut(u64),
    ) -> Result<RecordingSummary> {
        let in_order = Needs { observations: true, system: want.system, ..Needs::default() };
        let new = || Both {
            frames: want.frames,
            collected: new(),
            kept: KeptItems { observations: true, ..KeptItems::default() },
        };
        let hand = ItemForwarder { want: in_order, take, said: FrameReports::default(), lost: None };
        let mut both = BothForwarder { deliver, hand };
        let summary = self.in_parts(Needs { frames: true, ..want }, new, &mut both, seen)?;
        both.hand.end()?;
        Ok(summary)
    }
}

impl Reader for OwnReader {
    fn read(&mut self, want: Needs<'_>, take: &mut ItemSink<'_>) -> Result<RecordingSummary> {
        if let Some(epoch) = epoch(&self.log)? {
            take(Instant::ZERO, Item::Epoch(epoch))?;
        }
        let mut hand = ItemForwarder { want, take, said: FrameReports::default(), lost: None };
        let new =
            || KeptItems { frames: want.frames, observations: want.observations, ..KeptItems::default() };
        let all = Needs { frames: true, ..Needs::default() };
        let summary = self.in_parts(all, new, &mut hand, |bytes| self.progress.set_taken(bytes))?;
        hand.end()?;
        Ok(summary)
    }
}

struct Part<C> {
    frames: bool,
    observations: bool,
    counts: Counts,
    not_frames: u64,
    collected: C,
}

impl<C: ItemCollector> reader::EntryCollector for Part<C> {
    fn entry(&mut self, entry: &Entry<'_>) {
        match *entry {
            Entry::Frame { at, bytes, verified } => {
                let check = if verified { Check::Verified } else { Check::Unverified };
                let Some(frame) = Frame::again(bytes, check) else {
                    self.not_frames += 1;
                    return;
                };
                self.counts.add(frame.id(), verified, bytes.len());
                if self.frames {
                    self.collected.item(at, Item::Frame(&frame));
                }
                if let (true, Some((source, observation))) = (self.observations, observe(&frame)) {
                    self.collected.item(at, Item::Observation(source, &observation));
                }
            }
            Entry::Record { at, record } => self.collected.item(at, Item::Record(&record)),
        }
    }

    fn held_bytes(&self) -> usize {
        // Counts have a limit of their own.
        self.collected.held_bytes()
    }

    fn only_counts(&self) -> bool {
        !self.frames && !self.observations
    }

    fn frame(&mut self, _at: Instant, id: u32, bytes: usize, verified: bool) {
        self.counts.add(id, verified, bytes);
    }
}

struct Parts<'a, D> {
    deliver: &'a mut D,
    counts: Counts,
    not_frames: u64,
}

impl<C, D: PartReceiver<C>> reader::GroupReceiver<Part<C>> for Parts<'_, D> {
    fn gap(&mut self, own: &OwnGap) -> Result<()> {
        self.deliver.gap(&gap(own))
    }

    fn group(&mut self, part: Part<C>) -> Result<()> {
        self.counts.and(&part.counts);
        self.not_frames += part.not_frames;
        self.deliver.part(part.collected)
    }
}

#[derive(Default)]
struct KeptItems {
    frames: bool,
    observations: bool,
    items: Vec<(Instant, Stored)>,
    bytes: Vec<u8>,
}

enum Stored {
    /// Ends here in `bytes`; read later.
    Frame(Check, usize),
    Observation(Source, Box<Observation>),
    /// Ends here in `bytes`.
    Record(usize),
}

impl ItemCollector for KeptItems {
    fn item(&mut self, at: Instant, item: Item<'_>) {
        match item {
            Item::Frame(frame) => {
                if self.frames || matches!(frame.id(), HEARTBEAT | PARAM_VALUE | STATUSTEXT) {
                    self.bytes.extend_from_slice(frame.bytes());
                    self.items.push((at, Stored::Frame(frame.check(), self.bytes.len())));
                } else if let (true, Some((source, observation))) = (self.observations, observe(frame)) {
                    self.items.push((at, Stored::Observation(source, Box::new(observation))));
                }
            }
            Item::Record(record) => {
                let mut stored = [0; RECORD_BYTES_MAX];
                if let Ok(len) = record.store(&mut stored) {
                    self.bytes.extend_from_slice(stored.get(..len).unwrap_or_default());
                    self.items.push((at, Stored::Record(self.bytes.len())));
                }
            }
            _ => {}
        }
    }

    fn held_bytes(&self) -> usize {
        // Observations are on the heap, with the allocator's overhead.
        const ITEM_BYTES: usize = size_of::<(Instant, Stored)>() + size_of::<Observation>() + 16;
        self.bytes.len() + self.items.len() * ITEM_BYTES
    }
}

struct Both<C> {
    frames: bool,
    collected: C,
    kept: KeptItems,
}

impl<C: ItemCollector> ItemCollector for Both<C> {
    fn item(&mut self, at: Instant, item: Item<'_>) {
        self.kept.item(at, item);
        if self.frames || !matches!(item, Item::Frame(_)) {
            self.collected.item(at, item);
        }
    }

    fn held_bytes(&self) -> usize {
        self.collected.held_bytes() + self.kept.held_bytes()
    }
}

struct BothForwarder<'a, 'b, 'c, D> {
    deliver: &'c mut D,
    hand: ItemForwarder<'a, 'b>,
}

impl<C, D: PartReceiver<C>> PartReceiver<Both<C>> for BothForwarder<'_, '_, '_, D> {
    fn gap(&mut self, gap: &Gap) -> Result<()> {
        self.hand.gap(gap)?;
        self.deliver.gap(gap)
    }

    fn part(&mut self, part: Both<C>) -> Result<()> {
        self.hand.part(part.kept)?;
        self.deliver.part(part.collected)
    }
}

struct ItemForwarder<'a, 'b> {
    want: Needs<'a>,
    take: &'a mut ItemSink<'b>,
    said: FrameReports,
    /// Losses until recording goes on: there is a record for each second.
    lost: Option<(Instant, Loss)>,
}

impl PartReceiver<KeptItems> for ItemForwarder<'_, '_> {
    fn gap(&mut self, gap: &Gap) -> Result<()> {
        self.tell_lost()?;
        (self.take)(gap.from.unwrap_or(Instant::ZERO), Item::Gap(gap))
    }

    fn part(&mut self, part: KeptItems) -> Result<()> {
        let mut start = 0;
        let mut bytes = |end| part.bytes.get(std::mem::replace(&mut start, end)..end).unwrap_or_default();
        for (at, stored) in &part.items {
            if !matches!(stored, Stored::Record(_)) {
                self.tell_lost()?;
            }
            match stored {
                Stored::Frame(check, end) => {
                    if let Some(frame) = Frame::again(bytes(*end), *check) {
                        self.said.frame(*at, &frame, self.want, self.take)?;
                    }
                }
                Stored::Observation(source, observation) => {
                    (self.take)(*at, Item::Observation(*source, observation))?;
                }
                Stored::Record(end) => self.record(*at, &Record::read(bytes(*end)))?,
            }
        }
        Ok(())
    }
}

impl ItemForwarder<'_, '_> {
    fn record(&mut self, at: Instant, record: &Record<'_>) -> Result<()> {
        (self.take)(at, Item::Record(record))?;
        if let Some((last, _)) = &mut self.lost {
            *last = at;
        }
        match record {
            Record::Note(Note { text: JOINED, .. }) => {
                std::mem::take(&mut self.said).end(self.take)?;
                (self.take)(at, Item::Joint)
            }
            Record::Loss(loss @ Loss { what: LossKind::WrongChecksums | LossKind::DamagedPlaces, .. }) => {
                (self.take)(at, Item::Gap(&of_packed(loss)))
            }
            Record::Loss(loss) if loss::words(loss).is_some() => match &mut self.lost {
                Some((last, lost)) if lost.what == loss.what => {
                    (*last, lost.to) = (at, lost.to.max(loss.to));
                    lost.count = lost.count.saturating_add(loss.count);
                    Ok(())
                }
                _ => {
                    self.tell_lost()?;
                    self.lost = Some((at, *loss));
                    Ok(())
                }
            },
            _ => Ok(()),
        }
    }

    fn tell_lost(&mut self) -> Result<()> {
        let Some((at, lost)) = self.lost.take() else { return Ok(()) };
        match not_recorded(&lost) {
            Some(gap) => (self.take)(at, Item::Gap(&gap)),
            None => Ok(()),
        }
    }

    /// The log ends.
    fn end(mut self) -> Result<()> {
        self.tell_lost()?;
        self.said.end(self.take)
    }
}

fn of_packed(loss: &Loss) -> Gap {
    let (words, to) = match loss.what {
        // Over the whole recording.
        LossKind::WrongChecksums => (wrong_checksums(loss.count), Some(loss.to)),
        _ => (format!("{} in the recording that was packed", count(loss.count, "damaged place")), None),
    };
    Gap { to, ..Gap::new(Some(loss.from), Cause::Lost, words) }
}

/// The recorder's count.
fn not_recorded(loss: &Loss) -> Option<Gap> {
    let gap = Gap::new(Some(loss.from), Cause::Lost, loss::words(loss)?);
    Some(Gap { to: Some(loss.to), ..gap })
}

fn gap(own: &OwnGap) -> Gap {
    let is_kept = own.cause != OwnCause::Disarmed;
    let cause = if is_kept { Cause::Damaged } else { Cause::NotKept };
    let why = loss::why(own);
    let sectors = u64::from(own.sectors_lost.saturating_add(own.sectors_skipped));
    let frames = own.frames.map_or_else(
        || "an unknown number of frames is".to_owned(),
        |frames| are(u64::from(frames), "frame"),
    );
    Gap {
        from: own.from,
        to: own.to,
        cause,
        place: None,
        bytes: sectors * SECTOR_BYTES as u64,
        words: if is_kept { format!("{frames} missing: {why}") } else { why.to_owned() },
        own: Some(*own),
    }
}
