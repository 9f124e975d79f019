//! The parity of the current stretch: sums that grow with each written sector.

use crate::{BLOCK_BYTES, Block};
use hums_blackbox::SECTOR_BYTES;
use hums_blackbox::parity::{COLUMNS, PARITY_SECTORS, STRETCH_SECTORS, Sum};
use hums_core::clock::{Instant, Span};

/// Longest time until the parity of an unfinished stretch is written: sectors lost by the card before a power cut
/// cannot be rebuilt without it.
const EVERY: Span = Span::from_secs(10);

pub(crate) struct Parity {
    blocks: [Block; PARITY_SECTORS as usize],
    /// Sectors in each column so far, missing ones included.
    rows: [u8; COLUMNS],
    stretch: u32,
    since: Option<Instant>,
}

impl Parity {
    pub(crate) const fn new() -> Self {
        Self {
            blocks: [[0; BLOCK_BYTES]; PARITY_SECTORS as usize],
            rows: [0; COLUMNS],
            stretch: 0,
            since: None,
        }
    }

    /// Lends the buffer, for directory blocks while a card is mounted or a segment is made. No parity is made until
    /// [`Self::begin`].
    pub(crate) const fn lend(&mut self) -> &mut [Block] {
        self.since = None;
        &mut self.blocks
    }

    /// Starts afresh.
    pub(crate) fn begin(&mut self, stretch: u32) {
        self.blocks.iter_mut().for_each(|block| block.fill(0));
        self.rows = [0; COLUMNS];
        (self.stretch, self.since) = (stretch, None);
    }

    pub(crate) const fn stretch(&self) -> u32 {
        self.stretch
    }

    pub(crate) fn add(&mut self, now: Instant, at: u32, sector: &[u8; SECTOR_BYTES]) {
        let index = (at % STRETCH_SECTORS) as usize;
        let (row, column) = ((index / COLUMNS) as u8, index % COLUMNS);
        let Some(rows) = self.rows.get_mut(column) else { return };
        let passed = row.saturating_sub(*rows);
        *rows = row + 1;
        for (sum, blocks) in Sum::ALL.into_iter().zip(self.blocks.chunks_mut(COLUMNS)) {
            if let Some(block) = blocks.get_mut(column) {
                (0..passed).for_each(|_| sum.pass(block));
                sum.add(block, sector);
            }
        }
        self.since.get_or_insert(now);
    }

    pub(crate) fn end(&self) -> u32 {
        let of = |(column, rows): (u32, u8)| {
            rows.checked_sub(1).map(|row| u32::from(row) * COLUMNS as u32 + column + 1)
        };
        let in_stretch = (0..).zip(self.rows).filter_map(of).max().unwrap_or(0);
        self.stretch.wrapping_mul(STRETCH_SECTORS).wrapping_add(in_stretch)
    }

    pub(crate) const fn is_due(&self) -> bool {
        self.since.is_some()
    }

    pub(crate) fn is_overdue(&self, now: Instant) -> bool {
        self.since.is_some_and(|since| now.since(since) >= EVERY)
    }

    /// The parity blocks to write, for a file whose first sector has the number `base`. They are due again after the
    /// next sector.
    pub(crate) fn blocks(&mut self, session: u32, base: u32) -> &[Block] {
        self.since = None;
        let first = base.wrapping_add(self.stretch.wrapping_mul(STRETCH_SECTORS));
        for (sum, blocks) in Sum::ALL.into_iter().zip(self.blocks.chunks_mut(COLUMNS)) {
            for (column, (block, rows)) in (0..).zip(blocks.iter_mut().zip(self.rows)) {
                if let Some(row) = rows.checked_sub(1) {
                    let index = u32::from(row) * COLUMNS as u32 + column;
                    sum.seal(block, session, first.wrapping_add(index));
                }
            }
        }
        &self.blocks
    }
}
