//! One MAVLink frame in a slice of bytes: its length, its header and whether its checksum holds.
//!
//! The framer of the pipeline (`hums-link`) follows a stream byte by byte; this looks at bytes that are all there.

use hums_dialect::Message;

/// The longest frame: MAVLink 2 with 255 bytes of payload and a signature.
pub const FRAME_BYTES_MAX: usize = 10 + 255 + 2 + 13;

const MAGIC_V1: u8 = 0xfe;
const MAGIC_V2: u8 = 0xfd;
/// The bit of MAVLink 2's incompatibility flags that announces a signature; no other bit is known.
const SIGNED: u8 = 0x01;

/// Whether the checksum follows our definition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Check {
    /// It holds.
    Good,
    /// It does not: damage, or another definition of this id.
    Bad,
    /// The dialect lacks this message id, so it is unknown.
    Unknown,
}

/// The structure at the beginning of some bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Peek<'a> {
    /// Not the beginning of a frame.
    Other,
    /// The beginning of a frame, but the bytes end before the frame does.
    Short,
    /// A frame, consistent in its length.
    Frame(Frame<'a>),
}

/// A frame, consistent in its length.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// The whole frame, from the magic to the checksum or signature.
    pub bytes: &'a [u8],
    /// The message id.
    pub id: u32,
    /// The sequence number.
    pub sequence: u8,
    /// The sender's system id.
    pub system: u8,
    /// The sender's component id.
    pub component: u8,
    /// The payload as sent: MAVLink 2 leaves trailing zeros out.
    pub payload: &'a [u8],
}

impl Frame<'_> {
    /// Whether the checksum holds. It takes time for every byte.
    pub fn check(&self) -> Check {
        if self.message().is_none() {
            return Check::Unknown;
        }
        let checked = hums_link::Frame::parse(self.bytes).map(|frame| frame.check());
        if checked == Some(hums_link::Check::Verified) { Check::Good } else { Check::Bad }
    }

    /// The definition of the message, if the dialect has one.
    pub fn message(&self) -> Option<&'static Message> {
        hums_dialect::message(self.id)
    }
}

/// Looks at the beginning of `bytes`.
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

/// The length of the frame that begins here, by its header;
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

    /// A HEARTBEAT of ArduCopter 4.6, MAVLink 2, taken from a recording.
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
