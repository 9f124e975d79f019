//! The reader's side of a distribution on a PC: all places at once, without a branch.
//!
//! A processor cannot predict the symbols, so a branch on one is mispredicted about as often as the symbol is new.
//! Also a division and a search wait for each other. Both take most of the reading time.

use super::Cdf;

impl Cdf {
    /// The symbol at a place among parts of this width, with start and size; adapts.
    #[inline]
    pub(crate) fn read(&mut self, width: u16, offset: u32) -> (usize, u32, u32) {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: SSE2 is part of x86-64.
        unsafe {
            sse2::read([&mut self.0], width, offset)
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            let symbol = find(width, offset, |symbol| self.part_of(symbol));
            let (start, size) = self.part_of(symbol);
            self.adapt(symbol);
            (symbol, start, size)
        }
    }

    #[inline]
    pub(crate) fn read_between(&mut self, other: &mut Self, width: u16, offset: u32) -> (usize, u32, u32) {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: SSE2 is part of x86-64.
        unsafe {
            sse2::read([&mut self.0, &mut other.0], width, offset)
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            let symbol = find(width, offset, |symbol| self.part_between(other, symbol));
            let (start, size) = self.part_between(other, symbol);
            self.adapt(symbol);
            other.adapt(symbol);
            (symbol, start, size)
        }
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn find(width: u16, offset: u32, part_of: impl Fn(usize) -> (u32, u32)) -> usize {
    let part = (offset / u32::from(width)).min(u32::from(u16::MAX));
    let mut symbol = 0;
    for step in [8, 4, 2, 1] {
        symbol += if part_of(symbol + step).0 <= part { step } else { 0 };
    }
    symbol
}

#[cfg(target_arch = "x86_64")]
mod sse2 {
    use core::arch::x86_64::{
        __m128i, _mm_add_epi16, _mm_avg_epu16, _mm_cmpgt_epi32, _mm_cvtsi32_si128, _mm_loadu_si128,
        _mm_movemask_epi8, _mm_mulhi_epu16, _mm_mullo_epi16, _mm_packs_epi16, _mm_packs_epi32,
        _mm_set1_epi16, _mm_set1_epi32, _mm_srl_epi16, _mm_storeu_si128, _mm_sub_epi16, _mm_unpackhi_epi16,
        _mm_unpacklo_epi16, _mm_xor_si128,
    };

    use super::super::{PROBABILITY_BITS, SPEED_LAST, SPEEDS, SURE, SYMBOLS, USES, USES_MAX, gain};

    /// Ways to adapt, for the reader: by uses, and the last one for certain symbols, which changes nothing.
    const WAYS: usize = USES_MAX as usize + 2;
    const STAYS: usize = WAYS - 1;

    /// How far each way goes: `1 / 2^n` of it; for the last way nothing of 16 bits remains.
    static SHIFTS: [u8; WAYS] = shifts();

    const fn shifts() -> [u8; WAYS] {
        let mut shifts = [SPEED_LAST as u8; WAYS];
        let mut uses = 0;
        while uses < SPEEDS.len() {
            shifts[uses] = SPEEDS[uses];
            uses += 1;
        }
        shifts[STAYS] = u16::BITS as u8;
        shifts
    }

    static ALL_GAINS: [[[u16; SYMBOLS]; SYMBOLS]; WAYS] = all_gains();

    const fn all_gains() -> [[[u16; SYMBOLS]; SYMBOLS]; WAYS] {
        let mut gains = [[[0; SYMBOLS]; SYMBOLS]; WAYS];
        let shifts = shifts();
        let mut index = 0;
        while index < STAYS * SYMBOLS * SYMBOLS {
            let (rest, place) = (index / SYMBOLS, index % SYMBOLS);
            let (uses, symbol) = (rest / SYMBOLS, rest % SYMBOLS);
            gains[uses][symbol][place] = if place < USES {
                gain(place, symbol, shifts[uses] as u32)
            } else {
                // One more, and the loss in the step.
                (uses < USES_MAX as usize) as u16 + (uses as u16 >> shifts[uses])
            };
            index += 1;
        }
        gains
    }

    /// The symbol at a place among parts of this width, its start and its size, for one distribution or the mean of two. Adapts
    /// them.
    #[inline]
    #[target_feature(enable = "sse2")]
    pub(super) fn read<const N: usize>(
        mut all: [&mut [u16; SYMBOLS]; N],
        width: u16,
        offset: u32,
    ) -> (usize, u32, u32) {
        let (mut lower, mut upper) = halves(all[0]);
        if N > 1 {
            let other = halves(all[1]);
            (lower, upper) = (_mm_avg_epu16(lower, other.0), _mm_avg_epu16(upper, other.1));
        }
        // Numbers without a sign are compared as ones with a sign, all moved by as much.
        let moved = _mm_set1_epi32(i32::MIN);
        let offset = _mm_set1_epi32(offset as i32 ^ i32::MIN);
        let width = _mm_set1_epi16(width as i16);
        let beyond = |places| {
            let (low, high) = (_mm_mullo_epi16(places, width), _mm_mulhi_epu16(places, width));
            let one = _mm_xor_si128(_mm_unpacklo_epi16(low, high), moved);
            let other = _mm_xor_si128(_mm_unpackhi_epi16(low, high), moved);
            _mm_packs_epi32(_mm_cmpgt_epi32(one, offset), _mm_cmpgt_epi32(other, offset))
        };
        // The first one that begins beyond the place; the last one is the uses, and no symbol begins there.
        let beyond = _mm_movemask_epi8(_mm_packs_epi16(beyond(lower), beyond(upper))) as u32 | 1 << USES;
        let symbol = beyond.trailing_zeros() as usize % SYMBOLS;

        let place = |at: usize| {
            let sum: u32 = all.iter().map(|places| u32::from(places[at % SYMBOLS])).sum();
            sum.div_ceil(N as u32)
        };
        let end = if symbol == SYMBOLS - 1 { 1 << PROBABILITY_BITS } else { place(symbol) };
        let start = place(symbol.wrapping_sub(1)) & u32::from(symbol != 0).wrapping_neg();
        for places in &mut all {
            adapt(places, symbol);
        }
        (symbol, start, end - start)
    }

    #[inline]
    #[target_feature(enable = "sse2")]
    fn adapt(places: &mut [u16; SYMBOLS], symbol: usize) {
        let (lower, upper) = halves(places);
        let uses = usize::from(places[USES].min(USES_MAX));
        let sure = symbol == 0 && uses == usize::from(USES_MAX) && places[0] >= SURE;
        let way = if sure { STAYS } else { uses };
        let shift = _mm_cvtsi32_si128(i32::from(SHIFTS[way]));
        let gains = halves(&ALL_GAINS[way][symbol]);
        let adapted =
            |places, gains| _mm_add_epi16(_mm_sub_epi16(places, _mm_srl_epi16(places, shift)), gains);
        let (to_lower, to_upper) = places.split_at_mut(SYMBOLS / 2);
        // SAFETY: each is a half, of eight numbers: the 16 bytes that are written. Any alignment is allowed.
        unsafe {
            _mm_storeu_si128(to_lower.as_mut_ptr().cast(), adapted(lower, gains.0));
            _mm_storeu_si128(to_upper.as_mut_ptr().cast(), adapted(upper, gains.1));
        }
    }

    #[inline]
    #[target_feature(enable = "sse2")]
    fn halves(places: &[u16; SYMBOLS]) -> (__m128i, __m128i) {
        let (lower, upper) = places.split_at(SYMBOLS / 2);
        // SAFETY: each is a half, of eight numbers: the 16 bytes that are read. Any alignment is allowed.
        unsafe { (_mm_loadu_si128(lower.as_ptr().cast()), _mm_loadu_si128(upper.as_ptr().cast())) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::SYMBOLS;
    use super::*;

    #[test]
    fn what_is_read_is_the_symbol_that_owns_the_place_and_adapts_as_in_writing() {
        let (mut read, mut written) = (Cdf::FLAT, Cdf::FLAT);
        let mut state = 7_u32;
        for round in 0..20_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let symbol = match round % 1_000 {
                0..500 => 0,
                500..700 => 15,
                _ => (state >> 20) as usize % 16,
            };
            let (start, size) = written.part_of(symbol);
            let width = [1, 0x100, u16::MAX, (state >> 8) as u16 | 1][round % 4];
            let (first, last) = (start * u32::from(width), (start + size) * u32::from(width) - 1);
            let offset = [first, last][round / 4 % 2];
            assert_eq!(read.read(width, offset), (symbol, start, size), "round {round}");
            written.adapt(symbol);
            assert_eq!(read.0, written.0, "round {round}");
        }
    }

    #[test]
    fn between_two_distributions_what_is_read_is_what_was_written() {
        let [mut a, mut b, mut c, mut d] = [Cdf::FLAT; 4];
        let mut state = 7_u32;
        for round in 0..20_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let symbol = if round % 1_000 < 500 { 0 } else { (state >> 20) as usize % 16 };
            let (start, size) = a.part_between(&b, symbol);
            let width = [1, 0x100, u16::MAX, (state >> 8) as u16 | 1][round % 4];
            let (first, last) = (start * u32::from(width), (start + size) * u32::from(width) - 1);
            let offset = [first, last][round / 4 % 2];
            assert_eq!(c.read_between(&mut d, width, offset), (symbol, start, size), "round {round}");
            a.adapt(symbol);
            b.adapt(symbol);
            if round % 300 == 0 {
                (b, d) = (Cdf::FLAT, Cdf::FLAT);
            }
        }
    }

    #[test]
    fn what_lies_beyond_all_parts_is_the_last_symbol() {
        let mut cdf = Cdf::FLAT;
        for offset in [0xffff_ffff, 0x0001_0000] {
            assert_eq!(cdf.read(1, offset).0, SYMBOLS - 1);
        }
    }
}
