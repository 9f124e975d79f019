//! Logs of HUMS as the one stream. Groups are decoded side by side ([`crate::logs::reader`]) and handed on in order.

use anyhow::Result;
use hums_blackbox::record::{Loss, Lost, Note};
use hums_blackbox::{Cause as OwnCause, Entry, Gap as OwnGap, Record};
use hums_core::observation::{Observation, Source};
use hums_core::time::Instant;
use hums_link::{Check, Frame, observe};

use super::checksums::wrong_checksums;
use super::input::Progress;
use super::item::{Cause, Gap, Item, MessageCount, Reader, Summary, Take, Want};
use super::said::Said;
use super::told::Told;
use crate::ending::Ending;
use crate::logs::Log;
use crate::logs::reader::{Collect, Deliver, epoch, read};
use crate::mavlink::ids::{HEARTBEAT, PARAM_VALUE, STATUSTEXT};
use crate::plural::count;

/// The note in a packed log behind which another recording goes on: the input was joined of several.
pub const JOINED: &str = "another recording begins here: the input was joined of several";

/// A session of a log of ours.
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

    /// How far it has been read.
    pub fn progress(&self) -> Progress {
        self.progress.clone()
    }
}

impl Reader for OwnReader {
    fn read(&mut self, want: Want<'_>, take: &mut Take<'_>) -> Result<Summary> {
        if let Some(epoch) = epoch(&self.log)? {
            take(Instant::ZERO, Item::Epoch(epoch))?;
        }
        let mut hand = Hand { want, take, said: Said::default(), frames: 0, frame_bytes: 0 };
        let new =
            || Collected { frames: want.frames, observations: want.observations, ..Collected::default() };
        let progress = &self.progress;
        let summary = read(&self.log, new, &mut hand, |blocks| {
            progress.set_taken(blocks * hums_blackbox::SECTOR_BYTES as u64);
        })?;
        hand.said.end(hand.take)?;
        let (count, bytes) = (hand.frames, hand.frame_bytes);
        let messages = vec![MessageCount { name: "frames".to_owned(), count, bytes }];
        Ok(Summary { messages, ending: Some(Ending::of(&self.log, summary)) })
    }
}

/// What a group tells, in order.
#[derive(Default)]
struct Collected {
    frames: bool,
    observations: bool,
    entries: Vec<(Instant, Kept)>,
    bytes: Vec<u8>,
    count: u64,
    frame_bytes: u64,
}

enum Kept {
    /// A frame, which ends here in `bytes`; all that it says is made of it later.
    Frame(Check, usize),
    Observation(Source, Box<Observation>),
    Told(Told),
    /// Another recording begins, in a packed log.
    Joint,
    /// What was packed was damaged.
    Damaged(Loss),
}

impl Collect for Collected {
    fn entry(&mut self, entry: &Entry<'_>) {
        match *entry {
            Entry::Frame { at, bytes, verified } => {
                (self.count, self.frame_bytes) = (self.count + 1, self.frame_bytes + bytes.len() as u64);
                let check = if verified { Check::Verified } else { Check::Unverified };
                let Some(frame) = Frame::again(bytes, check) else { return };
                if self.frames || matches!(frame.id(), HEARTBEAT | PARAM_VALUE | STATUSTEXT) {
                    self.bytes.extend_from_slice(bytes);
                    self.entries.push((at, Kept::Frame(check, self.bytes.len())));
                } else if let (true, Some((source, observation))) = (self.observations, observe(&frame)) {
                    self.entries.push((at, Kept::Observation(source, Box::new(observation))));
                }
            }
            Entry::Record { at, record: Record::Note(Note { text: JOINED, .. }) } => {
                self.entries.push((at, Kept::Joint));
            }
            Entry::Record {
                at,
                record: Record::Loss(loss @ Loss { what: Lost::WrongChecksums | Lost::DamagedPlaces, .. }),
            } => self.entries.push((at, Kept::Damaged(loss))),
            Entry::Record { at, record } => {
                self.entries.extend(Told::of(&record).map(|told| (at, Kept::Told(told))));
            }
        }
    }

    fn held_bytes(&self) -> usize {
        // Observations lie on the heap, each with what the allocator adds.
        const ENTRY_BYTES: usize = size_of::<(Instant, Kept)>() + size_of::<Observation>() + 16;
        self.bytes.len() + self.entries.len() * ENTRY_BYTES
    }
}

/// Hands groups on.
struct Hand<'a, 'b> {
    want: Want<'a>,
    take: &'a mut Take<'b>,
    said: Said,
    frames: u64,
    frame_bytes: u64,
}

impl Deliver<Collected> for Hand<'_, '_> {
    fn gap(&mut self, own: &OwnGap) -> Result<()> {
        let at = own.from.unwrap_or(Instant::ZERO);
        (self.take)(at, Item::Gap(&gap(own)))
    }

    fn group(&mut self, group: Collected) -> Result<()> {
        (self.frames, self.frame_bytes) = (self.frames + group.count, self.frame_bytes + group.frame_bytes);
        let mut start = 0;
        for (at, kept) in &group.entries {
            match kept {
                Kept::Frame(check, end) => {
                    let bytes = group.bytes.get(start..*end).unwrap_or_default();
                    start = *end;
                    if let Some(frame) = Frame::again(bytes, *check) {
                        self.said.frame(*at, &frame, self.want, self.take)?;
                    }
                }
                Kept::Observation(source, observation) => {
                    (self.take)(*at, Item::Observation(*source, observation))?;
                }
                Kept::Told(told) => (self.take)(*at, Item::Record(told))?,
                Kept::Damaged(loss) => (self.take)(*at, Item::Gap(&of_packed(loss)))?,
                Kept::Joint => {
                    std::mem::take(&mut self.said).end(self.take)?;
                    (self.take)(*at, Item::Joint)?;
                }
            }
        }
        Ok(())
    }
}

/// What was damaged in the recording that was packed, as a loss: the log itself is whole.
fn of_packed(loss: &Loss) -> Gap {
    let (words, to) = match loss.what {
        // Counted over the whole recording.
        Lost::WrongChecksums => (wrong_checksums(loss.count), Some(loss.to)),
        _ => (format!("{} in the recording that was packed", count(loss.count, "damaged place")), None),
    };
    Gap { from: Some(loss.from), to, cause: Cause::Lost, place: None, bytes: 0, words }
}

/// A gap in the stream's words.
fn gap(own: &OwnGap) -> Gap {
    let cause = if own.cause == OwnCause::Disarmed { Cause::NotKept } else { Cause::Damaged };
    let sectors = u64::from(own.sectors_lost.saturating_add(own.sectors_skipped));
    let frames = own.frames.map_or_else(|| "an unknown number of".to_owned(), |frames| frames.to_string());
    Gap {
        from: own.from,
        to: own.to,
        cause,
        place: None,
        bytes: sectors * hums_blackbox::SECTOR_BYTES as u64,
        words: format!("{frames} frames are missing: {}", own.cause.name()),
    }
}
