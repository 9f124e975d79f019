//! A stream of bytes with the times at which they arrive.

use std::io::{self, Read};

/// Bytes that arrive together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// When the last of them is there, in microseconds since the first byte of the input; never falls.
    pub at_us: u64,
    /// The bytes; empty if only time passed (a silent live source).
    pub bytes: Vec<u8>,
}

/// A stream of chunks.
pub trait Source: Send {
    /// The next chunk; `None` at the end.
    fn next(&mut self) -> io::Result<Option<Chunk>>;

    /// The source of its chunks: it answers all calls that this one does not.
    fn inner(&self) -> Option<&dyn Source> {
        None
    }

    /// UTC at the first byte, microseconds since 1970, if the input has it (known after the first chunk).
    fn utc_start_us(&self) -> Option<u64> {
        self.inner()?.utc_start_us()
    }

    /// Whether each chunk is a record of its own (a frame of a tlog), not just some bytes of a stream.
    fn has_records(&self) -> bool {
        self.inner().is_some_and(Source::has_records)
    }

    /// Whether another recording begins with the chunk that was handed on last: it was joined on.
    fn begins_another(&self) -> bool {
        self.inner().is_some_and(Source::begins_another)
    }

    /// Number of damaged places in the input so far; complete after its end.
    fn damages(&self) -> u64 {
        self.inner().map_or(0, Source::damages)
    }

    /// A remark about the input, once it has been read.
    fn remark(&self) -> Option<String> {
        self.inner()?.remark()
    }
}

/// Reads the available bytes, again after an interrupted call; 0 at the end.
pub(super) fn read_some(input: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match input.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            result => return result,
        }
    }
}
