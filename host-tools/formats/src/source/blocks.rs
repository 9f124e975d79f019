//! Raw bytes that no line made: unwritten blocks, and remains of another file.

use hums_core::clock::Instant;

use super::item::Gap;
use crate::plural::count;

/// Bytes 0x00 or 0xff in a row: frames and lines are shorter (255 bytes of payload).
const BLOCK_BYTES: u64 = 512;
/// Bytes without a frame: 5 s at 115,200 baud are foreign data, not noise.
const FOREIGN_BYTES: u64 = 64 * 1024;

/// A number, with the first one's place.
#[derive(Clone, Copy, Debug, Default)]
struct Bytes {
    count: u64,
    first: Option<u64>,
}

impl Bytes {
    fn add(&mut self, place: u64, count: u64) {
        self.first.get_or_insert(place);
        self.count += count;
    }

    fn gap(self, at: Instant, what: &str) -> Option<Gap> {
        let words = format!("{what}: {}", count(self.count, "byte"));
        self.first.map(|place| Gap { bytes: self.count, ..Gap::damaged(at, place, words) })
    }
}

/// Finds parts that no line made.
#[derive(Debug, Default)]
pub struct BlockFinder {
    value: u8,
    length: u64,
    unwritten: Bytes,
    foreign: Bytes,
    /// Frames so far; start of bytes without a frame, and unwritten ones among them.
    frames: u64,
    since: u64,
    unwritten_since: u64,
    /// Bytes so far.
    pub place: u64,
}

impl BlockFinder {
    /// `frames`: so far.
    pub fn take(&mut self, bytes: &[u8], frames: u64) {
        if self.frames != frames {
            self.end();
            (self.frames, self.since, self.unwritten_since) = (frames, self.place, 0);
        }
        for &byte in bytes {
            self.place += 1;
            if byte != self.value || (byte != 0 && byte != 0xff) {
                (self.value, self.length) = (byte, 0);
            }
            self.length += 1;
            if matches!(byte, 0 | 0xff) && self.length >= BLOCK_BYTES {
                let new = if self.length == BLOCK_BYTES { BLOCK_BYTES } else { 1 };
                self.unwritten.add(self.place - BLOCK_BYTES, new);
                self.unwritten_since += new;
            }
        }
    }

    /// A frame follows.
    pub fn end(&mut self) {
        let count = (self.place - self.since).saturating_sub(self.unwritten_since);
        if count >= FOREIGN_BYTES {
            self.foreign.add(self.since, count);
        }
        self.since = self.place;
    }

    /// Number of these bytes.
    pub const fn bytes(&self) -> u64 {
        self.unwritten.count + self.foreign.count
    }

    /// The damage, once all has been taken.
    pub fn gaps(&self, at: Instant) -> impl Iterator<Item = Gap> {
        let unwritten = self.unwritten.gap(at, "of nothing but 0x00 or 0xff");
        unwritten.into_iter().chain(self.foreign.gap(at, "of something else than MAVLink"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `frames`: places.
    fn told(bytes: &[u8], frames: &[usize]) -> Vec<(Option<u64>, u64)> {
        let mut blocks = BlockFinder::default();
        for (at, chunk) in (0..).zip(bytes.chunks(32)) {
            blocks.take(chunk, frames.iter().filter(|frame| **frame <= at * 32).count() as u64);
        }
        blocks.end();
        blocks.gaps(Instant::ZERO).map(|gap| (gap.place, gap.bytes)).collect()
    }

    #[test]
    fn what_no_line_made_is_told() {
        let noise = |count: usize| (0..count).map(|at| (at % 251) as u8 + 1).collect::<Vec<u8>>();
        assert_eq!(told(&noise(60_000), &[]), []);
        assert_eq!(told(&noise(90_000), &[]), [(Some(0), 90_000)]);
        assert_eq!(told(&noise(90_016), &[45_024]), []);
        assert_eq!(told(&[vec![1; 64], vec![0; 600], vec![1; 64]].concat(), &[]), [(Some(64), 600)]);
        let both = [vec![0xff; 100_000], noise(70_000)].concat();
        assert_eq!(told(&both, &[]), [(Some(0), 100_000), (Some(0), 70_000)]);
    }
}
