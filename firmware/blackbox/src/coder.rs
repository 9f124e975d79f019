//! The range coder: symbols with known probabilities become bytes, nearly at their entropy.
//!
//! Subbotin's carryless form: a byte that has been given out never changes, so it may lie in a sector that is already
//! on the card. All arithmetic is in 32 bits; writing needs no division.
//!
//! *State:* the interval `[low, low + range)` of 32-bit numbers that begin with what has not been given out yet.
//! After each step `range >= 2^16`, so a symbol may have a probability down to 2^-15.

/// A top byte is settled when both ends of the interval share it.
const TOP: u32 = 1 << 24;
/// Below this the interval is cut so that its top bytes settle.
const BOTTOM: u32 = 1 << 16;

/// Bytes that the decoder reads ahead of the symbol that it decodes.
pub(crate) const LOOKAHEAD: usize = 4;

/// Bytes that end a stream at most: enough to name one number within the interval, as `range >= 2^16`.
pub(crate) const FLUSH_MAX: usize = 2;

/// Where the encoder's bytes go for one entry.
pub(crate) struct Scratch<const N: usize> {
    bytes: [u8; N],
    len: usize,
}

impl<const N: usize> Scratch<N> {
    pub(crate) const fn new() -> Self {
        Self { bytes: [0; N], len: 0 }
    }

    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    /// The bytes, or `None` where there were more than it holds.
    pub(crate) fn bytes(&self) -> Option<&[u8]> {
        self.bytes.get(..self.len)
    }
}

impl<const N: usize> Scratch<N> {
    #[inline]
    fn push(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(self.len) {
            *place = byte;
        }
        self.len = self.len.saturating_add(1);
    }
}

/// The writing end's interval.
#[derive(Clone, Copy)]
pub(crate) struct Encoder {
    low: u32,
    range: u32,
}

impl Encoder {
    pub(crate) const fn new() -> Self {
        Self { low: 0, range: u32::MAX }
    }

    /// A symbol that takes `size` of `1 << bits` parts from part `start` on; `bits <= 15`, `size >= 1`.
    #[inline]
    pub(crate) fn put<const N: usize>(&mut self, start: u32, size: u32, bits: u32, out: &mut Scratch<N>) {
        let part = self.range >> bits;
        self.low = self.low.wrapping_add(part.wrapping_mul(start));
        self.range = part.wrapping_mul(size);
        while (self.low ^ self.low.wrapping_add(self.range)) < TOP || self.range < BOTTOM {
            if (self.low ^ self.low.wrapping_add(self.range)) >= TOP {
                self.range = self.low.wrapping_neg() & (BOTTOM - 1);
            }
            out.push((self.low >> 24) as u8);
            self.low <<= 8;
            self.range <<= 8;
        }
    }

    /// The fewest bytes that, followed by zeros, decode to all that was put so far; they leave the state as it is.
    pub(crate) fn flush(&self) -> ([u8; FLUSH_MAX], usize) {
        for len in 0..FLUSH_MAX {
            let mask = u32::MAX >> (8 * len);
            let value = self.low.wrapping_add(mask) & !mask;
            if value.wrapping_sub(self.low) < self.range {
                let bytes = value.to_be_bytes();
                return ([bytes[0], bytes[1]], len);
            }
        }
        let value = self.low.wrapping_add(BOTTOM - 1) & !(BOTTOM - 1);
        let bytes = value.to_be_bytes();
        ([bytes[0], bytes[1]], FLUSH_MAX)
    }
}

/// The reading end; it sees zeros after the last byte.
pub(crate) struct Decoder {
    low: u32,
    range: u32,
    code: u32,
    at: usize,
}

impl Decoder {
    /// Starts at byte `at` of the group's bytes. Needs `LOOKAHEAD` bytes, or the end of the stream.
    pub(crate) fn new(input: &[u8], at: usize) -> Self {
        let mut decoder = Self { low: 0, range: u32::MAX, code: 0, at };
        for _ in 0..LOOKAHEAD {
            decoder.code = decoder.code << 8 | decoder.byte(input);
        }
        decoder
    }

    #[inline]
    fn byte(&mut self, input: &[u8]) -> u32 {
        let byte = input.get(self.at).copied().unwrap_or(0);
        self.at = self.at.saturating_add(1);
        u32::from(byte)
    }

    /// Which of the `1 << bits` parts comes next. `take` must follow with the symbol that holds it.
    #[inline]
    pub(crate) fn part(&mut self, bits: u32) -> u32 {
        self.range >>= bits;
        (self.code.wrapping_sub(self.low) / self.range).min((1 << bits) - 1)
    }

    /// Removes the symbol that `part` found.
    #[inline]
    pub(crate) fn take(&mut self, start: u32, size: u32, input: &[u8]) {
        self.low = self.low.wrapping_add(self.range.wrapping_mul(start));
        self.range = self.range.wrapping_mul(size);
        while (self.low ^ self.low.wrapping_add(self.range)) < TOP || self.range < BOTTOM {
            if (self.low ^ self.low.wrapping_add(self.range)) >= TOP {
                self.range = self.low.wrapping_neg() & (BOTTOM - 1);
            }
            self.code = self.code << 8 | self.byte(input);
            self.low <<= 8;
            self.range <<= 8;
        }
    }

    /// Bytes read of the group's bytes so far, those ahead included.
    pub(crate) fn position(&self) -> usize {
        self.at
    }
}
