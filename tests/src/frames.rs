//! MAVLink frames with minimal code. Seeds come from pymavlink: no line is shared with the framer under test.

use std::collections::BTreeMap;

const STX_V1: u8 = 0xFE;
const STX_V2: u8 = 0xFD;
const SIGNED: u8 = 0x01;

/// Checksum seeds by message id.
pub type Seeds = BTreeMap<u32, u8>;

/// One frame of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Microseconds since 1970, if known.
    pub time_us: Option<u64>,
    /// The message id.
    pub id: u32,
    /// The frame from start byte to checksum or signature.
    pub bytes: &'a [u8],
    /// Known id, valid checksum.
    pub verified: bool,
}

fn header(data: &[u8]) -> Option<(usize, u32)> {
    let (length, id) = match *data.first()? {
        STX_V1 => (8 + usize::from(*data.get(1)?), u32::from(*data.get(5)?)),
        STX_V2 => {
            let flags = *data.get(2)?;
            if flags & !SIGNED != 0 {
                return None;
            }
            let signature = if flags & SIGNED == 0 { 0 } else { 13 };
            let id = u32::from_le_bytes([*data.get(7)?, *data.get(8)?, *data.get(9)?, 0]);
            (12 + usize::from(data[1]) + signature, id)
        }
        _ => return None,
    };
    (length <= data.len()).then_some((length, id))
}

/// X.25, a byte a step.
pub fn checksum(covered: &[u8], seed: u8) -> u16 {
    let mut crc = 0xFFFF_u16;
    for byte in covered.iter().chain([&seed]) {
        let mixed = byte ^ crc as u8;
        let mixed = u16::from(mixed ^ mixed << 4);
        crc = crc >> 8 ^ mixed << 8 ^ mixed << 3 ^ mixed >> 4;
    }
    crc
}

fn verified(frame: &[u8], id: u32, seeds: &Seeds) -> bool {
    let Some(seed) = seeds.get(&id) else { return false };
    let end = if frame[0] == STX_V1 { 6 } else { 10 } + usize::from(frame[1]);
    checksum(&frame[1..end], *seed).to_le_bytes() == frame[end..end + 2]
}

/// Entries of a tlog, verified or not.
///
/// # Panics
/// With `strict`: other bytes are in it.
pub fn of_tlog<'a>(data: &'a [u8], seeds: &Seeds, strict: bool) -> Vec<Frame<'a>> {
    let mut frames = Vec::new();
    let mut at = 0;
    while at + 8 < data.len() {
        let Some((length, id)) = header(&data[at + 8..]) else {
            assert!(!strict, "no entry of a tlog at byte {at}");
            at += 1;
            continue;
        };
        let bytes = &data[at + 8..at + 8 + length];
        let time_us = u64::from_be_bytes(data[at..at + 8].try_into().unwrap());
        frames.push(Frame { time_us: Some(time_us), id, bytes, verified: verified(bytes, id, seeds) });
        at += 8 + length;
    }
    assert!(!strict || at == data.len(), "the tlog ends inside an entry");
    frames
}

/// Verified frames of a raw recording.
pub fn of_raw<'a>(data: &'a [u8], seeds: &Seeds) -> Vec<Frame<'a>> {
    let mut frames = Vec::new();
    let mut at = 0;
    while at < data.len() {
        match header(&data[at..]) {
            Some((length, id)) if verified(&data[at..at + length], id, seeds) => {
                frames.push(Frame { time_us: None, id, bytes: &data[at..at + length], verified: true });
                at += length;
            }
            _ => at += 1,
        }
    }
    frames
}

/// A v2 frame of an autopilot, with `seed`'s checksum.
pub fn build_v2(sequence: u8, id: u32, payload: &[u8], seed: u8) -> Vec<u8> {
    build_from((1, 1), sequence, id, payload, seed)
}

/// As [`build_v2`], of this system and component.
pub fn build_from((system, component): (u8, u8), sequence: u8, id: u32, payload: &[u8], seed: u8) -> Vec<u8> {
    let [low, middle, high, _] = id.to_le_bytes();
    let length = u8::try_from(payload.len()).unwrap();
    let mut frame = vec![STX_V2, length, 0, 0, sequence, system, component, low, middle, high];
    frame.extend_from_slice(payload);
    let checksum = checksum(&frame[1..], seed);
    frame.extend_from_slice(&checksum.to_le_bytes());
    frame
}

/// The same verified frames in order. Other bytes of `output` are bytes of `stream`, in order.
///
/// # Panics
///
/// At the first difference.
#[track_caller]
pub fn assert_same(expected: &[Frame<'_>], output: &[Frame<'_>], stream: &[u8]) {
    let expected: Vec<_> = expected.iter().filter(|frame| frame.verified).collect();
    let verified: Vec<_> = output.iter().filter(|frame| frame.verified).collect();
    for (index, (a, b)) in expected.iter().zip(&verified).enumerate() {
        assert_eq!(
            a.bytes,
            b.bytes,
            "frame {index} (of {}) differs; ids {} and {}",
            expected.len(),
            a.id,
            b.id
        );
    }
    assert_eq!(expected.len(), verified.len(), "number of verified frames");
    let mut at = 0;
    for frame in output.iter().filter(|frame| !frame.verified) {
        let found = stream[at..].windows(frame.bytes.len()).position(|window| window == frame.bytes);
        let Some(offset) = found else {
            panic!("a frame of id {} came out that never went in: {:02x?}", frame.id, frame.bytes);
        };
        at += offset + frame.bytes.len();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_the_published_one() {
        // CRC-16/MCRF4XX of "123456789" is 0x6F91; the last digit is the seed.
        assert_eq!(checksum(b"12345678", b'9'), 0x6F91);
    }

    #[test]
    fn a_damaged_frame_is_not_verified() {
        let seeds = Seeds::from([(0, 50)]);
        let mut data = build_v2(1, 0, &[1, 2, 3], 50);
        assert_eq!(of_raw(&data, &seeds).len(), 1);
        data[11] ^= 1;
        assert_eq!(of_raw(&data, &seeds).len(), 0);
    }

    #[test]
    #[should_panic(expected = "number of verified frames")]
    fn a_missing_frame_is_a_difference() {
        let data = build_v2(1, 0, &[1], 50);
        let frames = of_raw(&data, &Seeds::from([(0, 50)]));
        assert_same(&frames, &[], &data);
    }

    #[test]
    #[should_panic(expected = "never went in")]
    fn an_invented_frame_is_a_difference() {
        let data = build_v2(1, 0, &[1], 50);
        let invented = build_v2(1, 77_777, &[1], 0);
        let output = [Frame { time_us: None, id: 77_777, bytes: &invented, verified: false }];
        assert_same(&[], &output, &data);
    }
}
