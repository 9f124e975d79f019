//! Bytes without a layout: text, payloads of unknown messages, records. Each bit is coded in two contexts, the bytes
//! before it and the same place of the text before it, and the one that knows more decides.

use crate::coder::Coder;
use crate::distribution::Cell;

/// Contexts, hashed without check.
const CELLS: usize = 2_048;

pub(crate) struct TextModel {
    cells: [Cell; CELLS],
}

impl TextModel {
    pub(crate) const fn new() -> Self {
        Self { cells: [Cell::EVEN; CELLS] }
    }

    pub(crate) fn reset(&mut self) {
        self.cells.fill(Cell::EVEN);
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
        let seeds = [
            hash(before & 0x00ff_ffff, 0x1000_0001),
            hash(before & 0xffff, 0x2000_0003),
            hash(before & 0xff, 0x3000_0005),
            hash(u32::from(above) << 2 | matched.min(3), 0x4000_0007),
        ];
        let mut node = 1_u32;
        for _ in 0..8 {
            let bit = byte >> 7 != 0;
            let bit = if C::WRITES { (byte >> (7 - node.ilog2())) & 1 != 0 } else { bit };
            let places = seeds.map(|seed| (hash(seed ^ node, 0x9e37_79b1) >> 20) as usize % CELLS);
            let one = mix(places.map(|place| self.cells[place]));
            let bit = coder.bit(one, bit);
            for place in places {
                self.cells[place].adapt(bit);
            }
            node = node << 1 | u32::from(bit);
        }
        node as u8
    }
}

fn hash(value: u32, salt: u32) -> u32 {
    let x = (value ^ salt).wrapping_mul(0x85eb_ca6b);
    x ^ (x >> 15)
}

/// The probability that the contexts make together: each counts by how often it was used and how sure it is.
fn mix(cells: [Cell; 4]) -> u32 {
    let (mut sum, mut weights) = (2_048_u32, 1_u32);
    for cell in cells {
        let sure = cell.one().abs_diff(2_048) >> 6;
        let weight = cell.uses() * (1 + sure * sure);
        sum += cell.one() * weight;
        weights += weight;
    }
    (sum / weights).clamp(16, 4_080)
}
