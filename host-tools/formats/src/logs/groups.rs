//! A log's groups of sectors: units of parallel work.

use anyhow::Result;
use hums_blackbox::{Assembler, BlockCounts, GROUP_SECTORS, Step};

use super::board::{HEADING_GROUPS, heading};
use super::places::{BLOCK_BYTES, Log, LogBlocks};
use super::repair::{Evidence, Repairs};
use super::strangers::{ForeignSectors, Strangers};

/// Sectors in order, or a group's part without its beginning.
pub type Group = Vec<Step>;

/// Allocated and never written, like most of a short log's segment. The assembler needs as long as for a
/// sector.
fn is_empty(block: &[u8; BLOCK_BYTES]) -> bool {
    block.as_chunks().0.iter().all(|piece| *piece == [0; 32])
}

/// A start's record at a log's beginning.
pub fn has_start(log: &Log) -> bool {
    let mut groups = Groups::new(log);
    let mut first = (0..HEADING_GROUPS).map_while(|_| groups.next_group().ok()?);
    first.any(|group| heading(&group).is_some())
}

/// Streams a log's groups.
pub struct Groups<'a> {
    blocks: LogBlocks<'a>,
    assembler: Assembler,
    group: Group,
    ended: bool,
    ends_short: bool,
    foreign_at_end: u64,
    file: usize,
    /// Kept while blocks before it are given out.
    first: Option<[u8; BLOCK_BYTES]>,
    /// `None` if a scan found the sectors: their places have no meaning.
    strangers: Option<Strangers>,
    /// Of the last block's file. `None` as for `strangers`.
    repairs: Option<(Option<usize>, Repairs)>,
    repaired: u64,
    /// Evidence from the parity of the files so far.
    evidence: Evidence,
}

impl<'a> Groups<'a> {
    /// The groups of a log.
    pub fn new(log: &'a Log) -> Self {
        let assembler = log.session.map_or_else(Assembler::new, Assembler::for_session);
        let is_late = log.first_segment().is_some_and(|number| number > 0);
        Self {
            blocks: log.blocks(),
            assembler: if is_late { assembler.beginning_late() } else { assembler },
            group: Vec::new(),
            foreign_at_end: 0,
            ended: false,
            ends_short: log.ends_short(),
            file: 0,
            first: None,
            strangers: log.session.is_none().then(|| Strangers::new(log.pieces.len())),
            repairs: log.session.is_none().then(Default::default),
            repaired: 0,
            evidence: Evidence::default(),
        }
    }

    /// Next group.
    pub fn next_group(&mut self) -> Result<Option<Group>> {
        loop {
            let Some(step) = self.assembler.next() else {
                if self.ended {
                    break;
                }
                self.next_block()?;
                continue;
            };
            let full = self.group.len() >= GROUP_SECTORS;
            let broken = step.missing > 0 || self.group.last().is_some_and(|last| last.header.partial);
            if !self.group.is_empty() && (step.header.starts_group() || broken || full) {
                let mut next = Vec::with_capacity(GROUP_SECTORS);
                next.push(step);
                return Ok(Some(std::mem::replace(&mut self.group, next)));
            }
            self.group.push(step);
        }
        Ok((!self.group.is_empty()).then(|| std::mem::take(&mut self.group)))
    }

    fn next_block(&mut self) -> Result<()> {
        let held = self.first.take();
        let is_held = held.is_some();
        let block = if is_held { held } else { self.read_block()? };
        let (file, _) = self.blocks.place();
        if !is_held && block.is_some() && file != std::mem::replace(&mut self.file, file) {
            self.assembler.begin_file();
            self.first = block;
            return Ok(());
        }
        match block {
            Some(block) if is_empty(&block) => {
                self.foreign_at_end = 0;
                self.assembler.skip_empty();
            }
            Some(block) => self.feed(&block),
            None => {
                self.ended = true;
                self.assembler.end();
            }
        }
        Ok(())
    }

    /// Rebuilt if known.
    fn read_block(&mut self) -> Result<Option<[u8; BLOCK_BYTES]>> {
        let (Some(block), (file, at)) = (self.blocks.next_block()?.copied(), self.blocks.place()) else {
            return Ok(None);
        };
        let Some((of, repairs)) = &mut self.repairs else { return Ok(Some(block)) };
        if of.replace(file) != Some(file) {
            *repairs = Repairs::of(self.blocks.log(), file, self.assembler.session())?;
            self.evidence.add(&repairs.evidence);
        }
        let Some(made) = repairs.at(at).filter(|made| **made != block) else { return Ok(Some(block)) };
        self.repaired += 1;
        Ok(Some(*made))
    }

    fn feed(&mut self, block: &[u8; BLOCK_BYTES]) {
        let before = self.assembler.counts();
        self.assembler.feed(block);
        let seen = self.assembler.counts().since(&before);
        self.foreign_at_end = if seen.foreign > 0 { self.foreign_at_end + 1 } else { 0 };
        let Some(strangers) = &mut self.strangers else { return };
        let (file, at) = self.blocks.place();
        match seen {
            BlockCounts { stale: 1.., .. } => strangers.other(file, at, block),
            BlockCounts { damaged: 0, parity: 0, empty: 0, erased: 0, foreign: 0, unsound: 0, .. } => {
                strangers.own(file);
            }
            _ => {}
        }
    }

    /// Foreign sectors, once all is read.
    pub fn strange(&self) -> Vec<ForeignSectors> {
        self.strangers.as_ref().map_or_else(Vec::new, Strangers::strange)
    }

    /// Counts so far.
    pub fn counts(&self) -> BlockCounts {
        BlockCounts { repaired: self.repaired, ..self.assembler.counts() }
    }

    /// Evidence from parity, once all is read.
    pub const fn evidence(&self) -> Evidence {
        self.evidence
    }

    /// Counts of the blocks after the last sector.
    pub const fn behind(&self) -> BlockCounts {
        self.assembler.behind_last()
    }

    /// Foreign blocks at the end of all files.
    pub const fn foreign_at_end(&self) -> u64 {
        self.foreign_at_end
    }

    /// The session in its sectors.
    pub fn session(&self) -> Option<u32> {
        self.assembler.session()
    }

    /// Damaged blocks after the last sector: broken sectors of the session.
    pub fn damaged_at_end(&self) -> u32 {
        self.assembler.damaged_since().max(u32::from(self.ends_short))
    }
}
