//! The layout of a card: read from its first blocks and checked before any other access.
//!
//! A card may hold any data, so a number that does not fit is an error here ([`LayoutError`]), and never an overflow
//! later. Source of the layout: Microsoft FAT specification 1.03 (`fatgen103`).

use core::fmt;

use crate::{BLOCK_BYTES, Block, CardDevice};

/// Clusters below this number make a FAT16 volume, whatever else it says.
pub const FAT32_CLUSTERS_MIN: u32 = 65_525;
/// Cluster numbers stop before the reserved ones.
pub const FAT32_CLUSTERS_MAX: u32 = 0x0FFF_FFF5;
/// MBR partition types of FAT32: CHS and LBA.
const FAT32_TYPES: [u8; 2] = [0x0B, 0x0C];

/// MBR partition type of exFAT, and of NTFS.
pub(crate) const EXFAT_TYPE: u8 = 0x07;

/// In the first partition of a card; block numbers are absolute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    /// The volume's first block.
    pub start: u32,
    /// The information sector (free cluster hint).
    pub info: u32,
    /// The first FAT's first block.
    pub fat_start: u32,
    /// Blocks of one FAT with entries of clusters.
    pub fat_blocks: u32,
    /// Blocks from one copy of the FAT to the next.
    pub fat_stride: u32,
    /// Copies of the FAT: 1 or 2.
    pub fat_copies: u32,
    /// The first block of cluster 2.
    pub data_start: u32,
    /// Blocks of a cluster: a power of two, 1 to 128.
    pub cluster_blocks: u32,
    /// Numbered from 2.
    pub clusters: u32,
    /// First one of the root directory.
    pub root: u32,
    /// The number that formatting gave the volume.
    pub volume_id: u32,
}

/// Reported, never formatted unasked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayoutError<E> {
    /// The card did not answer.
    Device(E),
    /// Block 0 has no partition table.
    NoPartitionTable,
    /// The first partition is not FAT32; its type byte (0x07 is exFAT or NTFS, 0xEE is GPT).
    NotFat32(u8),
    /// The volume's first block does not describe a FAT32 volume; the wrong field.
    BadVolume(&'static str),
}

// The fault alone, without advice: such a card may hold logs, and a reader in a hurry might erase them.
impl<E> fmt::Display for LayoutError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(_) => write!(f, "the card does not answer"),
            Self::NoPartitionTable => {
                write!(f, "the card has no partition table (MBR)")
            }
            Self::NotFat32(kind) => {
                write!(f, "the card's first partition is of type {kind:#04x}, not FAT32")
            }
            Self::BadVolume(what) => {
                write!(f, "the card's FAT32 volume is damaged ({what})")
            }
        }
    }
}

impl Layout {
    /// Reads and checks a card's first partition.
    pub fn read<D: CardDevice>(device: &D) -> Result<Self, LayoutError<D::Error>> {
        let card_blocks = device.num_blocks().map_err(LayoutError::Device)?;
        let mut block = [[0; BLOCK_BYTES]];
        device.read(&mut block, 0).map_err(LayoutError::Device)?;
        let (start, blocks) = partition(&block[0])?;
        if start >= card_blocks {
            return Err(LayoutError::BadVolume("the partition begins outside the card"));
        }
        device.read(&mut block, start).map_err(LayoutError::Device)?;
        Self::from_boot_sector(&block[0], start, blocks.min(card_blocks - start))
            .map_err(LayoutError::BadVolume)
    }

    /// The same for a volume without a partition table, as in an image of a partition alone. The recorder writes to
    /// no such card.
    pub fn volume<D: CardDevice>(device: &D) -> Result<Self, LayoutError<D::Error>> {
        let blocks = device.num_blocks().map_err(LayoutError::Device)?;
        let mut block = [[0; BLOCK_BYTES]];
        device.read(&mut block, 0).map_err(LayoutError::Device)?;
        Self::from_boot_sector(&block[0], 0, blocks).map_err(LayoutError::BadVolume)
    }

    fn from_boot_sector(boot: &Block, start: u32, blocks: u32) -> Result<Self, &'static str> {
        let u8_at = |at: usize| u32::from(boot[at]);
        let u16_at = |at: usize| u32::from(u16::from_le_bytes([boot[at], boot[at + 1]]));
        let u32_at = |at: usize| u32::from_le_bytes([boot[at], boot[at + 1], boot[at + 2], boot[at + 3]]);
        let check = |good: bool, what: &'static str| if good { Ok(()) } else { Err(what) };

        check(u16_at(510) == 0xAA55, "no boot signature")?;
        check(u16_at(11) == BLOCK_BYTES as u32, "blocks are not of 512 bytes")?;
        let cluster_blocks = u8_at(13);
        check(cluster_blocks.is_power_of_two(), "blocks a cluster")?;
        let reserved = u16_at(14);
        let fat_copies = u8_at(16);
        check((1..=2).contains(&fat_copies), "number of FATs")?;
        check(u16_at(17) == 0 && u16_at(22) == 0, "it is FAT12 or FAT16")?;
        let fat_blocks = u32_at(36);
        let flags = u16_at(40);
        check(flags & 0x80 == 0 || flags & 0x0F == 0, "another FAT than the first is in use")?;
        check(u16_at(42) == 0, "version")?;
        let total = if u16_at(19) == 0 { u32_at(32) } else { u16_at(19) };
        check(total <= blocks, "it is larger than its partition")?;
        let info = u16_at(48);
        check(info > 0 && info < reserved, "place of the information sector")?;

        let fats = fat_blocks.checked_mul(fat_copies).ok_or("size of the FAT")?;
        let data = reserved.checked_add(fats).filter(|data| *data < total).ok_or("size of the FAT")?;
        let clusters = (total - data) / cluster_blocks;
        check((FAT32_CLUSTERS_MIN..=FAT32_CLUSTERS_MAX).contains(&clusters), "number of clusters")?;
        check(u64::from(fat_blocks) * 128 >= u64::from(clusters) + 2, "the FAT is shorter than the volume")?;
        let root = u32_at(44);
        check(root >= 2 && root < clusters + 2, "place of the root directory")?;
        Ok(Self {
            start,
            info: start + info,
            fat_start: start + reserved,
            fat_blocks: (clusters + 2).div_ceil(128),
            fat_stride: fat_blocks,
            fat_copies,
            data_start: start + data,
            cluster_blocks,
            clusters,
            root,
            volume_id: u32_at(67),
        })
    }

    /// Bytes that files and directories can hold.
    pub const fn data_bytes(&self) -> u64 {
        self.clusters as u64 * self.cluster_blocks as u64 * BLOCK_BYTES as u64
    }

    /// End of the used blocks.
    pub const fn end(&self) -> u32 {
        self.data_start + self.clusters * self.cluster_blocks
    }
}

fn partition<E>(mbr: &Block) -> Result<(u32, u32), LayoutError<E>> {
    let entry = &mbr[446..462];
    let word = |at: usize| u32::from_le_bytes([entry[at], entry[at + 1], entry[at + 2], entry[at + 3]]);
    // A volume without a partition table begins with a jump instruction and carries the same signature; `mkfs.vfat`
    // gives it a table as well, whose partition begins with the table itself.
    let is_table = mbr[510..512] == [0x55, 0xAA] && entry[0] & 0x7F == 0 && entry[4] != 0 && word(8) != 0;
    if !is_table {
        return Err(LayoutError::NoPartitionTable);
    }
    if !FAT32_TYPES.contains(&entry[4]) {
        return Err(LayoutError::NotFat32(entry[4]));
    }
    Ok((word(8), word(12)))
}
