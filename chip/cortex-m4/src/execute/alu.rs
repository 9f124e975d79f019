//! Sums, logic, shifts, and their flags.

use crate::op::{Alu, Extend, Shift};
use crate::processor::Core;

/// `Shift_C`: value and carry; by 0 nothing changes. Amounts are up to 255.
#[inline(always)]
pub(crate) fn shift(value: u32, kind: Shift, amount: u8, carry: bool) -> (u32, bool) {
    if amount == 0 {
        return (value, carry);
    }
    let amount = u32::from(amount);
    match kind {
        Shift::Lsl if amount < 32 => (value << amount, value >> (32 - amount) & 1 == 1),
        Shift::Lsl => (0, amount == 32 && value & 1 == 1),
        Shift::Lsr if amount < 32 => (value >> amount, value >> (amount - 1) & 1 == 1),
        Shift::Lsr => (0, amount == 32 && value >> 31 == 1),
        Shift::Asr => {
            let by = amount.min(32);
            let extended = i64::from(value as i32);
            ((extended >> by) as u32, extended >> (by - 1) & 1 == 1)
        }
        Shift::Ror => {
            let value = value.rotate_right(amount & 31);
            (value, value >> 31 == 1)
        }
        Shift::Rrx => (value >> 1 | u32::from(carry) << 31, value & 1 == 1),
    }
}

/// `AddWithCarry`: sum, carry, overflow.
#[inline(always)]
pub(crate) fn add_with_carry(x: u32, y: u32, carry: bool) -> (u32, bool, bool) {
    let wide = u64::from(x) + u64::from(y) + u64::from(carry);
    let sum = wide as u32;
    (sum, wide >> 32 != 0, (!(x ^ y) & (x ^ sum)) >> 31 == 1)
}

impl Core {
    #[inline(always)]
    pub(crate) fn compare(&mut self, x: u32, y: u32) {
        let (result, carry, overflow) = add_with_carry(x, !y, true);
        self.flags.nz(result);
        self.flags.c = carry;
        self.flags.v = overflow;
    }

    /// `carry` is the shifter's, for the logical ones.
    #[inline(always)]
    pub(crate) fn alu(&mut self, alu: Alu, flags: bool, d: u8, x: u32, y: u32, carry: bool) {
        let c = self.flags.c;
        let (result, carry, overflow) = match alu {
            Alu::And | Alu::Tst => (x & y, carry, self.flags.v),
            Alu::Bic => (x & !y, carry, self.flags.v),
            Alu::Orr => (x | y, carry, self.flags.v),
            Alu::Orn => (x | !y, carry, self.flags.v),
            Alu::Eor | Alu::Teq => (x ^ y, carry, self.flags.v),
            Alu::Mov => (y, carry, self.flags.v),
            Alu::Mvn => (!y, carry, self.flags.v),
            Alu::Add | Alu::Cmn => add_with_carry(x, y, false),
            Alu::Adc => add_with_carry(x, y, c),
            Alu::Sub | Alu::Cmp => add_with_carry(x, !y, true),
            Alu::Sbc => add_with_carry(x, !y, c),
            Alu::Rsb => add_with_carry(!x, y, true),
        };
        if flags {
            self.flags.nz(result);
            self.flags.c = carry;
            self.flags.v = overflow;
        }
        if !matches!(alu, Alu::Tst | Alu::Teq | Alu::Cmn | Alu::Cmp) {
            self.set(d, result);
        }
    }

    /// SXTB and its family: `n` 15 adds nothing.
    #[inline(always)]
    pub(crate) fn extend(&mut self, kind: Extend, d: u8, n: u8, m: u8, rotate: u8) {
        let rotated = self.get(m).rotate_right(u32::from(rotate));
        let base = if n == 15 { 0 } else { self.get(n) };
        let pairs =
            |low: u32, high: u32| (base.wrapping_add(low) & 0xFFFF) | (base >> 16).wrapping_add(high) << 16;
        let value = match kind {
            Extend::Sxtb => base.wrapping_add(rotated as i8 as u32),
            Extend::Sxth => base.wrapping_add(rotated as i16 as u32),
            Extend::Uxtb => base.wrapping_add(rotated & 0xFF),
            Extend::Uxth => base.wrapping_add(rotated & 0xFFFF),
            Extend::Sxtb16 => pairs(rotated as i8 as u32, (rotated >> 16) as i8 as u32),
            Extend::Uxtb16 => pairs(rotated & 0xFF, rotated >> 16 & 0xFF),
        };
        self.set(d, value);
    }
}
