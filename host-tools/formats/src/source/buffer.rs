//! The bytes of a log that were read and not yet taken, in bounded memory.

use std::io::{self, Read};

use super::stream::read_some;

/// First touches of pages cost a small log more than its messages.
const CHUNK_BYTES: usize = 64 * 1024;

pub(super) struct Buffer<R> {
    input: R,
    bytes: Vec<u8>,
    /// The rest's place in the bytes, and theirs in the input.
    at: usize,
    base: u64,
    ended: bool,
    /// A damaged compressed stream, a failing disk: the end.
    trouble: Option<io::Error>,
}

impl<R: Read> Buffer<R> {
    pub(super) const fn new(input: R) -> Self {
        Self { input, bytes: Vec::new(), at: 0, base: 0, ended: false, trouble: None }
    }

    /// Reads until the rest has these bytes, if the input has them.
    pub(super) fn fill(&mut self, wanted: usize) {
        if self.ended || self.rest().len() >= wanted {
            return;
        }
        // Each byte is moved once at most.
        if self.at >= self.rest().len() {
            self.bytes.drain(..self.at);
            self.base += self.at as u64;
            self.at = 0;
        }
        while self.rest().len() < wanted && !self.ended {
            let old = self.bytes.len();
            self.bytes.resize(old + CHUNK_BYTES, 0);
            let got = read_some(&mut self.input, self.bytes.get_mut(old..).unwrap_or_default());
            let got = got.unwrap_or_else(|error| {
                self.trouble = Some(error);
                0
            });
            self.bytes.truncate(old + got);
            self.ended = got == 0;
        }
    }

    /// As [`Self::fill`]; trouble comes first.
    pub(super) fn try_fill(&mut self, wanted: usize) -> io::Result<()> {
        self.fill(wanted);
        self.take_trouble().map_or(Ok(()), Err)
    }

    pub(super) const fn take_trouble(&mut self) -> Option<io::Error> {
        self.trouble.take()
    }

    /// Bytes read and not yet taken.
    pub(super) fn rest(&self) -> &[u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }

    /// The rest's place in the input.
    pub(super) const fn place(&self) -> u64 {
        self.base + self.at as u64
    }

    /// The rest is the last.
    pub(super) const fn ended(&self) -> bool {
        self.ended
    }

    pub(super) fn take(&mut self, bytes: usize) -> &[u8] {
        self.take_before(bytes).0
    }

    /// The bytes, and the rest after them.
    pub(super) fn take_before(&mut self, bytes: usize) -> (&[u8], &[u8]) {
        let start = self.at;
        self.at = self.bytes.len().min(start + bytes);
        (self.bytes.get(start..self.at).unwrap_or_default(), self.rest())
    }

    /// Bytes of memory.
    #[cfg(test)]
    pub(super) fn capacity(&self) -> usize {
        self.bytes.capacity()
    }
}
