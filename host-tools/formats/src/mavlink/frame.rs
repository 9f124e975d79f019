//! One MAVLink frame at the beginning of some bytes.
//!
//! `hums-link`'s framer follows a stream instead.

use hums_link::{Check, Frame};

/// MAVLink 2, 255 bytes of payload, a signature.
pub const FRAME_BYTES_MAX: usize = 10 + 255 + 2 + 13;

const MAGIC_V1: u8 = 0xfe;
const MAGIC_V2: u8 = 0xfd;
/// Incompatibility flag of a signature; no other is known.
const SIGNED: u8 = 0x01;

/// The structure at the beginning of some bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peek<'a> {
    /// Not the beginning of a frame.
    Other,
    /// The bytes end before the frame does.
    Short,
    /// A frame, consistent in its length. Its checksum was not read: [`is_good`].
    Frame(Frame<'a>),
}

/// Looks at a beginning.
pub fn peek(bytes: &[u8]) -> Peek<'_> {
    let total = match *bytes {
        [MAGIC_V1, length, ..] => 6 + usize::from(length) + 2,
        [MAGIC_V2, length, 0, ..] => 10 + usize::from(length) + 2,
        [MAGIC_V2, length, SIGNED, ..] => 10 + usize::from(length) + 2 + 13,
        [MAGIC_V1 | MAGIC_V2, ..] if bytes.len() < 3 => return Peek::Short,
        _ => return Peek::Other,
    };
    let frame = bytes.get(..total).and_then(|frame| Frame::again(frame, Check::Unverified));
    frame.map_or(Peek::Short, Peek::Frame)
}

/// Whether the checksum holds, with a definition of the dialect.
pub fn is_good(frame: &Frame<'_>) -> bool {
    Frame::parse(frame.bytes()).is_some_and(|frame| frame.check() == Check::Verified)
}

/// Whether the checksum is wrong, or made with another definition than the dialect's.
pub fn is_bad(frame: &Frame<'_>) -> bool {
    hums_dialect::message(frame.id()).is_some() && !is_good(frame)
}

#[cfg(test)]
pub(crate) mod tests;
