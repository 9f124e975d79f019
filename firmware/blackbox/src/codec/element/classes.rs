//! The distributions of classes: an element gets its own when it first changes.

use super::Element;
use crate::coder::Coder;
use crate::distribution::{Cdf, SYMBOLS};

const BLOCKS: usize = 432;

/// Kinds whose elements behave alike: integers of 1, 2 and 4 bytes, floats, decimal floats, random floats, times, computed floats.
const KINDS: usize = 8;
pub(super) const INTEGER_1: usize = 0;
pub(super) const INTEGER_2: usize = 1;
pub(super) const INTEGER_4: usize = 2;
pub(super) const FLOAT: usize = 3;
pub(super) const DECIMAL: usize = 4;
pub(super) const RANDOM_FLOAT: usize = 5;
pub(super) const TIME: usize = 6;
pub(super) const COMPUTED: usize = 7;

/// Random and computed floats have none.
const AFTER: [usize; KINDS] = [0, 0, 0, 1, 2, NONE, 3, NONE];
const NONE: usize = usize::MAX;

const CALM: Cdf = Cdf::from_sizes([600, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20, 20]);

#[derive(zerocopy::FromZeros)]
pub(crate) struct Distributions {
    blocks: [Cdf; BLOCKS],
    used: u16,
    /// For elements without their own: by kind.
    calm: [Cdf; KINDS],
    /// Initial distribution.
    young: [Cdf; KINDS],
    /// First values.
    first: [Cdf; KINDS],
    /// For all elements with distributions of their own, by the previous class
    after: [[Cdf; SYMBOLS]; 4],
}

impl Distributions {
    pub(crate) fn reset(&mut self) {
        self.used = 0;
        self.calm = [CALM; KINDS];
        self.young = [Cdf::FLAT; KINDS];
        self.first = [Cdf::FLAT; KINDS];
        self.after = [[Cdf::FLAT; SYMBOLS]; 4];
    }

    /// A new distribution; 0 where there is none left.
    pub(crate) fn claim(&mut self, from: Cdf) -> u16 {
        let Some(block) = self.blocks.get_mut(usize::from(self.used)) else { return 0 };
        *block = from;
        self.used += 1;
        self.used
    }

    #[inline]
    pub(crate) fn get(&mut self, number: u16) -> Option<&mut Cdf> {
        self.blocks.get_mut(usize::from(number).wrapping_sub(1))
    }

    /// An element without a distribution gets one at its first change.
    #[expect(clippy::inline_always, reason = "so that each use has its kind as a constant")]
    #[inline(always)]
    pub(super) fn class<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        kind: usize,
        symbol: usize,
    ) -> usize {
        let after =
            self.after.get_mut(AFTER[kind % KINDS]).map(|after| &mut after[element.class() % SYMBOLS]);
        let is_other = matches!(kind, DECIMAL | RANDOM_FLOAT | COMPUTED);
        let block = if is_other { &mut element.other } else { &mut element.block };
        let symbol = match (self.blocks.get_mut(usize::from(*block).wrapping_sub(1)), after) {
            (Some(own), Some(after)) => coder.symbol_between(own, after, symbol),
            (Some(own), None) => coder.symbol(own, symbol),
            (None, _) => self.class_of_calm(coder, block, kind, symbol),
        };
        element.note_class(symbol);
        symbol
    }

    #[inline(never)]
    fn class_of_calm<C: Coder>(
        &mut self,
        coder: &mut C,
        block: &mut u16,
        kind: usize,
        symbol: usize,
    ) -> usize {
        let symbol = coder.symbol(&mut self.calm[kind % KINDS], symbol);
        if symbol != 0 {
            let young = &mut self.young[kind % KINDS];
            let mut cdf = young.renewed();
            cdf.adapt(symbol);
            young.adapt(symbol);
            *block = self.claim(cdf);
        }
        symbol
    }

    /// The class of a value that may be the first one.
    #[inline]
    pub(super) fn class_or_first<C: Coder>(
        &mut self,
        coder: &mut C,
        element: &mut Element,
        kind: usize,
        symbol: usize,
    ) -> usize {
        if element.known() {
            self.class(coder, element, kind, symbol)
        } else {
            self.class_of_first(coder, kind, symbol)
        }
    }

    #[inline(never)]
    fn class_of_first<C: Coder>(&mut self, coder: &mut C, kind: usize, symbol: usize) -> usize {
        coder.symbol(&mut self.first[kind % KINDS], symbol)
    }
}
