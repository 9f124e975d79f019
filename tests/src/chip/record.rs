//! A card's record, compared with the sent frames.

use std::collections::{BTreeMap, HashMap, VecDeque};

use hums_blackbox::Entry;
use hums_blackbox::record::Record;
use hums_recorder::BLOCK_BYTES;
use hums_recorder::{Buffers, Card, CardStatus, LogName};
use hums_sdcard::Medium;

use super::log::{self, Item};

/// A session on a card.
#[derive(Debug, Default)]
pub struct Session {
    /// Milliseconds of the record's clock, and bytes.
    pub frames: Vec<(u64, Vec<u8>)>,
    /// Kind, count, from and to in milliseconds.
    pub losses: Vec<(&'static str, u64, u64, u64)>,
    /// Faults and notes.
    pub texts: Vec<String>,
    /// The processor's load in thousandths, of some seconds.
    pub loads: Vec<u64>,
    /// Unreadable parts.
    pub gaps: usize,
}

/// All sessions, in their order.
pub fn read(medium: &Medium) -> Vec<Session> {
    some(medium, 0)
}

/// The newest session.
pub fn last(medium: &Medium) -> Option<Session> {
    some(medium, usize::MAX).pop()
}

/// Skips `skip`, but not the last one.
fn some(medium: &Medium, skip: usize) -> Vec<Session> {
    let (status, held) = (CardStatus::new(), Buffers::new());
    let Ok(card) = Card::mount(medium, &status, &held) else { return Vec::new() };
    let mut names: BTreeMap<u32, Vec<LogName>> = BTreeMap::new();
    if card.logs(|log| names.entry(log.name.session).or_default().push(log.name)).is_err() {
        return Vec::new();
    }
    let skip = skip.min(names.len().saturating_sub(1));
    let mut sessions = Vec::new();
    for mut names in names.into_values().skip(skip) {
        names.sort_unstable();
        let mut blocks = Vec::new();
        for name in names {
            let Ok(mut segment) = card.segment(name) else { continue };
            // The newest copy of the last sector may be at the place after it.
            let mut empty = 0;
            for index in 0..segment.blocks() {
                let mut block = [0; BLOCK_BYTES];
                if card.read(&mut segment, index, &mut block).is_err() {
                    break;
                }
                empty = if block == [0; 512] { empty + 1 } else { 0 };
                if empty > 1 {
                    break;
                }
                blocks.push(block);
            }
        }
        let mut session = Session::default();
        log::read(&blocks, |item| session.take(&item));
        sessions.push(session);
    }
    sessions
}

impl Session {
    fn take(&mut self, item: &Item<'_>) {
        match item {
            Item::Entry(Entry::Frame { at, bytes, .. }) => self.frames.push((at.as_millis(), bytes.to_vec())),
            Item::Entry(Entry::Record { record, .. }) => self.record(record),
            Item::Gap(_) => self.gaps += 1,
        }
    }

    fn record(&mut self, record: &Record<'_>) {
        match record {
            Record::Loss(loss) => {
                let (from, to) = (loss.from.as_millis(), loss.to.as_millis());
                self.losses.push((loss.what.name(), loss.count, from, to));
            }
            Record::Fault(fault) => {
                self.texts.push(format!("fault: {} in {} at {}", fault.message, fault.task, fault.place));
            }
            Record::Note(note) => self.texts.push(note.text.to_owned()),
            Record::Stats(stats) => self.loads.push(stats.cpu_permille),
            _ => {}
        }
    }
}

/// Recorded frames against sent ones.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Compared {
    /// Unchanged frames.
    pub right: usize,
    /// Sent frames that are not there.
    pub missing: usize,
    /// Frames not sent, or more often than sent.
    pub wrong: usize,
    /// Missing before the first and after the last one.
    pub ends: (usize, usize),
}

/// Compares by content; the reader checks their order.
pub fn compare<'a>(sent: &[Vec<u8>], recorded: impl Iterator<Item = &'a [u8]>) -> Compared {
    let mut places: HashMap<&[u8], VecDeque<usize>> = HashMap::new();
    for (place, frame) in sent.iter().enumerate() {
        places.entry(frame).or_default().push_back(place);
    }
    let mut compared = Compared::default();
    let (mut first, mut last) = (sent.len(), 0);
    for frame in recorded {
        match places.get_mut(frame).and_then(VecDeque::pop_front) {
            Some(place) => {
                compared.right += 1;
                (first, last) = (first.min(place), last.max(place + 1));
            }
            None => compared.wrong += 1,
        }
    }
    compared.missing = sent.len() - compared.right;
    compared.ends = (first, sent.len() - last);
    compared
}
