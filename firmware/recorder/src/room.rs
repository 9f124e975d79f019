//! How much room there is: free clusters, found for one more segment, chained to be its own, and counted for the share that logs can
//! have.
//!
//! **Allocation without data.** The library allocates by writing, block by block; here a segment of 8 MiB costs its FAT blocks and no
//! more. What an earlier file left in those clusters stays there until it is overwritten: readers tell it by its session.

use embedded_sdmmc::{Block, BlockDevice, BlockIdx};

use crate::card_error::CardError;
use crate::chain::{END_OF_CHAIN, ENTRIES, entry, set_entry};
use crate::claims::chain_again;
use crate::gate::{Gate, GateError, HINT};
use crate::layout::Layout;

/// FAT blocks that are looked through at a time, beside a segment's own: 64 ms of a usual card. All of a large card's FAT takes
/// seconds, and no one service of the card may take so long.
const SEARCH_BLOCKS: u32 = 128;
/// FAT blocks, beside a segment's own, of which lost chains of logs are looked for with one walk over the directory.
const CLAIM_BLOCKS: u32 = 8;

/// The search for free clusters, which goes on from segment to segment, and what is known of how many there are.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Room {
    /// The FAT block to look at next; `None`: where the information sector says.
    next: Option<u32>,
    /// FAT blocks looked through since enough were found, and what free clusters they told of.
    searched: u32,
    found: u32,
    /// From which cluster on these are.
    first: u32,
    /// So many clusters, and so no more than that, were not there in all of the FAT: nothing but another computer
    /// makes clusters free.
    too_many: u32,
    /// FAT blocks whose free entries are counted, for how much room there is in all.
    counted: u32,
    /// Free clusters counted.
    clusters: u32,
}

impl Room {
    pub(crate) const fn new() -> Self {
        Self { next: None, searched: 0, found: 0, first: 0, too_many: u32::MAX, counted: 0, clusters: 0 }
    }

    /// Counts the free clusters of one more block of the FAT; how many there are once all of it is counted.
    pub(crate) fn count<D: BlockDevice>(
        &mut self,
        gate: &Gate<'_, D>,
    ) -> Result<Option<u32>, CardError<D::Error>> {
        if self.counted >= gate.layout().fat_blocks {
            return Ok(Some(self.clusters));
        }
        self.clusters += free_in_block(gate, self.counted)?;
        self.counted += 1;
        Ok(None)
    }

    /// From which cluster on that many are free. Asked before a segment is made, so that one that does not fit leaves no half
    /// of a chain behind. What logs claim of these is chained again before anything of it counts as free.
    ///
    /// # Errors
    ///
    /// [`CardError::Searching`] where a part of the FAT was looked through and the next call looks further;
    /// [`CardError::Full`] where all of it was.
    pub(crate) fn find<D: BlockDevice>(
        &mut self,
        gate: &Gate<'_, D>,
        wanted: u32,
    ) -> Result<u32, CardError<D::Error>> {
        if wanted >= self.too_many {
            return Err(CardError::Full);
        }
        let fat_blocks = gate.layout().fat_blocks;
        let mut next = match self.next {
            Some(next) => next,
            None => hint(gate)? / ENTRIES,
        };
        let mut looked_to = 0;
        for _ in 0..SEARCH_BLOCKS + wanted / ENTRIES {
            next %= fat_blocks;
            let mut free = free_in_block(gate, next)?;
            if free > 0 && (next >= looked_to || next == 0) {
                let blocks = (CLAIM_BLOCKS + wanted / ENTRIES).min(fat_blocks - next);
                if chain_again(gate, next, blocks)? {
                    free = free_in_block(gate, next)?;
                }
                looked_to = next + blocks;
            }
            if self.found == 0 {
                self.first = (next * ENTRIES).max(2);
            }
            self.found += free;
            if self.found >= wanted {
                let first = self.first;
                // This block may have some left for the next segment. What is counted changes under the count.
                *self = Self { next: Some(next), too_many: self.too_many, ..Self::new() };
                return Ok(first);
            }
            next += 1;
            self.next = Some(next);
            self.searched += 1;
            if self.searched >= fat_blocks {
                (self.searched, self.found, self.too_many) = (0, 0, wanted);
                return Err(CardError::Full);
            }
        }
        Err(CardError::Searching)
    }
}

/// Makes so many free clusters one chain, from this one's block of the FAT on, and behind the FAT's end from its beginning; the first
/// and the last of them. Within a transaction: what was chained when it fails is forgotten with it.
pub(crate) fn chain_free<D: BlockDevice>(
    gate: &Gate<'_, D>,
    from: u32,
    wanted: u32,
) -> Result<(u32, u32), CardError<D::Error>> {
    let fat_blocks = gate.layout().fat_blocks;
    let mut ends: Option<(u32, u32)> = None;
    let mut left = wanted;
    for index in 0..fat_blocks {
        let Some(part) = chain_in_block(gate, (from / ENTRIES + index) % fat_blocks, left)? else { continue };
        ends = match ends {
            None => Some((part.first, part.last)),
            Some((first, last)) => {
                link(gate, last, part.first)?;
                Some((first, part.last))
            }
        };
        left -= part.clusters;
        if left == 0 {
            break;
        }
    }
    ends.filter(|_| left == 0).ok_or(CardError::Full)
}

/// What of a chain lies in one block of the FAT.
struct Part {
    first: u32,
    last: u32,
    clusters: u32,
}

/// Makes the free clusters of one block of the FAT a chain, or so many of them.
// Each function that holds a block is a call of its own, so that the stack never has two of them.
#[inline(never)]
fn chain_in_block<D: BlockDevice>(
    gate: &Gate<'_, D>,
    index: u32,
    most: u32,
) -> Result<Option<Part>, GateError<D::Error>> {
    let layout = *gate.layout();
    let mut block = [Block::new()];
    gate.read(&mut block, BlockIdx(layout.fat_start + index))?;
    let mut part: Option<Part> = None;
    for cluster in (index * ENTRIES).max(2)..((index + 1) * ENTRIES).min(layout.clusters + 2) {
        if entry(&block[0], cluster) != 0 {
            continue;
        }
        set_entry(&mut block[0], cluster, END_OF_CHAIN);
        let part = part.get_or_insert(Part { first: cluster, last: cluster, clusters: 0 });
        if part.clusters > 0 {
            set_entry(&mut block[0], part.last, cluster);
        }
        (part.last, part.clusters) = (cluster, part.clusters + 1);
        if part.clusters == most {
            break;
        }
    }
    if part.is_some() {
        write_fat(gate, &block, index)?;
    }
    Ok(part)
}

/// Lets the FAT say that this cluster is followed by that one.
#[inline(never)]
fn link<D: BlockDevice>(gate: &Gate<'_, D>, cluster: u32, next: u32) -> Result<(), GateError<D::Error>> {
    let mut block = [Block::new()];
    gate.read(&mut block, BlockIdx(gate.layout().fat_start + cluster / ENTRIES))?;
    set_entry(&mut block[0], cluster, next);
    write_fat(gate, &block, cluster / ENTRIES)
}

/// Writes a block of the FAT into each of its copies.
fn write_fat<D: BlockDevice>(
    gate: &Gate<'_, D>,
    block: &[Block; 1],
    index: u32,
) -> Result<(), GateError<D::Error>> {
    let Layout { fat_start, fat_blocks, fat_copies, .. } = *gate.layout();
    (0..fat_copies).try_for_each(|copy| gate.write(block, BlockIdx(fat_start + copy * fat_blocks + index)))
}

/// The cluster from which on a search is to begin, as the information sector says; the first one where it does not.
fn hint<D: BlockDevice>(gate: &Gate<'_, D>) -> Result<u32, GateError<D::Error>> {
    let mut block = [Block::new()];
    gate.read(&mut block, BlockIdx(gate.layout().info))?;
    let hint =
        block[0].get(HINT..HINT + 4).and_then(|hint| hint.try_into().ok()).map_or(0, u32::from_le_bytes);
    Ok(if hint < gate.layout().clusters + 2 { hint } else { 0 })
}

/// Free clusters that one block of the FAT tells of.
fn free_in_block<D: BlockDevice>(gate: &Gate<'_, D>, index: u32) -> Result<u32, GateError<D::Error>> {
    let layout = gate.layout();
    let mut block = [Block::new()];
    gate.read(&mut block, BlockIdx(layout.fat_start + index))?;
    let entries = (layout.clusters + 2).saturating_sub(index * ENTRIES).min(ENTRIES);
    let is_free = |entry: &&[u8]| u32::from_le_bytes([entry[0], entry[1], entry[2], entry[3] & 0x0F]) == 0;
    Ok(block[0].chunks_exact(4).take(entries as usize).filter(is_free).count() as u32)
}
