//! Bytes without a layout: text, payloads of unknown messages, records. Each bit is coded in two contexts, the bytes
//! before it and the same place of the text before it, and the one that knows more decides.

use crate::coder::Coder;
use crate::distribution::Cell;

/// Cells of a context's row: for the ways in which four bits may begin (the first is not used).
const ROW: usize = 16;

/// Rows, hashed without check.
const ROWS: usize = 128;

pub(crate) struct TextModel {
    rows: [[Cell; ROW]; ROWS],
}

impl TextModel {
    pub(crate) const fn new() -> Self {
        Self { rows: [[Cell::EVEN; ROW]; ROWS] }
    }

    pub(crate) fn reset(&mut self) {
        self.rows = [[Cell::EVEN; ROW]; ROWS];
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
    #[inline]
    fn nibble<C: Coder>(&mut self, coder: &mut C, seeds: [u32; 2], value: u32) -> u32 {
        let rows = seeds.map(|seed| (hash(seed, 0x9e37_79b1) >> 25) as usize % ROWS);
        let mut node = 1_usize;
        for shift in [3, 2, 1, 0] {
            let cells = rows.map(|row| self.rows[row][node % ROW]);
            let bit = coder.bit(mix(cells), value >> shift & 1 != 0);
            for (row, mut cell) in rows.into_iter().zip(cells) {
                cell.adapt(bit);
                self.rows[row][node % ROW] = cell;
            }
            node = node << 1 | usize::from(bit);
        }
        node as u32 & 15
    }
}

fn hash(value: u32, salt: u32) -> u32 {
    let x = (value ^ salt).wrapping_mul(0x85eb_ca6b);
    x ^ (x >> 15)
}

/// The probability that the contexts make together: each counts by how often it was used and how sure it is.
fn mix(cells: [Cell; 2]) -> u32 {
    let (mut sum, mut weights) = (2_048_u32, 1_u32);
    for cell in cells {
        let sure = cell.one().abs_diff(2_048) >> 6;
        let weight = cell.uses() * (1 + sure * sure);
        sum += cell.one() * weight;
        weights += weight;
    }
    (sum / weights).clamp(16, 4_080)
}
