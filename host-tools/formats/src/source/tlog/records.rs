//! The records of a tlog.
//!
//! Bytes without a record are skipped, and handed on as noise.

use std::io::{self, Read};

use crate::mavlink::frame::{FRAME_BYTES_MAX, Peek, is_good, peek};
use crate::source::buffer::Buffer;
use crate::source::doubt::ASKED;

pub(in crate::source) const TIME_BYTES: usize = 8;
const NOISE_BYTES: usize = 64 * 1024;
const RECORD_BYTES: usize = 2 * (TIME_BYTES + FRAME_BYTES_MAX);
/// Records that confirm a time, behind damage as well.
const AHEAD_BYTES: usize = 256 * 1024;
/// Bytes without a record: the rest is not the log's.
const NOTHING_BYTES: usize = 64 * 1024;

/// Earlier times count from a power-on.
pub(in crate::source) const UTC_US_MIN: u64 = 946_684_800_000_000;
/// After the year 2255: damage. Small times count since boot.
const TIME_US_MAX: u64 = 9_000_000_000_000_000;

/// One record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Record {
    /// Microseconds (since 1970, if known), and a frame.
    Frame {
        /// The recorded time.
        time_us: u64,
        /// The frame.
        bytes: Vec<u8>,
    },
    /// Bytes that belong to no record.
    Noise(Vec<u8>),
}

/// The records of a tlog, in order.
pub struct Records<R> {
    buffer: Buffer<R>,
    /// Following bytes to keep.
    ahead_bytes: usize,
}

impl<R: Read> Records<R> {
    /// No further than necessary: another program may be writing it.
    pub fn new(input: R) -> Self {
        Self { buffer: Buffer::new(input), ahead_bytes: RECORD_BYTES }
    }

    pub(in crate::source) fn ahead(input: R) -> Self {
        Self { ahead_bytes: AHEAD_BYTES, ..Self::new(input) }
    }

    pub(in crate::source) fn times_after(&self) -> (Vec<u64>, bool) {
        let mut times = Vec::with_capacity(ASKED);
        let is_end = self.each_after(&mut |time_us, _| {
            times.push(time_us);
            times.len() < ASKED
        });
        (times, is_end)
    }

    pub(in crate::source) fn frames_after<T>(
        &self,
        mut told: impl FnMut(u64, &[u8]) -> Option<T>,
    ) -> Option<T> {
        let mut found = None;
        self.each_after(&mut |time_us, bytes| {
            found = told(time_us, bytes);
            found.is_none()
        });
        found
    }

    /// Until `each` returns `false`. Returns whether the recording ends there.
    pub(in crate::source) fn each_after(&self, each: &mut dyn FnMut(u64, &[u8]) -> bool) -> bool {
        let (mut rest, mut nothing) = (self.buffer.rest(), 0);
        while !rest.is_empty() {
            let Some((time_us, length)) = record_at(rest, self.buffer.ended()) else {
                rest = rest.get(1..).unwrap_or_default();
                nothing += 1;
                continue;
            };
            if !each(time_us, rest.get(TIME_BYTES..TIME_BYTES + length).unwrap_or_default()) {
                return false;
            }
            rest = rest.get(TIME_BYTES + length..).unwrap_or_default();
            nothing = 0;
        }
        self.buffer.ended() || nothing >= NOTHING_BYTES
    }

    /// The input ended with these last bytes, in a record.
    pub(in crate::source) fn is_cut(&self, noise: &[u8]) -> bool {
        let frame = noise.get(TIME_BYTES..).filter(|frame| !frame.is_empty());
        self.buffer.ended()
            && self.buffer.rest().is_empty()
            && noise.first() == Some(&0)
            && frame.is_none_or(|frame| matches!(peek(frame), Peek::Short))
    }

    /// `None` at the end.
    pub fn next_record(&mut self) -> io::Result<Option<Record>> {
        let mut noise = Vec::new();
        loop {
            self.buffer.try_fill(self.ahead_bytes)?;
            let rest = self.buffer.rest();
            let Some(first) = rest.first() else {
                return Ok((!noise.is_empty()).then_some(Record::Noise(noise)));
            };
            if let Some((time_us, length)) = record_at(rest, self.buffer.ended()) {
                if !noise.is_empty() {
                    return Ok(Some(Record::Noise(noise)));
                }
                let record = self.buffer.take(TIME_BYTES + length);
                let bytes = record.get(TIME_BYTES..).unwrap_or_default().to_vec();
                return Ok(Some(Record::Frame { time_us, bytes }));
            }
            noise.push(*first);
            self.buffer.take(1);
            if noise.len() >= NOISE_BYTES {
                return Ok(Some(Record::Noise(noise)));
            }
        }
    }
}

/// Time and frame length. With a wrong checksum the next record, or the end, must be at its place: another
/// definition. A frame around a whole record does not count: its length is damaged, or its end is missing.
fn record_at(bytes: &[u8], ended: bool) -> Option<(u64, usize)> {
    let time_us = u64::from_be_bytes(bytes.get(..TIME_BYTES)?.try_into().ok()?);
    if time_us > TIME_US_MAX {
        return None;
    }
    let Peek::Frame(frame) = peek(bytes.get(TIME_BYTES..)?) else { return None };
    let length = frame.bytes().len();
    let after = bytes.get(TIME_BYTES + length..).unwrap_or_default();
    let followed = match after.get(TIME_BYTES..) {
        None => ended && after.is_empty(),
        Some(next) => after.first() == Some(&0) && matches!(peek(next), Peek::Frame(_) | Peek::Short),
    };
    let counts = is_good(&frame) || followed && !has_record_in(frame.bytes());
    counts.then_some((time_us, length))
}

fn has_record_in(frame: &[u8]) -> bool {
    (1..frame.len()).any(|at| {
        let record = frame.get(at..).unwrap_or_default();
        record.first() == Some(&0)
            && record
                .get(TIME_BYTES..)
                .is_some_and(|inner| matches!(peek(inner), Peek::Frame(inner) if is_good(&inner)))
    })
}
