//! Recorded frames, without the code under test.

pub(crate) type Frame = (u64, Vec<u8>, bool);

/// CRC-16/MCRF4XX over the bytes and the seed.
pub(crate) fn checksum(bytes: &[u8], seed: u8) -> u16 {
    bytes.iter().chain([&seed]).fold(0xffff, |crc, &byte| {
        let mut x = byte ^ crc as u8;
        x ^= x << 4;
        let x = u16::from(x);
        (crc >> 8) ^ (x << 8) ^ (x << 3) ^ (x >> 4)
    })
}

pub(crate) fn checks(frame: &[u8]) -> bool {
    let (id, payload_at) = match *frame {
        [0xfe, _, _, _, _, id, ..] => (u32::from(id), 6),
        [0xfd, _, _, _, _, _, _, a, b, c, ..] => (u32::from_le_bytes([a, b, c, 0]), 10),
        _ => return false,
    };
    let end = payload_at + usize::from(frame[1]);
    let Some(&[low, high]) = frame.get(end..end + 2) else { return false };
    let found = u16::from_le_bytes([low, high]);
    hums_dialect::message(id).is_some_and(|message| found == checksum(&frame[1..end], message.crc_extra))
}

pub(crate) fn frame_len(bytes: &[u8]) -> Option<usize> {
    match *bytes {
        [0xfe, len, ..] => Some(usize::from(len) + 8),
        [0xfd, len, flags, ..] => Some(usize::from(len) + 12 + if flags & 1 == 1 { 13 } else { 0 }),
        _ => None,
    }
}

pub(crate) fn frames_of(tlog: &[u8]) -> Vec<Frame> {
    let (mut frames, mut rest, mut start, mut latest) = (Vec::new(), tlog, None, 0);
    while let Some((time, tail)) = rest.split_first_chunk::<8>() {
        let Some(len) = frame_len(tail) else { break };
        let Some((frame, tail)) = tail.split_at_checked(len) else { break };
        let time = u64::from_be_bytes(*time);
        let start = *start.get_or_insert(time);
        latest = time.saturating_sub(start).max(latest);
        frames.push((latest / 1_000, frame.to_vec(), checks(frame)));
        rest = tail;
    }
    frames
}
