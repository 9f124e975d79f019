//! Our own frames: system id of the vehicle we ride on, component 191 (`MAV_COMP_ID_ONBOARD_COMPUTER`), MAVLink 2.

use core::fmt::{self, Write as _};

use hums_core::time::Instant;

use crate::crc;
use crate::frame::{CHECKSUM, HEADER_V2, INCOMPAT_SIGNED, SIGNATURE, START_V2};
use crate::packet::Packet;
use crate::signing::Seal;

/// `MAV_COMP_ID_ONBOARD_COMPUTER`
pub const COMPONENT: u8 = 191;
/// The longest frame: 10 bytes of header, 255 of payload, 2 of checksum, 13 of signature.
pub const GS_FRAME_BYTES_MAX: usize = 280;
/// The system id until the vehicle's is known: what most autopilots have by default.
const SYSTEM_DEFAULT: u8 = 1;
/// Bytes of text in one STATUSTEXT.
pub const TEXT_BYTES_MAX: usize = 50;

/// Makes our frames and counts them.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    system: u8,
    component: u8,
    sequence: u8,
}

impl Default for Encoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Encoder {
    /// Before the vehicle's system id is known.
    pub const fn new() -> Self {
        Self::of(SYSTEM_DEFAULT, COMPONENT)
    }

    /// For frames of another component: a ground station's, in tools and tests.
    pub const fn of(system: u8, component: u8) -> Self {
        Self { system, component, sequence: 0 }
    }

    /// Takes on the vehicle's system id.
    pub const fn set_system(&mut self, system: u8) {
        self.system = system;
    }

    /// The system id that our frames carry.
    pub const fn system(&self) -> u8 {
        self.system
    }

    /// The sequence number of the next frame.
    pub const fn set_sequence(&mut self, sequence: u8) {
        self.sequence = sequence;
    }

    /// The bytes of the frame that carries `packet`, without a signature.
    pub fn frame_len(&self, packet: &Packet) -> usize {
        HEADER_V2 + packet.payload().len() + CHECKSUM
    }

    /// The frame that carries `packet`; empty for a message that no definition of ours knows.
    pub fn frame<'a>(&mut self, out: &'a mut [u8; GS_FRAME_BYTES_MAX], packet: &Packet) -> &'a [u8] {
        let len = self.put(out, packet, 0);
        out.get(..len).unwrap_or_default()
    }

    /// The same, signed.
    pub fn frame_signed<'a>(
        &mut self,
        out: &'a mut [u8; GS_FRAME_BYTES_MAX],
        packet: &Packet,
        now: Instant,
        seal: &mut Seal,
    ) -> &'a [u8] {
        let len = self.put(out, packet, INCOMPAT_SIGNED);
        if len == 0 {
            return &[];
        }
        let tail = seal.sign(now, &out[..len]);
        out[len..len + SIGNATURE].copy_from_slice(&tail);
        &out[..len + SIGNATURE]
    }

    fn put(&mut self, out: &mut [u8; GS_FRAME_BYTES_MAX], packet: &Packet, incompat: u8) -> usize {
        let Some(message) = hums_dialect::message(packet.id()) else { return 0 };
        let payload = packet.payload();
        let [id0, id1, id2, _] = packet.id().to_le_bytes();
        let len = payload.len() as u8;
        let header = [START_V2, len, incompat, 0, self.sequence, self.system, self.component, id0, id1, id2];
        self.sequence = self.sequence.wrapping_add(1);
        let end = HEADER_V2 + payload.len();
        out[..HEADER_V2].copy_from_slice(&header);
        out[HEADER_V2..end].copy_from_slice(payload);
        let sum = crc::step(crc::update(crc::START, &out[1..end]), message.crc_extra);
        out[end..end + CHECKSUM].copy_from_slice(&sum.to_le_bytes());
        end + CHECKSUM
    }
}

/// How urgent a text is (`MAV_SEVERITY`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Severity {
    /// Act now.
    Critical = 2,
    /// Act soon.
    Warning = 4,
    /// Worth knowing.
    Notice = 5,
    /// All is well again.
    Info = 6,
}

/// A text that is put together; what does not fit is cut.
#[derive(Clone, Debug, Default)]
pub struct Text(heapless::String<TEXT_BYTES_MAX>);

impl Text {
    /// Formats a text.
    pub fn new(arguments: fmt::Arguments<'_>) -> Self {
        let mut text = Self::default();
        // Cut where it is full: that is what a text of 50 bytes is.
        let _ = text.write_fmt(arguments);
        text
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Write for Text {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for character in text.chars() {
            self.0.push(character).map_err(|_| fmt::Error)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Check, Frame};
    use crate::messages;

    #[test]
    fn our_frames_check_and_count() {
        let mut encoder = Encoder::new();
        encoder.set_system(7);
        let mut buffer = [0; GS_FRAME_BYTES_MAX];
        for sequence in 0..3 {
            let packet = messages::heartbeat(4);
            let frame = Frame::parse(encoder.frame(&mut buffer, &packet)).expect("a frame");
            assert_eq!(frame.bytes().len(), encoder.frame_len(&packet));
            assert_eq!(frame.check(), Check::Verified);
            assert_eq!((frame.id(), frame.system(), frame.component()), (0, 7, COMPONENT));
            assert_eq!(frame.sequence(), sequence);
        }
        assert_eq!(encoder.frame(&mut buffer, &Packet::new(0xff_fffe)), [0; 0], "no such message");
    }

    #[test]
    fn a_text_is_cut_at_fifty_bytes_between_characters() {
        let text = Text::new(format_args!("{}é", "a".repeat(49)));
        assert_eq!(text.as_str(), "a".repeat(49));
    }
}
