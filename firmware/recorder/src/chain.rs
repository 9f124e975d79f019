//! The chain of clusters of a file or directory, followed only as far as needed.
//!
//! The clusters of a segment mostly lie in a row. A known row lets the card take many blocks in one command, at which
//! cards are fast.

use crate::CardDevice;
use crate::card::CardError;
use crate::volume::{ENTRIES, Volume, entry};

/// A chain with the row used last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ClusterChain {
    first: u32,
    before: u32,
    cluster: u32,
    length: u32,
}

impl ClusterChain {
    pub(crate) const fn new(first: u32) -> Self {
        Self { first, before: 0, cluster: first, length: 1 }
    }

    /// The card's block of block `index` of the file, and the number of blocks in a row from there: 1 to `wanted`, as
    /// far as one read of the FAT shows it. `None`: the chain ends before it.
    pub(crate) fn locate<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
        index: u32,
        wanted: u32,
    ) -> Result<Option<(u32, u32)>, CardError<D::Error>> {
        let layout = volume.layout;
        let (cluster, offset) = (index / layout.cluster_blocks, index % layout.cluster_blocks);
        if cluster < self.before {
            *self = Self::new(self.first);
        }
        if !volume.is_cluster(self.cluster) {
            return Ok(None);
        }
        // Each step takes in one cluster at least, so that this ends.
        while cluster >= self.before + self.length {
            if !self.lengthen(volume)? && !self.next_row(volume)? {
                return Ok(None);
            }
        }
        let at = cluster - self.before;
        let in_row = |chain: &Self| (chain.length - at) * layout.cluster_blocks - offset;
        if in_row(self) < wanted {
            self.lengthen(volume)?;
        }
        Ok(Some((volume.block_of(self.cluster + at) + offset, in_row(self))))
    }

    fn lengthen<D: CardDevice>(&mut self, volume: &Volume<'_, D>) -> Result<bool, CardError<D::Error>> {
        let before = self.length;
        let fat_block = self.last() / ENTRIES;
        let [block] = volume.read_fat(fat_block)?;
        while self.last() / ENTRIES == fat_block {
            let next = self.last() + 1;
            if entry(&block, self.last()) != next || !volume.is_cluster(next) {
                break;
            }
            self.length += 1;
        }
        Ok(self.length > before)
    }

    fn next_row<D: CardDevice>(&mut self, volume: &Volume<'_, D>) -> Result<bool, CardError<D::Error>> {
        let next = volume.entry(self.last())?;
        if !volume.is_cluster(next) {
            return Ok(false);
        }
        (self.before, self.cluster, self.length) = (self.before + self.length, next, 1);
        Ok(true)
    }

    /// The row's last cluster; after [`Self::locate`] found the end, the chain's last one.
    pub(crate) const fn last(&self) -> u32 {
        self.cluster + self.length - 1
    }
}
