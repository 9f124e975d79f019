//! Our frames: the vehicle's system id, component 191 (`MAV_COMP_ID_ONBOARD_COMPUTER`), MAVLink 2.

use hums_core::clock::Instant;
use hums_dialect::crc;
pub use hums_dialect::wire::FRAME_BYTES_MAX;
use hums_dialect::wire::{CHECKSUM_BYTES, HEADER_V2_BYTES, INCOMPAT_SIGNED, SIGNATURE_BYTES, START_V2};

use crate::packet::Packet;
use crate::signing::Seal;

/// `MAV_COMP_ID_ONBOARD_COMPUTER`
pub const COMPONENT: u8 = hums_core::observation::OUR_COMPONENT;
/// The system id until the vehicle's is known: the default of most autopilots.
const SYSTEM_DEFAULT: u8 = 1;

/// Makes our frames and counts them.
#[derive(Clone, Copy, Debug)]
pub struct Encoder {
    system: u8,
    component: u8,
    sequence: u8,
}

impl Encoder {
    /// Before the vehicle's system id is known.
    pub const fn new() -> Self {
        Self::of(SYSTEM_DEFAULT, COMPONENT)
    }

    /// Another component's: a ground station's, in tools and tests.
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

    /// The message of a frame that was made with these addresses, to be sent at another port; `None` for other frames.
    pub fn message_of(&self, frame: &[u8]) -> Option<Packet> {
        let (header, rest) = frame.split_first_chunk::<HEADER_V2_BYTES>()?;
        let [START_V2, len, _, _, _, system, component, id0, id1, id2] = *header else { return None };
        if (system, component) != (self.system, self.component) {
            return None;
        }
        Some(Packet::new(u32::from_le_bytes([id0, id1, id2, 0])).bytes(0, rest.get(..usize::from(len))?))
    }

    /// The sequence number of the next frame.
    pub const fn set_sequence(&mut self, sequence: u8) {
        self.sequence = sequence;
    }

    /// Bytes of the frame, without a signature.
    pub fn frame_len(&self, packet: &Packet) -> usize {
        HEADER_V2_BYTES + packet.payload().len() + CHECKSUM_BYTES
    }

    /// Empty for a message without a definition.
    pub fn frame<'a>(&mut self, out: &'a mut [u8; FRAME_BYTES_MAX], packet: &Packet) -> &'a [u8] {
        let len = self.put(out, packet, 0);
        out.get(..len).unwrap_or_default()
    }

    /// Writes a signed frame.
    pub fn frame_signed<'a>(
        &mut self,
        out: &'a mut [u8; FRAME_BYTES_MAX],
        packet: &Packet,
        now: Instant,
        seal: &mut Seal,
    ) -> &'a [u8] {
        let len = self.put(out, packet, INCOMPAT_SIGNED);
        if len == 0 {
            return &[];
        }
        let tail = seal.sign(now, &out[..len]);
        out[len..len + SIGNATURE_BYTES].copy_from_slice(&tail);
        &out[..len + SIGNATURE_BYTES]
    }

    fn put(&mut self, out: &mut [u8; FRAME_BYTES_MAX], packet: &Packet, incompat: u8) -> usize {
        let Some(message) = hums_dialect::message(packet.id()) else { return 0 };
        let payload = packet.payload();
        let [id0, id1, id2, _] = packet.id().to_le_bytes();
        let len = payload.len() as u8;
        let header = [START_V2, len, incompat, 0, self.sequence, self.system, self.component, id0, id1, id2];
        self.sequence = self.sequence.wrapping_add(1);
        let end = HEADER_V2_BYTES + payload.len();
        out[..HEADER_V2_BYTES].copy_from_slice(&header);
        out[HEADER_V2_BYTES..end].copy_from_slice(payload);
        let sum = crc::step(crc::update(crc::START, &out[1..end]), message.crc_extra);
        out[end..end + CHECKSUM_BYTES].copy_from_slice(&sum.to_le_bytes());
        end + CHECKSUM_BYTES
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
        let mut buffer = [0; FRAME_BYTES_MAX];
        for sequence in 0..3 {
            let packet = messages::heartbeat(4);
            let frame = Frame::parse(encoder.frame(&mut buffer, &packet)).expect("a frame");
            assert_eq!(frame.bytes().len(), encoder.frame_len(&packet));
            assert_eq!(frame.check(), Check::Verified);
            assert_eq!((frame.id(), frame.system(), frame.component()), (0, 7, COMPONENT));
            assert_eq!(frame.sequence(), sequence);
        }
        assert_eq!(encoder.frame(&mut buffer, &Packet::new(0xff_fffe)), [0; 0], "no such message");
        let text = messages::status_text(crate::statustext::Severity::Notice, "HUMS: ready");
        let frame = encoder.frame(&mut buffer, &text).to_vec();
        let again = encoder.message_of(&frame).expect("ours");
        assert_eq!((again.id(), again.payload()), (text.id(), text.payload()));
        assert!(Encoder::of(7, 1).message_of(&frame).is_none());
        assert!((0..frame.len() - 2).all(|cut| encoder.message_of(&frame[..cut]).is_none()));
    }
}
