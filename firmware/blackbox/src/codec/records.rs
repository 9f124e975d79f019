//! Records: numbers are coded against the previous record of their kind, times against the entry's own time, bytes by
//! the text model.

use super::element::{integer_class, integer_rest};
use super::text::TextModel;
use crate::coder::Coder;
use crate::distribution::Cdf;
use crate::limits::ENTRY_BYTES_MAX;
use crate::record::Shape;

/// Kinds with a stored last record, each in the place of its number modulo this.
const KINDS: usize = 16;

/// Stored numbers of a record: its shape, its length, and the first words. Statistics have 24.
const KEPT: usize = 26;

/// Each word's of each kind, as far as they go round.
const CONTEXTS: usize = 16;

/// The beginning of a record: uncoded bytes, its kind, or a kind that is spelled out.
const RAW: usize = 0;
const OTHER_KIND: usize = 15;

#[derive(zerocopy::FromZeros)]
pub(super) struct Records {
    kinds: Cdf,
    kept: [[u32; KEPT]; KINDS],
    words: [Cdf; CONTEXTS],
    /// For the halves, by whether the previous one was 0, small or large.
    halves: [Cdf; 4],
}

impl Records {
    /// In place: a new one would go through the stack.
    pub(super) fn reset(&mut self) {
        self.kinds = Cdf::FLAT;
        self.kept.as_flattened_mut().fill(0);
        self.words.fill(Cdf::FLAT);
        self.halves.fill(Cdf::FLAT);
    }

    /// Codes a record in its stored form, `len` bytes of the buffer; returns its length. `raw`: uncoded.
    #[inline(never)]
    pub(super) fn code<C: Coder>(
        &mut self,
        coder: &mut C,
        text: &mut TextModel,
        at_ms: u64,
        (buffer, len): (&mut [u8; ENTRY_BYTES_MAX], usize),
        raw: bool,
    ) -> Option<usize> {
        let known = buffer.get(..len).and_then(Shape::read).filter(|_| !raw);
        let (mut shape, mut rest) = known.unwrap_or_default();
        let symbol = match shape.kind {
            _ if known.is_none() => RAW,
            kind => usize::from(kind).clamp(1, OTHER_KIND),
        };
        let symbol = coder.symbol(&mut self.kinds, symbol);
        shape.kind = match symbol {
            RAW => return raw_bytes(coder, buffer, len),
            OTHER_KIND => coder.bits16(u32::from(shape.kind), 8) as u8,
            kind => kind as u8,
        };
        let kind = usize::from(shape.kind);
        let packed = u32::from_le_bytes([shape.version, shape.words, shape.halves, 0]);
        [shape.version, shape.words, shape.halves, _] =
            self.number(coder, kind, 0, packed, None).to_le_bytes();
        rest = self.number(coder, kind, 1, rest as u32, None) as usize;
        let len = shape.bytes_at().checked_add(rest)?;
        *buffer.first_chunk_mut()? = [shape.kind, shape.version, shape.words, shape.halves];
        let at_us = at_ms.wrapping_mul(1_000);
        let now = [at_us as u32, (at_us >> 32) as u32];
        let stored = buffer.get_mut(..len)?;
        let (numbers, bytes) = stored.split_at_mut_checked(shape.bytes_at())?;
        let (words, halves) = numbers.split_at_mut_checked(shape.halves_at())?;
        let words = words.get_mut(crate::record::HEAD_BYTES..)?.as_chunks_mut().0;
        for (index, word) in words.iter_mut().enumerate() {
            let time = (index < shape.times()).then_some(now[index % 2]);
            *word = self.number(coder, kind, index + 2, u32::from_le_bytes(*word), time).to_le_bytes();
        }
        self.halves(coder, halves.as_chunks_mut().0);
        let mut before = 0;
        for place in bytes {
            *place = text.byte(coder, *place, before);
            before = u32::from(*place);
        }
        Some(len)
    }

    fn number<C: Coder>(
        &mut self,
        coder: &mut C,
        kind: usize,
        index: usize,
        number: u32,
        guess: Option<u32>,
    ) -> u32 {
        let mut beyond = 0;
        let kept = self.kept[kind % KINDS].get_mut(index).unwrap_or(&mut beyond);
        let guess = guess.unwrap_or(*kept);
        let difference = number.wrapping_sub(guess) as i32;
        let cdf = &mut self.words[(5 * kind + index) % CONTEXTS];
        let symbol = coder.symbol(cdf, integer_class(difference.unsigned_abs()));
        *kept = guess.wrapping_add(integer_rest(coder, symbol, difference) as u32);
        *kept
    }

    fn halves<C: Coder>(&mut self, coder: &mut C, halves: &mut [[u8; 2]]) {
        let mut last = 0;
        for half in halves {
            let difference = i32::from(i16::from_le_bytes(*half));
            let context = usize::from(last > 0) + usize::from(last > 4) + usize::from(last > 8);
            last = coder.symbol(&mut self.halves[context], integer_class(difference.unsigned_abs()));
            *half = (integer_rest(coder, last, difference) as i16).to_le_bytes();
        }
    }
}

fn raw_bytes<C: Coder>(coder: &mut C, buffer: &mut [u8; ENTRY_BYTES_MAX], len: usize) -> Option<usize> {
    let len = coder.bits16(len as u32, 10) as usize;
    for place in buffer.get_mut(..len)? {
        *place = coder.bits16(u32::from(*place), 8) as u8;
    }
    Some(len)
}
