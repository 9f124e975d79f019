//! Parts of all encodings.

/// The instruction's place, as far as decoding depends on it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// The instruction's address.
    pub(crate) address: u32,
    /// Instructions of 16 bits leave the flags alone.
    pub(crate) in_it: bool,
}

impl Place {
    /// The program counter as it reads, aligned: the base of literals.
    pub(super) fn base(self) -> u32 {
        self.address.wrapping_add(4) & !3
    }

    pub(super) fn target(self, distance: i32) -> u32 {
        self.address.wrapping_add(4).wrapping_add_signed(distance)
    }
}

pub(super) fn field(word: u32, low: u32, width: u32) -> u32 {
    word >> low & ((1 << width) - 1)
}

pub(super) fn reg(word: u32, low: u32) -> u8 {
    (word >> low & 15) as u8
}

pub(super) fn sign_extend(value: u32, bits: u32) -> i32 {
    (value << (32 - bits)) as i32 >> (32 - bits)
}

/// 13 or 15: barred for most instructions of 32 bits.
pub(super) fn barred(register: u8) -> bool {
    register == 13 || register == 15
}
