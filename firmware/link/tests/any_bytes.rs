//! The framer's fuzz checks (`fuzz/`) on some thousand repeatable inputs: noise with start bytes, changed frames.

#![allow(unreachable_pub, reason = "the files are those of another crate")]

#[path = "../../../fuzz/src/framer.rs"]
mod framer;

struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 >> 16
    }
}

/// Version 1, right checksum.
const HEARTBEAT: [u8; 17] = [0xfe, 9, 0x4e, 1, 1, 0, 0, 0, 0, 0, 2, 3, 0x51, 4, 3, 0x1c, 0x7f];

#[test]
fn every_byte_is_accounted_for_however_the_line_is_cut() {
    let mut random = Random(0x1357_9bdf_0246_8ace);
    for _ in 0..3_000 {
        let mut bytes = vec![random.next() as u8];
        for _ in 0..random.next() % 40 {
            match random.next() % 4 {
                0 => bytes.extend_from_slice(&HEARTBEAT),
                1 => bytes.push([0xfd, 0xfe][(random.next() % 2) as usize]),
                2 => bytes.extend_from_slice(&random.next().to_le_bytes()),
                _ => {
                    let at = (random.next() as usize) % bytes.len();
                    bytes[at] ^= 1 << (random.next() % 8);
                }
            }
        }
        framer::check(&bytes);
    }
}
