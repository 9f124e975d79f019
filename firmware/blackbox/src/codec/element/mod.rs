//! One element of a field: predicted from its past, and the difference coded.
//!
//! A difference becomes a *class* (about the length of its magnitude in bits), coded with the element's own adaptive
//! distribution (`classes`). Sign and lower bits follow uncoded (`rest`): in a flight they are noise. The prediction
//! with the lowest recent cost is used (`costs`).

mod classes;
mod costs;
mod floats;
mod integers;
mod rest;
mod times;

use zerocopy::FromZeros;

pub(crate) use classes::Distributions;
use costs::Costs;
pub(super) use rest::{integer_class, integer_rest};

/// Elements at most: a copter with all streams has 430, a PX4 510.
pub(crate) const ELEMENTS: usize = 544;

/// An element that has not changed for 8 frames is quiet: one of these bits of the count is set.
const QUIET: u8 = 0x38;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum ElementKind {
    /// 1, 2 or 4 bytes.
    Integer1,
    Integer2,
    Integer4,
    /// Times of 4 bytes.
    Millis,
    Micros,
    Float,
    /// 8 bytes; the next element is their upper half.
    Wide,
    WideTime,
    Upper,
    /// Text or data.
    Text,
    /// Implied by the slot.
    Instance,
}

impl ElementKind {
    /// The kind of an element. A bit flip in memory may give an unknown kind. Such an element is not coded, because a
    /// jump by it could go anywhere.
    #[inline]
    const fn of(kind: u8) -> Self {
        match kind {
            0 => Self::Integer1,
            1 => Self::Integer2,
            2 => Self::Integer4,
            3 => Self::Millis,
            4 => Self::Micros,
            5 => Self::Float,
            6 => Self::Wide,
            7 => Self::WideTime,
            9 => Self::Text,
            10 => Self::Instance,
            _ => Self::Upper,
        }
    }

    pub(crate) const fn is_wide(self) -> bool {
        matches!(self, Self::Wide | Self::WideTime)
    }
}

#[derive(Clone, Copy, Debug, FromZeros)]
pub(crate) struct Element {
    /// The last value's bits; of a 64-bit element the lower half.
    pub(crate) last: u32,
    /// The last difference.
    step: i32,
    /// Clock at the last value, or the linked number's bits; for a text, the place of its copy.
    pub(crate) aux: u32,
    costs: Costs,
    /// Its own distribution, and the one for its other mode; 0: none yet.
    block: u16,
    other: u16,
    /// A [`ElementKind`].
    kind: u8,
    /// For a text or instance its bytes; for a number its row in the table of links.
    detail: u8,
    pub(crate) end: u8,
    /// Bits 0-2: how surely it is a multiple of 1/100 (float) or of 1000 (64-bit integer): 3 and more. Bits 3-6: the last
    /// class. Bit 7: `step` is in hundredths.
    decimal: u8,
    /// The exponent from which the classes of a random float count. For an integer with links: 1 if signed.
    pub(crate) exponent: u8,
    /// Frames since it changed, up to 63; bit 7: it has a last value.
    quiet: u8,
}

const KNOWN: u8 = 0x80;
const QUIET_MAX: u8 = 0x3f;
const STEP_DECIMAL: u8 = 0x80;
const DECIMALS: u8 = 7;
const CLASS_AT: u32 = 3;
const CLASS: u8 = 15 << CLASS_AT;

impl Element {
    pub(crate) const fn new(what: ElementKind, detail: u8, end: u8) -> Self {
        Self {
            last: 0,
            step: 0,
            aux: 0,
            costs: Costs::NEW,
            block: 0,
            other: 0,
            kind: what as u8,
            detail,
            end,
            decimal: 0,
            exponent: 120,
            quiet: 0,
        }
    }

    #[inline]
    pub(crate) const fn what(&self) -> ElementKind {
        ElementKind::of(self.kind)
    }

    #[inline]
    pub(crate) const fn known(&self) -> bool {
        self.quiet & KNOWN != 0
    }

    #[inline]
    pub(crate) const fn is_quiet(&self) -> bool {
        self.quiet & QUIET != 0
    }

    /// `any_quiet` reads them or-ed for many elements.
    #[inline]
    pub(crate) const fn quiet_bits(&self) -> u8 {
        self.quiet
    }

    /// `bits`: or-ed for many elements.
    #[inline]
    pub(crate) const fn any_quiet(bits: u8) -> bool {
        bits & QUIET != 0
    }

    #[inline]
    pub(crate) const fn size(&self) -> usize {
        /// By kind; 0 for kinds of variable size.
        const BYTES: [u8; 11] = [1, 2, 4, 4, 4, 4, 8, 8, 0, 0, 0];
        match self.what() {
            ElementKind::Text | ElementKind::Instance => self.detail as usize,
            what => BYTES[what as usize] as usize,
        }
    }

    #[inline]
    pub(crate) const fn offset(&self) -> usize {
        (self.end as usize).wrapping_sub(self.size())
    }

    /// A number's row in the table of links; 0: none.
    #[inline]
    pub(crate) const fn row(&self) -> u8 {
        self.detail
    }

    #[inline]
    pub(crate) fn note(&mut self, same: bool) {
        let counted = self.quiet + u8::from(self.quiet & QUIET_MAX < QUIET_MAX);
        self.quiet = KNOWN | if same { counted } else { 0 };
    }

    pub(crate) fn number(&self) -> f32 {
        match (self.what(), self.exponent) {
            (ElementKind::Float, _) => f32::from_bits(self.last),
            (ElementKind::Integer2, 1) => f32::from(self.last as i16),
            (ElementKind::Integer4, 1) => self.last as i32 as f32,
            _ => self.last as f32,
        }
    }

    #[inline]
    fn decimals(&self) -> u8 {
        self.decimal & DECIMALS
    }

    #[inline]
    fn weigh_decimal(&mut self, is: bool) {
        let decimals = self.decimals();
        let decimals = if is { (decimals + 1).min(6) } else { decimals.saturating_sub(2) };
        self.decimal = self.decimal & !DECIMALS | decimals;
    }

    #[inline]
    fn class(&self) -> usize {
        usize::from((self.decimal & CLASS) >> CLASS_AT)
    }

    #[inline]
    fn note_class(&mut self, class: usize) {
        self.decimal = self.decimal & !CLASS | (class as u8) << CLASS_AT & CLASS;
    }
}

pub(crate) struct Context {
    /// Milliseconds since the last frame of this slot.
    pub(crate) elapsed_ms: u32,
    /// The newest time that any message gave, in microseconds; only differences count.
    pub(crate) clock_us: u32,
    pub(crate) clock_ms: u32,
    /// The float before in this frame: now and before.
    pub(crate) neighbour: Option<(f32, f32)>,
    /// Prediction of the linked register for this float, and whether it used the sender's own computation.
    pub(crate) link: Option<(f32, bool)>,
}

#[derive(FromZeros)]
pub(crate) struct Elements {
    pub(crate) list: [Element; ELEMENTS],
    used: u16,
}

impl Elements {
    pub(crate) fn reset(&mut self) {
        self.used = 0;
    }

    pub(crate) fn claim(&mut self, count: usize) -> Option<u16> {
        let first = self.used;
        if usize::from(first) + count > ELEMENTS {
            return None;
        }
        self.used += count as u16;
        Some(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The image jumps by it.
    #[test]
    fn whatever_memory_holds_is_a_kind() {
        for kind in 0..=u8::MAX {
            let element = Element { kind, ..crate::zeros() };
            let expected = if kind < 11 { kind } else { ElementKind::Upper as u8 };
            assert_eq!((element.what() as u8, element.size() <= 8), (expected, true));
        }
    }

    #[test]
    fn elements_are_claimed_until_the_last_one_and_no_further() {
        let mut elements: Elements = crate::zeros();
        assert_eq!(elements.claim(ELEMENTS - 1), Some(0));
        assert_eq!(elements.claim(2), None);
        assert_eq!(elements.claim(1), Some(ELEMENTS as u16 - 1));
        assert_eq!(elements.claim(1), None);
    }
}
