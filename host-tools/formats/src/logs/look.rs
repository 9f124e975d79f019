//! A file's kind, by content.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::{Context as _, Result};
use hums_blackbox::{Header, NotASector, VERSION};

use super::places::BLOCK_BYTES;
use crate::archive;
use crate::mavlink::frame::{Peek, peek};

const LOOK_BLOCKS: usize = 2048;

/// A file's kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    /// Sectors of a log.
    Log,
    /// A partition table, or blocks to be searched.
    Image,
    /// A known but unreadable log.
    Unread(UnreadReason),
    /// A ground station's log or raw MAVLink.
    Mavlink,
    /// An empty file.
    Empty,
    /// Anything else.
    Other,
}

/// The reason that a log is not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UnreadReason {
    Older(u8),
    Newer(u8),
    Sealed,
}

impl std::fmt::Display for UnreadReason {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Older(version) => {
                write!(
                    f,
                    "is a log of format version {version}, which is older than what this program reads ({VERSION})"
                )
            }
            Self::Newer(version) => write!(
                f,
                "is a log of format version {version}, which this program is too old for; take a newer hums"
            ),
            Self::Sealed => {
                f.write_str("is a sealed log, which this program is too old for; take a newer hums")
            }
        }
    }
}

/// Finds the kind of a file.
pub fn look(path: &Path) -> Result<Content> {
    let context = || format!("{}: cannot be read", path.display());
    let mut file = File::open(path).with_context(context)?;
    let mut start = Vec::new();
    file.by_ref().take(BLOCK_BYTES as u64).read_to_end(&mut start).with_context(context)?;
    if start.first_chunk().is_some_and(|block| Header::read(block).is_ok()) {
        // Nearly every log begins with a sector.
        return Ok(Content::Log);
    }
    let rest = ((LOOK_BLOCKS - 1) * BLOCK_BYTES) as u64;
    file.by_ref().take(rest).read_to_end(&mut start).with_context(context)?;
    if start.is_empty() {
        return Ok(Content::Empty);
    }
    let mut unread = None;
    let mut log_blocks = 0_usize;
    let mut other_blocks = 0_usize;
    for block in start.chunks(BLOCK_BYTES) {
        let mut whole = [0; BLOCK_BYTES];
        whole.iter_mut().zip(block).for_each(|(to, from)| *to = *from);
        match Header::read(&whole) {
            Ok(_) => log_blocks += 1,
            Err(NotASector::OtherVersion(version)) if version < VERSION => {
                unread = Some(UnreadReason::Older(version));
            }
            Err(NotASector::OtherVersion(version)) => unread = Some(UnreadReason::Newer(version)),
            Err(NotASector::Sealed) => unread = Some(UnreadReason::Sealed),
            Err(NotASector::Empty | NotASector::Erased | NotASector::Damaged) => {}
            Err(NotASector::Foreign) => other_blocks += 1,
        }
        // A log has a sector early.
        if log_blocks > 0 {
            break;
        }
    }
    let signed = start.get(510..512) == Some(&[0x55, 0xaa]);
    let large = start.len() == LOOK_BLOCKS * BLOCK_BYTES;
    let frame_at = |at: usize| start.get(at..).is_some_and(|rest| matches!(peek(rest), Peek::Frame(_)));
    Ok(match (log_blocks, unread) {
        _ if signed && other_blocks > 0 => Content::Image,
        (1.., _) => Content::Log,
        (0, Some(unread)) => Content::Unread(unread),
        _ if frame_at(0) || frame_at(8) => Content::Mavlink,
        // Large, and known to be something else.
        _ if start.starts_with(&archive::GZIP) || archive::hint(&start).is_some() => Content::Other,
        // Only a search shows a card without its first blocks.
        _ if large => Content::Image,
        _ => Content::Other,
    })
}
