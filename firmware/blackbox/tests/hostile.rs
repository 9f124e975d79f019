//! The fuzz targets' checks (`fuzz/`) on some thousand repeatable inputs: noise, and a log changed, moved, cut and
//! doubled.

#![allow(unreachable_pub, reason = "the files are those of another crate")]

#[path = "../../../fuzz/src/decoder.rs"]
mod decoder;
#[path = "../../../fuzz/src/reader.rs"]
mod reader;
#[path = "../../../fuzz/src/round_trip.rs"]
mod round_trip;

use crate::common;

use common::Random;
use hums_blackbox::{GROUP_SECTORS, SECTOR_BYTES};

impl Random {
    fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| (self.next() >> 24) as u8).collect()
    }

    fn damaged(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        for _ in 0..=self.below(8) {
            let (at, len) = (self.below(bytes.len()), self.below(64));
            let end = (at + len).min(bytes.len());
            match self.below(6) {
                0 => bytes.truncate(at),
                1 => drop(bytes.drain(at..end)),
                2 => {
                    let doubled = bytes[at..end].to_vec();
                    bytes.splice(at..at, doubled);
                }
                3 => bytes[at..end].fill(0),
                _ => {
                    if let Some(byte) = bytes.get_mut(at) {
                        *byte ^= 1 << self.below(8);
                    }
                }
            }
        }
        bytes
    }
}

fn golden() -> Vec<u8> {
    std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden/mixed-3.log")).expect("the golden file")
}

fn stream() -> Vec<u8> {
    let log = golden();
    let blocks = log.as_chunks::<SECTOR_BYTES>().0.iter().take(GROUP_SECTORS);
    let bodies = blocks.flat_map(|block| {
        let len = usize::from(u16::from_le_bytes([block[3], block[4]]) & 0x1ff);
        block[19..19 + len].to_vec()
    });
    bodies.skip(26).collect()
}

#[test]
fn the_decoder_bears_any_stream() {
    let mut random = Random(0x1234_5678_9abc_def1);
    let stream = stream();
    for round in 0..1_500 {
        let entries = (round % 300) as u16;
        let body = if round % 3 == 0 {
            let len = random.below(3_000);
            random.bytes(len)
        } else {
            let len = random.below(6_000);
            random.damaged(&stream[..len])
        };
        decoder::check(&[&entries.to_le_bytes(), &body[..]].concat());
    }
}

#[test]
fn the_reader_bears_any_file() {
    let mut random = Random(0x0bad_cafe_1234_5679);
    let log = golden();
    for round in 0..800_u32 {
        let first = random.below(log.len() / SECTOR_BYTES) * SECTOR_BYTES;
        let len = (random.below(40) * SECTOR_BYTES).min(log.len() - first);
        let mut file = random.damaged(&log[first..first + len]);
        if round % 4 == 0 {
            let (a, b) = (random.below(len / SECTOR_BYTES), random.below(len / SECTOR_BYTES));
            for at in 0..SECTOR_BYTES {
                let (a, b) = (a * SECTOR_BYTES + at, b * SECTOR_BYTES + at);
                if a.max(b) < file.len() {
                    file.swap(a, b);
                }
            }
        }
        reader::check(&[&[round as u8], &file[..]].concat());
    }
}

#[test]
fn any_pieces_come_back() {
    let mut random = Random(0xfeed_f00d_dead_beef);
    for _ in 0..1_500 {
        let len = random.below(4_000);
        round_trip::check(&random.bytes(len));
    }
}
