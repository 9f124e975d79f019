//! Where the blocks of a file lie: its chain of clusters, walked as far as it was needed.
//!
//! `embedded-sdmmc` hands the card one block at a time. A segment's clusters mostly lie in a row, so that whoever knows
//! the row can give the card many blocks in one command, which is what cards are fast at.

use embedded_sdmmc::{Block, BlockDevice, BlockIdx};

use crate::gate::{Gate, GateError};
use crate::layout::Layout;

/// FAT entries of a block.
pub(crate) const ENTRIES: u32 = 128;
/// What the last cluster of a chain has in the FAT.
pub(crate) const END_OF_CHAIN: u32 = 0x0FFF_FFFF;

/// A walk along one file's chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Chain {
    first: u32,
    /// Clusters of the file before the row that is known.
    before: u32,
    /// The row's first cluster.
    cluster: u32,
    /// Its length in clusters.
    length: u32,
}

impl Chain {
    /// The chain that begins at this cluster.
    pub(crate) const fn new(first: u32) -> Self {
        Self { first, before: 0, cluster: first, length: 1 }
    }

    /// The card's block that holds block `index` of the file, and how many of the file's blocks lie in a row from there
    /// on: at least that one, and as many as it takes for `wanted` where they do and one look at the FAT shows it.
    pub(crate) fn locate<D: BlockDevice>(
        &mut self,
        gate: &Gate<'_, D>,
        index: u32,
        wanted: u32,
    ) -> Result<(BlockIdx, u32), GateError<D::Error>> {
        let layout = *gate.layout();
        let (cluster, offset) = (index / layout.cluster_blocks, index % layout.cluster_blocks);
        if cluster < self.before {
            *self = Self::new(self.first);
        }
        // Each step takes in at least one cluster, and no chain has more than the volume.
        for _ in 0..=layout.clusters {
            if !is_cluster(&layout, self.cluster) {
                return Err(GateError::Refused);
            }
            if cluster < self.before + self.length {
                break;
            }
            if !self.lengthen(gate)? {
                self.next_row(gate)?;
            }
        }
        let at = cluster.checked_sub(self.before).filter(|at| *at < self.length).ok_or(GateError::Runaway)?;
        let in_row = |chain: &Self| (chain.length - at) * layout.cluster_blocks - offset;
        if in_row(self) < wanted {
            self.lengthen(gate)?;
        }
        let block = layout.data_start + (self.cluster - 2 + at) * layout.cluster_blocks + offset;
        Ok((BlockIdx(block), in_row(self)))
    }

    /// The row becomes longer by what one block of the FAT tells; `false` where it does not.
    fn lengthen<D: BlockDevice>(&mut self, gate: &Gate<'_, D>) -> Result<bool, GateError<D::Error>> {
        let before = self.length;
        let fat_block = self.last() / ENTRIES;
        let block = read_fat(gate, fat_block)?;
        while self.last() / ENTRIES == fat_block {
            let next = self.last() + 1;
            if entry(&block, self.last()) != next || !is_cluster(gate.layout(), next) {
                break;
            }
            self.length += 1;
        }
        Ok(self.length > before)
    }

    /// Goes on to the row after this one.
    fn next_row<D: BlockDevice>(&mut self, gate: &Gate<'_, D>) -> Result<(), GateError<D::Error>> {
        let next = entry(&read_fat(gate, self.last() / ENTRIES)?, self.last());
        (self.before, self.cluster, self.length) = (self.before + self.length, next, 1);
        Ok(())
    }

    /// The row's last cluster; the row lies within the volume.
    const fn last(&self) -> u32 {
        self.cluster + self.length - 1
    }
}

fn read_fat<D: BlockDevice>(gate: &Gate<'_, D>, fat_block: u32) -> Result<Block, GateError<D::Error>> {
    let mut block = [Block::new()];
    gate.read(&mut block, BlockIdx(gate.layout().fat_start + fat_block))?;
    let [block] = block;
    Ok(block)
}

/// What the FAT block of this cluster says comes after it.
pub(crate) fn entry(block: &Block, cluster: u32) -> u32 {
    let at = (cluster % ENTRIES * 4) as usize;
    let entry = block.get(at..at + 4).and_then(|entry| entry.try_into().ok());
    entry.map_or(0, u32::from_le_bytes) & 0x0FFF_FFFF
}

/// Lets the FAT block of this cluster say that; the entry's upper four bits are nobody's and stay.
pub(crate) fn set_entry(block: &mut Block, cluster: u32, value: u32) {
    let at = (cluster % ENTRIES * 4) as usize;
    if let Some(entry) = block.get_mut(at..).and_then(|entries| entries.first_chunk_mut()) {
        *entry = (u32::from_le_bytes(*entry) & 0xF000_0000 | value).to_le_bytes();
    }
}

const fn is_cluster(layout: &Layout, cluster: u32) -> bool {
    cluster >= 2 && cluster - 2 < layout.clusters
}
