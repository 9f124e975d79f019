//! For both forms of a log.

use std::io::{self, Read};

use crate::source::stream::read_some;

/// First touches of pages cost a small log more than its messages.
const CHUNK_BYTES: usize = 64 * 1024;
/// Bytes beyond a small request: the rest is not moved for each chunk.
const MORE_BYTES: usize = 256 * 1024;

pub(super) struct Buffer<R> {
    input: R,
    bytes: Vec<u8>,
    /// Place of reading.
    at: usize,
    base: u64,
    ended: bool,
}

impl<R: Read> Buffer<R> {
    pub(super) fn new(input: R) -> Self {
        Self { input, bytes: Vec::new(), at: 0, base: 0, ended: false }
    }

    pub(super) fn window(&mut self, bytes: usize) -> io::Result<&[u8]> {
        self.fill(bytes)?;
        Ok(self.rest())
    }

    pub(super) fn place(&self) -> u64 {
        self.base + self.at as u64
    }

    pub(super) const fn ended(&self) -> bool {
        self.ended
    }

    pub(super) fn rest(&self) -> &[u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// Consumes them.
    pub(super) fn take(&mut self, bytes: usize) -> &[u8] {
        self.take_before(bytes).0
    }

    pub(super) fn take_before(&mut self, bytes: usize) -> (&[u8], &[u8]) {
        let start = self.at;
        self.at += bytes;
        (self.bytes.get(start..self.at).unwrap_or_default(), self.rest())
    }

    pub(super) fn fill(&mut self, wanted: usize) -> io::Result<()> {
        if self.ended || self.rest().len() >= wanted {
            return Ok(());
        }
        self.bytes.drain(..self.at);
        self.base += self.at as u64;
        self.at = 0;
        let goal = if wanted < MORE_BYTES { wanted + MORE_BYTES } else { wanted };
        while self.bytes.len() < goal && !self.ended {
            let old = self.bytes.len();
            self.bytes.resize(old + CHUNK_BYTES, 0);
            let got = read_some(&mut self.input, self.bytes.get_mut(old..).unwrap_or_default());
            self.bytes.truncate(old + *got.as_ref().unwrap_or(&0));
            self.ended = got? == 0;
        }
        Ok(())
    }

    /// Bytes of memory.
    #[cfg(test)]
    pub(super) fn capacity(&self) -> usize {
        self.bytes.capacity()
    }
}
