//! An image file: made when it is missing, and read without ever writing to it.

use std::cell::RefCell;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use anyhow::{Context, Result, bail};
use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};
use hums_recorder::format::BLOCKS_MIN;

use crate::files::cannot_write;
use crate::outcome::usage;

/// The size of an image that is made, in MiB, unless `--card-size` says otherwise.
pub const SIZE_MIB: u64 = 256;
/// Nothing smaller can be FAT32, in MiB.
pub const SIZE_MIB_MIN: u64 = (BLOCKS_MIN as u64 * 512).div_ceil(1 << 20);
/// Block numbers have 32 bits, in MiB.
pub const SIZE_MIB_MAX: u64 = 2 * 1024 * 1024 - 1;

/// Whether an image was there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// It was, and is used as it is.
    Existing,
    /// It was not: a file of this size, sparse, was made, not formatted yet.
    Made,
}

/// Opens the image for writing, or makes a sparse file of `size_mib` where there is none.
pub fn open_or_make(path: &Path, size_mib: Option<u64>) -> Result<(File, Found)> {
    if let Some(size) = size_mib.filter(|size| !(SIZE_MIB_MIN..=SIZE_MIB_MAX).contains(size)) {
        return Err(usage(format!(
            "--card-size {size}: a FAT32 card has {SIZE_MIB_MIN} to {SIZE_MIB_MAX} MiB"
        )));
    }
    match path.metadata() {
        Ok(about) if about.is_dir() => bail!("{}: is a directory; --sd takes an image file", path.display()),
        Ok(about) => {
            if about.permissions().readonly() {
                bail!("{}: is read-only; make it writable or name another image", path.display());
            }
            if let Some(size) = size_mib.filter(|size| size << 20 != about.len()) {
                return Err(usage(format!(
                    "--card-size {size}: {} is there already and has {} MiB; remove it, or leave --card-size out",
                    path.display(),
                    about.len() >> 20
                )));
            }
            let file = OpenOptions::new().read(true).write(true).open(path);
            Ok((
                file.with_context(|| format!("{}: cannot be opened for writing", path.display()))?,
                Found::Existing,
            ))
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let file = OpenOptions::new().read(true).write(true).create_new(true).open(path);
            let file = file.with_context(|| cannot_write(path))?;
            let bytes = size_mib.unwrap_or(SIZE_MIB) << 20;
            file.set_len(bytes).with_context(|| format!("{}: cannot have {bytes} bytes", path.display()))?;
            Ok((file, Found::Made))
        }
        Err(error) => Err(error).with_context(|| format!("{}: cannot be looked at", path.display())),
    }
}

/// Bytes of a file, or of a raw device, whose metadata says 0.
pub fn length(mut file: &File) -> io::Result<u64> {
    file.seek(SeekFrom::End(0))
}

/// An image file as a card with its write protection on.
#[derive(Debug)]
pub struct ReadOnlyImage {
    file: RefCell<File>,
    blocks: u32,
}

impl ReadOnlyImage {
    /// The whole blocks of `file`.
    pub fn new(file: File) -> io::Result<Self> {
        let blocks = length(&file)? / Block::LEN as u64;
        Ok(Self { file: RefCell::new(file), blocks: u32::try_from(blocks).unwrap_or(u32::MAX) })
    }
}

impl BlockDevice for ReadOnlyImage {
    type Error = io::Error;

    fn read(&self, blocks: &mut [Block], start: BlockIdx) -> io::Result<()> {
        let mut file = self.file.borrow_mut();
        file.seek(SeekFrom::Start(start.into_bytes()))?;
        blocks.iter_mut().try_for_each(|block| file.read_exact(&mut block.contents))
    }

    fn write(&self, _: &[Block], _: BlockIdx) -> io::Result<()> {
        Err(io::ErrorKind::ReadOnlyFilesystem.into())
    }

    fn num_blocks(&self) -> io::Result<BlockCount> {
        Ok(BlockCount(self.blocks))
    }
}
