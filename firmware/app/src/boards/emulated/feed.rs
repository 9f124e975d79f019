//! The feed: the arrival times of the input, read from a file or FIFO of the host.
//!
//! A record is 12 bytes, little endian: `u64` microseconds since power-on, `u32` count of bytes that arrive then.
//! The bytes themselves come through USART1, or through USART2 where the count's highest bit is set: then they are the
//! ground station's. A count of 0 only moves the clock, and one of [`POWER_OFF`] is the end of the power. Times that go
//! back count as now.

use semihosting::fs::File;
use semihosting::io::Read;

/// A count that is none: power goes at this time.
const POWER_OFF: u32 = u32::MAX;

const RECORD_BYTES: usize = 12;
/// Records read from the host at a time; a FIFO may give fewer.
const RECORDS_AT_A_TIME: usize = 64;

/// The bit of a count that says whose bytes they are.
const FROM_GS: u32 = 1 << 31;

/// One record of the feed.
#[derive(Clone, Copy)]
pub(crate) struct Arrival {
    /// When, in microseconds since power-on.
    pub(crate) time_us: u64,
    /// How many bytes.
    pub(crate) bytes: u32,
    /// They come from the ground station, not from the autopilot.
    pub(crate) from_gs: bool,
}

/// Reads the feed record by record.
pub(crate) struct Feed {
    file: File,
    buffer: [u8; RECORD_BYTES * RECORDS_AT_A_TIME],
    start: usize,
    end: usize,
    ended: bool,
}

impl Arrival {
    /// Whether it says that power goes.
    pub(crate) const fn is_power_off(&self) -> bool {
        self.from_gs && self.bytes == POWER_OFF & !FROM_GS
    }
}

impl Feed {
    pub(crate) fn new(file: File) -> Self {
        Self { file, buffer: [0; RECORD_BYTES * RECORDS_AT_A_TIME], start: 0, end: 0, ended: false }
    }

    /// The next record without taking it; blocks while a FIFO's writer has nothing to say. `None` at the end, which
    /// a read error and a truncated record are too.
    pub(crate) fn peek(&mut self) -> Option<Arrival> {
        while !self.ended && self.end - self.start < RECORD_BYTES {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
            match self.file.read(&mut self.buffer[self.end..]) {
                Ok(0) | Err(_) => self.ended = true,
                Ok(count) => self.end += count,
            }
        }
        let record = self.buffer.get(self.start..self.end)?.first_chunk::<RECORD_BYTES>()?;
        let [t0, t1, t2, t3, t4, t5, t6, t7, n0, n1, n2, n3] = *record;
        let count = u32::from_le_bytes([n0, n1, n2, n3]);
        Some(Arrival {
            time_us: u64::from_le_bytes([t0, t1, t2, t3, t4, t5, t6, t7]),
            bytes: count & !FROM_GS,
            from_gs: count & FROM_GS != 0,
        })
    }

    /// Leaves the record that `peek` showed behind.
    pub(crate) fn take(&mut self) {
        self.start = (self.start + RECORD_BYTES).min(self.end);
    }
}
