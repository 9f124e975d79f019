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
pub(crate) mod tests {
    use super::*;

    /// ArduCopter 4.6, MAVLink 2, recorded.
    pub(crate) const HEARTBEAT: [u8; 21] = [
        0xfd, 0x09, 0x00, 0x00, 0x00, 0xff, 0xbe, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x06, 0x08, 0x00,
        0x04, 0x03, 0x3d, 0x48,
    ];

    #[test]
    fn a_frame_from_a_recording_checks() {
        let Peek::Frame(frame) = peek(&HEARTBEAT) else { panic!("no frame") };
        assert_eq!((frame.id, frame.system, frame.component), (0, 255, 190));
        assert_eq!((frame.payload.len(), frame.check()), (9, Check::Good));
    }

    #[test]
    fn a_flipped_bit_is_noticed() {
        for at in 10..HEARTBEAT.len() {
            let mut bytes = HEARTBEAT;
            bytes[at] ^= 0x10;
            let Peek::Frame(frame) = peek(&bytes) else { panic!("no frame") };
            assert_eq!(frame.check(), Check::Bad, "byte {at}");
        }
    }

    #[test]
    fn every_cut_is_short_and_other_bytes_are_other() {
        for end in 1..HEARTBEAT.len() {
            assert_eq!(peek(&HEARTBEAT[..end]), Peek::Short, "{end} bytes");
        }
        assert_eq!(peek(b""), Peek::Other);
        assert_eq!(peek(b"Init ArduCopter"), Peek::Other);
        assert_eq!(peek(&[0xfd, 9, 0x40, 0]), Peek::Other, "an incompatibility flag nobody knows");
    }
}
