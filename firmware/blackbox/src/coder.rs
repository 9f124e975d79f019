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

    /// A symbol that takes `size` of `1 << bits` parts from part `start` on; `bits <= 16`, `size >= 1`.
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

/// Bits of a probability.
const PROBABILITY_BITS: u32 = 15;

/// A distribution over 16 symbols that adapts to those it codes: quickly at first, then ever more slowly.
///
/// Place `i` (1 to 15) holds the probability, of 2^15, that the symbol is less than `i`; place 0 how often it was
/// used, as far as the speed of adaptation depends on it. Two places share a word, the even one in the lower half, so
/// that both adapt in one step: most of the writer's time goes here.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cdf([u32; 8]);

/// How often a distribution is used until it adapts no more slowly.
const USES_MAX: u32 = 20;

/// The speed of adaptation by uses: a step goes `1 / 2^n` of the way.
const SPEEDS: [u8; USES_MAX as usize + 1] = [1, 2, 2, 3, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 5];

/// Where the places go when a symbol was coded: those above it to one, the others to nothing.
static TARGETS: [[u32; 8]; 16] = targets();

const fn targets() -> [[u32; 8]; 16] {
    let mut targets = [[0; 8]; 16];
    let mut symbol = 0;
    while symbol < 16 {
        let mut place = symbol + 1;
        while place < 16 {
            targets[symbol][place / 2] |= 0x7fff << (16 * (place % 2));
            place += 1;
        }
        symbol += 1;
    }
    targets
}

impl Cdf {
    /// All symbols alike.
    pub(crate) const FLAT: Self = Self::from_sizes([1; 16]);

    /// From the symbols' relative sizes.
    pub(crate) const fn from_sizes(sizes: [u16; 16]) -> Self {
        let mut total = 0_u32;
        let mut index = 0;
        while index < 16 {
            total += sizes[index] as u32;
            index += 1;
        }
        let mut words = [0; 8];
        let mut below = 0_u32;
        index = 1;
        while index < 16 {
            below += sizes[index - 1] as u32;
            words[index / 2] |= ((below * 32_767) / total) << (16 * (index % 2));
            index += 1;
        }
        Self(words)
    }

    /// The same distribution, ready to adapt quickly.
    pub(crate) fn renewed(mut self) -> Self {
        let uses = self.0[0] & 0xffff;
        self.0[0] = self.0[0] & 0xffff_0000 | uses.min(RENEWED);
        self
    }

    /// Where symbol `index` (below 16) begins, of 2^15: no symbol is smaller than 8, whatever was learned.
    #[inline]
    fn start(&self, index: usize) -> u32 {
        if index == 0 {
            return 0;
        }
        let place = (self.0[(index / 2) & 7] >> (16 * (index & 1))) & 0x7fff;
        place - (place >> 8) + 8 * index as u32
    }

    #[inline]
    fn end(&self, symbol: usize) -> u32 {
        if symbol >= 15 { 1 << PROBABILITY_BITS } else { self.start(symbol + 1) }
    }

    /// The symbol that holds this part.
    #[inline]
    fn symbol_at(&self, part: u32) -> usize {
        let mut symbol = 0;
        for step in [8, 4, 2, 1] {
            symbol += if self.start(symbol + step) <= part { step } else { 0 };
        }
        symbol
    }

    /// Moves towards a symbol.
    #[inline]
    pub(crate) fn adapt(&mut self, symbol: usize) {
        let uses = (self.0[0] & 0xffff).min(USES_MAX);
        let speed = u32::from(SPEEDS[uses as usize]);
        if symbol == 0 && uses == USES_MAX && (0x7fff - (self.0[0] >> 16)) >> speed == 0 {
            // As sure of it as it gets: no step would move a place.
            return;
        }
        let mask = (0x7fff >> speed) * 0x0001_0001;
        for (word, target) in self.0.iter_mut().zip(&TARGETS[symbol & 15]) {
            // The distance that is left, in both halves; a step takes its part of it.
            let distance = *word ^ target;
            *word = target ^ (distance - (distance >> speed & mask));
        }
        self.0[0] = self.0[0] & 0xffff_0000 | (uses + 1).min(USES_MAX);
    }
}

/// Uses that a distribution made from another one counts at most.
const RENEWED: u32 = 2;

/// The speed of adaptation of a cell by uses, of 2^16: about `1 / (uses + 2)`.
const RATES: [i16; 16] = rates();

const fn rates() -> [i16; 16] {
    let mut rates = [0; 16];
    let mut uses = 0;
    while uses < rates.len() {
        rates[uses] = (65_535 / (uses as u32 + 2)) as i16;
        uses += 1;
    }
    rates
}

/// A binary probability that adapts likewise: bits 4..=15 that the bit is one, bits 0..=3 the uses.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell(u16);

impl Cell {
    pub(crate) const EVEN: Self = Self(0x8000);

    /// Uses so far, up to 15.
    pub(crate) const fn uses(self) -> u32 {
        self.0 as u32 & 15
    }

    /// The probability of a one, of 2^12.
    pub(crate) const fn one(self) -> u32 {
        self.0 as u32 >> 4
    }

    pub(crate) fn adapt(&mut self, bit: bool) {
        let uses = self.uses();
        let rate = i32::from(RATES[uses as usize]);
        let one = self.one() as i32;
        let target = if bit { 4_095 } else { 0 };
        let one = (one + (((target - one) * rate) >> 16)) as u32;
        self.0 = (one << 4 | (uses + 1).min(15)) as u16;
    }
}

/// One end of the coder. Writer and reader run the same code over it: what is given is written by the one and made
/// up by the other, which gives back what it read.
pub(crate) trait Coder {
    /// Whether what is given counts.
    const WRITES: bool;

    /// A symbol below 16.
    fn symbol(&mut self, cdf: &mut Cdf, symbol: usize) -> usize;

    /// A number of up to 16 bits, each as likely as any.
    fn bits16(&mut self, value: u32, bits: u32) -> u32;

    /// A bit that is one with probability `one` of 2^12, 1 to 4095.
    fn bit(&mut self, one: u32, bit: bool) -> bool;

    /// A number of up to 32 bits, each as likely as any.
    #[inline]
    fn bits(&mut self, value: u32, bits: u32) -> u32 {
        if bits <= 16 {
            return self.bits16(value, bits);
        }
        let low = self.bits16(value & 0xffff, 16);
        self.bits16(value >> 16, bits - 16) << 16 | low
    }
}

/// The writing end of the coder.
pub(crate) struct Writing<'a, const N: usize> {
    pub(crate) encoder: &'a mut Encoder,
    pub(crate) out: &'a mut Scratch<N>,
}

impl<const N: usize> Coder for Writing<'_, N> {
    const WRITES: bool = true;

    #[inline]
    fn symbol(&mut self, cdf: &mut Cdf, symbol: usize) -> usize {
        let symbol = symbol & 15;
        let start = cdf.start(symbol);
        self.encoder.put(start, cdf.end(symbol) - start, PROBABILITY_BITS, self.out);
        cdf.adapt(symbol);
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

/// The reading end of the coder.
pub(crate) struct Reading<'a> {
    pub(crate) decoder: &'a mut Decoder,
    pub(crate) input: &'a [u8],
}

impl Coder for Reading<'_> {
    const WRITES: bool = false;

    #[inline]
    fn symbol(&mut self, cdf: &mut Cdf, _: usize) -> usize {
        let symbol = cdf.symbol_at(self.decoder.part(PROBABILITY_BITS));
        let start = cdf.start(symbol);
        self.decoder.take(start, cdf.end(symbol) - start, self.input);
        cdf.adapt(symbol);
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
        let bit = self.decoder.part(12) < one;
        let (start, size) = if bit { (0, one) } else { (one, 4_096 - one) };
        self.decoder.take(start, size, self.input);
        bit
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
