//! Any recording's frames and times, in a file without a name. Any place is reached at once.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek, SeekFrom, Write};

use hums_core::clock::Instant;
use hums_link::Check;

/// Time, check, length.
const HEADER_BYTES: usize = 8 + 1 + 2;
/// The longest frame is 280 bytes.
const FRAME_MAX: usize = 512;

/// Takes frames.
#[derive(Debug)]
pub struct SpoolWriter {
    file: BufWriter<File>,
    offset: u64,
}

/// Reads the frames back.
#[derive(Debug)]
pub struct Spool {
    file: BufReader<File>,
    frame: Vec<u8>,
}

/// One frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SpooledFrame<'a> {
    /// When it came.
    pub at: Instant,
    /// Result of its checksum.
    pub check: Check,
    /// Its bytes.
    pub bytes: &'a [u8],
}

impl SpoolWriter {
    /// An empty one.
    pub fn new() -> io::Result<Self> {
        Ok(Self { file: BufWriter::new(tempfile::tempfile()?), offset: 0 })
    }

    /// Offset of the next frame.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// Takes a frame.
    pub fn push(&mut self, frame: SpooledFrame<'_>) -> io::Result<()> {
        let length = u16::try_from(frame.bytes.len()).map_err(|_| io::ErrorKind::InvalidInput)?;
        self.file.write_all(&frame.at.as_micros().to_le_bytes())?;
        self.file.write_all(&[u8::from(frame.check == Check::Verified)])?;
        self.file.write_all(&length.to_le_bytes())?;
        self.file.write_all(frame.bytes)?;
        self.offset += (HEADER_BYTES + frame.bytes.len()) as u64;
        Ok(())
    }

    /// All are there.
    pub fn finish(self) -> io::Result<Spool> {
        let file = self.file.into_inner().map_err(io::IntoInnerError::into_error)?;
        let mut spool = Spool { file: BufReader::with_capacity(64 * 1024, file), frame: Vec::new() };
        spool.seek(0)?;
        Ok(spool)
    }
}

impl Spool {
    /// Goes to an offset from [`SpoolWriter::offset`].
    pub fn seek(&mut self, offset: u64) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(offset)).map(|_| ())
    }

    /// The next frame if it came by `until`; otherwise it stays the next.
    pub fn next_until(&mut self, until: Instant) -> io::Result<Option<SpooledFrame<'_>>> {
        let mut header = [0; HEADER_BYTES];
        match self.file.read_exact(&mut header) {
            Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
            result => result?,
        }
        let [t0, t1, t2, t3, t4, t5, t6, t7, check, l0, l1] = header;
        let at = Instant::from_micros(u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]));
        if at > until {
            self.file.seek_relative(-(HEADER_BYTES as i64))?;
            return Ok(None);
        }
        let length = usize::from(u16::from_le_bytes([l0, l1])).min(FRAME_MAX);
        self.frame.resize(length, 0);
        self.file.read_exact(&mut self.frame)?;
        let check = if check == 1 { Check::Verified } else { Check::Unverified };
        Ok(Some(SpooledFrame { at, check, bytes: &self.frame }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_back_in_order_and_not_before_their_time() {
        let mut writer = SpoolWriter::new().expect("a file");
        let mut offsets = Vec::new();
        for number in 0..100_u8 {
            offsets.push(writer.offset());
            let bytes = vec![number; 10 + usize::from(number)];
            let at = Instant::from_millis(u64::from(number) * 10);
            writer.push(SpooledFrame { at, check: Check::Verified, bytes: &bytes }).expect("room");
        }
        let mut spool = writer.finish().expect("a file");
        let count = |spool: &mut Spool, until_ms| {
            let mut count = 0;
            while let Some(frame) = spool.next_until(Instant::from_millis(until_ms)).expect("a file") {
                assert!(frame.at <= Instant::from_millis(until_ms));
                count += 1;
            }
            count
        };
        assert_eq!([95, 95, 100, 5_000].map(|until| count(&mut spool, until)), [10, 0, 1, 89]);
        spool.seek(offsets[50]).expect("a file");
        let frame = spool.next_until(Instant::from_millis(500)).expect("a file").expect("a frame");
        assert_eq!((frame.bytes.len(), frame.bytes[0]), (60, 50));
    }
}
