//! A contiguous window over the input, of bounded memory.

use std::io::{self, Read};

use super::super::stream::read_some;

/// Beyond the longest message (65,538 bytes), so that little is moved. First touches of pages cost a small
/// log more than its messages.
const READ_BYTES: usize = 128 * 1024;

pub(super) struct Window<R> {
    input: R,
    buffer: Vec<u8>,
    /// The rest's place in the buffer.
    at: usize,
    /// The rest's place in the input.
    place: u64,
    ended: bool,
    /// A damaged compressed stream, a failing disk.
    trouble: Option<io::Error>,
}

impl<R: Read> Window<R> {
    pub(super) fn new(input: R) -> Self {
        Self { input, buffer: Vec::new(), at: 0, place: 0, ended: false, trouble: None }
    }

    /// Bytes read and not yet consumed.
    pub(super) fn rest(&self) -> &[u8] {
        self.buffer.get(self.at..).unwrap_or_default()
    }

    pub(super) fn place(&self) -> u64 {
        self.place
    }

    pub(super) fn ended(&self) -> bool {
        self.ended
    }

    pub(super) fn take_trouble(&mut self) -> Option<io::Error> {
        self.trouble.take()
    }

    pub(super) fn fill(&mut self, bytes: usize) {
        if self.rest().len() >= bytes || self.ended {
            return;
        }
        // Each byte is moved once at most.
        if self.at >= self.rest().len() {
            self.buffer.drain(..self.at);
            self.at = 0;
        }
        while self.rest().len() < bytes && !self.ended {
            let old = self.buffer.len();
            self.buffer.resize(old + READ_BYTES, 0);
            let got = match read_some(&mut self.input, self.buffer.get_mut(old..).unwrap_or_default()) {
                Ok(got) => got,
                Err(error) => {
                    self.trouble = Some(error);
                    0
                }
            };
            self.buffer.truncate(old + got);
            self.ended = got == 0;
        }
    }

    /// Moves on.
    pub(super) fn consume(&mut self, bytes: usize) {
        let bytes = bytes.min(self.rest().len());
        self.at += bytes;
        self.place += bytes as u64;
    }
}
