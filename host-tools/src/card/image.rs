//! An image file: made when it is missing, and read without ever writing to it.

use std::cell::RefCell;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use anyhow::{Context, Result, bail};
use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};
use hums_recorder::format::BLOCKS_MIN;

use crate::files::{is_seekable, lock_in_place, make_in_place};
use crate::outcome::usage;

/// The size of an image that is made, in MiB, unless `--card-size` says otherwise.
pub const SIZE_MIB: u64 = 256;
/// Nothing smaller can be FAT32, in MiB.
pub const SIZE_MIB_MIN: u64 = (BLOCKS_MIN as u64 * 512).div_ceil(1 << 20);
/// Block numbers have 32 bits, in MiB.
pub const SIZE_MIB_MAX: u64 = 2 * 1024 * 1024 - 1;

/// Opens the image for reading and writing, so that no other run does; or makes a sparse file of `size_mib`, which
/// `format` formats, where there is none.
pub fn open_or_make(
    path: &Path,
    size_mib: Option<u64>,
    format: impl FnOnce(&File) -> Result<()>,
) -> Result<File> {
    if let Some(size) = size_mib.filter(|size| !(SIZE_MIB_MIN..=SIZE_MIB_MAX).contains(size)) {
        return Err(usage(format!(
            "--card-size {size}: a FAT32 card has {SIZE_MIB_MIN} to {SIZE_MIB_MAX} MiB"
        )));
    }
    match path.metadata() {
        Ok(about) => open(path, &about, size_mib),
        Err(error) if error.kind() == io::ErrorKind::NotFound => make_in_place(path, |file| {
            let bytes = size_mib.unwrap_or(SIZE_MIB) << 20;
            file.set_len(bytes).with_context(|| format!("{}: cannot have {bytes} bytes", path.display()))?;
            format(file)
        }),
        Err(error) => Err(error).with_context(|| format!("{}: cannot be looked at", path.display())),
    }
}

fn open(path: &Path, about: &Metadata, size_mib: Option<u64>) -> Result<File> {
    let shown = path.display();
    if about.is_dir() {
        bail!("{shown}: is a directory; --sd takes an image file");
    }
    if !is_seekable(about) {
        bail!("{shown}: is a pipe, a socket, a terminal or the like; --sd takes an image file");
    }
    if about.permissions().readonly() {
        bail!("{shown}: is read-only; make it writable or name another image");
    }
    if let Some(size) = size_mib.filter(|size| size << 20 != about.len()) {
        return Err(usage(format!(
            "--card-size {size}: {shown} is there already and has {} MiB; name another image, or leave --card-size out",
            about.len() >> 20
        )));
    }
    let file = OpenOptions::new().read(true).write(true).open(path);
    let file = file.with_context(|| format!("{shown}: cannot be opened for writing"))?;
    lock_in_place(&file, path)?;
    Ok(file)
}

/// Why nothing can be recorded on an image, as far as its first block tells: a sentence without its name.
pub fn trouble(file: &File) -> io::Result<Option<String>> {
    let bytes = length(file)?;
    if bytes < SIZE_MIB_MIN << 20 {
        return Ok(Some(format!(
            "is no image of an SD card: {bytes} bytes, and a FAT32 card has {SIZE_MIB_MIN} MiB at least; nothing can \
             be recorded on it"
        )));
    }
    let (mut file, mut block) = (file, [0; Block::LEN]);
    file.seek(SeekFrom::Start(0))?;
    file.read_exact(&mut block)?;
    // The signature of a master boot record.
    Ok((!block.ends_with(&[0x55, 0xaa])).then(|| {
        "has no partition table (MBR), so that nothing can be recorded on it; name an image of a card, or a new file, \
         which is made as one"
            .to_owned()
    }))
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
