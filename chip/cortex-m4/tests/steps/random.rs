//! Random operands at the edges of an instruction's range.

/// Xorshift*: a seed gives the same tests for ever.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u32 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 32) as u32
    }

    pub(crate) fn below(&mut self, limit: u32) -> u32 {
        ((u64::from(self.next()) * u64::from(limit)) >> 32) as u32
    }

    pub(crate) fn one_in(&mut self, chance: u32) -> bool {
        self.below(chance) == 0
    }

    pub(crate) fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len() as u32) as usize]
    }

    /// An edge as often as not.
    pub(crate) fn operand(&mut self) -> u32 {
        const EDGES: [u32; 14] = [
            0,
            1,
            2,
            31,
            32,
            33,
            0xFF,
            0x7FFF,
            0x8000,
            0xFFFF,
            0x7FFF_FFFF,
            0x8000_0000,
            0x8000_0001,
            0xFFFF_FFFF,
        ];
        match self.below(6) {
            0..=2 => self.of(&EDGES),
            3 => (u32::from(self.of(&[0x7Fu8, 0x80, 0xFF, 0, 1])) * 0x0101_0101) ^ self.next() & 0x8001_8001,
            4 => self.next() >> self.below(32),
            _ => self.next(),
        }
    }

    /// Zeros, infinities, NaN, denormals, whole numbers, limits of integers, or anything.
    pub(crate) fn float(&mut self) -> u32 {
        const EDGES: [u32; 24] = [
            0,
            0x7F80_0000,
            0x7FC0_0000,
            0x7F80_0001,
            0x7FA1_2345,
            0x7FC5_4321,
            1,
            0x007F_FFFF,
            0x0040_0000,
            0x0080_0000,
            0x0080_0001,
            0x7F7F_FFFF,
            0x3F80_0000,
            0x3F00_0000,
            0x3FC0_0000,
            0x4F00_0000,
            0x4EFF_FFFF,
            0x4F80_0000,
            0x4F7F_FFFF,
            0x4700_0000,
            0x477F_FF00,
            0x3F7F_FFFF,
            0x3380_0000,
            0x3880_0000,
        ];
        let sign = self.next() & 0x8000_0000;
        sign | match self.below(8) {
            0..=2 => self.of(&EDGES),
            // Sums cancel, products round.
            3 => 0x3F80_0000 + (self.below(0x0180_0000) & self.next() | self.below(4)) - 0x0080_0000,
            4 => (self.below(70_000) as f32 / self.of(&[1.0f32, 2.0, 4.0, 3.0])).to_bits(),
            5 => self.below(0x0100_0000),
            6 => self.next() & 0x7FFF_FFFF & !(0xFFF << self.below(12)),
            _ => self.next() & 0x7FFF_FFFF,
        }
    }

    /// Has rules of its own, or nearly.
    pub(crate) fn special(&mut self) -> u32 {
        let sign = self.next() & 0x8000_0000;
        sign | self.of(&[
            0,
            0x7F80_0000,
            0x7FC0_1234,
            0x7F80_4321,
            0x3F80_0000,
            0x3F80_0001,
            0x0000_0001,
            0x7F7F_FFFF,
        ])
    }
}
