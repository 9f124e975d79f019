//! A MAVLink frame taken apart and put together again. What does not come out as it went in is no frame here and is
//! coded as plain bytes.

use super::ENTRY_BYTES_MAX;
use crate::bytes::copy_few;

pub(crate) const PAYLOAD_BYTES_MAX: usize = 255;
pub(crate) const SIGNATURE_BYTES: usize = 13;
const MAGIC_V1: u8 = 0xfe;
const MAGIC_V2: u8 = 0xfd;
/// The incompatibility flag of a signed frame.
const SIGNED: u8 = 1;

const _: () = assert!(PAYLOAD_BYTES_MAX == 0xff);

/// A frame's parts.
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
    pub(crate) const fn empty() -> Self {
        Self {
            v2: true,
            incompat: 0,
            compat: 0,
            sequence: 0,
            system: 0,
            component: 0,
            id: 0,
            len: 0,
            payload: [0; PAYLOAD_BYTES_MAX + 9],
            checksum: 0,
            signature: [0; SIGNATURE_BYTES],
            used: 0,
        }
    }

    /// The payload from here (below 256) on: room for the widest element.
    #[inline]
    pub(crate) fn place(&mut self, offset: usize) -> &mut [u8; 8] {
        let offset = offset & PAYLOAD_BYTES_MAX;
        self.payload[offset..].first_chunk_mut().expect("the payload has room for it")
    }

    pub(crate) const fn signed(&self) -> bool {
        self.v2 && self.incompat & SIGNED != 0
    }

    /// Nothing in the payload, as a frame to be read begins.
    pub(crate) fn clear(&mut self) {
        self.clear_payload(0);
    }

    /// Keeps `len` bytes of the payload; clears what a frame before left beyond.
    fn clear_payload(&mut self, len: usize) {
        if len < self.used
            && let Some(beyond) = self.payload.get_mut(len..self.used)
        {
            beyond.fill(0);
        }
        // Whoever fills it in says less.
        self.used = PAYLOAD_BYTES_MAX + 9;
    }

    /// Takes a frame apart; `None` where the bytes are not exactly one.
    pub(crate) fn parse(&mut self, bytes: &[u8]) -> Option<()> {
        let frame = self;
        let rest;
        match *bytes {
            [MAGIC_V1, len, sequence, system, component, id, ref tail @ ..] => {
                frame.v2 = false;
                (frame.incompat, frame.compat) = (0, 0);
                (frame.len, frame.sequence) = (usize::from(len), sequence);
                (frame.system, frame.component, frame.id) = (system, component, u32::from(id));
                rest = tail;
            }
            [MAGIC_V2, len, incompat, compat, sequence, system, component, a, b, c, ref tail @ ..] => {
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

    /// Its length when put together.
    pub(crate) fn bytes(&self) -> usize {
        let head = if self.v2 { 10 } else { 6 };
        head + self.len.min(PAYLOAD_BYTES_MAX) + 2 + if self.signed() { SIGNATURE_BYTES } else { 0 }
    }

    /// Puts a frame together that was read, with the checksum that this seed makes, or with its own.
    pub(crate) fn assemble(&mut self, seed: Option<u8>, out: &mut [u8; ENTRY_BYTES_MAX]) {
        if let Some(seed) = seed {
            self.checksum = crc_add(self.checksum_before_seed(), seed);
        }
        let head = self.head();
        let head = &head[..if self.v2 { 10 } else { 6 }];
        let payload = &self.payload[..self.len.min(PAYLOAD_BYTES_MAX)];
        let signature: &[u8] = if self.signed() { &self.signature } else { &[] };
        let mut at = 0;
        for part in [head, payload, &self.checksum.to_le_bytes(), signature] {
            out[at..at + part.len()].copy_from_slice(part);
            at += part.len();
        }
    }

    /// The message id as its head has it, if anyone knows what a frame with its flags means.
    pub(crate) fn known_id(&self) -> Option<u32> {
        match (self.v2, self.incompat) {
            (false, _) => Some(self.id & 0xff),
            (true, 0 | SIGNED) => Some(self.id & 0x00ff_ffff),
            _ => None,
        }
    }

    fn head(&self) -> [u8; 10] {
        let [a, b, c, _] = self.id.to_le_bytes();
        let len = self.len as u8;
        if self.v2 {
            let (incompat, compat) = (self.incompat, self.compat);
            [MAGIC_V2, len, incompat, compat, self.sequence, self.system, self.component, a, b, c]
        } else {
            [MAGIC_V1, len, self.sequence, self.system, self.component, a, 0, 0, 0, 0]
        }
    }

    /// The checksum before the seed goes in: CRC-16/MCRF4XX over header and payload.
    pub(crate) fn checksum_before_seed(&self) -> u16 {
        let head = self.head();
        let head = &head[1..if self.v2 { 10 } else { 6 }];
        let payload = &self.payload[..self.len.min(PAYLOAD_BYTES_MAX)];
        crc_add_all(crc_add_all(0xffff, head), payload)
    }

    /// Whether the payload ends as a MAVLink 2 sender ends it: not with a zero, unless that is all there is.
    #[inline]
    pub(crate) fn is_trimmed(&self) -> bool {
        match self.len {
            0 => false,
            1 => true,
            len => self.payload.get(len - 1).is_some_and(|&last| last != 0),
        }
    }

    /// The payload's length without its zeros at the end, at least 1: what a MAVLink 2 sender keeps of it. Of a frame that
    /// is read: there are only zeros beyond `full`.
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

    /// Of a frame that was read: bytes of the payload that may not be zero.
    pub(crate) fn fill_ends(&mut self, at: usize) {
        self.used = (at + size_of::<u64>()).min(self.payload.len());
    }
}

/// CRC-16/MCRF4XX: what a byte does to the checksum, and what it does when one, two or three bytes follow it. Four bytes
/// are taken in one step: this runs over every byte of every frame, in the firmware and in every reader.
static CHECKSUMS: [[u16; 256]; 4] = checksums();

const fn checksums() -> [[u16; 256]; 4] {
    let mut tables = [[0; 256]; 4];
    let mut index = 0;
    while index < 256 {
        let mut x = index as u8;
        x ^= x << 4;
        let x = x as u16;
        tables[0][index] = (x << 8) ^ (x << 3) ^ (x >> 4);
        index += 1;
    }
    let mut follow = 1;
    while follow < 4 {
        let mut index = 0;
        while index < 256 {
            tables[follow][index] = crc_step(&tables[0], tables[follow - 1][index], 0);
            index += 1;
        }
        follow += 1;
    }
    tables
}

#[inline]
const fn crc_step(table: &[u16; 256], crc: u16, byte: u8) -> u16 {
    crc >> 8 ^ table[(byte ^ crc as u8) as usize]
}

#[inline]
pub(crate) fn crc_add(crc: u16, byte: u8) -> u16 {
    crc_step(&CHECKSUMS[0], crc, byte)
}

#[inline]
fn crc_add_all(crc: u16, bytes: &[u8]) -> u16 {
    let [last, third, second, first] = &CHECKSUMS;
    let (words, rest) = bytes.as_chunks();
    let crc = words.iter().fold(crc, |crc, word| {
        let [a, b, c, d] = (u32::from(crc) ^ u32::from_le_bytes(*word)).to_le_bytes().map(usize::from);
        first[a] ^ second[b] ^ third[c] ^ last[d]
    });
    rest.iter().fold(crc, |crc, byte| crc_add(crc, *byte))
}

/// The seed that turns `before` into `checksum`, if there is one.
pub(crate) fn seed_for(before: u16, checksum: u16) -> Option<u8> {
    // The low byte of `before` only changes which seed it is; try what the high byte allows.
    (0..=u8::MAX).find(|&seed| crc_add(before, seed) == checksum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_bytes_a_step_do_what_each_does() {
        let bytes: Vec<u8> = (0..270_u32).map(|at| ((at * 97) >> 2) as u8).collect();
        for len in 0..bytes.len() {
            let each = bytes[..len].iter().fold(0xffff, |crc, byte| crc_add(crc, *byte));
            assert_eq!(crc_add_all(0xffff, &bytes[..len]), each, "{len}");
        }
    }

    #[test]
    fn frames_come_apart_and_together() {
        let heartbeat = [0xfe, 9, 0x4e, 1, 1, 0, 0, 0, 0, 0, 2, 3, 0x51, 4, 3, 0x1c, 0x7f];
        let mut frame = Frame::empty();
        frame.parse(&heartbeat).expect("a frame");
        assert_eq!(crc_add(frame.checksum_before_seed(), 50), frame.checksum);
        assert_eq!(seed_for(frame.checksum_before_seed(), frame.checksum), Some(50));
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
