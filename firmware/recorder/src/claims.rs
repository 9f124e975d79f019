//! Clusters that a log claims although the FAT calls them free.
//!
//! A card that lost power may have kept a log's directory entry and lost blocks of the FAT. To whoever looks for room
//! that log's clusters are free, and the next segment would be written over them. A segment mostly lies in a row, so its
//! clusters are known all the same: as many as its size takes, from the first one on. Where the FAT follows this row up to
//! an entry that says "free", which no sound chain holds, the free entries of the row are chained again. Clusters that
//! belong to anything are not touched, and a log whose chain leaves the row is passed over.

use embedded_sdmmc::{Block, BlockDevice, BlockIdx};

use crate::chain::{Chain, END_OF_CHAIN, ENTRIES, entry, set_entry};
use crate::gate::{Gate, GateError};
use crate::name::LogName;

/// Blocks that one look may read: a root directory of 64 K entries, and the FAT of the logs that lie there.
const READS_MAX: u32 = 4_096 + 1_024;
const DIRECTORY_ENTRY_BYTES: usize = 32;
/// Directory entries of a block.
const DIRECTORY_ENTRIES: u32 = Block::LEN_U32 / DIRECTORY_ENTRY_BYTES as u32;
/// Attributes of what is no file: a volume's label, a directory; a part of a long name has both.
const NO_FILE: u8 = 0x18;

/// The row of clusters that a log's directory entry claims.
#[derive(Clone, Copy)]
struct Row {
    first: u32,
    end: u32,
}

/// A walk over the root directory, an entry at a time.
struct Walk {
    chain: Chain,
    /// The entry to look at next, counted from the directory's first one.
    next: u32,
}

impl Row {
    /// What this directory entry claims; `None` where it is no log's, or no such clusters exist.
    fn read(entry: &[u8], cluster_bytes: u32, clusters: u32) -> Option<Self> {
        let (base, extension) = entry.get(..LogName::SHORT_BYTES)?.split_at(8);
        LogName::from_short(base, extension)?;
        let word = |at: usize| entry.get(at..at + 2)?.try_into().ok().map(u16::from_le_bytes);
        let size = u32::from_le_bytes(entry.get(28..32)?.try_into().ok()?);
        let first = (u32::from(word(20)?) << 16 | u32::from(word(26)?)) & 0x0FFF_FFFF;
        let end = first.checked_add(size.div_ceil(cluster_bytes))?;
        let is_file = entry.get(11)? & NO_FILE == 0;
        (is_file && first >= 2 && end <= clusters + 2).then_some(Self { first, end })
    }
}

/// Chains what logs claim of these blocks of the FAT again; whether there was anything to do.
// Each function that holds a block is a call of its own, so that the stack never has two of them.
#[inline(never)]
pub(crate) fn chain_again<D: BlockDevice>(
    gate: &Gate<'_, D>,
    from: u32,
    blocks: u32,
) -> Result<bool, GateError<D::Error>> {
    let reads_left = gate.reads_left();
    gate.allow_reads(READS_MAX);
    let mut changed = false;
    let looked = look(gate, from, from.saturating_add(blocks), &mut changed);
    gate.allow_reads(reads_left);
    match looked {
        // A directory that goes in circles, or whose entries all claim the same, is no reason not to record.
        Ok(()) | Err(GateError::Runaway | GateError::Refused) => Ok(changed),
        Err(error) => Err(error),
    }
}

fn look<D: BlockDevice>(
    gate: &Gate<'_, D>,
    from: u32,
    to: u32,
    changed: &mut bool,
) -> Result<(), GateError<D::Error>> {
    let part = Row { first: from.saturating_mul(ENTRIES), end: to.saturating_mul(ENTRIES) };
    let mut walk = Walk { chain: Chain::new(gate.layout().root), next: 0 };
    while let Some(row) = next_in(gate, &mut walk, part)? {
        let Some(broken_at) = broken_at(gate, row)? else { continue };
        let lost = Row { first: broken_at, end: row.end };
        for fat_block in from.max(broken_at / ENTRIES)..to.min(row.end.div_ceil(ENTRIES)) {
            *changed |= chain_block(gate, fat_block, lost)?;
        }
    }
    Ok(())
}

/// The next log that claims clusters of this part of the card.
#[inline(never)]
fn next_in<D: BlockDevice>(
    gate: &Gate<'_, D>,
    walk: &mut Walk,
    part: Row,
) -> Result<Option<Row>, GateError<D::Error>> {
    let layout = *gate.layout();
    let mut block = [Block::new()];
    loop {
        // The directory ends with its chain, which is refused to go beyond its end.
        let (at, _) = walk.chain.locate(gate, walk.next / DIRECTORY_ENTRIES, 1)?;
        gate.read(&mut block, at)?;
        let first = (walk.next % DIRECTORY_ENTRIES) as usize;
        for entry in block[0].chunks_exact(DIRECTORY_ENTRY_BYTES).skip(first) {
            if entry.first() == Some(&0) {
                return Ok(None);
            }
            walk.next += 1;
            let row = Row::read(entry, layout.cluster_blocks * Block::LEN_U32, layout.clusters);
            if let Some(row) = row.filter(|row| row.first < part.end && row.end > part.first) {
                return Ok(Some(row));
            }
        }
    }
}

/// The first cluster of the row that the FAT calls free, where it follows the row up to there.
#[inline(never)]
fn broken_at<D: BlockDevice>(gate: &Gate<'_, D>, row: Row) -> Result<Option<u32>, GateError<D::Error>> {
    let mut block = [Block::new()];
    let mut cluster = row.first;
    while cluster < row.end {
        let fat_block = cluster / ENTRIES;
        gate.read(&mut block, BlockIdx(gate.layout().fat_start + fat_block))?;
        while cluster < row.end && cluster / ENTRIES == fat_block {
            match entry(&block[0], cluster) {
                0 => return Ok(Some(cluster)),
                next if next == cluster + 1 => cluster = next,
                _ => return Ok(None),
            }
        }
    }
    Ok(None)
}

/// What the FAT says comes after this cluster.
#[inline(never)]
fn entry_of<D: BlockDevice>(gate: &Gate<'_, D>, cluster: u32) -> Result<u32, GateError<D::Error>> {
    let mut block = [Block::new()];
    gate.read(&mut block, BlockIdx(gate.layout().fat_start + cluster / ENTRIES))?;
    Ok(entry(&block[0], cluster))
}

/// Chains the free entries of one block of the FAT that lie in this row; whether there were any. One block is written in
/// each copy of the FAT, and each of its entries is right by itself, however much of the block is.
#[inline(never)]
fn chain_block<D: BlockDevice>(
    gate: &Gate<'_, D>,
    fat_block: u32,
    row: Row,
) -> Result<bool, GateError<D::Error>> {
    let (first, end) = (row.first.max(fat_block * ENTRIES), row.end.min((fat_block + 1) * ENTRIES));
    // What comes behind is chained to where it is free, and so the row's, too.
    let mut next = if end < row.end { entry_of(gate, end)? } else { END_OF_CHAIN };
    let layout = gate.layout();
    let mut block = [Block::new()];
    // As it is on the card: what the gate shows in the place of nonsense must not be written.
    let at = layout.fat_start + fat_block;
    gate.device().read(&mut block, BlockIdx(at)).map_err(GateError::Device)?;
    let mut changed = false;
    for cluster in (first..end).rev() {
        let old = entry(&block[0], cluster);
        if old == 0 {
            set_entry(&mut block[0], cluster, if next == 0 { cluster + 1 } else { END_OF_CHAIN });
            changed = true;
        }
        next = old;
    }
    for copy in (0..layout.fat_copies).filter(|_| changed) {
        let at = BlockIdx(at + copy * layout.fat_blocks);
        gate.device().write(&block, at).map_err(GateError::Device)?;
    }
    Ok(changed)
}
