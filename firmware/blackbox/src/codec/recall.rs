//! What the reader remembers beyond what the model must know: each slot's last frame, and which of its elements are not
//! quiet. Most frames say that their quiet elements stay as they are: these are there already, in the frame before, and
//! only the others are visited.

use super::element::{ELEMENTS, Element, What};
use super::slots::{SLOTS, Slot};
use crate::coder::{Coder, Reading, Writing};

/// Room for all slots: a power of two.
const PLACES: usize = SLOTS.next_power_of_two();

/// Words of a bit for each of a slot's elements.
pub(super) const WORDS: usize = 4;

/// What is known of a slot's last payload.
#[derive(Clone, Copy)]
struct Known {
    /// It is the last frame's, fields and nothing else.
    is: bool,
    /// What limited the fields, and where they end.
    limit: u16,
    end: u16,
    /// Elements that are not quiet, a bit each.
    lively: [u64; WORDS],
}

/// The last payloads of all slots.
pub(crate) struct Recall {
    /// The slot of the frame that is read.
    slot: usize,
    /// What the frame's checksum is made with, where it was not sent.
    pub(crate) seed: Option<u8>,
    known: [Known; PLACES],
    /// Where each element is in its payload.
    offsets: [u8; ELEMENTS],
}

impl Recall {
    pub(crate) const fn new() -> Self {
        let nothing = Known { is: false, limit: 0, end: 0, lively: [0; WORDS] };
        Self { slot: 0, seed: None, known: [nothing; PLACES], offsets: [0; ELEMENTS] }
    }

    pub(crate) fn reset(&mut self) {
        for known in &mut self.known {
            known.is = false;
        }
    }

    /// A frame of this slot comes.
    pub(super) fn turn_to(&mut self, slot: usize) {
        self.slot = slot;
    }

    #[inline]
    fn known(&mut self) -> &mut Known {
        &mut self.known[self.slot & (PLACES - 1)]
    }

    /// Where the fields of the last payload end, if it is there and was limited as this one is.
    #[inline]
    pub(super) fn end(&mut self, limit: usize) -> Option<usize> {
        let known = self.known();
        (known.is && usize::from(known.limit) == limit).then_some(usize::from(known.end))
    }

    /// All elements are going to be visited, or none.
    pub(super) fn forget(&mut self) {
        let known = self.known();
        known.is = false;
        known.lively = [0; WORDS];
    }

    /// An element of the slot was read; so many of them are left.
    #[inline]
    pub(super) fn visited(&mut self, slot: &Slot, left: usize, offset: usize, element: &Element) {
        let index = usize::from(slot.elements_count).wrapping_sub(left + 1);
        if let Some(place) = self.offsets.get_mut(usize::from(slot.elements) + index) {
            *place = offset as u8;
        }
        let lively = !element.is_quiet() && !matches!(element.what, What::Upper | What::Instance);
        if let Some(word) = self.known().lively.get_mut(index / 64) {
            *word |= u64::from(lively) << (index % 64);
        }
    }

    /// The payload has fields and nothing else, limited there, and they end there.
    pub(super) fn keep(&mut self, limit: usize, end: usize) {
        let known = self.known();
        known.is = true;
        (known.limit, known.end) = (limit as u16, end as u16);
    }

    /// Which of 64 elements are not quiet.
    #[inline]
    pub(super) fn lively(&mut self, word: usize) -> &mut u64 {
        &mut self.known().lively[word % WORDS]
    }

    /// Where an element is in its payload.
    #[inline]
    pub(super) fn offset(&self, slot: &Slot, index: usize) -> Option<usize> {
        self.offsets.get(usize::from(slot.elements) + index).map(|offset| usize::from(*offset))
    }
}

/// One end of the coder, of which the reading one has its memory with it.
pub(super) trait End: Coder {
    /// The reading end, where it is that.
    fn reading(&mut self) -> Option<Reading<'_, Recall>>;
}

impl<const N: usize> End for Writing<'_, N> {
    #[inline]
    fn reading(&mut self) -> Option<Reading<'_, Recall>> {
        None
    }
}

impl End for Reading<'_, Recall> {
    #[inline]
    fn reading(&mut self) -> Option<Reading<'_, Recall>> {
        Some(Reading { decoder: self.decoder, input: self.input, recall: self.recall })
    }
}
