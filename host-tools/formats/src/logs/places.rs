//! A log as places, and its blocks, streamed.

use std::fs::File;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};

use super::fat::{Extent, ReadAt as _};
use super::naming::segment_name;
use crate::card::image::length;

/// One sector.
pub const BLOCK_BYTES: usize = 512;
const READ_BYTES: u64 = 64 * 1024;

/// Places in one file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// A segment, packed log or card image.
    pub path: PathBuf,
    /// Its places in the file.
    pub extents: Vec<Extent>,
}

/// One log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Log {
    /// Unique within one call: `00042`, or `card/00042` with several inputs.
    pub name: String,
    /// Names on the card or on this PC.
    pub files: Vec<String>,
    /// A piece for each file, in order.
    pub pieces: Vec<Piece>,
    /// Known from a scan; otherwise the first sector decides.
    pub session: Option<u32>,
    /// The rest of a session outside of all files.
    pub left_over: bool,
}

impl Log {
    /// Bytes.
    pub fn bytes(&self) -> u64 {
        self.pieces.iter().flat_map(|piece| &piece.extents).map(|extent| extent.length).sum()
    }

    /// Ends within a block: a cut copy.
    pub fn ends_short(&self) -> bool {
        let last = self.pieces.last().and_then(|piece| piece.extents.last());
        last.is_some_and(|extent| extent.length % BLOCK_BYTES as u64 != 0)
    }

    /// Found by a scan, and ends at the end of its image: a copy of a part of a card.
    pub fn ends_with_image(&self) -> bool {
        let last = || self.pieces.last().and_then(|piece| Some((&piece.path, piece.extents.last()?)));
        let is_last = |(path, extent): (&PathBuf, &Extent)| {
            let length = File::open(path).and_then(|file| length(&file)).unwrap_or(u64::MAX);
            length.saturating_sub(extent.start + extent.length) < BLOCK_BYTES as u64
        };
        self.session.is_some() && last().is_some_and(is_last)
    }

    /// The first file's number, by its name. Earlier files were deleted by a full card, or by the ring of a
    /// vehicle that is recorded by arming. `None` for sectors found by a search.
    pub fn first_segment(&self) -> Option<u32> {
        let name = self.files.first().filter(|_| self.session.is_none());
        name.and_then(|name| segment_name(Path::new(name))).map(|name| name.segment)
    }

    /// The blocks, in order.
    pub fn blocks(&self) -> LogBlocks<'_> {
        LogBlocks {
            log: self,
            piece: 0,
            extent: 0,
            offset: 0,
            begun: 0,
            file: None,
            buffer: Vec::new(),
            at: 0,
        }
    }
}

/// Streams blocks; a short last one is padded with zeros.
pub struct LogBlocks<'a> {
    log: &'a Log,
    piece: usize,
    extent: usize,
    /// Bytes of the extent already read.
    offset: u64,
    /// Bytes before the buffer.
    begun: u64,
    file: Option<File>,
    buffer: Vec<u8>,
    at: usize,
}

impl<'a> LogBlocks<'a> {
    pub(super) const fn log(&self) -> &'a Log {
        self.log
    }

    /// Next block.
    pub fn next_block(&mut self) -> Result<Option<&[u8; BLOCK_BYTES]>> {
        while self.at + BLOCK_BYTES > self.buffer.len() {
            if !self.refill()? {
                return Ok(None);
            }
        }
        self.at += BLOCK_BYTES;
        Ok(self.buffer.get(self.at - BLOCK_BYTES..).and_then(|rest| rest.first_chunk()))
    }

    /// Piece, and block within it, of the last block.
    pub const fn place(&self) -> (usize, u64) {
        (self.piece, (self.begun + self.at as u64).saturating_sub(1) / BLOCK_BYTES as u64)
    }

    /// Up to this many blocks of the same file, as a log.
    pub fn from(&self, at: u64, blocks: u64) -> Log {
        let (piece, _) = self.place();
        let (mut skipped, mut left) = (at * BLOCK_BYTES as u64, blocks * BLOCK_BYTES as u64);
        let rest = |extent: &Extent| {
            let less = skipped.min(extent.length);
            let length = left.min(extent.length - less);
            (skipped, left) = (skipped - less, left - length);
            Extent { start: extent.start + less, length }
        };
        let pieces = self.log.pieces.get(piece).map(|piece| Piece {
            path: piece.path.clone(),
            extents: piece.extents.iter().map(rest).filter(|extent| extent.length > 0).collect(),
        });
        Log { pieces: pieces.into_iter().collect(), ..Log::default() }
    }

    fn refill(&mut self) -> Result<bool> {
        loop {
            let Some(piece) = self.log.pieces.get(self.piece) else { return Ok(false) };
            let Some(extent) = piece.extents.get(self.extent) else {
                (self.piece, self.extent, self.offset, self.file) = (self.piece + 1, 0, 0, None);
                (self.begun, self.at) = (0, 0);
                self.buffer.clear();
                continue;
            };
            let length = READ_BYTES.min(extent.length.saturating_sub(self.offset));
            if length == 0 {
                (self.extent, self.offset) = (self.extent + 1, 0);
                continue;
            }
            let context = || format!("{}: cannot be read", piece.path.display());
            let file = match &mut self.file {
                Some(file) => file,
                none => none.insert(File::open(&piece.path).with_context(context)?),
            };
            self.begun += self.buffer.len() as u64;
            // Not zeroed first.
            self.buffer.resize((length as usize).next_multiple_of(BLOCK_BYTES), 0);
            let (bytes, behind) = self.buffer.split_at_mut(length as usize);
            file.read_at(extent.start + self.offset, bytes).with_context(context)?;
            behind.fill(0);
            self.offset += length;
            self.at = 0;
            return Ok(true);
        }
    }
}
