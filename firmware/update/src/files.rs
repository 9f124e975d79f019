//! A file in a card's root directory, for reading only. Every number of the card is checked, and every walk ends.

use hums_recorder::layout::Layout;
use hums_recorder::{BLOCK_BYTES, Block, CardDevice};

use crate::header::Refusal;

/// A name as an entry of a directory has it: eight letters and three, filled with spaces.
pub type Name = [u8; 11];

const ENTRY_BYTES: usize = 32;
const ATTRIBUTES: usize = 11;
const CLUSTER_HIGH: usize = 20;
const CLUSTER_LOW: usize = 26;
const LENGTH: usize = 28;
/// A volume's label, a directory or a part of a long name.
const NO_FILE: u8 = 0x18;
/// Blocks of the longest directory: 65,536 entries, as the FAT specification allows a directory.
const DIRECTORY_BLOCKS_MAX: u32 = 4_096;
/// Entries of the FAT in a block.
const LINKS: u32 = 128;

/// An opened file.
pub struct File<'a, D> {
    device: &'a D,
    layout: Layout,
    cluster: u32,
    block: u32,
    /// Bytes of the file.
    pub bytes: u32,
}

impl<'a, D: CardDevice> File<'a, D> {
    /// Finds a file of this name. The card must have a FAT32 volume in its first partition.
    pub fn open(device: &'a D, name: &Name) -> Result<Self, Refusal> {
        device.begin_service();
        let layout = Layout::read(device).map_err(|_| Refusal::NoFile)?;
        let mut directory = Self { device, layout, cluster: layout.root, block: 0, bytes: 0 };
        for _ in 0..DIRECTORY_BLOCKS_MAX {
            let block = directory.next_block()?;
            for entry in block.as_chunks::<ENTRY_BYTES>().0 {
                if entry[0] == 0 {
                    return Err(Refusal::NoFile);
                }
                if entry.starts_with(name) && entry[ATTRIBUTES] & NO_FILE == 0 {
                    let half = |at: usize| u32::from(u16::from_le_bytes([entry[at], entry[at + 1]]));
                    let cluster = half(CLUSTER_HIGH) << 16 | half(CLUSTER_LOW);
                    let bytes = half(LENGTH + 2) << 16 | half(LENGTH);
                    return Ok(Self { cluster, block: 0, bytes, ..directory });
                }
            }
        }
        Err(Refusal::NoFile)
    }

    /// The next block; behind the end of the chain an error.
    pub fn next_block(&mut self) -> Result<Block, Refusal> {
        let Layout { cluster_blocks, data_start, clusters, fat_start, .. } = self.layout;
        if self.block == cluster_blocks {
            let links = self.read(fat_start + self.cluster / LINKS)?;
            let at = (self.cluster % LINKS * 4) as usize;
            let link = links.get(at..).and_then(|links| links.first_chunk()).ok_or(Refusal::Damaged)?;
            (self.cluster, self.block) = (u32::from_le_bytes(*link) & 0x0FFF_FFFF, 0);
        }
        if self.cluster < 2 || self.cluster - 2 >= clusters {
            return Err(Refusal::Damaged);
        }
        let block = self.read(data_start + (self.cluster - 2) * cluster_blocks + self.block)?;
        self.block += 1;
        Ok(block)
    }

    fn read(&self, at: u32) -> Result<Block, Refusal> {
        self.device.begin_service();
        let mut block = [[0; BLOCK_BYTES]];
        self.device.read(&mut block, at).map_err(|_| Refusal::NoFile)?;
        Ok(block[0])
    }
}
