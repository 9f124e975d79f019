//! Payloads field by field, at the wire's offsets (larger fields first, extensions after them).
//!
//! This does not use the structures of the `mavlink` crate's generator: those reject an unknown enumeration number,
//! and an unknown command needs an answer too.

use hums_dialect::wire::PAYLOAD_BYTES_MAX;

/// The part that MAVLink 2 left out reads as zero.
#[derive(Clone, Copy, Debug)]
pub struct Fields<'a>(pub &'a [u8]);

impl<'a> Fields<'a> {
    /// `N` bytes from `at` on.
    pub fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        for (to, from) in bytes.iter_mut().zip(self.0.iter().skip(at)) {
            *to = *from;
        }
        bytes
    }

    /// `uint8_t`
    #[inline(never)]
    pub fn u8(&self, at: usize) -> u8 {
        self.0.get(at).copied().unwrap_or(0)
    }

    /// `uint16_t`
    #[inline(never)]
    pub fn u16(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }

    /// `uint32_t`
    #[inline(never)]
    pub fn u32(&self, at: usize) -> u32 {
        u32::from_le_bytes(self.bytes(at))
    }

    /// `uint64_t`
    pub fn u64(&self, at: usize) -> u64 {
        u64::from_le_bytes(self.bytes(at))
    }

    /// `float`
    #[inline(never)]
    pub fn f32(&self, at: usize) -> f32 {
        f32::from_le_bytes(self.bytes(at))
    }

    /// Text of at most `len` bytes that ends at a zero; `None` unless it is UTF-8.
    pub fn text(&self, at: usize, len: usize) -> Option<&'a str> {
        let end = at.saturating_add(len).min(self.0.len());
        let bytes = self.0.get(at..end).unwrap_or_default();
        let text = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
        core::str::from_utf8(text).ok()
    }
}

/// A message to be sent.
#[derive(Clone, Debug)]
pub struct Packet {
    id: u32,
    len: usize,
    payload: [u8; PAYLOAD_BYTES_MAX],
}

impl Packet {
    /// A message whose fields are all zero.
    pub const fn new(id: u32) -> Self {
        Self { id, len: 0, payload: [0; PAYLOAD_BYTES_MAX] }
    }

    /// Bytes beyond the longest payload are dropped.
    #[inline(never)]
    pub fn bytes(mut self, at: usize, bytes: &[u8]) -> Self {
        for (index, byte) in bytes.iter().enumerate() {
            if let Some(place) = self.payload.get_mut(at + index) {
                *place = *byte;
                self.len = self.len.max(at + index + 1);
            }
        }
        self
    }

    /// `uint8_t`
    pub fn u8(self, at: usize, value: u8) -> Self {
        self.bytes(at, &[value])
    }

    /// `uint16_t`
    pub fn u16(self, at: usize, value: u16) -> Self {
        self.bytes(at, &value.to_le_bytes())
    }

    /// `uint32_t`
    pub fn u32(self, at: usize, value: u32) -> Self {
        self.bytes(at, &value.to_le_bytes())
    }

    /// `uint64_t`
    pub fn u64(self, at: usize, value: u64) -> Self {
        self.bytes(at, &value.to_le_bytes())
    }

    /// `float`
    pub fn f32(self, at: usize, value: f32) -> Self {
        self.bytes(at, &value.to_le_bytes())
    }

    /// Text, cut at `len` bytes.
    pub fn text(self, at: usize, len: usize, text: &str) -> Self {
        let bytes = text.as_bytes();
        self.bytes(at, bytes.get(..len).unwrap_or(bytes))
    }

    /// The message id.
    pub const fn id(&self) -> u32 {
        self.id
    }

    /// The payload without the zeros at its end; at least one byte, as MAVLink 2 wants it.
    pub fn payload(&self) -> &[u8] {
        let used = self.payload.get(..self.len).unwrap_or_default();
        let end = used.iter().rposition(|byte| *byte != 0).map_or(1, |last| last + 1);
        self.payload.get(..end).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_left_out_reads_as_zero() {
        let fields = Fields(&[1, 2, 3]);
        assert_eq!((fields.u8(0), fields.u16(1), fields.u32(2), fields.u64(9)), (1, 0x0302, 3, 0));
        assert_eq!(Fields(b"NAME\0rest").text(0, 16), Some("NAME"));
        assert_eq!(Fields(b"NAME").text(2, 1), Some("M"));
        assert_eq!(Fields(&[0xff]).text(0, 16), None);
    }

    #[test]
    fn a_packet_ends_with_its_last_byte_that_is_not_zero() {
        assert_eq!(Packet::new(7).u32(0, 0).payload(), [0]);
        assert_eq!(Packet::new(7).u16(2, 0x0102).u8(4, 0).payload(), [0, 0, 2, 1]);
        assert_eq!(Packet::new(7).bytes(250, &[1; 20]).payload().len(), 255);
    }
}
