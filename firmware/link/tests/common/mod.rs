//! Recordings, read without the code under test.
#![allow(dead_code, missing_docs, unreachable_pub, reason = "each test file uses its own part of this")]

use std::path::{Path, PathBuf};

/// Excerpts that live beside the tests.
pub fn excerpt(name: &str) -> Recording {
    Recording::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name))
}

/// A flight in the folder of `HUMS_FLIGHTS`, or in the repository; `None` in neither.
pub fn flight(name: &str) -> Option<Recording> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/flights");
    let folders = std::env::var_os("HUMS_FLIGHTS").map(PathBuf::from).into_iter().chain([repository]);
    let mut paths = folders.flat_map(|root| ["own", "public", "."].map(|sub| root.join(sub).join(name)));
    Some(Recording::read(&paths.find(|path| path.exists())?))
}

/// The bytes, with a tlog's frames: beginning and time.
pub struct Recording {
    pub bytes: Vec<u8>,
    /// Start, length, microseconds since 1970; empty for a raw recording.
    pub frames: Vec<(usize, usize, u64)>,
}

impl Recording {
    fn read(path: &Path) -> Self {
        let file = std::fs::read(path).expect("readable");
        if path.extension().is_some_and(|extension| extension == "raw") {
            return Self { bytes: file, frames: Vec::new() };
        }
        let mut bytes = Vec::new();
        let mut frames = Vec::new();
        let mut rest = &file[..];
        while rest.len() > 11 {
            let micros = u64::from_be_bytes(rest[..8].try_into().expect("8 bytes"));
            let head = &rest[8..];
            let len = match head[0] {
                0xfe => 8 + head[1] as usize,
                0xfd => 12 + head[1] as usize + if head[2] & 1 == 1 { 13 } else { 0 },
                other => panic!("{}: no frame begins with {other:#x}", path.display()),
            };
            if head.len() < len {
                break;
            }
            frames.push((bytes.len(), len, micros));
            bytes.extend_from_slice(&head[..len]);
            rest = &head[len..];
        }
        Self { bytes, frames }
    }
}

/// CRC-32 as zlib computes it, bit by bit.
pub fn crc32(mut crc: u32, bytes: &[u8]) -> u32 {
    crc = !crc;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg());
        }
    }
    !crc
}

/// Splitmix64.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, bound: u64) -> u64 {
        self.next() % bound
    }
}
