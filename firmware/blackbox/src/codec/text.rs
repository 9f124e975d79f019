//! Bytes without a layout: text, payloads of unknown messages, the texts of records. Each byte is coded as two halves of four
//! bits, in a context that the caller chooses. A byte equal to the one in the previous text costs one bit.

use crate::coder::Coder;
use crate::distribution::{Cdf, Cell};

/// Rows, hashed without check: a distribution of four bits each.
const ROWS: usize = 64;

const MATCHES: usize = 8;

#[derive(zerocopy::FromZeros)]
pub(crate) struct TextModel {
    rows: [Cdf; ROWS],
    same: [Cell; MATCHES],
}

impl TextModel {
    /// In place: a new one would go through the stack.
    pub(crate) fn reset(&mut self) {
        self.rows.fill(Cdf::FLAT);
        self.same.fill(Cell::EVEN);
    }

    pub(crate) fn byte<C: Coder>(&mut self, coder: &mut C, byte: u8, context: u32) -> u8 {
        let upper = coder.symbol(&mut self.rows[row(context)], usize::from(byte >> 4));
        let context = context ^ (16 + upper as u32) << 24;
        let lower = coder.symbol(&mut self.rows[row(context)], usize::from(byte & 15));
        (upper << 4 | lower) as u8
    }

    /// One byte where the text before had `above`, after `matched` bytes in a row that were as there.
    #[inline]
    pub(crate) fn byte_below<C: Coder>(
        &mut self,
        coder: &mut C,
        byte: u8,
        context: u32,
        above: u8,
        matched: usize,
    ) -> u8 {
        let cell = &mut self.same[matched.min(MATCHES - 1)];
        let same = coder.bit(cell.one().clamp(16, 4_080), byte == above);
        cell.adapt(same);
        if same { above } else { self.byte(coder, byte, context) }
    }
}

fn row(context: u32) -> usize {
    let x = (context ^ 0x2000_0003).wrapping_mul(0x85eb_ca6b);
    ((x ^ x >> 15).wrapping_mul(0x9e37_79b1) >> 26) as usize % ROWS
}
