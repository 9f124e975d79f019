//! A log as it lies on the card: which one a segment holds, how much of it was recorded, and its bytes.
//!
//! A card may have lost any sector, the first one too, and behind the end lies whatever the segment held before. So no one place
//! tells where a log ends: parity, at the segment's end, says how far it goes at least, and from there on it ends where so many
//! sectors in a row are none of it ([`LOST_MAX`]). What is lost before that is offered as it reads, for whoever reads the log to tell.
//! Of the log in work the recorder knows the end.
//!
//! An undamaged log takes about a hundred reads, 0.1 s of a usual card, in which frames wait in the sector queue; one of 8 MiB
//! without its parity 400.

use core::ops::Range;

use hums_blackbox::Header;
use hums_blackbox::parity::{COLUMNS, PARITY_SECTORS, Parity, STRETCH_SECTORS, data_blocks, parity_block};
use hums_recorder::card::Segment;
use hums_recorder::recorder::InWork;
use hums_recorder::{BLOCK_BYTES, Block, Card, CardDevice, CardError, LogName, Trouble};

use super::asked::LogId;

/// Sectors in a row that a card may have lost: two of its largest pages, 16 KiB each.
const LOST_MAX: u32 = 64;

/// A segment's blocks, one by one. One that the card does not give is zeros, as one that it has lost.
struct Blocks<'r, 'a, D: CardDevice> {
    card: &'r Card<'a, D>,
    segment: &'r mut Segment,
    block: Block,
    /// The card did not give one.
    has_lost: bool,
    /// The card no longer answers: what was read since says nothing of it.
    is_gone: bool,
}

impl<'r, 'a, D: CardDevice> Blocks<'r, 'a, D> {
    fn of(card: &'r Card<'a, D>, segment: &'r mut Segment) -> Self {
        Self { card, segment, block: [0; BLOCK_BYTES], has_lost: false, is_gone: false }
    }

    /// Of a card that no longer answers, zeros without another command: each would take its whole time again.
    fn read(&mut self, at: u32) -> &Block {
        if self.is_gone {
            self.block.fill(0);
        } else if let Err(error) = self.card.read(self.segment, at, &mut self.block) {
            let trouble =
                if let CardError::Device(error) = &error { D::trouble(error) } else { Trouble::Refusing };
            self.has_lost = true;
            self.is_gone |= trouble != Trouble::Refusing;
            self.block.fill(0);
        }
        &self.block
    }

    /// How many of them are for sectors.
    const fn limit(&self) -> u32 {
        data_blocks(self.segment.blocks())
    }

    /// The session of the segment's first sector, and its number, by the first one that can be read.
    fn begin(&mut self) -> Option<(u32, u32)> {
        let limit = self.limit();
        let far = (LOST_MAX..limit).step_by(LOST_MAX as usize);
        (0..LOST_MAX.min(limit)).chain(far).find_map(|at| {
            let header = Header::read(self.read(at)).ok()?;
            Some((header.session, header.number.wrapping_sub(at)))
        })
    }

    /// How many blocks were recorded of the session, from the sector with this number on.
    fn recorded(&mut self, session: u32, first: u32) -> u32 {
        let limit = self.limit();
        let mut end = self.covered(session, first).max(1);
        // From the end on, nothing before this block is of it.
        let mut seen = end;
        loop {
            let until = (end + LOST_MAX + 1).min(limit);
            let is_own = |at: &u32| {
                let header = Header::read(self.read(*at));
                header.is_ok_and(|header| {
                    header.session == session && header.number.wrapping_sub(first) < limit
                })
            };
            let Some(last) = (seen..until).rev().find(is_own) else { return end };
            (end, seen) = (last + 1, until);
        }
    }

    /// How many blocks were recorded at least, by the parity of as many stretches as have one.
    fn covered(&mut self, session: u32, first: u32) -> u32 {
        let (blocks, limit) = (self.segment.blocks(), self.limit());
        let (mut end, mut absent) = (0, 0);
        for stretch in 0..limit.div_ceil(STRETCH_SECTORS) {
            // P of the first column, and Q, which lies on another page.
            let p = parity_block(blocks, stretch);
            let covered = [p, p + COLUMNS as u32].into_iter().find_map(|at| {
                let parity = Parity::read(self.read(at)).filter(|parity| parity.session == session)?;
                Some(parity.last.wrapping_sub(first)).filter(|last| *last < limit)
            });
            absent += PARITY_SECTORS;
            if let Some(last) = covered {
                (end, absent) = (last + 1, 0);
            }
            if absent > LOST_MAX {
                break;
            }
        }
        end
    }
}

/// Whether the segment still holds this log; `None` where the card does not tell.
pub(super) fn holds<D: CardDevice>(card: &Card<'_, D>, segment: &mut Segment, log: &LogId) -> Option<bool> {
    let mut blocks = Blocks::of(card, segment);
    let begin = blocks.begin().or((!blocks.has_lost).then_some((0, 0)))?;
    Some(begin == (log.session, log.first))
}

/// Which log a segment holds, and how many blocks of it were recorded; `None` where the card does not tell.
pub(super) fn measure<D: CardDevice>(
    card: &Card<'_, D>,
    segment: &mut Segment,
    name: LogName,
) -> Option<(LogId, u32)> {
    let mut blocks = Blocks::of(card, segment);
    let Some((session, first)) = blocks.begin() else {
        // What was not read may have been a sector.
        return (!blocks.has_lost).then_some((LogId { name, ..LogId::NONE }, 0));
    };
    let recorded = blocks.recorded(session, first);
    (!blocks.is_gone).then_some((LogId { name, session, first }, recorded))
}

/// The same of the log in work: what no longer changes. What was there before is none of it.
pub(super) fn in_work(log: &InWork) -> (LogId, u32) {
    let InWork { name, session, first, blocks } = *log;
    let log = if blocks > 0 { LogId { name, session, first } } else { LogId { name, ..LogId::NONE } };
    (log, blocks)
}

/// Gives what is in these bytes of a log, block by block; `false` where the card no longer answers. The file of parameters, which is
/// no log, must not lack any.
pub(super) fn for_each_part<D: CardDevice>(
    card: &Card<'_, D>,
    segment: &mut Segment,
    log: &LogId,
    bytes: Range<u32>,
    mut each: impl FnMut(&[u8]),
) -> bool {
    let mut blocks = Blocks::of(card, segment);
    let mut at = bytes.start;
    while at < bytes.end {
        let index = at / BLOCK_BYTES as u32;
        let start = index * BLOCK_BYTES as u32;
        let end = bytes.end.min(start + BLOCK_BYTES as u32);
        blocks.read(index);
        if blocks.is_gone || blocks.has_lost && *log == LogId::NONE {
            return false;
        }
        each(blocks.block.get((at - start) as usize..(end - start) as usize).unwrap_or_default());
        at = end;
    }
    true
}
