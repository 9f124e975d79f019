//! Bytes without a layout: text, payloads of unknown messages, records. Each bit is coded in two contexts, the bytes
//! before it and the same place of the text before it, and the one that knows more decides.

use crate::coder::Coder;
use crate::distribution::Cell;

/// Cells of a context's row: for the ways in which four bits may begin (the first is not used).
const ROW: usize = 16;

/// Rows, hashed without check.
const ROWS: usize = 128;

pub(crate) struct TextModel {
    /// Row after row.
    cells: [Cell; ROWS * ROW],
}

impl TextModel {
    pub(crate) const fn new() -> Self {
        Self { cells: [Cell::EVEN; ROWS * ROW] }
    }

    pub(crate) fn reset(&mut self) {
        self.cells = [Cell::EVEN; ROWS * ROW];
    }

    /// One byte after `before` (the last three, the latest lowest), where the text before had `above`, and `matched`
    /// bytes in a row were as there.
    pub(crate) fn byte<C: Coder>(
        &mut self,
        coder: &mut C,
        byte: u8,
        before: u32,
        above: u8,
        matched: u32,
    ) -> u8 {
        let seeds =
            [hash(before & 0xffff, 0x2000_0003), hash(u32::from(above) << 2 | matched.min(3), 0x4000_0007)];
        let mut value = u32::from(byte);
        let upper = self.nibble(coder, seeds, value >> 4);
        value = self.nibble(coder, seeds.map(|seed| seed ^ (16 + upper)), value & 15);
        (upper << 4 | value) as u8
    }

    /// Four bits, the highest first. Each context has a row of cells for them, one for each way they may begin.
    #[inline(never)]
    fn nibble<C: Coder>(&mut self, coder: &mut C, seeds: [u32; 2], value: u32) -> u32 {
        let [first, second] = seeds.map(|seed| (hash(seed, 0x9e37_79b1) >> 25) as usize * ROW);
        let (mut node, mut rest) = (1, value << 28);
        while node < ROW {
            // The remainders say that no index is beyond the end; none ever is.
            let (at, other) = ((first + node) % (ROWS * ROW), (second + node) % (ROWS * ROW));
            let (cell, other_cell) = (self.cells[at], self.cells[other]);
            let bit = coder.bit(mix(cell, other_cell), rest >> 31 != 0);
            rest <<= 1;
            self.cells[at] = cell.adapted(bit);
            self.cells[other] = other_cell.adapted(bit);
            node = node << 1 | usize::from(bit);
        }
        node as u32 & 15
    }
}

fn hash(value: u32, salt: u32) -> u32 {
    let x = (value ^ salt).wrapping_mul(0x85eb_ca6b);
    x ^ (x >> 15)
}

/// The probability that two contexts make together: each counts by how often it was used and how sure it is.
#[inline]
fn mix(cell: Cell, other: Cell) -> u32 {
    let weight = |cell: Cell| {
        let sure = cell.one().abs_diff(2_048) >> 6;
        cell.uses() * (1 + sure * sure)
    };
    let weights = [weight(cell), weight(other)];
    let sum = 2_048 + cell.one() * weights[0] + other.one() * weights[1];
    (sum / (1 + weights[0] + weights[1])).clamp(16, 4_080)
}
