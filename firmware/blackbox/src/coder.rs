//! The range coder: symbols with known probabilities become bytes, nearly at their entropy.
//!
//! Subbotin's carryless form: an output byte never changes, so it may be in a sector on the card already. All
//! arithmetic is in 32 bits; writing needs no division.
//!
//! *State:* the interval `[low, low + range)` of 32-bit numbers that begin with the pending output. After each step
//! `range >= 2^16`, so a symbol may have a probability down to 2^-16.

use zerocopy::FromZeros;

use crate::distribution::{Cdf, PROBABILITY_BITS};

/// A top byte is settled when both ends of the interval share it.
const TOP: u32 = 1 << 24;
/// Below this the interval is cut so that its top bytes settle.
const BOTTOM: u32 = 1 << 16;

pub(crate) const LOOKAHEAD: usize = 4;

/// Bytes that end a stream at most: enough to name one number within the interval, as `range >= 2^16`.
pub(crate) const FLUSH_MAX: usize = 2;

/// The range with which the interval's top byte is settled, if it is: cut where the interval got too small without
/// that.
#[inline]
const fn cut(low: u32, range: u32) -> Option<u32> {
    if (low ^ low.wrapping_add(range)) < TOP {
        Some(range)
    } else if range < BOTTOM {
        Some(low.wrapping_neg() & (BOTTOM - 1))
    } else {
        None
    }
}

#[derive(FromZeros)]
pub(crate) struct Scratch<const N: usize> {
    bytes: [u8; N],
    len: usize,
}

impl<const N: usize> Scratch<N> {
    pub(crate) fn clear(&mut self) {
        self.len = 0;
    }

    pub(crate) fn first(&self) -> [u8; 8] {
        self.bytes.first_chunk().copied().unwrap_or_default()
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

#[derive(Clone, Copy, FromZeros)]
pub(crate) struct Encoder {
    low: u32,
    range: u32,
}

impl Encoder {
    pub(crate) const fn new() -> Self {
        Self { low: 0, range: u32::MAX }
    }

    /// A symbol that takes `size` of `1 << bits` parts from part `start` on; `bits <= 16`, `size >= 1`.
    #[inline]
    pub(crate) fn put<const N: usize>(&mut self, start: u32, size: u32, bits: u32, out: &mut Scratch<N>) {
        let part = self.range >> bits;
        self.low = self.low.wrapping_add(part.wrapping_mul(start));
        self.range = part.wrapping_mul(size);
        while let Some(range) = cut(self.low, self.range) {
            out.push((self.low >> 24) as u8);
            self.low <<= 8;
            self.range = range << 8;
        }
    }

    /// The fewest bytes that, followed by zeros, decode to everything so far; the state is unchanged.
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

/// Writer and reader run the same code over an end of the coder. The writer codes the given value; the reader ignores it and
/// returns the decoded one.
pub(crate) trait Coder {
    const WRITES: bool;

    /// A symbol below 16.
    fn symbol(&mut self, cdf: &mut Cdf, symbol: usize) -> usize;

    /// A symbol below 16, by the mean of two distributions.
    fn symbol_between(&mut self, one: &mut Cdf, other: &mut Cdf, symbol: usize) -> usize;

    /// A number of up to 16 bits, each as likely as any.
    fn bits16(&mut self, value: u32, bits: u32) -> u32;

    /// A bit that is one with probability `one` of 2^12, 1 to 4095.
    fn bit(&mut self, one: u32, bit: bool) -> bool;

    #[inline]
    fn bits(&mut self, value: u32, bits: u32) -> u32 {
        if bits <= 16 {
            return self.bits16(value, bits);
        }
        let low = self.bits16(value & 0xffff, 16);
        self.bits16(value >> 16, bits - 16) << 16 | low
    }
}

pub(crate) struct SymbolWriter<'a, const N: usize> {
    pub(crate) encoder: &'a mut Encoder,
    pub(crate) out: &'a mut Scratch<N>,
}

impl<const N: usize> Coder for SymbolWriter<'_, N> {
    const WRITES: bool = true;

    #[inline(never)]
    fn symbol(&mut self, cdf: &mut Cdf, symbol: usize) -> usize {
        let (start, size) = cdf.part_of(symbol);
        self.encoder.put(start, size, PROBABILITY_BITS, self.out);
        cdf.adapt(symbol);
        symbol
    }

    #[inline(never)]
    fn symbol_between(&mut self, one: &mut Cdf, other: &mut Cdf, symbol: usize) -> usize {
        let (start, size) = one.part_between(other, symbol);
        self.encoder.put(start, size, PROBABILITY_BITS, self.out);
        one.adapt(symbol);
        other.adapt(symbol);
        symbol
    }

    #[inline]
    fn bits16(&mut self, value: u32, bits: u32) -> u32 {
        if bits > 0 {
            self.encoder.put(value, 1, bits, self.out);
        }
        value
    }

    #[inline]
    fn bit(&mut self, one: u32, bit: bool) -> bool {
        let (start, size) = if bit { (0, one) } else { (one, 4_096 - one) };
        self.encoder.put(start, size, 12, self.out);
        bit
    }
}

pub(crate) struct SymbolReader<'a, R> {
    pub(crate) decoder: &'a mut Decoder,
    pub(crate) input: &'a [u8],
    pub(crate) recall: &'a mut R,
}

impl<R> Coder for SymbolReader<'_, R> {
    const WRITES: bool = false;

    #[expect(clippy::inline_always, reason = "the reader's hottest path: a call more costs a tenth of it")]
    #[inline(always)]
    fn symbol(&mut self, cdf: &mut Cdf, _: usize) -> usize {
        let (width, offset) = self.decoder.parts();
        let (symbol, start, size) = cdf.read(width, offset);
        self.decoder.take(start, size, self.input);
        symbol
    }

    #[expect(clippy::inline_always, reason = "as above")]
    #[inline(always)]
    fn symbol_between(&mut self, one: &mut Cdf, other: &mut Cdf, _: usize) -> usize {
        let (width, offset) = self.decoder.parts();
        let (symbol, start, size) = one.read_between(other, width, offset);
        self.decoder.take(start, size, self.input);
        symbol
    }

    #[inline]
    fn bits16(&mut self, _: u32, bits: u32) -> u32 {
        if bits == 0 {
            return 0;
        }
        let value = self.decoder.part(bits);
        self.decoder.take(value, 1, self.input);
        value
    }

    #[inline]
    fn bit(&mut self, one: u32, _: bool) -> bool {
        let bit = self.decoder.is_below(one, 12);
        let (start, size) = if bit { (0, one) } else { (one, 4_096 - one) };
        self.decoder.take(start, size, self.input);
        bit
    }
}

/// The reading end; it sees zeros after the last byte.
pub(crate) struct Decoder {
    low: u32,
    range: u32,
    offset: u32,
    at: usize,
}

impl Decoder {
    /// Starts at byte `at` of the group's bytes. Needs `LOOKAHEAD` bytes, or the end of the stream.
    pub(crate) fn new(input: &[u8], at: usize) -> Self {
        Self { low: 0, range: u32::MAX, offset: ahead(input, at), at: at.saturating_add(LOOKAHEAD) }
    }

    /// The next of the `1 << bits` parts. `take` must follow with the symbol that holds it.
    #[inline]
    pub(crate) fn part(&mut self, bits: u32) -> u32 {
        self.range >>= bits;
        (self.offset / self.range).min((1 << bits) - 1)
    }

    /// Whether the next value is among the first `parts` of the `1 << bits` parts: `part` without dividing.
    #[inline]
    pub(crate) fn is_below(&mut self, parts: u32, bits: u32) -> bool {
        self.range >>= bits;
        self.offset < self.range.wrapping_mul(parts)
    }

    /// The width of each of the `2^16` parts, and the offset of the next one in all of them. They are operands of
    /// `part`, for callers that need no division. `take` must follow.
    #[inline]
    pub(crate) fn parts(&mut self) -> (u16, u32) {
        self.range >>= PROBABILITY_BITS;
        (self.range as u16, self.offset)
    }

    #[inline]
    pub(crate) fn take(&mut self, start: u32, size: u32, input: &[u8]) {
        let below = self.range.wrapping_mul(start);
        self.low = self.low.wrapping_add(below);
        self.offset = self.offset.wrapping_sub(below);
        self.range = self.range.wrapping_mul(size);
        // All settled bytes are output together: their number is as unpredictable as the symbols.
        let settled = (self.low ^ self.low.wrapping_add(self.range)).leading_zeros() & 0x18;
        self.shift(settled, input);
        if self.range < BOTTOM {
            self.take_cut(input);
        }
    }

    #[cold]
    #[inline(never)]
    fn take_cut(&mut self, input: &[u8]) {
        while let Some(range) = cut(self.low, self.range) {
            self.range = range;
            self.shift(8, input);
        }
    }

    /// Goes on by 0 to 24 bits.
    #[inline]
    fn shift(&mut self, bits: u32, input: &[u8]) {
        let bits = bits & 31;
        let pair = u64::from(self.offset) << 32 | u64::from(ahead(input, self.at));
        self.offset = (pair << bits >> 32) as u32;
        self.low <<= bits;
        self.range <<= bits;
        self.at += bits as usize / 8;
    }

    /// Bytes read of the group, including those ahead.
    pub(crate) fn position(&self) -> usize {
        self.at
    }
}

#[inline]
fn ahead(input: &[u8], at: usize) -> u32 {
    match input.get(at..).and_then(|rest| rest.first_chunk()) {
        Some(bytes) => u32::from_be_bytes(*bytes),
        None => ahead_at_end(input, at),
    }
}

#[cold]
#[inline(never)]
fn ahead_at_end(input: &[u8], at: usize) -> u32 {
    let mut bytes = [0; LOOKAHEAD];
    for (place, byte) in bytes.iter_mut().zip(input.get(at..).unwrap_or_default()) {
        *place = *byte;
    }
    u32::from_be_bytes(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_put_comes_out_also_after_a_flush_anywhere() {
        for count in 0..400 {
            let (mut encoder, mut out) = (Encoder::new(), crate::zeros::<Scratch<2_048>>());
            let mut cdf = Cdf::FLAT;
            let value = |index: u32| index.wrapping_mul(2_654_435_761);
            let mut writing = SymbolWriter { encoder: &mut encoder, out: &mut out };
            for index in 0..count {
                writing.symbol(&mut cdf, (value(index) >> 28) as usize);
                let mask = ((1_u64 << (index % 33)) - 1) as u32;
                writing.bits(value(index) & mask, index % 33);
                writing.bit(16 + index % 4_000, index % 3 == 0);
            }
            let (end, len) = encoder.flush();
            let mut bytes = out.bytes().expect("fits").to_vec();
            bytes.extend_from_slice(&end[..len]);
            let mut cdf = Cdf::FLAT;
            let mut decoder = Decoder::new(&bytes, 0);
            let mut reading = SymbolReader { decoder: &mut decoder, input: &bytes, recall: &mut () };
            for index in 0..count {
                assert_eq!(reading.symbol(&mut cdf, 0), (value(index) >> 28) as usize);
                let bits = index % 33;
                let mask = ((1_u64 << bits) - 1) as u32;
                assert_eq!(reading.bits(0, bits) & mask, value(index) & mask);
                assert_eq!(reading.bit(16 + index % 4_000, false), index % 3 == 0);
            }
        }
    }

    #[test]
    fn a_flush_names_a_number_within_even_the_smallest_interval() {
        for low in [0, 1, 0xffff, 0x1234_0000, 0x1234_0001, 0x1234_ffff, 0x12ff_ffff, 0xfffe_ffff] {
            let encoder = Encoder { low, range: BOTTOM };
            let (end, len) = encoder.flush();
            let mut bytes = [0; 4];
            bytes[..len].copy_from_slice(&end[..len]);
            let named = u32::from_be_bytes(bytes);
            assert!(named.wrapping_sub(low) < BOTTOM, "{named:x} from {low:x} on");
        }
    }
}
