//! Chained check of a session's received entries.
//!
//! Each entry has a CRC-32C of its time, kind, length and bytes, independent of the codec, which a reader computes
//! again. So a recorder with changed memory cannot write a wrong frame that passes as correct. The values are chained
//! from the session's first entry to its last. Each group begins with the value before it; each sector has the one
//! after the last entry that it completes. So the value in a session's last sector covers all of it.

use crate::codec::{CodedEntry, Kind};
use crate::crc::{Crc32c, crc32c};

pub(crate) fn value_of(entry: &CodedEntry<'_>) -> u32 {
    let kind = match entry.kind {
        Kind::Frame { verified } => u8::from(verified),
        Kind::Record => 2,
    };
    let mut head = [0; 11];
    head[..8].copy_from_slice(&entry.at_ms.to_le_bytes());
    head[8] = kind;
    head[9..].copy_from_slice(&(entry.bytes.len() as u16).to_le_bytes());
    let mut crc = Crc32c::new();
    crc.add(&head);
    crc.add(entry.bytes);
    crc.value()
}

pub(crate) fn begun(preamble: &[u8]) -> u32 {
    crc32c(preamble)
}

pub(crate) fn after(chain: u32, entry: u32) -> u32 {
    let mut crc = Crc32c::going_on(chain);
    crc.add(&entry.to_le_bytes());
    crc.value()
}
