//! A log as it lies on the card: which one a segment holds, how much of it was recorded, and its bytes.

use core::ops::Range;

use embedded_sdmmc::{Block, BlockDevice};
use hums_blackbox::Header;
use hums_recorder::card::Segment;
use hums_recorder::{Card, LogName};

use super::asked::LogId;

fn header<D: BlockDevice>(card: &Card<'_, D>, segment: &mut Segment, index: u32) -> Option<Header> {
    let mut block = Block::new();
    card.read(segment, index, &mut block).ok()?;
    Header::read(&block.contents).ok()
}

/// Whether the segment still holds this log.
pub(super) fn is_same<D: BlockDevice>(card: &Card<'_, D>, segment: &mut Segment, log: &LogId) -> bool {
    let header = header(card, segment, 0);
    header.map_or((0, 0), |header| (header.session, header.number)) == (log.session, log.first)
}

/// Which log a segment holds, and how many blocks of it were recorded. `in_work` is the session that is recorded there
/// now.
pub(super) fn measure<D: BlockDevice>(
    card: &Card<'_, D>,
    segment: &mut Segment,
    name: LogName,
    in_work: Option<u32>,
) -> (LogId, u32) {
    let Some(first) = header(card, segment, 0) else { return (LogId { name, ..LogId::NONE }, 0) };
    let log = LogId { name, session: first.session, first: first.number };
    if in_work.is_some_and(|session| session != log.session) {
        // What was there before: of its own it has nothing yet.
        return (LogId { name, ..LogId::NONE }, 0);
    }
    let mut blocks = recorded_blocks(card, segment, log.session);
    // The log in work: copies of a sector in progress, at its place and at the next one, are still written over.
    while in_work.is_some() && blocks > 0 && header(card, segment, blocks - 1).is_none_or(|last| last.partial)
    {
        blocks -= 1;
    }
    (log, blocks)
}

/// How many blocks hold sectors of the session that the first one names.
fn recorded_blocks<D: BlockDevice>(card: &Card<'_, D>, segment: &mut Segment, session: u32) -> u32 {
    // Below `first` all are; from `end` on none is. One that is torn does not end it.
    let (mut first, mut end) = (1, segment.blocks());
    while first < end {
        let middle = first + (end - first) / 2;
        let mut is_of_it =
            |index| header(card, segment, index).is_some_and(|header| header.session == session);
        if (middle..(middle + 2).min(end)).any(&mut is_of_it) {
            first = middle + 1;
        } else {
            end = middle;
        }
    }
    first
}

/// How reading went.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Read {
    /// All of it.
    All,
    /// The card does not give a block.
    Failed,
    /// A block holds a sector of another session, which has overwritten the log.
    Gone,
}

/// Gives what is in these bytes of a log, block by block, as far as it can be read.
pub(super) fn for_each_part<D: BlockDevice>(
    card: &Card<'_, D>,
    segment: &mut Segment,
    log: &LogId,
    bytes: Range<u32>,
    mut each: impl FnMut(&[u8]),
) -> Read {
    let mut block = Block::new();
    let mut at = bytes.start;
    while at < bytes.end {
        let index = at / Block::LEN_U32;
        if card.read(segment, index, &mut block).is_err() {
            return Read::Failed;
        }
        let session = Header::read(&block.contents).map_or(log.session, |header| header.session);
        // The file of parameters is no log, and holds no sectors.
        if session != log.session && *log != LogId::NONE {
            return Read::Gone;
        }
        let start = index * Block::LEN_U32;
        let end = bytes.end.min(start + Block::LEN_U32);
        each(block.contents.get((at - start) as usize..(end - start) as usize).unwrap_or_default());
        at = end;
    }
    Read::All
}
