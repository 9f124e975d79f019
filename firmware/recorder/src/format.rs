//! Formats a card: one partition, FAT32. Used for the PC's card images, and on the board by command
//! ([`crate::CardStatus::want_format`]), never unasked.
//!
//! One FAT instead of two, deliberately. With two, each update has a moment in which the copies differ, and a cut
//! there is an error for a file system check. The second copy is never read by any system in use.

use crate::layout::FAT32_CLUSTERS_MIN;
use crate::{BLOCK_BYTES, Block, CardDevice};

/// The partition begins at 1 MiB, as SD cards and every partitioning tool have it.
const PARTITION_START: u32 = 2048;
/// Blocks before the FAT: the customary 32.
const RESERVED_BLOCKS: u32 = 32;
const INFO_BLOCK: u32 = 1;
const BACKUP_BLOCK: u32 = 6;
const ROOT_CLUSTER: u32 = 2;
const ENTRIES: u32 = 128;
/// The smallest card that FAT32 fits on, in blocks: 65,525 clusters of one block, their FAT and what is before them. The
/// FAT has entries for the blocks that it takes itself, too (see `Plan::new`): a block of it for each 127 clusters.
pub const BLOCKS_MIN: u32 =
    PARTITION_START + RESERVED_BLOCKS + FAT32_CLUSTERS_MIN.div_ceil(ENTRIES - 1) + FAT32_CLUSTERS_MIN;

/// The reason that a card was not formatted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FormatError<E> {
    /// The card did not take a block.
    Device(E),
    /// The card is smaller than [`BLOCKS_MIN`].
    TooSmall,
}

/// The largest cluster with which a volume of this size is still FAT32: large clusters take few FAT blocks for a new
/// segment. At most 32 KiB, which every system reads.
const fn cluster_blocks(volume_blocks: u32) -> u32 {
    let mut blocks = 64;
    while blocks > 1 && volume_blocks / blocks < FAT32_CLUSTERS_MIN + FAT32_CLUSTERS_MIN / ENTRIES {
        blocks /= 2;
    }
    blocks
}

/// Blocks that are cleared with one command; they lie on the stack.
const CLEAR_BLOCKS: u32 = 4;

/// Makes a partition table and an empty FAT32 volume; everything on the card is lost.
pub fn format<D: CardDevice>(device: &D, volume_id: u32) -> Result<(), FormatError<D::Error>> {
    let mut formatting = Formatting::new(volume_id);
    while !formatting.step(device)? {}
    Ok(())
}

/// One command at a step: a large card's FAT is tens of megabytes.
///
/// The partition table is cleared first and written last, so that a cut in between leaves an unformatted card, and
/// not a damaged volume.
#[derive(Clone, Copy, Debug)]
pub struct Formatting {
    volume_id: u32,
    plan: Option<Plan>,
}

#[derive(Clone, Copy, Debug)]
struct Plan {
    volume_id: u32,
    total: u32,
    cluster_blocks: u32,
    fat_blocks: u32,
    next: u32,
    end: u32,
    structures: usize,
}

const FAT_START: u32 = PARTITION_START + RESERVED_BLOCKS;
type Make = fn(&Plan) -> Block;
/// The blocks that are written after the FAT and the root directory are cleared, in this order.
const STRUCTURES: [(Make, u32); 6] = [
    (fat_begin, FAT_START),
    (boot_sector, PARTITION_START),
    (info_sector, PARTITION_START + INFO_BLOCK),
    (boot_sector, PARTITION_START + BACKUP_BLOCK),
    (info_sector, PARTITION_START + BACKUP_BLOCK + INFO_BLOCK),
    (partition_table, 0),
];

impl Plan {
    const fn new(card_blocks: u32, volume_id: u32) -> Self {
        let total = card_blocks - PARTITION_START;
        let cluster_blocks = cluster_blocks(total);
        // The FAT for all remaining blocks is a little larger than needed: it also covers its own blocks.
        let fat_blocks = ((total - RESERVED_BLOCKS) / cluster_blocks + 2).div_ceil(ENTRIES);
        // The FAT, and behind it the root directory's cluster.
        let end = FAT_START + fat_blocks + cluster_blocks;
        Self { volume_id, total, cluster_blocks, fat_blocks, next: FAT_START, end, structures: 0 }
    }
}

impl Formatting {
    /// A card before the first step.
    pub const fn new(volume_id: u32) -> Self {
        Self { volume_id, plan: None }
    }

    /// Whether it was the last one.
    pub fn step<D: CardDevice>(&mut self, device: &D) -> Result<bool, FormatError<D::Error>> {
        let Some(plan) = &mut self.plan else {
            let card_blocks = device.num_blocks().map_err(FormatError::Device)?;
            if card_blocks < BLOCKS_MIN {
                return Err(FormatError::TooSmall);
            }
            clear(device, 0, 1)?;
            self.plan = Some(Plan::new(card_blocks, self.volume_id));
            return Ok(false);
        };
        let left = plan.end - plan.next;
        if left > 0 {
            let count = left.min(CLEAR_BLOCKS);
            clear(device, plan.next, count)?;
            plan.next += count;
            return Ok(false);
        }
        if let Some((make, at)) = STRUCTURES.get(plan.structures) {
            device.write(&[make(plan)], *at).map_err(FormatError::Device)?;
            plan.structures += 1;
        }
        Ok(plan.structures >= STRUCTURES.len())
    }
}

#[inline(never)]
fn clear<D: CardDevice>(device: &D, at: u32, count: u32) -> Result<(), FormatError<D::Error>> {
    let zeros = [[0; BLOCK_BYTES]; CLEAR_BLOCKS as usize];
    let zeros = zeros.get(..count as usize).unwrap_or_default();
    device.write(zeros, at).map_err(FormatError::Device)
}

fn put(block: &mut Block, at: usize, bytes: &[u8]) {
    block[at..at + bytes.len()].copy_from_slice(bytes);
}

fn partition_table(plan: &Plan) -> Block {
    let mut block = [0; BLOCK_BYTES];
    // Status, CHS of the first block ("too far"), type FAT32 LBA, CHS of the last block.
    put(&mut block, 446, &[0x00, 0xFE, 0xFF, 0xFF, 0x0C, 0xFE, 0xFF, 0xFF]);
    put(&mut block, 454, &PARTITION_START.to_le_bytes());
    put(&mut block, 458, &plan.total.to_le_bytes());
    put(&mut block, 510, &[0x55, 0xAA]);
    block
}

fn boot_sector(plan: &Plan) -> Block {
    let Plan { total, cluster_blocks, fat_blocks, volume_id, .. } = *plan;
    let mut block = [0; BLOCK_BYTES];
    put(&mut block, 0, &[0xEB, 0x58, 0x90]);
    put(&mut block, 3, b"HUMS    ");
    put(&mut block, 11, &(BLOCK_BYTES as u16).to_le_bytes());
    put(&mut block, 13, &[cluster_blocks as u8]);
    put(&mut block, 14, &(RESERVED_BLOCKS as u16).to_le_bytes());
    put(&mut block, 16, &[1]); // one FAT
    put(&mut block, 21, &[0xF8]); // media: fixed
    put(&mut block, 24, &63_u16.to_le_bytes());
    put(&mut block, 26, &255_u16.to_le_bytes());
    put(&mut block, 28, &PARTITION_START.to_le_bytes());
    put(&mut block, 32, &total.to_le_bytes());
    put(&mut block, 36, &fat_blocks.to_le_bytes());
    put(&mut block, 44, &ROOT_CLUSTER.to_le_bytes());
    put(&mut block, 48, &(INFO_BLOCK as u16).to_le_bytes());
    put(&mut block, 50, &(BACKUP_BLOCK as u16).to_le_bytes());
    put(&mut block, 64, &[0x80, 0, 0x29]);
    put(&mut block, 67, &volume_id.to_le_bytes());
    put(&mut block, 71, b"NO NAME    ");
    put(&mut block, 82, b"FAT32   ");
    put(&mut block, 510, &[0x55, 0xAA]);
    block
}

/// The free count stays unknown for ever, so it can never be wrong.
fn info_sector(_: &Plan) -> Block {
    let mut block = [0; BLOCK_BYTES];
    put(&mut block, 0, &0x4161_5252_u32.to_le_bytes());
    put(&mut block, 484, &0x6141_7272_u32.to_le_bytes());
    put(&mut block, 488, &u32::MAX.to_le_bytes());
    put(&mut block, 492, &(ROOT_CLUSTER + 1).to_le_bytes());
    put(&mut block, 510, &[0x55, 0xAA]);
    block
}

fn fat_begin(_: &Plan) -> Block {
    let mut block = [0; BLOCK_BYTES];
    for (entry, value) in [0x0FFF_FFF8_u32, 0x0FFF_FFFF, 0x0FFF_FFFF].iter().enumerate() {
        put(&mut block, entry * 4, &value.to_le_bytes());
    }
    block
}
