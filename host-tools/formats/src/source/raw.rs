//! Raw bytes without times, to be paced ([`super::paced`]).

use std::io::{self, Read};

use super::stream::{Chunk, Source, read_some};

const CHUNK_BYTES: usize = 4096;

/// All at time zero.
pub struct Raw<R> {
    input: R,
}

impl<R: Read> Raw<R> {
    /// The bytes of `input`.
    pub fn new(input: R) -> Self {
        Self { input }
    }
}

impl<R: Read + Send> Source for Raw<R> {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        let mut bytes = vec![0; CHUNK_BYTES];
        let got = read_some(&mut self.input, &mut bytes)?;
        bytes.truncate(got);
        Ok((got > 0).then_some(Chunk { at_us: 0, bytes }))
    }
}
