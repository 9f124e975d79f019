//! Preamble: plain bytes at the start of each group's first sector, for a reader that starts there.
//!
//! ```text
//!   0  u32: hash of the layout table that the group was written with
//!   4  u48: time of the first entry, milliseconds since power-on
//!  10  u32: frames of the session before this group
//!  14  u64: UTC at power-on, microseconds since 1970; 0 where it is not known yet
//!  22  u32: check of the session's entries before this group
//! ```

use crate::bytes::ByteFields;

pub(crate) const PREAMBLE_BYTES: usize = 26;

/// Preamble of a group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Preamble {
    /// Hash of the layout table that the group was written with.
    pub layouts: u32,
    /// First entry, milliseconds since power-on.
    pub start_ms: u64,
    /// Frames of the session before this group, modulo 2^32.
    pub frames_before: u32,
    /// UTC at power-on, microseconds since 1970, if known.
    pub epoch_micros: Option<u64>,
    /// Check of all entries of the session before this group.
    pub chain: u32,
}

impl Preamble {
    pub(crate) fn store(&self) -> [u8; PREAMBLE_BYTES] {
        let mut out = [0; PREAMBLE_BYTES];
        out[..4].copy_from_slice(&self.layouts.to_le_bytes());
        out[4..10].copy_from_slice(&self.start_ms.to_le_bytes()[..6]);
        out[10..14].copy_from_slice(&self.frames_before.to_le_bytes());
        out[14..22].copy_from_slice(&self.epoch_micros.unwrap_or(0).to_le_bytes());
        out[22..].copy_from_slice(&self.chain.to_le_bytes());
        out
    }

    /// Reads the body of a group's first sector; `None` if that is too short.
    pub fn read(body: &[u8]) -> Option<Self> {
        let mut fields = ByteFields::new(body.get(..PREAMBLE_BYTES)?);
        let layouts = fields.u32();
        let mut start = [0; 8];
        start[..6].copy_from_slice(fields.bytes(6));
        let frames_before = fields.u32();
        let epoch = fields.u64();
        Some(Self {
            layouts,
            start_ms: u64::from_le_bytes(start),
            frames_before,
            epoch_micros: (epoch != 0).then_some(epoch),
            chain: fields.u32(),
        })
    }
}
