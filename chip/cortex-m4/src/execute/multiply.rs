//! Multiplication, division, and bits of one register.

use crate::op::{Long, Multiply, Op, Unary};
use crate::processor::Core;
use crate::timing;
use crate::trap::Trap;

fn half(value: u32, top: bool) -> i64 {
    i64::from(if top { (value >> 16) as i16 } else { value as i16 })
}

fn products(n: u32, m: u32, exchange: bool) -> (i64, i64) {
    let m = if exchange { m.rotate_right(16) } else { m };
    (half(n, false) * half(m, false), half(n, true) * half(m, true))
}

impl Core {
    pub(super) fn execute_multiply(&mut self, op: Op) -> Result<(), Trap> {
        match op {
            Op::BitInsert { d, n, lsb, mask } => {
                let value = self.get(d) & !mask | self.get(n) << lsb & mask;
                self.set(d, value);
            }
            Op::BitClear { d, mask } => self.set(d, self.get(d) & !mask),
            Op::MovTop { d, value } => self.set(d, self.get(d) & 0xFFFF | u32::from(value) << 16),
            Op::Unary { kind, d, m } => {
                let value = self.get(m);
                let result = match kind {
                    Unary::Clz => value.leading_zeros(),
                    Unary::Rbit => value.reverse_bits(),
                    Unary::Rev => value.swap_bytes(),
                    Unary::Rev16 => value.swap_bytes().rotate_right(16),
                    Unary::Revsh => (value as u16).swap_bytes() as i16 as u32,
                };
                self.set(d, result);
            }
            Op::Mul { flags, d, n, m } => {
                let result = self.get(n).wrapping_mul(self.get(m));
                self.set(d, result);
                if flags {
                    self.flags.nz(result);
                }
            }
            Op::Multiply { kind, d, n, m, a } => {
                let result = self.multiply(kind, self.get(n), self.get(m), a);
                self.set(d, result);
            }
            Op::Long { kind, low, high, n, m } => {
                let addend = u64::from(self.get(high)) << 32 | u64::from(self.get(low));
                let result = long(kind, self.get(n), self.get(m), addend);
                self.set(low, result as u32);
                self.set(high, (result >> 32) as u32);
            }
            Op::Divide { signed, d, n, m } => {
                let (n, m) = (self.get(n), self.get(m));
                if m == 0 && self.control.ccr & crate::registers::DIV_0_TRP != 0 {
                    return Err(Trap::DivideByZero);
                }
                let result = match (signed, m) {
                    (_, 0) => 0,
                    (false, m) => n / m,
                    (true, m) => (n as i32).wrapping_div(m as i32) as u32,
                };
                self.cycles += if signed {
                    timing::division((n as i32).unsigned_abs(), (m as i32).unsigned_abs())
                } else {
                    timing::division(n, m)
                };
                self.set(d, result);
            }
            _ => return Err(Trap::Undefined),
        }
        Ok(())
    }

    /// A result of 32 bits; overflow of an addition sets Q.
    fn multiply(&mut self, kind: Multiply, n: u32, m: u32, a: u8) -> u32 {
        let addend = if a == 15 { 0 } else { self.get(a) };
        let signed = i64::from(addend as i32);
        let rounding = |round: bool| if round { 0x8000_0000 } else { 0 };
        let product = i64::from(n as i32).wrapping_mul(i64::from(m as i32));
        let wide = match kind {
            Multiply::Mla => return addend.wrapping_add(n.wrapping_mul(m)),
            Multiply::Mls => return addend.wrapping_sub(n.wrapping_mul(m)),
            Multiply::Usada8 => {
                let bytes = n.to_le_bytes().into_iter().zip(m.to_le_bytes());
                return bytes.fold(addend, |sum, (x, y)| sum.wrapping_add(u32::from(x.abs_diff(y))));
            }
            Multiply::Smmla { round } => {
                return ((signed << 32).wrapping_add(product).wrapping_add(rounding(round)) >> 32) as u32;
            }
            Multiply::Smmls { round } => {
                return ((signed << 32).wrapping_sub(product).wrapping_add(rounding(round)) >> 32) as u32;
            }
            Multiply::Smlaxy { n_top, m_top } => half(n, n_top) * half(m, m_top) + signed,
            Multiply::Smlaw { m_top } => ((i64::from(n as i32) * half(m, m_top)) >> 16) + signed,
            Multiply::Smlad { exchange } => {
                let (low, high) = products(n, m, exchange);
                low + high + signed
            }
            Multiply::Smlsd { exchange } => {
                let (low, high) = products(n, m, exchange);
                low - high + signed
            }
        };
        if wide != i64::from(wide as i32) {
            self.flags.q = true;
        }
        wide as u32
    }
}

/// A result of 64 bits.
fn long(kind: Long, n: u32, m: u32, addend: u64) -> u64 {
    let signed = i64::from(n as i32).wrapping_mul(i64::from(m as i32)) as u64;
    let unsigned = u64::from(n) * u64::from(m);
    match kind {
        Long::Smull => signed,
        Long::Umull => unsigned,
        Long::Smlal => addend.wrapping_add(signed),
        Long::Umlal => addend.wrapping_add(unsigned),
        Long::Umaal => unsigned + (addend & 0xFFFF_FFFF) + (addend >> 32),
        Long::Smlalxy { n_top, m_top } => addend.wrapping_add((half(n, n_top) * half(m, m_top)) as u64),
        Long::Smlald { exchange } => {
            let (low, high) = products(n, m, exchange);
            addend.wrapping_add((low + high) as u64)
        }
        Long::Smlsld { exchange } => {
            let (low, high) = products(n, m, exchange);
            addend.wrapping_add((low - high) as u64)
        }
    }
}
