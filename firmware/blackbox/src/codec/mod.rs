//! How entries (frames and records) become symbols for the range coder, and back.
//!
//! An entry's time is in whole milliseconds since the monitor's power-on and never falls within a group.

use crate::coder::{Decoder, Encoder, Scratch};
use crate::layouts::Layouts;
use crate::record::RECORD_BYTES_MAX;

/// The longest frame: a MAVLink 2 header, 255 bytes of payload, checksum and signature.
pub const FRAME_BYTES_MAX: usize = 10 + 255 + 2 + 13;

/// The longest entry.
pub(crate) const ENTRY_BYTES_MAX: usize =
    if FRAME_BYTES_MAX > RECORD_BYTES_MAX { FRAME_BYTES_MAX } else { RECORD_BYTES_MAX };

/// What the coder may make of an entry at most, bytes. An entry that would become longer starts a new group, where
/// its bytes go out as they are.
pub(crate) const CODED_BYTES_MAX: usize = 640;

/// What an entry is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// A frame, and whether its checksum is that of our definition.
    Frame { verified: bool },
    /// A record in its stored form.
    Record,
}

/// An entry: as it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Entry<'a> {
    pub(crate) kind: Kind,
    pub(crate) at_ms: u64,
    pub(crate) bytes: &'a [u8],
}

/// An entry read: its bytes are in the buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Decoded {
    pub(crate) kind: Kind,
    pub(crate) at_ms: u64,
    pub(crate) len: usize,
}

/// The stream is not one that the writer makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Corrupt;

pub(crate) type Out = Scratch<CODED_BYTES_MAX>;

/// What writer and reader know alike of the group so far.
pub(crate) struct Model {
    last_ms: u64,
}

impl Model {
    pub(crate) const fn new() -> Self {
        Self { last_ms: 0 }
    }

    /// Starts afresh, at a group's start.
    pub(crate) fn reset(&mut self, at_ms: u64, _layouts: Layouts) {
        self.last_ms = at_ms;
    }

    pub(crate) fn encode(&mut self, entry: &Entry<'_>, coder: &mut Encoder, out: &mut Out) {
        let kind = match entry.kind {
            Kind::Frame { verified: false } => 0,
            Kind::Frame { verified: true } => 1,
            Kind::Record => 2,
        };
        coder.put(kind, 1, 2, out);
        let step = entry.at_ms.saturating_sub(self.last_ms);
        self.last_ms = entry.at_ms;
        let len = entry.bytes.len().min(ENTRY_BYTES_MAX);
        for byte in step.to_le_bytes().into_iter().chain((len as u16).to_le_bytes()) {
            coder.put(u32::from(byte), 1, 8, out);
        }
        for byte in entry.bytes.iter().take(len) {
            coder.put(u32::from(*byte), 1, 8, out);
        }
    }

    pub(crate) fn decode(
        &mut self,
        coder: &mut Decoder,
        input: &[u8],
        buffer: &mut [u8; ENTRY_BYTES_MAX],
    ) -> Result<Decoded, Corrupt> {
        let kind = coder.part(2);
        coder.take(kind, 1, input);
        let mut byte = || {
            let byte = coder.part(8);
            coder.take(byte, 1, input);
            byte as u8
        };
        let step = u64::from_le_bytes(core::array::from_fn(|_| byte()));
        self.last_ms = self.last_ms.saturating_add(step);
        let len = usize::from(u16::from_le_bytes([byte(), byte()]));
        let bytes = buffer.get_mut(..len).ok_or(Corrupt)?;
        for place in bytes {
            *place = byte();
        }
        let kind = match kind {
            0 => Kind::Frame { verified: false },
            1 => Kind::Frame { verified: true },
            2 => Kind::Record,
            _ => return Err(Corrupt),
        };
        Ok(Decoded { kind, at_ms: self.last_ms, len })
    }
}
