//! Whether what a log lacks before its first sector was left out on purpose.
//!
//! While a vehicle that is recorded by arming is disarmed, the recorder keeps the last while in a ring of files. When it
//! begins a file, it writes the oldest one anew, if the second oldest began long enough ago (`hums_recorder::ring`). So a log
//! that lacks its first files may be whole: then a later file of the ring was begun, and when that was, the first one that is
//! left held the last while. Where no file says so, somebody else took one. The first file of a log is never left out before
//! others are: a log that has it and begins later was recorded on a card that came later, and says so.
//! Between a log's first sector and its last one nothing is ever left out: after an arming the next log begins.

use anyhow::Result;
use hums_blackbox::record::{Keep, Lost};
use hums_blackbox::{Entry, GROUP_SECTORS, GroupDecoder, Header, Outline, Record, Sector};
use hums_core::time::{Instant, Span};

use super::groups::{Group, Groups};
use super::places::Log;

/// Files of a full ring but for one, of which the oldest goes however little the others hold.
const RING_FILES: usize = 15;
/// The ring counts from when a file is begun on the card, and the log tells when its first group began. Between both lie the
/// time in which a sector fills, of which a copy is written each 150 ms, and the longest pause of a card that is not given
/// up (8 s: `hums_recorder::spi`).
const SLACK: Span = Span::from_secs(10);
/// Numbers of the events that say that a card came or went.
const CARD: [u8; 2] = [6, 7];

/// What a log lacks that begins with another sector than the first one of its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Late {
    /// The sector from which on only the last while was kept. Those before it are another log's.
    pub from: u32,
    /// All from there on was left out on purpose.
    pub is_wanted: bool,
    /// Nothing is missing, and yet its first file has not the name of a first one.
    pub is_renamed: bool,
}

/// `None` where the log begins with its session in a file of that name, or its first group does not say that only the last while is kept.
pub fn late(log: &Log) -> Result<Option<Late>> {
    let mut groups = Groups::new(log);
    let Some(group) = groups.next_group()? else { return Ok(None) };
    let first = group.first().map(|step| step.header);
    let segment = log.first_segment();
    let Some(first) = first.filter(Header::starts_group) else { return Ok(None) };
    let is_further = segment.is_some_and(|segment| segment > 0);
    if first.number == 0 {
        return Ok(is_further.then_some(Late { from: 0, is_wanted: true, is_renamed: true }));
    }
    let mut seen = Seen::default();
    seen.take(&group);
    let Some(keep) = seen.keep.filter(|keep| keep.from <= first.number) else { return Ok(None) };
    let late = |is_wanted| Some(Late { from: keep.from, is_wanted, is_renamed: false });
    let lacks_none = keep.from == first.number;
    if log.session.is_some() || lacks_none {
        return Ok(Some(Late { from: keep.from, is_wanted: true, is_renamed: is_further }));
    }
    if !begins_with(log, &first)? {
        return Ok(late(false));
    }
    let is_wanted = match segment {
        Some(0) => seen.go_on(&mut groups, |seen| seen.card)?.card,
        Some(_) => was_written_anew(log, &first, &mut groups, &mut seen, keep)?,
        // Of one file of another name nobody knows where others were begun.
        None => seen.go_on(&mut groups, |seen| seen.seconds() >= keep.seconds)?.seconds() >= keep.seconds,
    };
    Ok(late(is_wanted))
}

/// Whether the ring gave away a file before the first one that is left.
fn was_written_anew(
    log: &Log,
    first: &Header,
    groups: &mut Groups<'_>,
    seen: &mut Seen,
    keep: Keep,
) -> Result<bool> {
    let Some(start) = seen.start else { return Ok(false) };
    let enough = Span::from_secs(u64::from(keep.seconds));
    let is_enough = |at: Option<Instant>| at.is_none_or(|at| at.since(start) + SLACK >= enough);
    let mut begun = begun(log, first)?.into_iter().skip(1).enumerate();
    let Some((_, at)) = begun.find(|(nth, at)| is_enough(*at) || nth + 1 >= RING_FILES) else {
        return Ok(false);
    };
    // Files that were begun after the arming are none of the ring's. One without a sector was begun when power went.
    let at = at.unwrap_or(Instant::from_micros(u64::MAX));
    let armed = seen.go_on(groups, |seen| seen.last.is_some_and(|last| last > at))?.all;
    Ok(armed.is_none_or(|armed| at <= armed))
}

/// When the first group of each file began, where that is known. One that was begun when the card was back begins with the rest of
/// the group before.
fn begun(log: &Log, first: &Header) -> Result<Vec<Option<Instant>>> {
    let mut all = Vec::new();
    for piece in &log.pieces {
        let one = Log { pieces: vec![piece.clone()], ..log.clone() };
        let (mut blocks, mut start) = (one.blocks(), None);
        for _ in 0..=GROUP_SECTORS {
            let Some(block) = blocks.next_block()? else { break };
            // What a file held before is of another session, or older.
            let is_own = |header: &Header| header.session == first.session && header.number >= first.number;
            let Some(header) = Header::read(block).ok().filter(is_own) else { break };
            if header.starts_group() {
                start = Sector::from_bytes(*block).preamble();
                break;
            }
        }
        all.push(start.map(|start| Instant::from_millis(start.start_ms)));
    }
    Ok(all)
}

/// Whether this sector lies where a log's first one does: in the first block, or a copy of it in the second one.
fn begins_with(log: &Log, first: &Header) -> Result<bool> {
    let mut blocks = log.blocks();
    for is_second in [false, true] {
        let header = blocks.next_block()?.and_then(|block| Header::read(block).ok());
        let header = header.filter(|header| header.partial || !is_second);
        if header.is_some_and(|header| (header.session, header.number) == (first.session, first.number)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// What was read of the time before the arming.
#[derive(Default)]
struct Seen {
    decoder: Box<GroupDecoder>,
    start: Option<Instant>,
    last: Option<Instant>,
    /// The first record of what is kept.
    keep: Option<Keep>,
    /// When a record said that everything is kept from now on.
    all: Option<Instant>,
    /// A card came or went, or there was none.
    card: bool,
    is_broken: bool,
}

impl Seen {
    /// Reads on until there is enough, the vehicle is armed, or something is missing.
    fn go_on(&mut self, groups: &mut Groups<'_>, enough: impl Fn(&Self) -> bool) -> Result<&Self> {
        while !enough(self) && self.all.is_none() && !self.is_broken {
            match groups.next_group()? {
                Some(group) => self.take(&group),
                None => break,
            }
        }
        Ok(self)
    }

    /// Takes the next group.
    fn take(&mut self, group: &Group) {
        self.is_broken |= self.start.is_some() && group.first().is_some_and(|step| step.missing > 0);
        if self.is_broken {
            return;
        }
        for step in group {
            if self.decoder.push(&step.header, &step.sector).is_err() {
                self.is_broken = true;
                return;
            }
            self.start.get_or_insert(Instant::from_millis(self.decoder.preamble().start_ms));
            while let Some(outline) = self.decoder.next_outline() {
                let (at, record) = match outline {
                    Ok(Outline::Frame { at, .. } | Outline::Whole(Entry::Frame { at, .. })) => (at, None),
                    Ok(Outline::Whole(Entry::Record { at, record })) => (at, Some(record)),
                    Err(_) => {
                        self.is_broken = true;
                        return;
                    }
                };
                self.last = Some(at);
                match record {
                    Some(Record::Keep(keep)) => {
                        self.keep.get_or_insert(keep);
                        if keep.all {
                            self.all.get_or_insert(at);
                        }
                    }
                    Some(Record::Event(event)) => self.card |= CARD.contains(&event.number),
                    Some(Record::Loss(loss)) => self.card |= loss.what == Lost::Card,
                    _ => {}
                }
            }
        }
    }

    /// Seconds before the arming, or before the last entry, rounded up: what the ring holds may end a little before the time
    /// at which its oldest file went.
    fn seconds(&self) -> u32 {
        let end = self.all.or(self.last.map(|last| last + SLACK));
        let span = self.start.zip(end).map_or(Span::ZERO, |(start, end)| end.since(start));
        u32::try_from(span.as_millis() / 1000).unwrap_or(u32::MAX)
    }
}
