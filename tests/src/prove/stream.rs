//! A recording back to back at a line rate, repeated as needed.

use std::fs;
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::ops::Range;
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use hums::source::Chunk;

use crate::flights::Manifest;
use crate::frames;

/// 0.35 ms at 921,600 baud.
const SLICE: usize = 32;
/// Supported by the recorder, baud.
pub(super) const FULL_RATE: u64 = 921_600;

pub(super) struct Stream {
    pub(super) bytes: Vec<u8>,
    /// Places.
    pub(super) frames: Vec<Range<usize>>,
    /// Most frames.
    pub(super) is_signed: bool,
    baud: u64,
}

impl Stream {
    pub(super) fn of_flight(path: &Path, baud: u64) -> Result<Self> {
        let data = fs::read(path).with_context(|| path.display().to_string())?;
        let seeds = &Manifest::own().seeds;
        let is_tlog = path.extension().is_some_and(|kind| kind == "tlog");
        let found = if is_tlog { frames::of_tlog(&data, seeds, false) } else { frames::of_raw(&data, seeds) };
        let signed = found.iter().filter(|frame| frame.bytes[0] == 0xFD && frame.bytes[2] & 1 == 1);
        let is_signed = 2 * signed.count() > found.len();
        let (mut bytes, mut places) = (Vec::new(), Vec::new());
        for frame in found {
            let start = bytes.len();
            bytes.extend_from_slice(frame.bytes);
            places.push(start..bytes.len());
        }
        ensure!(!places.is_empty(), "{}: no frames", path.display());
        Ok(Self { bytes, frames: places, is_signed, baud })
    }

    /// Shorter recordings are repeated.
    pub(super) fn for_seconds(&self, seconds: f64) -> Self {
        let wanted = (seconds * self.baud as f64 / 10.0) as usize;
        let (mut bytes, mut places) = (Vec::with_capacity(wanted + 512), Vec::new());
        for frame in self.frames.iter().cycle() {
            if bytes.len() >= wanted {
                break;
            }
            let start = bytes.len();
            bytes.extend_from_slice(&self.bytes[frame.clone()]);
            places.push(start..bytes.len());
        }
        Self { bytes, frames: places, is_signed: self.is_signed, baud: self.baud }
    }

    /// All data, then data before arming, in turn.
    pub(super) fn flying_and_resting(&self, seconds: &[(f64, f64)]) -> Result<Self> {
        let armed = self.frames.iter().position(|frame| is_armed(&self.bytes[frame.clone()]));
        let armed =
            armed.filter(|armed| *armed > 0).context("it is never armed, or from the beginning on")?;
        let resting = Self { bytes: self.bytes.clone(), frames: self.frames[..armed].to_vec(), ..*self };
        let (mut bytes, mut frames) = (Vec::new(), Vec::new());
        for (flying, rest) in seconds {
            for part in [self.for_seconds(*flying), resting.for_seconds(*rest)] {
                let start = bytes.len();
                bytes.extend_from_slice(&part.bytes);
                frames.extend(part.frames.iter().map(|frame| start + frame.start..start + frame.end));
            }
        }
        Ok(Self { bytes, frames, is_signed: self.is_signed, baud: self.baud })
    }

    /// Seconds on the line.
    pub(super) fn seconds(&self) -> f64 {
        self.bytes.len() as f64 * 10.0 / self.baud as f64
    }

    pub(super) fn chunks(&self) -> impl Iterator<Item = Chunk> + '_ {
        let ends = (SLICE..self.bytes.len() + SLICE).step_by(SLICE).map(|end| end.min(self.bytes.len()));
        ends.scan(0, |start, end| {
            let bytes = self.bytes[*start..end].to_vec();
            *start = end;
            Some(Chunk { at_us: self.at_us(end), bytes })
        })
    }

    /// Microseconds since the first byte.
    pub(super) fn arrivals_us(&self) -> Vec<u64> {
        let slice_end = |end: usize| end.next_multiple_of(SLICE).min(self.bytes.len());
        self.frames.iter().map(|frame| self.at_us(slice_end(frame.end))).collect()
    }

    pub(super) fn hashes(&self) -> Vec<u64> {
        self.frames.iter().map(|frame| hash(&self.bytes[frame.clone()])).collect()
    }

    fn at_us(&self, end: usize) -> u64 {
        end as u64 * 10 * 1_000_000 / self.baud
    }
}

/// `MAV_MODE_FLAG_SAFETY_ARMED` in a heartbeat.
fn is_armed(frame: &[u8]) -> bool {
    let (id, mode) = match frame {
        [0xFE, ..] => (frame.get(5..6), frame.get(6 + 6)),
        _ => (frame.get(7..10), frame.get(10 + 6)),
    };
    id.is_some_and(|id| id.iter().all(|byte| *byte == 0)) && mode.is_some_and(|mode| mode & 0x80 != 0)
}

pub(super) fn hash(bytes: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    bytes.hash(&mut hasher);
    hasher.finish()
}
