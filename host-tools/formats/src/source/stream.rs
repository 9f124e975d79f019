//! Bytes with their times of arrival.

use std::io::{self, Read};

/// Bytes that arrive together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// The last byte's time, microseconds since the input's first; never falls.
    pub at_us: u64,
    /// Empty if only time passed (a silent live source).
    pub bytes: Vec<u8>,
}

/// A stream of chunks.
pub trait Source: Send {
    /// The next chunk; `None` at the end.
    fn next(&mut self) -> io::Result<Option<Chunk>>;

    /// Answers all calls that this one does not.
    fn inner(&self) -> Option<&dyn Source> {
        None
    }

    /// A chunk is a record (a tlog's frame).
    fn has_records(&self) -> bool {
        self.inner().is_some_and(Source::has_records)
    }

    /// Complete after the end.
    fn damages(&self) -> u64 {
        self.inner().map_or(0, Source::damages)
    }

    /// A remark on the input, once it has been read.
    fn remark(&self) -> Option<String> {
        self.inner()?.remark()
    }
}

/// Retries after an interruption; 0 at the end.
pub(super) fn read_some(input: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match input.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
}
