//! Whether what a log lacks before its first sector was left out on purpose.
//!
//! While a vehicle that is recorded by arming is disarmed, the recorder keeps the last while in a ring of files, and writes
//! the oldest one anew. So a log that lacks its first files may be whole. But the ring keeps at least as many seconds as the
//! record of what is kept says: where less lies between the log's first sector and the arming, somebody else took a file.
//! Between a log's first sector and its last one nothing is ever left out: after an arming the next log begins.

use anyhow::Result;
use hums_blackbox::record::Keep;
use hums_blackbox::{Entry, GroupDecoder, Header, Outline, Record};
use hums_core::time::{Instant, Span};

use super::groups::{Group, Groups};
use super::places::Log;

/// Files of a full ring but for one, of which the oldest goes however little the others hold.
const RING_FILES: usize = 15;
/// Where power went, what the ring holds may end so much before the time at which its oldest file went.
const SLACK: Span = Span::from_secs(5);

/// What a log lacks that begins with another sector than the first one of its session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Late {
    /// The sector from which on only the last while was kept. Those before it are another log's.
    pub(super) from: u32,
    /// All from there on was left out on purpose.
    pub(super) is_wanted: bool,
}

/// `None` where the log begins with its session, or its first group does not say that only the last while is kept.
pub(super) fn late(log: &Log) -> Result<Option<Late>> {
    let mut groups = Groups::new(log);
    let Some(group) = groups.next_group()? else { return Ok(None) };
    let first = group.first().map(|step| step.header);
    let Some(first) = first.filter(|first| first.number > 0 && first.starts_group()) else { return Ok(None) };
    let mut seen = Seen::default();
    let mut decoder = Box::new(GroupDecoder::new());
    let mut more = seen.take(&group, &mut decoder);
    let Some(keep) = seen.keep.filter(|keep| keep.from <= first.number) else { return Ok(None) };
    if keep.from == first.number || log.session.is_some() {
        return Ok(Some(Late { from: keep.from, is_wanted: true }));
    }
    if !begins_with(log, &first)? {
        return Ok(Some(Late { from: keep.from, is_wanted: false }));
    }
    let is_first = log.first_segment() == Some(0);
    while more && !is_first {
        more = match groups.next_group()? {
            Some(group) => seen.take(&group, &mut decoder),
            None => false,
        };
    }
    let is_wanted = is_first || seen.is_enough() || groups.file() >= RING_FILES;
    Ok(Some(Late { from: keep.from, is_wanted }))
}

/// Whether this sector, or a copy of it, lies where a log's first one does.
fn begins_with(log: &Log, first: &Header) -> Result<bool> {
    let mut blocks = log.blocks();
    for _ in 0..2 {
        let header = blocks.next_block()?.and_then(|block| Header::read(&block).ok());
        if header.is_some_and(|header| (header.session, header.number) == (first.session, first.number)) {
            return Ok(true);
        }
    }
    Ok(false)
}

/// What was read of the time before the arming.
#[derive(Debug, Default)]
struct Seen {
    start: Option<Instant>,
    last: Option<Instant>,
    /// The first record of what is kept.
    keep: Option<Keep>,
    /// A record said that everything is kept from now on.
    all: bool,
}

impl Seen {
    /// Takes the next group; whether more is to be read.
    fn take(&mut self, group: &Group, decoder: &mut GroupDecoder) -> bool {
        let is_broken = self.start.is_some() && group.first().is_some_and(|step| step.missing > 0);
        if is_broken {
            return false;
        }
        for step in group {
            if decoder.push(&step.header, &step.sector).is_err() {
                return false;
            }
            self.start.get_or_insert(Instant::from_millis(decoder.preamble().start_ms));
            while let Some(outline) = decoder.next_outline() {
                let Ok(outline) = outline else { return false };
                self.entry(&outline);
                if self.all || self.is_enough() {
                    return false;
                }
            }
        }
        true
    }

    fn entry(&mut self, outline: &Outline<'_>) {
        match outline {
            Outline::Frame { at, .. } | Outline::Whole(Entry::Frame { at, .. }) => self.last = Some(*at),
            Outline::Whole(Entry::Record { at, record }) => {
                self.last = Some(*at);
                if let Record::Keep(keep) = record {
                    self.keep.get_or_insert(*keep);
                    self.all |= keep.all;
                }
            }
        }
    }

    /// Whether as much was read as the ring keeps at least.
    fn is_enough(&self) -> bool {
        let Some(((start, last), keep)) = self.start.zip(self.last).zip(self.keep) else { return false };
        let slack = if self.all { Span::ZERO } else { SLACK };
        last.since(start) + slack >= Span::from_secs(u64::from(keep.seconds))
    }
}
