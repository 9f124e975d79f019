//! Reader's memory beside the model: whether each slot's last frame still holds the last value of each element. In
//! most frames the quiet elements are unchanged, and need not be written again.

use super::slots::SLOTS;
use crate::coder::{Coder, SymbolReader, SymbolWriter};

/// No payload, and so no limit.
const NONE: u16 = u16::MAX;

pub(crate) struct Recall {
    slot: usize,
    pub(crate) seed: Option<u8>,
    /// Limits of the fields in each slot's last payload, which has no other bytes.
    limits: [u16; SLOTS],
}

impl Recall {
    pub(crate) const fn new() -> Self {
        Self { slot: 0, seed: None, limits: [NONE; SLOTS] }
    }

    pub(crate) fn reset(&mut self) {
        self.limits = [NONE; SLOTS];
    }

    pub(super) fn turn_to(&mut self, slot: usize) {
        self.slot = slot;
    }

    #[inline]
    pub(super) fn has(&self, limit: usize) -> bool {
        self.limits.get(self.slot).is_some_and(|&known| usize::from(known) == limit)
    }

    /// The payload has fields limited there; `only`: and no other bytes.
    #[inline]
    pub(super) fn keep(&mut self, limit: usize, only: bool) {
        if let Some(known) = self.limits.get_mut(self.slot) {
            *known = if only { limit as u16 } else { NONE };
        }
    }
}

pub(super) trait End: Coder {
    fn reading(&mut self) -> Option<SymbolReader<'_, Recall>>;
}

impl<const N: usize> End for SymbolWriter<'_, N> {
    #[inline]
    fn reading(&mut self) -> Option<SymbolReader<'_, Recall>> {
        None
    }
}

impl End for SymbolReader<'_, Recall> {
    #[inline]
    fn reading(&mut self) -> Option<SymbolReader<'_, Recall>> {
        Some(SymbolReader { decoder: self.decoder, input: self.input, recall: self.recall })
    }
}
