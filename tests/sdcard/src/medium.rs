//! What a card holds: blocks, as many as were ever written.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::rc::Rc;

use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};
use hums_recorder::CardDevice;
use hums_recorder::format::format;

/// A row of blocks, zero where nothing was written. A clone is the same medium.
#[derive(Clone, Debug)]
pub struct Medium {
    blocks: Rc<RefCell<BTreeMap<u32, [u8; 512]>>>,
    size: u32,
    writes: Rc<Cell<u64>>,
}

impl Medium {
    /// An empty one of so many blocks.
    pub fn new(size: u32) -> Self {
        Self { blocks: Rc::default(), size, writes: Rc::default() }
    }

    /// One that holds an empty FAT32 volume.
    ///
    /// # Panics
    /// If it is too small for that.
    pub fn formatted(size: u32) -> Self {
        let medium = Self::new(size);
        assert!(format(&medium, size ^ 0x5D5D_0001).is_ok(), "{size} blocks are too few");
        medium.writes.set(0);
        medium
    }

    /// How many blocks it has.
    pub const fn size(&self) -> u32 {
        self.size
    }

    /// One block.
    pub fn get(&self, at: u32) -> [u8; 512] {
        self.blocks.borrow().get(&at).copied().unwrap_or([0; 512])
    }

    /// Writes one block.
    pub fn set(&self, at: u32, block: &[u8; 512]) {
        self.writes.set(self.writes.get() + 1);
        self.blocks.borrow_mut().insert(at, *block);
    }

    /// Writes into one block.
    ///
    /// # Panics
    /// If that is beyond the block's end.
    pub fn patch(&self, at: u32, offset: usize, bytes: &[u8]) {
        let mut block = self.get(at);
        block[offset..offset + bytes.len()].copy_from_slice(bytes);
        self.set(at, &block);
    }

    /// All of it that was ever written.
    pub fn content(&self) -> BTreeMap<u32, [u8; 512]> {
        self.blocks.borrow().clone()
    }

    /// Blocks written since it was made or formatted.
    pub fn writes(&self) -> u64 {
        self.writes.get()
    }
}

/// As a card reader has it: without a driver's troubles.
impl BlockDevice for Medium {
    type Error = Infallible;

    fn read(&self, blocks: &mut [Block], start: BlockIdx) -> Result<(), Infallible> {
        for (at, block) in (start.0..).zip(blocks) {
            block.contents = self.get(at);
        }
        Ok(())
    }

    fn write(&self, blocks: &[Block], start: BlockIdx) -> Result<(), Infallible> {
        for (at, block) in (start.0..).zip(blocks) {
            self.set(at, &block.contents);
        }
        Ok(())
    }

    fn num_blocks(&self) -> Result<BlockCount, Infallible> {
        Ok(BlockCount(self.size))
    }
}

impl CardDevice for Medium {}
