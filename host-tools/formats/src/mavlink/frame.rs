//! One MAVLink frame in a slice: length, header, checksum.
//!
//! `hums-link`'s framer follows a stream instead.

use hums_dialect::Message;

/// MAVLink 2, 255 bytes of payload, a signature.
pub const FRAME_BYTES_MAX: usize = 10 + 255 + 2 + 13;

const MAGIC_V1: u8 = 0xfe;
const MAGIC_V2: u8 = 0xfd;
/// Incompatibility flag of a signature; no other is known.
const SIGNED: u8 = 0x01;

/// Result of the checksum.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// It holds.
    Good,
    /// Damage, or another definition.
    Bad,
    /// The dialect lacks this message id, so it is unknown.
    Unknown,
}

/// The structure at the beginning of some bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peek<'a> {
    /// Not the beginning of a frame.
    Other,
    /// The bytes end before the frame does.
    Short,
    /// A frame, consistent in its length.
    Frame(Frame<'a>),
}

/// A consistent frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The frame from magic to checksum or signature.
    pub bytes: &'a [u8],
    /// The message id.
    pub id: u32,
    /// The sequence number.
    pub sequence: u8,
    /// Sender's system.
    pub system: u8,
    /// Sender's component.
    pub component: u8,
    /// The payload as sent: MAVLink 2 leaves trailing zeros out.
    pub payload: &'a [u8],
}

impl Frame<'_> {
    /// Checks every byte.
    pub fn check(&self) -> Check {
        if self.message().is_none() {
            return Check::Unknown;
        }
        let checked = hums_link::Frame::parse(self.bytes).map(|frame| frame.check());
        if checked == Some(hums_link::Check::Verified) { Check::Good } else { Check::Bad }
    }

    /// The definition, if the dialect has one.
    pub fn message(&self) -> Option<&'static Message> {
        hums_dialect::message(self.id)
    }
}

/// Looks at a beginning.
pub fn peek(bytes: &[u8]) -> Peek<'_> {
    let Some(total) = length(bytes) else {
        return match bytes.first() {
            Some(&(MAGIC_V1 | MAGIC_V2)) if bytes.len() < 3 => Peek::Short,
            _ => Peek::Other,
        };
    };
    let Some(frame) = bytes.get(..total) else { return Peek::Short };
    let byte = |at: usize| frame.get(at).copied().unwrap_or(0);
    let (header, sequence, system, component, id) = if byte(0) == MAGIC_V1 {
        (6, byte(2), byte(3), byte(4), u32::from(byte(5)))
    } else {
        (10, byte(4), byte(5), byte(6), u32::from_le_bytes([byte(7), byte(8), byte(9), 0]))
    };
    let end = header + usize::from(byte(1));
    let payload = frame.get(header..end).unwrap_or_default();
    Peek::Frame(Frame { bytes: frame, id, sequence, system, component, payload })
}

fn length(bytes: &[u8]) -> Option<usize> {
    match *bytes {
        [MAGIC_V1, length, ..] => Some(6 + usize::from(length) + 2),
        [MAGIC_V2, length, 0, ..] => Some(10 + usize::from(length) + 2),
        [MAGIC_V2, length, SIGNED, ..] => Some(10 + usize::from(length) + 2 + 13),
        _ => None,
    }
}

#[cfg(test)]
pub(crate) mod tests;
