//! Bytes back to back at a line rate.

use std::collections::VecDeque;
use std::io;

use super::stream::{Chunk, Source};

/// Start, eight data, stop.
const BITS_PER_BYTE: u64 = 10;

/// 0.35 ms at 921,600 baud: times stay within the millisecond.
const SLICE_BYTES: usize = 32;

/// The bytes of another source, paced.
pub struct PacedSource<S> {
    inner: S,
    baud: u64,
    waiting: VecDeque<u8>,
    sent: u64,
}

impl<S: Source> PacedSource<S> {
    /// Bytes with the times of a line at `baud` (at least 1).
    pub fn new(inner: S, baud: u32) -> Self {
        Self { inner, baud: u64::from(baud.max(1)), waiting: VecDeque::new(), sent: 0 }
    }
}

impl<S: Source> Source for PacedSource<S> {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        while self.waiting.len() < SLICE_BYTES {
            match self.inner.next()? {
                Some(chunk) => self.waiting.extend(chunk.bytes),
                None => break,
            }
        }
        if self.waiting.is_empty() {
            return Ok(None);
        }
        let bytes: Vec<u8> = self.waiting.drain(..self.waiting.len().min(SLICE_BYTES)).collect();
        self.sent += bytes.len() as u64;
        // 128 bits: a terabyte at 1 baud still has a time.
        let at_us = u128::from(self.sent) * u128::from(BITS_PER_BYTE * 1_000_000) / u128::from(self.baud);
        Ok(Some(Chunk { at_us: u64::try_from(at_us).unwrap_or(u64::MAX), bytes }))
    }

    fn remark(&self) -> Option<String> {
        self.inner.remark()
    }
}

#[cfg(test)]
mod tests {
    use super::super::raw::Raw;
    use super::*;

    #[test]
    fn ten_bits_a_byte() {
        let mut source = PacedSource::new(Raw::new(&[7u8; 11_520][..]), 115_200);
        let (mut bytes, mut last) = (0, 0);
        while let Some(chunk) = source.next().expect("memory") {
            assert!(chunk.at_us >= last, "time fell");
            last = chunk.at_us;
            bytes += chunk.bytes.len();
        }
        assert_eq!((bytes, last), (11_520, 1_000_000));
    }
}
