//! A log on the card: the identity of the log in a segment, its recorded length, and its bytes.
//!
//! A card may have lost any sector, also the first one, and old data lies behind the end. So no single block marks
//! the end of a log. Parity, at the segment's end, gives a minimum length. From there on the log ends at the first
//! row of [`LOST_MAX`] blocks without a sector of it. Lost sectors before that are delivered as they read, and the
//! log's reader reports them. The recorder knows the end of the log in work.
//!
//! An undamaged log takes about a hundred reads, 0.1 s of a usual card, in which frames wait in the sector queue. One
//! of 8 MiB without parity takes 400.

use core::ops::Range;

use hums_blackbox::Header;
use hums_blackbox::parity::{COLUMNS, PARITY_SECTORS, Parity, STRETCH_SECTORS, data_blocks, parity_block};
use hums_recorder::card::Segment;
use hums_recorder::recorder::OpenLog;
use hums_recorder::{BLOCK_BYTES, Block, Card, CardDevice, CardError, LogName, Trouble};

use super::asked::LogId;

/// Sectors in a row that a card may lose: two of its largest pages, 16 KiB each.
const LOST_MAX: u32 = 64;

/// A segment's blocks, one by one. An unreadable one counts as zeros, like a lost one.
struct Blocks<'r, 'a, D: CardDevice> {
    card: &'r Card<'a, D>,
    segment: &'r mut Segment,
    block: Block,
    /// One was unreadable.
    has_lost: bool,
    /// The card no longer answers: later reads are invalid.
    is_gone: bool,
}

impl<'r, 'a, D: CardDevice> Blocks<'r, 'a, D> {
    fn of(card: &'r Card<'a, D>, segment: &'r mut Segment) -> Self {
        Self { card, segment, block: [0; BLOCK_BYTES], has_lost: false, is_gone: false }
    }

    /// After the card stopped answering, zeros without another command: each would take its full timeout.
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

    const fn limit(&self) -> u32 {
        data_blocks(self.segment.blocks())
    }

    fn begin(&mut self) -> Option<(u32, u32)> {
        let limit = self.limit();
        let far = (LOST_MAX..limit).step_by(LOST_MAX as usize);
        (0..LOST_MAX.min(limit)).chain(far).find_map(|at| {
            let header = Header::read(self.read(at)).ok()?;
            Some((header.session, header.number.wrapping_sub(at)))
        })
    }

    fn recorded(&mut self, session: u32, first: u32) -> u32 {
        let limit = self.limit();
        let mut end = self.covered(session, first).max(1);
        // Blocks from `end` up to this one hold no sector of it.
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

    /// Minimum of recorded blocks, by the parity of all stretches that have one.
    fn covered(&mut self, session: u32, first: u32) -> u32 {
        let (blocks, limit) = (self.segment.blocks(), self.limit());
        let (mut end, mut absent) = (0, 0);
        for stretch in 0..limit.div_ceil(STRETCH_SECTORS) {
            // P of the first column, and Q, which is on another page.
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

/// `None` if the card does not answer.
pub(super) fn holds<D: CardDevice>(card: &Card<'_, D>, segment: &mut Segment, log: &LogId) -> Option<bool> {
    let mut blocks = Blocks::of(card, segment);
    let begin = blocks.begin().or((!blocks.has_lost).then_some((0, 0)))?;
    Some(begin == (log.session, log.first))
}

/// The log with recorded blocks; `None` if the card does not answer.
pub(super) fn measure<D: CardDevice>(
    card: &Card<'_, D>,
    segment: &mut Segment,
    name: LogName,
) -> Option<(LogId, u32)> {
    let mut blocks = Blocks::of(card, segment);
    let Some((session, first)) = blocks.begin() else {
        // An unread block may have been a sector.
        return (!blocks.has_lost).then_some((LogId { name, ..LogId::NONE }, 0));
    };
    let recorded = blocks.recorded(session, first);
    (!blocks.is_gone).then_some((LogId { name, session, first }, recorded))
}

/// The log in work: its finished part, without earlier data.
pub(super) fn in_work(log: &OpenLog) -> (LogId, u32) {
    let OpenLog { name, session, first, blocks } = *log;
    let log = if blocks > 0 { LogId { name, session, first } } else { LogId { name, ..LogId::NONE } };
    (log, blocks)
}

/// Gives these bytes of a log to `each`, block by block; `false` if the card no longer answers. The file of
/// parameters, which is not a log, must be complete.
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
