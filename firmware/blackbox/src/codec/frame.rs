//! A MAVLink frame taken apart and put together again. A frame that would not decode bit for bit is coded as plain bytes.

use hums_dialect::crc;
use hums_dialect::wire::{
    CHECKSUM_BYTES, HEADER_V1_BYTES, HEADER_V2_BYTES, INCOMPAT_SIGNED, PAYLOAD_BYTES_MAX, SIGNATURE_BYTES,
    START_V1, START_V2,
};

use crate::bytes::copy_few;
use crate::limits::ENTRY_BYTES_MAX;

const _: () = assert!(PAYLOAD_BYTES_MAX == 0xff);

/// A frame's parts.
#[derive(zerocopy::FromZeros)]
pub(crate) struct Frame {
    pub(crate) v2: bool,
    pub(crate) incompat: u8,
    pub(crate) compat: u8,
    pub(crate) sequence: u8,
    pub(crate) system: u8,
    pub(crate) component: u8,
    pub(crate) id: u32,
    pub(crate) len: usize,
    /// Zeros beyond `len`; room to read the widest element anywhere.
    pub(crate) payload: [u8; PAYLOAD_BYTES_MAX + 9],
    pub(crate) checksum: u16,
    pub(crate) signature: [u8; SIGNATURE_BYTES],
    /// Bytes of `payload` that may not be zero.
    used: usize,
}

impl Frame {
    /// The payload from here (below 256) on: room for the widest element.
    #[inline]
    pub(crate) fn place(&mut self, offset: usize) -> &mut [u8; 8] {
        let offset = offset & PAYLOAD_BYTES_MAX;
        self.payload[offset..].first_chunk_mut().expect("the payload has room for it")
    }

    pub(crate) const fn signed(&self) -> bool {
        self.v2 && self.incompat & INCOMPAT_SIGNED != 0
    }

    pub(crate) fn clear(&mut self) {
        self.clear_payload(0);
    }

    fn clear_payload(&mut self, len: usize) {
        if len < self.used
            && let Some(beyond) = self.payload.get_mut(len..self.used)
        {
            beyond.fill(0);
        }
        // A caller that fills fewer bytes lowers it.
        self.used = self.payload.len();
    }

    pub(crate) fn parse(&mut self, bytes: &[u8]) -> Option<()> {
        let frame = self;
        let rest;
        match *bytes {
            [START_V1, len, sequence, system, component, id, ref tail @ ..] => {
                frame.v2 = false;
                (frame.incompat, frame.compat) = (0, 0);
                (frame.len, frame.sequence) = (usize::from(len), sequence);
                (frame.system, frame.component, frame.id) = (system, component, u32::from(id));
                rest = tail;
            }
            [START_V2, len, incompat, compat, sequence, system, component, a, b, c, ref tail @ ..] => {
                (frame.v2, frame.incompat, frame.compat) = (true, incompat, compat);
                (frame.len, frame.sequence) = (usize::from(len), sequence);
                (frame.system, frame.component, frame.id) =
                    (system, component, u32::from_le_bytes([a, b, c, 0]));
                rest = tail;
            }
            _ => return None,
        }
        let (payload, rest) = rest.split_at_checked(frame.len)?;
        copy_few(payload, &mut frame.payload);
        frame.clear_payload(frame.len);
        frame.used = frame.len;
        let (checksum, signature) = rest.split_first_chunk()?;
        frame.checksum = u16::from_le_bytes(*checksum);
        if frame.signed() {
            frame.signature = *signature.as_array()?;
        } else if !signature.is_empty() {
            return None;
        }
        Some(())
    }

    pub(crate) fn bytes(&self) -> usize {
        let head = if self.v2 { HEADER_V2_BYTES } else { HEADER_V1_BYTES };
        head + self.len.min(PAYLOAD_BYTES_MAX)
            + CHECKSUM_BYTES
            + if self.signed() { SIGNATURE_BYTES } else { 0 }
    }

    pub(crate) fn assemble(&mut self, seed: Option<u8>, out: &mut [u8; ENTRY_BYTES_MAX]) {
        if let Some(seed) = seed {
            self.checksum = crc::step(self.checksum_before_seed(), seed);
        }
        let head = self.head();
        let head = &head[..if self.v2 { HEADER_V2_BYTES } else { HEADER_V1_BYTES }];
        let payload = &self.payload[..self.len.min(PAYLOAD_BYTES_MAX)];
        let signature: &[u8] = if self.signed() { &self.signature } else { &[] };
        let mut at = 0;
        for part in [head, payload, &self.checksum.to_le_bytes(), signature] {
            out[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
    }

    pub(crate) fn known_id(&self) -> Option<u32> {
        match (self.v2, self.incompat) {
            (false, _) => Some(self.id & 0xff),
            (true, 0 | INCOMPAT_SIGNED) => Some(self.id & 0x00ff_ffff),
            _ => None,
        }
    }

    fn head(&self) -> [u8; HEADER_V2_BYTES] {
        let [a, b, c, _] = self.id.to_le_bytes();
        let len = self.len as u8;
        if self.v2 {
            let (incompat, compat) = (self.incompat, self.compat);
            [START_V2, len, incompat, compat, self.sequence, self.system, self.component, a, b, c]
        } else {
            [START_V1, len, self.sequence, self.system, self.component, a, 0, 0, 0, 0]
        }
    }

    /// The checksum before the seed goes in: CRC-16/MCRF4XX over header and payload.
    pub(crate) fn checksum_before_seed(&self) -> u16 {
        let head = self.head();
        let head = &head[1..if self.v2 { HEADER_V2_BYTES } else { HEADER_V1_BYTES }];
        let payload = &self.payload[..self.len.min(PAYLOAD_BYTES_MAX)];
        crc::update(crc::update(crc::START, head), payload)
    }

    /// A MAVLink 2 sender's payload does not end with a zero, unless that is all there is.
    #[inline]
    pub(crate) fn is_trimmed(&self) -> bool {
        match self.len {
            0 => false,
            1 => true,
            len => self.payload.get(len - 1).is_some_and(|&last| last != 0),
        }
    }

    /// Length of the payload without trailing zeros, at least 1, as a MAVLink 2 sender truncates it. For a frame that
    /// was read, only zeros are beyond `full`.
    pub(crate) fn trimmed(&self, full: usize) -> usize {
        let words = self.payload.as_chunks().0;
        let words = words.get(..full.div_ceil(size_of::<u64>())).unwrap_or_default();
        for (index, word) in words.iter().enumerate().rev() {
            let word = u64::from_le_bytes(*word);
            if word != 0 {
                return (index + 1) * size_of::<u64>() - word.leading_zeros() as usize / 8;
            }
        }
        1
    }

    /// For a frame that was read: bytes of the payload that may not be zero.
    pub(crate) fn fill_ends(&mut self, at: usize) {
        self.used = (at + size_of::<u64>()).min(self.payload.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_apart_and_together() {
        let heartbeat = [0xfe, 9, 0x4e, 1, 1, 0, 0, 0, 0, 0, 2, 3, 0x51, 4, 3, 0x1c, 0x7f];
        let mut frame: Frame = crate::zeros();
        frame.parse(&heartbeat).expect("a frame");
        assert_eq!(crc::step(frame.checksum_before_seed(), 50), frame.checksum);
        assert_eq!(crc::extra_of(frame.checksum_before_seed(), frame.checksum), Some(50));
        for seed in [None, Some(50)] {
            let mut out = [0; ENTRY_BYTES_MAX];
            frame.assemble(seed, &mut out);
            assert_eq!(&out[..frame.bytes()], heartbeat);
            frame.checksum = 0;
        }
        assert!(frame.parse(&heartbeat[..16]).is_none());
        assert!(frame.parse(&[0xfd; 12]).is_none());
    }
}
