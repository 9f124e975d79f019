//! Adaptive probabilities of the coder: distributions over 16 symbols, and cells for single bits.

mod at_once;

use zerocopy::FromZeros;

pub(crate) const SYMBOLS: usize = 16;

pub(crate) const PROBABILITY_BITS: u32 = 16;

/// A distribution over 16 symbols that adapts to those it codes: quickly at first, then ever more slowly.
///
/// Place `i` (0 to 14) is the beginning of symbol `i + 1`, of 2^16. Place 15 counts the uses of the distribution, as
/// far as the speed of adaptation depends on it. Two places are adapted in one step, as the halves of a word: most of
/// the writer's time goes here.
#[derive(Clone, Copy, Debug, FromZeros)]
#[repr(align(4))]
pub(crate) struct Cdf([u16; SYMBOLS]);

const USES: usize = SYMBOLS - 1;

/// How often a distribution is used until it adapts no more slowly.
const USES_MAX: u16 = 20;

/// Uses that a distribution made from another one counts at most.
const USES_RENEWED: u16 = 2;

/// The speed of adaptation by uses: a step goes `1 / 2^n` of the way.
const SPEEDS: [u8; USES_MAX as usize] = [1, 2, 2, 3, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4, 4];

/// The speed after that. The number of uses, in its place, is less than 2 to this power, and so is unchanged by a
/// step.
const SPEED_LAST: u32 = 5;
const _: () = assert!(USES_MAX >> SPEED_LAST == 0);

const SURE: u16 = 0xf800;

/// The gains of places in a step towards a symbol, two places in a word.
type Gains = [u32; SYMBOLS / 2];

/// Gains by speed (from 1 on) and symbol.
static GAINS: [[Gains; SYMBOLS]; SPEED_LAST as usize] = gains();

/// Gain of the places above the symbol, beside every place's gain.
const fn reach(speed: u32) -> u16 {
    (u16::MAX >> speed) - SYMBOLS as u16
}

/// The gain of a place in a step. All gain a little, ever more, so that each symbol keeps a share; those above the
/// symbol gain the step.
const fn gain(place: usize, symbol: usize, speed: u32) -> u16 {
    place as u16 + 1 + if place >= symbol { reach(speed) } else { 0 }
}

const fn gains() -> [[Gains; SYMBOLS]; SPEED_LAST as usize] {
    let mut gains = [[[0; SYMBOLS / 2]; SYMBOLS]; SPEED_LAST as usize];
    let mut index = 0;
    while index < SPEED_LAST as usize * SYMBOLS * USES {
        let (rest, place) = (index / USES, index % USES);
        let (speed, symbol) = (rest / SYMBOLS, rest % SYMBOLS);
        gains[speed][symbol][place / 2] |=
            (gain(place, symbol, speed as u32 + 1) as u32) << (16 * (place % 2));
        index += 1;
    }
    gains
}

impl Cdf {
    /// All symbols alike.
    pub(crate) const FLAT: Self = Self::from_sizes([1; SYMBOLS]);

    pub(crate) const fn from_sizes(sizes: [u16; SYMBOLS]) -> Self {
        let mut total = 0_u32;
        let mut index = 0;
        while index < SYMBOLS {
            total += sizes[index] as u32;
            index += 1;
        }
        let mut places = [0; SYMBOLS];
        let mut below = 0_u32;
        index = 0;
        while index < USES {
            below += sizes[index] as u32;
            places[index] = (below * 65_535 / total) as u16;
            index += 1;
        }
        Self(places)
    }

    pub(crate) fn renewed(mut self) -> Self {
        self.0[USES] = self.0[USES].min(USES_RENEWED);
        self
    }

    /// Start and size of a symbol (modulo 16), of 2^16.
    #[inline]
    pub(crate) fn part_of(&self, symbol: usize) -> (u32, u32) {
        let symbol = symbol % SYMBOLS;
        let end = if symbol == SYMBOLS - 1 { 1 << PROBABILITY_BITS } else { u32::from(self.0[symbol]) };
        let start = if symbol == 0 { 0 } else { u32::from(self.0[symbol - 1]) };
        (start, end - start)
    }

    #[inline]
    pub(crate) fn part_between(&self, other: &Self, symbol: usize) -> (u32, u32) {
        let ((one, size), (two, other)) = (self.part_of(symbol), other.part_of(symbol));
        let start = (one + two).div_ceil(2);
        (start, (one + size + two + other).div_ceil(2) - start)
    }

    #[expect(clippy::inline_always, reason = "the writer's hottest path: a call more costs a tenth of it")]
    #[inline(always)]
    pub(crate) fn adapt(&mut self, symbol: usize) {
        if self.0[USES] < USES_MAX {
            self.adapt_young(symbol);
        } else if symbol != 0 || self.0[0] < SURE {
            self.step(symbol, SPEED_LAST);
        }
    }

    #[expect(clippy::inline_always, reason = "so that each use has its speed as a constant")]
    #[inline(always)]
    fn step(&mut self, symbol: usize, speed: u32) {
        let gains = &GAINS[(speed as usize).wrapping_sub(1) % GAINS.len()][symbol % SYMBOLS];
        let mask = u32::from(u16::MAX >> speed) * 0x0001_0001;
        for (pair, gain) in self.0.as_chunks_mut::<2>().0.iter_mut().zip(gains) {
            let word = u32::from(pair[1]) << 16 | u32::from(pair[0]);
            let word = word - ((word >> speed) & mask) + gain;
            *pair = [word as u16, (word >> 16) as u16];
        }
    }

    #[inline(never)]
    fn adapt_young(&mut self, symbol: usize) {
        let uses = self.0[USES];
        self.step(symbol, u32::from(SPEEDS[usize::from(uses) % SPEEDS.len()]));
        self.0[USES] = uses + 1;
    }
}

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

/// Bits 4..=15: that the bit is one; bits 0..=3: the uses.
#[derive(Clone, Copy, Debug, FromZeros)]
pub(crate) struct Cell(u16);

impl Cell {
    /// Zero and one alike.
    pub(crate) const EVEN: Self = Self(0x8000);

    pub(crate) const fn uses(self) -> u32 {
        self.0 as u32 & 15
    }

    /// The probability of a one, of 2^12.
    pub(crate) const fn one(self) -> u32 {
        self.0 as u32 >> 4
    }

    #[inline]
    pub(crate) fn adapt(&mut self, bit: bool) {
        *self = self.adapted(bit);
    }

    /// The cell after this bit. Without a branch: text has eight of these a byte, twice.
    #[inline]
    pub(crate) fn adapted(self, bit: bool) -> Self {
        let uses = self.uses();
        let rate = i32::from(RATES[uses as usize]);
        let one = self.one() as i32;
        let target = -i32::from(bit) & 4_095;
        let one = (one + (((target - one) * rate) >> 16)) as u32;
        // One more use, but never 16.
        let uses = uses + 1 - ((uses + 1) >> 4);
        Self((one << 4 | uses) as u16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distributions_adapt_as_described_and_no_symbol_gets_lost() {
        let mut cdf = Cdf::FLAT;
        let mut state = 7_u32;
        for round in 0..20_000 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Long runs of the first symbol, so that it becomes as sure as it gets, and of the last one.
            let symbol = match round % 1_000 {
                0..500 => 0,
                500..700 => 15,
                _ => (state >> 20) as usize % 16,
            };
            // Plain form of the paired computation.
            let mut expected = cdf.0;
            let speed = SPEEDS.get(usize::from(cdf.0[USES])).map_or(SPEED_LAST, |&speed| u32::from(speed));
            for (place, value) in expected.iter_mut().enumerate().take(USES) {
                *value = *value - (*value >> speed) + gain(place, symbol, speed);
            }
            expected[USES] = (expected[USES] + 1).min(USES_MAX);
            let sure = symbol == 0 && cdf.0[USES] == USES_MAX && cdf.0[0] >= SURE;
            if sure {
                expected = cdf.0;
            }
            cdf.adapt(symbol);
            assert_eq!(cdf.0, expected, "round {round}");
            assert!((0..SYMBOLS).all(|symbol| cdf.part_of(symbol).1 >= 1), "round {round}");
        }
    }
}
