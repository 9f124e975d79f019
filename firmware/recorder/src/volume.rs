//! A card's blocks for the file system: one timed command at a time.

use crate::card::CardError;
use crate::layout::Layout;
use crate::status::CardStatus;
use crate::{BLOCK_BYTES, Block, CardDevice};

/// Tries of writing a block of the file system. A partly written chain takes clusters without a file. The device
/// bounds the time of all tries together ([`CardDevice::begin_service`]).
const METADATA_TRIES: u32 = 8;

pub(crate) const ENTRIES: u32 = 128;
pub(crate) const END_OF_CHAIN: u32 = 0x0FFF_FFFF;

pub(crate) struct Volume<'a, D> {
    device: &'a D,
    status: &'a CardStatus,
    pub(crate) layout: Layout,
}

impl<'a, D: CardDevice> Volume<'a, D> {
    pub(crate) const fn new(device: &'a D, status: &'a CardStatus, layout: Layout) -> Self {
        Self { device, status, layout }
    }

    pub(crate) const fn device(&self) -> &'a D {
        self.device
    }

    pub(crate) fn read(&self, blocks: &mut [Block], at: u32) -> Result<(), CardError<D::Error>> {
        self.command(|device| device.read(blocks, at))
    }

    pub(crate) fn write(&self, blocks: &[Block], at: u32) -> Result<(), CardError<D::Error>> {
        self.command(|device| device.write(blocks, at))
    }

    pub(crate) fn write_metadata(&self, blocks: &[Block], at: u32) -> Result<(), CardError<D::Error>> {
        let mut written = self.write(blocks, at);
        for _ in 1..METADATA_TRIES {
            if written.is_ok() {
                break;
            }
            written = self.write(blocks, at);
        }
        written
    }

    fn command<T>(&self, act: impl FnOnce(&D) -> Result<T, D::Error>) -> Result<T, CardError<D::Error>> {
        self.status.begin_command(self.device.now());
        let done = act(self.device);
        self.status.end_command(self.device.now());
        done.map_err(CardError::Device)
    }

    pub(crate) fn read_fat(&self, index: u32) -> Result<[Block; 1], CardError<D::Error>> {
        let mut block = [[0; BLOCK_BYTES]];
        self.read(&mut block, self.layout.fat_start + index)?;
        Ok(block)
    }

    pub(crate) fn write_fat(&self, block: &[Block; 1], index: u32) -> Result<(), CardError<D::Error>> {
        let Layout { fat_start, fat_stride, fat_copies, .. } = self.layout;
        (0..fat_copies).try_for_each(|copy| self.write_metadata(block, fat_start + copy * fat_stride + index))
    }

    #[inline(never)]
    pub(crate) fn link(&self, cluster: u32, next: u32) -> Result<(), CardError<D::Error>> {
        let mut block = self.read_fat(cluster / ENTRIES)?;
        set_entry(&mut block[0], cluster, next);
        self.write_fat(&block, cluster / ENTRIES)
    }

    #[inline(never)]
    pub(crate) fn entry(&self, cluster: u32) -> Result<u32, CardError<D::Error>> {
        Ok(entry(&self.read_fat(cluster / ENTRIES)?[0], cluster))
    }

    pub(crate) const fn is_cluster(&self, cluster: u32) -> bool {
        cluster >= 2 && cluster - 2 < self.layout.clusters
    }

    pub(crate) const fn block_of(&self, cluster: u32) -> u32 {
        self.layout.data_start + (cluster - 2) * self.layout.cluster_blocks
    }

    /// Whether this cluster is free by its entry in a block of the FAT. The root directory's first one never is, even
    /// if the card lost its part of the FAT.
    pub(crate) fn is_free(&self, block: &Block, cluster: u32) -> bool {
        self.is_cluster(cluster) && cluster != self.layout.root && entry(block, cluster) == 0
    }
}

pub(crate) fn entry(block: &Block, cluster: u32) -> u32 {
    let at = (cluster % ENTRIES * 4) as usize;
    let entry = block.get(at..at + 4).and_then(|entry| entry.try_into().ok());
    entry.map_or(0, u32::from_le_bytes) & 0x0FFF_FFFF
}

/// In its block of the FAT; the upper four bits are reserved and stay.
pub(crate) fn set_entry(block: &mut Block, cluster: u32, value: u32) {
    let at = (cluster % ENTRIES * 4) as usize;
    if let Some(entry) = block.get_mut(at..).and_then(|entries| entries.first_chunk_mut()) {
        *entry = (u32::from_le_bytes(*entry) & 0xF000_0000 | value).to_le_bytes();
    }
}
