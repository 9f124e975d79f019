//! An image file of a card.

use std::borrow::Borrow;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use anyhow::{Context, Result, bail};
use hums_recorder::format::BLOCKS_MIN;
use hums_recorder::layout::{Layout, LayoutError};
use hums_recorder::{BLOCK_BYTES, Block, CardDevice};

use crate::files::{make_in_place, open_in_place};
use crate::outcome::usage;

/// Default of `--card-size`, MiB.
pub const SIZE_MIB: u64 = 256;
/// Least size for FAT32, MiB.
pub const SIZE_MIB_MIN: u64 = (BLOCKS_MIN as u64 * 512).div_ceil(1 << 20);
/// Block numbers have 32 bits, in MiB.
pub const SIZE_MIB_MAX: u64 = 2 * 1024 * 1024 - 1;

/// Opens the image for reading and writing, for this run alone; without one, makes a sparse file of
/// `size_mib` for `format`.
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
        Err(error) if error.kind() == io::ErrorKind::NotFound => make_in_place(path, false, |file| {
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
    if !about.is_file() {
        bail!("{shown}: is not a file; --sd takes an image file");
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
    open_in_place(OpenOptions::new().read(true).write(true), path)
        .with_context(|| format!("{shown}: cannot be opened for writing"))
}

/// Refuses an image without a usable file system, unless it is empty: such a card may be formatted by
/// command. Returns a remark for an empty one.
pub fn check(file: &File, path: &Path) -> Result<Option<String>> {
    let context = || format!("{}: cannot be read", path.display());
    let bytes = length(file).with_context(context)?;
    if bytes < SIZE_MIB_MIN << 20 {
        bail!(
            "{}: is no image of an SD card: it has {bytes} bytes, and a FAT32 card has {SIZE_MIB_MIN} MiB at least; name an image of a card, or a new file",
            path.display()
        );
    }
    let why = match Layout::read(&ReadOnlyImage::new(file)?) {
        Ok(_) => return Ok(None),
        Err(LayoutError::Device(error)) => return Err(error).with_context(context),
        Err(why) => why,
    };
    // A partition table alone holds no data to lose.
    let from = if matches!(why, LayoutError::NoPartitionTable) { 0 } else { BLOCK_BYTES as u64 };
    if is_zero(file, from).with_context(context)? {
        return Ok(Some(format!(
            "{why}, so that nothing can be recorded on it before it is formatted; name an image of a card, or a new file"
        )));
    }
    bail!(
        "{}: {why}, so that nothing can be recorded on it, and it stays. Name an image of a card, or a new file; `hums info --salvage` looks for logs in it",
        path.display()
    )
}

/// Whether an image has a partition table and a FAT32 volume.
pub fn is_card(file: &File) -> io::Result<bool> {
    Ok(Layout::read(&ReadOnlyImage::new(file)?).is_ok())
}

fn is_zero(mut file: &File, mut at: u64) -> io::Result<bool> {
    let mut bytes = vec![0; 1 << 20];
    loop {
        let Some(data) = data_from(file, at)? else { return Ok(true) };
        at = data;
        file.seek(SeekFrom::Start(at))?;
        let got = file.read(&mut bytes)?;
        if got == 0 {
            return Ok(true);
        }
        if bytes.iter().take(got).any(|byte| *byte != 0) {
            return Ok(false);
        }
        at += got as u64;
    }
}

/// First byte that is no hole, from `at` on.
#[cfg(target_os = "linux")]
pub(crate) fn data_from(file: &File, at: u64) -> io::Result<Option<u64>> {
    match rustix::fs::seek(file, rustix::fs::SeekFrom::Data(at)) {
        Ok(data) => Ok(Some(data)),
        Err(rustix::io::Errno::NXIO) => Ok(None),
        // Unknown to the file system.
        Err(rustix::io::Errno::INVAL) => Ok(Some(at)),
        Err(error) => Err(error.into()),
    }
}

#[cfg(not(target_os = "linux"))]
#[expect(clippy::unnecessary_wraps, reason = "asking a system that tells may fail")]
pub(crate) fn data_from(_: &File, at: u64) -> io::Result<Option<u64>> {
    Ok(Some(at))
}

/// Size of a file, or of a raw device (0 in its metadata).
pub fn length(mut file: &File) -> io::Result<u64> {
    file.seek(SeekFrom::End(0))
}

/// An image file as a write-protected card.
#[derive(Debug)]
pub struct ReadOnlyImage<F> {
    file: F,
    blocks: u32,
}

impl<F: Borrow<File>> ReadOnlyImage<F> {
    /// The whole blocks of `file`.
    pub fn new(file: F) -> io::Result<Self> {
        let blocks = length(file.borrow())? / BLOCK_BYTES as u64;
        Ok(Self { file, blocks: u32::try_from(blocks).unwrap_or(u32::MAX) })
    }
}

impl<F: Borrow<File>> CardDevice for ReadOnlyImage<F> {
    type Error = io::Error;

    fn read(&self, blocks: &mut [Block], start: u32) -> io::Result<()> {
        let mut file: &File = self.file.borrow();
        file.seek(SeekFrom::Start(u64::from(start) * BLOCK_BYTES as u64))?;
        blocks.iter_mut().try_for_each(|block| file.read_exact(block))
    }

    fn write(&self, _: &[Block], _: u32) -> io::Result<()> {
        Err(io::ErrorKind::ReadOnlyFilesystem.into())
    }

    fn num_blocks(&self) -> io::Result<u32> {
        Ok(self.blocks)
    }
}
