//! Rebuilds lost sectors from parity, and checks the others against it. Sectors are covered once they are on
//! the card: one that disagrees was altered later.
//!
//! The sector with the number `n` is at block `n - base` of its file. The base shows the lost sectors: every
//! place with another sector, or none. Most sound sectors agree on it, unless the recorder had just begun to
//! rewrite the file.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::Result;
use hums_blackbox::Header;
use hums_blackbox::parity::{COLUMNS, Column, Parity, STRETCH_SECTORS, Sum, parity_block};
use hums_recorder::card::SEGMENT_BYTES_MAX;

use super::places::{BLOCK_BYTES, Log};

const LOST_MAX: usize = 2;
/// Twice the recorder's longest file. A hostile file of parity is held whole.
const FILE_BYTES_MAX: u64 = 2 * SEGMENT_BYTES_MAX as u64;

/// Evidence from the parity of a log's files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Evidence {
    /// The last covered sector.
    pub last: Option<u32>,
    /// Certainly written parity sectors: a full stretch's before the next stretch, and the last at a proper
    /// end.
    pub written: u64,
    /// Missing parity sectors.
    pub missing: u64,
    /// Checked columns.
    pub columns: u64,
    /// Columns that disagree.
    pub contradicted: u64,
    /// The first of these: file, first and last sector.
    pub first: Option<(usize, u32, u32)>,
}

impl Evidence {
    /// Adds the next file's.
    pub fn add(&mut self, next: &Self) {
        self.last = self.last.max(next.last);
        self.written += next.written;
        self.missing += next.missing;
        self.columns += next.columns;
        self.contradicted += next.contradicted;
        self.first = self.first.or(next.first);
    }
}

#[derive(Debug, Default)]
pub(super) struct Repairs {
    made: BTreeMap<u64, [u8; BLOCK_BYTES]>,
    pub(super) evidence: Evidence,
}

impl Repairs {
    /// The session is given, or that of the first sound sector.
    pub(super) fn of(log: &Log, index: usize, session: Option<u32>) -> Result<Self> {
        let Some(piece) = log.pieces.get(index) else { return Ok(Self::default()) };
        let file = Log { pieces: vec![piece.clone()], ..log.clone() };
        if file.bytes() > FILE_BYTES_MAX {
            return Ok(Self::default());
        }
        let Some(sectors) = FileSectors::of(&file, session)? else { return Ok(Self::default()) };
        let last = sectors.parity.iter().map(|(one, _)| one.last).max();
        let mut all = Self { evidence: Evidence { last, ..Evidence::default() }, ..Self::default() };
        let Some(base) = sectors.base else { return Ok(all) };
        (all.evidence.written, all.evidence.missing) = sectors.written_and_missing(base);
        let mut columns = sectors.columns(base);
        let mut blocks = file.blocks();
        let mut at = 0;
        while !columns.is_empty()
            && let Some(block) = blocks.next_block()?
        {
            if let Some(number) = sectors.in_place(base, at)
                && let Some((column, _)) = columns.get_mut(&column_of(at))
            {
                column.sector(number, block);
            }
            at += 1;
        }
        for ((stretch, first), (column, lost)) in columns {
            all.evidence.columns += 1;
            // Which one is wrong is unknown.
            if !column.agrees(&lost) {
                let first =
                    base.saturating_add(stretch.saturating_mul(STRETCH_SECTORS)).saturating_add(first);
                all.evidence.contradicted += 1;
                all.evidence.first.get_or_insert((index, first, column.last().unwrap_or(first)));
                continue;
            }
            for sector in column.solve(&lost).into_iter().flatten() {
                all.made.insert(u64::from(sector.number().wrapping_sub(base)), *sector.bytes());
            }
        }
        Ok(all)
    }

    pub(super) fn at(&self, block: u64) -> Option<&[u8; BLOCK_BYTES]> {
        self.made.get(&block)
    }
}

const fn column_of(at: u32) -> (u32, u32) {
    (at / STRETCH_SECTORS, at % COLUMNS as u32)
}

struct FileSectors {
    session: u32,
    /// `None` without a sector of the session.
    base: Option<u32>,
    /// Numbers of the session's whole sector in each block.
    numbers: Vec<Option<u32>>,
    /// The one that ends the log in order.
    closed: Option<u32>,
    parity: Vec<(Parity, [u8; BLOCK_BYTES])>,
}

impl FileSectors {
    fn of(file: &Log, session: Option<u32>) -> Result<Option<Self>> {
        let (mut session, mut numbers, mut parity) = (session, Vec::new(), Vec::new());
        let (mut bases, mut begins, mut closed) = (BTreeMap::<u32, u32>::new(), None, None);
        let (mut blocks, mut at) = (file.blocks(), 0_u32);
        while let Some(block) = blocks.next_block()? {
            let header = Header::read(block).ok();
            if let Some(header) = header {
                session.get_or_insert(header.session);
            }
            let own = header.filter(|header| Some(header.session) == session);
            if let Some(own) = own {
                begins.get_or_insert(own.number.wrapping_sub(at));
            }
            let own = own.filter(|own| !own.partial);
            if let Some(own) = own {
                *bases.entry(own.number.wrapping_sub(at)).or_default() += 1;
                closed = closed.or(own.closed.then_some(own.number));
            } else if header.is_none()
                && let Some(one) = Parity::read(block)
            {
                parity.push((one, *block));
            }
            numbers.push(own.map(|own| own.number));
            at = at.saturating_add(1);
        }
        let base = bases.into_iter().max_by_key(|(_, count)| *count).map(|(base, _)| base);
        // Out of order: the file is begun anew.
        let anew = |begins: &u32| {
            let mut others =
                (0_u32..).zip(&numbers).filter_map(|(at, number)| number.map(|number| (at, number)));
            base.is_none_or(|base| base < *begins)
                && others.all(|(at, number)| number.wrapping_sub(at) == *begins || number < *begins)
        };
        let base = begins.filter(anew).or(base);
        let Some(session) = session else { return Ok(None) };
        parity.retain(|(one, _)| one.session == session);
        Ok(Some(Self { session, base, numbers, closed, parity }))
    }

    /// Certainly written parity sectors, and missing ones. A file trimmed after its last sector, like a
    /// download, never had the last ones.
    fn written_and_missing(&self, base: u32) -> (u64, u64) {
        let last = (0..self.numbers.len() as u32).rev().find(|at| self.in_place(base, *at).is_some());
        let Some(last) = last else { return (0, 0) };
        let (full, begun) = (last / STRETCH_SECTORS, last % STRETCH_SECTORS + 1);
        let is_closed = self.closed == Some(base.wrapping_add(last));
        let has_place = |stretch| parity_block(self.numbers.len() as u32, stretch) > last;
        let columns = |stretch| match stretch {
            _ if !has_place(stretch) => 0,
            _ if stretch < full => COLUMNS as u32,
            _ if stretch == full && is_closed => begun.min(COLUMNS as u32),
            _ => 0,
        };
        let written = (0..=full).map(|stretch| 2 * u64::from(columns(stretch))).sum();
        let there: BTreeSet<_> = self
            .parity
            .iter()
            .filter_map(|(one, _)| {
                let (stretch, column) = column_of(one.last.checked_sub(base)?);
                (column < columns(stretch)).then_some((stretch, column, one.sum == Sum::P))
            })
            .collect();
        (written, written - there.len() as u64)
    }

    fn in_place(&self, base: u32, at: u32) -> Option<u32> {
        let number = self.numbers.get(at as usize).copied().flatten();
        number.filter(|number| *number == base.wrapping_add(at))
    }

    fn columns(&self, base: u32) -> BTreeMap<(u32, u32), (Column, Vec<u32>)> {
        let mut columns = BTreeMap::new();
        for (one, block) in &self.parity {
            // Older content's parity covers sectors before the base, or far away.
            let last = one.last.checked_sub(base);
            let Some(last) = last.filter(|last| (*last as usize) < self.numbers.len()) else { continue };
            let empty = || (Column::new(self.session), Vec::new());
            let (column, _) = columns.entry(column_of(last)).or_insert_with(empty);
            column.sum(one, block);
        }
        for ((stretch, first), (column, lost)) in &mut columns {
            let first = stretch.saturating_mul(STRETCH_SECTORS).saturating_add(*first);
            let last = column.last().map_or(0, |last| last.wrapping_sub(base));
            let rows = (first..=last).step_by(COLUMNS);
            let gone = rows.filter(|at| self.in_place(base, *at).is_none());
            lost.extend(gone.map(|at| base.wrapping_add(at)).take(LOST_MAX + 1));
        }
        columns.retain(|_, (_, lost)| lost.len() <= LOST_MAX);
        columns
    }
}
