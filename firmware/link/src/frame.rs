//! One received MAVLink frame: borrowed bytes and the offsets of its parts. Bytes are never copied or altered, so a frame can be
//! recorded and forwarded bit for bit.

use hums_core::observation::Source;
use hums_dialect::crc;
use hums_dialect::wire::{
    CHECKSUM_BYTES, HEADER_V1_BYTES, HEADER_V2_BYTES, INCOMPAT_SIGNED, SIGNATURE_BYTES, START_V1, START_V2,
};

use crate::packet::Fields;

/// Result of the checksum test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Check {
    /// Correct with our definition of the message.
    Verified,
    /// Consistent frame of an unknown definition: record and forward it only.
    Unverified,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    /// 1 or 2.
    pub(crate) version: u8,
    pub(crate) signed: bool,
    pub(crate) payload_len: u8,
    pub(crate) sequence: u8,
    pub(crate) system: u8,
    pub(crate) component: u8,
    pub(crate) id: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoHeader {
    /// Undecided: this many bytes are needed.
    Incomplete(usize),
    Invalid,
}

impl Header {
    #[inline]
    pub(crate) fn read(bytes: &[u8]) -> Result<Self, NoHeader> {
        match *bytes {
            [START_V1, payload_len, sequence, system, component, id, ..] => Ok(Self {
                version: 1,
                signed: false,
                payload_len,
                sequence,
                system,
                component,
                id: u32::from(id),
            }),
            [START_V2, payload_len, incompat, _, sequence, system, component, id0, id1, id2, ..]
                if incompat & !INCOMPAT_SIGNED == 0 =>
            {
                Ok(Self {
                    version: 2,
                    signed: incompat == INCOMPAT_SIGNED,
                    payload_len,
                    sequence,
                    system,
                    component,
                    id: u32::from_le_bytes([id0, id1, id2, 0]),
                })
            }
            [START_V1] | [START_V1, _, ..] if bytes.len() < HEADER_V1_BYTES => {
                Err(NoHeader::Incomplete(HEADER_V1_BYTES))
            }
            // The flags come early: most false starts end here immediately.
            [START_V2] | [START_V2, _] => Err(NoHeader::Incomplete(3)),
            [START_V2, _, incompat, ..]
                if incompat & !INCOMPAT_SIGNED == 0 && bytes.len() < HEADER_V2_BYTES =>
            {
                Err(NoHeader::Incomplete(HEADER_V2_BYTES))
            }
            _ => Err(NoHeader::Invalid),
        }
    }

    #[inline]
    pub(crate) const fn payload_at(&self) -> usize {
        if self.version == 1 { HEADER_V1_BYTES } else { HEADER_V2_BYTES }
    }

    #[inline]
    pub(crate) const fn checksum_at(&self) -> usize {
        self.payload_at() + self.payload_len as usize
    }

    #[inline]
    pub(crate) const fn frame_len(&self) -> usize {
        self.checksum_at() + CHECKSUM_BYTES + if self.signed { SIGNATURE_BYTES } else { 0 }
    }
}

/// The computed checksum before `crc_extra`, and the transmitted one.
#[inline]
pub(crate) fn checksums(header: &Header, bytes: &[u8]) -> Option<(u16, u16)> {
    let at = header.checksum_at();
    let computed = crc::update(crc::START, bytes.get(1..at)?);
    let sent = u16::from_le_bytes([*bytes.get(at)?, *bytes.get(at + 1)?]);
    Some((computed, sent))
}

/// A received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    header: Header,
    bytes: &'a [u8],
    check: Check,
    /// Index in the dialect's table, if the checksum is correct.
    message: Option<u16>,
}

impl<'a> Frame<'a> {
    /// Reads `bytes` as exactly one frame. `None` without a start byte, with unknown flags, or if the length differs from the
    /// header's. Without a matching definition of the message the frame is [`Check::Unverified`].
    ///
    /// Bytes from a line go through [`crate::framer::Framer`], which separates frames from noise.
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        let header = Header::read(bytes).ok()?;
        if header.frame_len() != bytes.len() {
            return None;
        }
        let (computed, sent) = checksums(&header, bytes)?;
        let message = hums_dialect::index(header.id).filter(|index| {
            let message = hums_dialect::messages().get(usize::from(*index));
            message.is_some_and(|message| crc::step(computed, message.crc_extra) == sent)
        });
        Some(Self::from_parts(header, bytes, message))
    }

    /// A frame that was checked before, for example when it was recorded. Skips the checksum.
    pub fn again(bytes: &'a [u8], check: Check) -> Option<Self> {
        let header = Header::read(bytes).ok().filter(|header| header.frame_len() == bytes.len())?;
        let message = if check == Check::Verified { hums_dialect::index(header.id) } else { None };
        Some(Self { header, bytes, check, message })
    }

    /// Found and checked by the framer, with its [`Self::message`]: not looked up again.
    pub fn from_queue(bytes: &'a [u8], message: Option<u16>) -> Option<Self> {
        let header = Header::read(bytes).ok().filter(|header| header.frame_len() == bytes.len())?;
        Some(Self::from_parts(header, bytes, message))
    }

    /// `bytes` are exactly the frame of `header`: the framer has seen to that. `message` is there where the checksum is right.
    #[inline]
    pub(crate) fn from_parts(header: Header, bytes: &'a [u8], message: Option<u16>) -> Self {
        debug_assert_eq!(header.frame_len(), bytes.len());
        let check = if message.is_some() { Check::Verified } else { Check::Unverified };
        Self { header, bytes, check, message }
    }

    /// Index in the dialect's table; `None` if the checksum does not match our definition.
    #[inline]
    pub const fn message(&self) -> Option<u16> {
        self.message
    }

    /// The message id.
    #[inline]
    pub const fn id(&self) -> u32 {
        self.header.id
    }

    /// System id of the sender.
    #[inline]
    pub const fn system(&self) -> u8 {
        self.header.system
    }

    /// Component id of the sender.
    #[inline]
    pub const fn component(&self) -> u8 {
        self.header.component
    }

    /// Sender.
    #[inline]
    pub const fn source(&self) -> Source {
        Source { system: self.header.system, component: self.header.component }
    }

    /// The sender's count of frames, modulo 256.
    #[inline]
    pub const fn sequence(&self) -> u8 {
        self.header.sequence
    }

    /// The MAVLink version: 1 or 2.
    #[inline]
    pub const fn version(&self) -> u8 {
        self.header.version
    }

    /// Whether a signature follows the checksum. It is carried, not verified: see [`crate::signing`].
    #[inline]
    pub const fn signed(&self) -> bool {
        self.header.signed
    }

    /// Target system and component, 0 for all; `None` if the message has no target or is unknown.
    pub fn target(&self) -> Option<(u8, u8)> {
        let message = hums_dialect::messages().get(usize::from(self.message?))?;
        if message.target_system == hums_dialect::Message::NO_TARGET {
            return None;
        }
        let at = |offset: u8| Fields(self.payload()).u8(usize::from(offset));
        Some((at(message.target_system), at(message.target_component)))
    }

    /// The signed bytes (from the first to the checksum) and the signature (link id, timestamp, hash). `None` for an unsigned
    /// frame.
    pub fn signature(&self) -> Option<(&'a [u8], &'a [u8; SIGNATURE_BYTES])> {
        self.bytes.split_last_chunk().filter(|_| self.header.signed)
    }

    /// The payload as sent: MAVLink 2 leaves out zeros at the end.
    #[inline]
    pub fn payload(&self) -> &'a [u8] {
        self.bytes.get(self.header.payload_at()..self.header.checksum_at()).unwrap_or_default()
    }

    /// All bytes of the frame.
    #[inline]
    pub const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Result of the checksum test.
    #[inline]
    pub const fn check(&self) -> Check {
        self.check
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// HEARTBEAT of an ArduPilot quad, from the MAVLink serialisation guide's layout; checksum by pymavlink.
    const HEARTBEAT_V1: [u8; 17] = [0xfe, 9, 78, 1, 1, 0, 0, 0, 0, 0, 2, 3, 81, 3, 3, 0x19, 0xf3];

    #[test]
    fn a_frame_with_another_length_than_its_header_says_is_none() {
        assert_eq!(Frame::parse(&HEARTBEAT_V1[..16]), None);
        let mut longer = HEARTBEAT_V1.to_vec();
        longer.push(0);
        assert_eq!(Frame::parse(&longer), None);
        assert_eq!(Frame::parse(&[]), None);
    }

    #[test]
    fn parts_of_a_frame_lie_where_the_guide_says() {
        let frame = Frame::parse(&HEARTBEAT_V1).expect("a frame");
        assert_eq!((frame.id(), frame.system(), frame.component(), frame.sequence()), (0, 1, 1, 78));
        assert_eq!((frame.version(), frame.signed(), frame.payload().len()), (1, false, 9));
        assert_eq!(frame.check(), Check::Verified);
    }

    #[test]
    fn a_checksum_of_another_definition_is_unverified() {
        let mut bytes = HEARTBEAT_V1;
        bytes[15] ^= 1;
        assert_eq!(Frame::parse(&bytes).map(|frame| frame.check()), Some(Check::Unverified));
    }

    #[test]
    fn unknown_incompatibility_flags_make_it_no_frame() {
        let mut bytes = [0; 12];
        bytes[..3].copy_from_slice(&[START_V2, 0, 2]);
        assert_eq!(Frame::parse(&bytes), None);
        bytes[2] = 0;
        assert!(Frame::parse(&bytes).is_some());
    }

    #[test]
    fn a_header_is_refused_as_soon_as_it_can_be() {
        assert_eq!(Header::read(&[START_V2, 9, 4]), Err(NoHeader::Invalid));
        assert_eq!(Header::read(&[START_V2, 9]), Err(NoHeader::Incomplete(3)));
        assert_eq!(Header::read(&[START_V2, 9, 0, 0]), Err(NoHeader::Incomplete(HEADER_V2_BYTES)));
        assert_eq!(Header::read(&[START_V1]), Err(NoHeader::Incomplete(HEADER_V1_BYTES)));
        assert_eq!(Header::read(&[START_V1, 1, 2, 3, 4]), Err(NoHeader::Incomplete(HEADER_V1_BYTES)));
        assert_eq!(Header::read(&[0x55]), Err(NoHeader::Invalid));
        assert_eq!(Header::read(&[]), Err(NoHeader::Invalid));
    }
}
