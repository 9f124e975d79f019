//! The content of a card: the blocks that were ever written.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::rc::Rc;

use hums_recorder::format::format;
use hums_recorder::{Block, CardDevice};

/// A row of blocks, zero if never written. A clone is the same medium.
#[derive(Clone, Debug)]
pub struct Medium {
    blocks: Rc<RefCell<BTreeMap<u32, [u8; 512]>>>,
    size: u32,
    writes: Rc<Cell<u64>>,
}

impl Medium {
    /// Empty, of `size` blocks.
    pub fn new(size: u32) -> Self {
        Self { blocks: Rc::default(), size, writes: Rc::default() }
    }

    /// Holds an empty FAT32 volume.
    ///
    /// # Panics
    /// If it is too small.
    pub fn formatted(size: u32) -> Self {
        let medium = Self::new(size);
        assert!(format(&medium, size ^ 0x5D5D_0001).is_ok(), "{size} blocks are too few");
        medium.writes.set(0);
        medium
    }

    /// A medium with this image's content, which may be sparse. An incomplete last block is left out.
    ///
    /// # Errors
    ///
    /// Errors of reading; `InvalidInput` for more blocks than a card can have.
    pub fn load(mut image: &File) -> io::Result<Self> {
        const CHUNK: usize = 2_048 * 512;
        let size = u32::try_from(image.metadata()?.len() / 512).map_err(|_| io::ErrorKind::InvalidInput)?;
        let medium = Self::new(size);
        let mut chunk = vec![0; CHUNK];
        for first in (0..size).step_by(CHUNK / 512) {
            let blocks = (size - first).min((CHUNK / 512) as u32) as usize;
            let from = u64::from(first) * 512;
            if is_hole(image, from, (blocks * 512) as u64) {
                continue;
            }
            image.seek(SeekFrom::Start(from))?;
            image.read_exact(&mut chunk[..blocks * 512])?;
            let blocks = chunk[..blocks * 512].as_chunks::<512>().0;
            let written = (first..).zip(blocks).filter(|(_, block)| **block != [0; 512]);
            medium.blocks.borrow_mut().extend(written.map(|(at, block)| (at, *block)));
        }
        Ok(medium)
    }

    /// Writes the image in place.
    ///
    /// # Errors
    /// Of the image's writing.
    pub fn save(&self, mut image: &File) -> io::Result<()> {
        if image.metadata()?.len() < u64::from(self.size) * 512 {
            image.set_len(u64::from(self.size) * 512)?;
        }
        self.blocks.borrow().iter().try_for_each(|(at, block)| {
            image.seek(SeekFrom::Start(u64::from(*at) * 512))?;
            image.write_all(block)
        })
    }

    /// Blocks.
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

    /// Erases one block.
    pub(crate) fn erase(&self, at: u32) {
        self.blocks.borrow_mut().insert(at, [0xFF; 512]);
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

/// Reading a hole would give the same, but slowly.
#[cfg(not(target_os = "linux"))]
fn is_hole(_file: &File, _from: u64, _bytes: u64) -> bool {
    false
}

#[cfg(target_os = "linux")]
fn is_hole(file: &File, from: u64, bytes: u64) -> bool {
    match rustix::fs::seek(file, rustix::fs::SeekFrom::Data(from)) {
        Ok(data) => data >= from + bytes,
        Err(error) => error == rustix::io::Errno::NXIO,
    }
}

impl CardDevice for Medium {
    type Error = Infallible;

    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), Infallible> {
        for (at, block) in (start..).zip(blocks) {
            *block = self.get(at);
        }
        Ok(())
    }

    fn write(&self, blocks: &[Block], start: u32) -> Result<(), Infallible> {
        for (at, block) in (start..).zip(blocks) {
            self.set(at, block);
        }
        Ok(())
    }

    fn num_blocks(&self) -> Result<u32, Infallible> {
        Ok(self.size)
    }
}
