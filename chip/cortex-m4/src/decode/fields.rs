//! Parts of all encodings: fields, registers, and the base of distances.

/// The place of the instruction, as far as decoding depends on it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// The instruction's address.
    pub(crate) address: u32,
    /// Inside of an IT block: instructions of 16 bits leave the flags alone.
    pub(crate) in_it: bool,
}

impl Place {
    /// The program counter as it reads, aligned to a word: the base of literals.
    pub(super) fn base(self) -> u32 {
        self.address.wrapping_add(4) & !3
    }

    /// The target of a branch by this distance.
    pub(super) fn target(self, distance: i32) -> u32 {
        self.address.wrapping_add(4).wrapping_add_signed(distance)
    }
}

/// A field of an encoding: `width` bits from `low` on.
pub(super) fn field(word: u32, low: u32, width: u32) -> u32 {
    word >> low & ((1 << width) - 1)
}

/// A field that is a register's number.
pub(super) fn reg(word: u32, low: u32) -> u8 {
    (word >> low & 15) as u8
}

/// A value of `bits` bits with its sign.
pub(super) fn sign_extend(value: u32, bits: u32) -> i32 {
    (value << (32 - bits)) as i32 >> (32 - bits)
}

/// Whether a register is one that most instructions of 32 bits may not name: 13 or 15.
pub(super) fn barred(register: u8) -> bool {
    register == 13 || register == 15
}
