//! Free clusters: found for one more segment, chained to be its own, and counted for the share of the card that logs
//! can have.
//!
//! A segment of 8 MiB costs its FAT blocks and no more. Old data stays in those clusters until it is overwritten;
//! readers recognise it by its session.

use core::ops::Range;

use crate::card::CardError;
use crate::volume::{END_OF_CHAIN, ENTRIES, Volume, entry, set_entry};
use crate::{BLOCK_BYTES, Block, CardDevice};

/// FAT blocks that one call looks through, beside a segment's own: 64 ms of a usual card. All of a large card's FAT
/// takes seconds, which one service may not take.
const SEARCH_BLOCKS: u32 = 128;

/// Offsets in the information sector: the cluster from which on to search, and the number of free ones.
const HINT: usize = 492;
const FREE_COUNT: usize = 488;
/// Signatures of the information sector (Microsoft's FAT specification 1.03, `FSInfo`), and their offsets.
const SIGNATURES: [(usize, u32); 3] = [(0, 0x4161_5252), (484, 0x6141_7272), (508, 0xAA55_0000)];

#[derive(Clone, Copy, Debug)]
pub(crate) struct FreeSearch {
    next: u32,
    /// FAT blocks searched since enough clusters were found, and free clusters in the last of them.
    searched: u32,
    found: u32,
    first: u32,
    /// Clusters of a search that goes on; 0: none.
    wanted: u32,
    /// This many clusters are not free. Only another computer frees clusters.
    too_many: u32,
    /// FAT blocks whose free entries are counted, and their number.
    counted: u32,
    clusters: u32,
}

impl FreeSearch {
    pub(crate) fn new<D: CardDevice>(volume: &Volume<'_, D>) -> Self {
        let mut block = [[0; BLOCK_BYTES]];
        // An unreadable sector counts as an unsigned one.
        let is_read = volume.read(&mut block, volume.layout.info).is_ok();
        let hint = Some(word(&block[0], HINT))
            .filter(|hint| is_read && is_signed(&block[0]) && volume.is_cluster(*hint));
        Self::at(hint.unwrap_or(0) / ENTRIES, u32::MAX)
    }

    const fn at(next: u32, too_many: u32) -> Self {
        Self { next, searched: 0, found: 0, first: next, wanted: 0, too_many, counted: 0, clusters: 0 }
    }

    /// Begins at the FAT block after this cluster, if the cluster in the information sector is not free.
    pub(crate) fn begin<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
        cluster: u32,
    ) -> Result<(), CardError<D::Error>> {
        if volume.is_cluster(cluster) && free_in_block(volume, self.next)? == 0 {
            *self = Self::at(cluster.div_ceil(ENTRIES), self.too_many);
        }
        Ok(())
    }

    pub(crate) const fn next(&self) -> u32 {
        self.next
    }

    pub(crate) fn count<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
    ) -> Result<Option<u32>, CardError<D::Error>> {
        if self.counted >= volume.layout.fat_blocks {
            return Ok(Some(self.clusters));
        }
        self.clusters += free_in_block(volume, self.counted)?;
        self.counted += 1;
        Ok(None)
    }

    /// Blocks of the FAT with this many free clusters; one call searches a limited number, and the next goes on at
    /// the last of them. A result never spans the FAT's end.
    ///
    /// # Errors
    ///
    /// [`CardError::Searching`] after a part of the FAT: the next call goes on. [`CardError::Full`] after all of it.
    pub(crate) fn find<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
        wanted: u32,
    ) -> Result<Range<u32>, CardError<D::Error>> {
        self.find_within(volume, wanted, SEARCH_BLOCKS + wanted / ENTRIES)
    }

    /// Continues an unfinished search, one block of the FAT at a call. The next [`Self::find`] begins with its
    /// result.
    pub(crate) fn search_on<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
    ) -> Result<(), CardError<D::Error>> {
        if self.wanted > 0 {
            let found = self.find_within(volume, self.wanted, 1)?;
            self.again(&found);
        }
        Ok(())
    }

    fn find_within<D: CardDevice>(
        &mut self,
        volume: &Volume<'_, D>,
        wanted: u32,
        blocks: u32,
    ) -> Result<Range<u32>, CardError<D::Error>> {
        if wanted >= self.too_many {
            return Err(CardError::Full);
        }
        let fat_blocks = volume.layout.fat_blocks;
        for _ in 0..blocks {
            if self.next >= fat_blocks {
                (self.next, self.found) = (0, 0);
            }
            let free = free_in_block(volume, self.next)?;
            if self.found == 0 || self.next - self.first > SEARCH_BLOCKS + wanted / ENTRIES {
                (self.first, self.found) = (self.next, 0);
            }
            self.found += free;
            if self.found >= wanted {
                let found = self.first..self.next + 1;
                // The last block may have free clusters for the next segment. A count in progress is now invalid.
                *self = Self::at(self.next, self.too_many);
                return Ok(found);
            }
            self.next += 1;
            self.searched += 1;
            if self.searched >= fat_blocks {
                *self = Self::at(self.next, wanted);
                return Err(CardError::Full);
            }
        }
        self.wanted = wanted;
        Err(CardError::Searching)
    }

    pub(crate) const fn restart(&mut self) {
        (self.first, self.found) = (self.next, 0);
    }

    pub(crate) const fn again(&mut self, found: &Range<u32>) {
        (self.next, self.first) = (found.start, found.start);
    }
}

/// Chains this many free clusters of these blocks of the FAT; returns the first and the last one. The blocks are
/// written from the last to the first, so that each entry names a cluster that is chained already.
pub(crate) fn chain_free<D: CardDevice>(
    volume: &Volume<'_, D>,
    found: &Range<u32>,
    wanted: u32,
) -> Result<(u32, u32), CardError<D::Error>> {
    let (mut end, mut before, mut in_last) = (found.start, 0, 0);
    while before + in_last < wanted {
        if end >= found.end {
            return Err(CardError::Full);
        }
        before += in_last;
        in_last = free_in_block(volume, end)?;
        end += 1;
    }
    let (last, mut next) = chain_in_block(volume, end.saturating_sub(1), wanted - before, END_OF_CHAIN)?;
    for index in (found.start..end.saturating_sub(1)).rev() {
        if free_in_block(volume, index)? > 0 {
            (_, next) = chain_in_block(volume, index, ENTRIES, next)?;
        }
    }
    Ok((next, last))
}

pub(crate) fn free_chain<D: CardDevice>(
    volume: &Volume<'_, D>,
    first: u32,
) -> Result<(), CardError<D::Error>> {
    let mut cluster = first;
    // Each step frees one cluster, which ends a circular chain.
    while volume.is_cluster(cluster) {
        let index = cluster / ENTRIES;
        let mut block = volume.read_fat(index)?;
        while volume.is_cluster(cluster) && cluster / ENTRIES == index {
            let next = entry(&block[0], cluster);
            set_entry(&mut block[0], cluster, 0);
            cluster = next;
        }
        volume.write_fat(&block, index)?;
    }
    Ok(())
}

/// Chains the free clusters of one block of the FAT, at most `most`, to `next`; returns the last and the first one.
// Two blocks must not share a stack frame.
#[inline(never)]
fn chain_in_block<D: CardDevice>(
    volume: &Volume<'_, D>,
    index: u32,
    most: u32,
    next: u32,
) -> Result<(u32, u32), CardError<D::Error>> {
    let mut block = volume.read_fat(index)?;
    let (mut first, mut last, mut taken) = (0, 0, 0);
    for cluster in index * ENTRIES..(index + 1) * ENTRIES {
        if taken == most || !volume.is_free(&block[0], cluster) {
            continue;
        }
        set_entry(&mut block[0], cluster, next);
        if taken == 0 {
            first = cluster;
        } else {
            set_entry(&mut block[0], last, cluster);
        }
        (last, taken) = (cluster, taken + 1);
    }
    volume.write_fat(&block, index)?;
    Ok((last, first))
}

#[inline(never)]
fn free_in_block<D: CardDevice>(volume: &Volume<'_, D>, index: u32) -> Result<u32, CardError<D::Error>> {
    let [block] = volume.read_fat(index)?;
    let clusters = index * ENTRIES..(index + 1) * ENTRIES;
    Ok(clusters.filter(|cluster| volume.is_free(&block, *cluster)).count() as u32)
}

/// Writes the information sector: the next search, on any computer, begins at this cluster. The free count is written
/// as unknown, so that it can never be wrong. A refused write is ignored: files need no hint.
#[inline(never)]
pub(crate) fn write_hint<D: CardDevice>(volume: &Volume<'_, D>, cluster: u32) {
    let mut block = [[0; BLOCK_BYTES]];
    let is_read = volume.read(&mut block, volume.layout.info).is_ok();
    if !is_read || !is_signed(&block[0]) {
        block = [[0; BLOCK_BYTES]];
    }
    let words = [(FREE_COUNT, u32::MAX), (HINT, cluster)];
    for (at, value) in SIGNATURES.into_iter().chain(words) {
        block[0][at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    let _ = volume.write(&block, volume.layout.info);
}

fn is_signed(block: &Block) -> bool {
    SIGNATURES.into_iter().all(|(at, signature)| word(block, at) == signature)
}

fn word(block: &Block, at: usize) -> u32 {
    block.get(at..at + 4).and_then(|word| word.try_into().ok()).map_or(0, u32::from_le_bytes)
}
