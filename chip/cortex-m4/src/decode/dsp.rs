//! 32 bits, registers alone: shifts, extensions, SIMD, multiplication, division.

use super::fields::{barred, field, reg};
use crate::op::{Extend, Lanes, Long, Multiply, Op, Prefix, Shift, Unary};

/// Data processing (register).
pub(super) fn register(a: u32, b: u32) -> Op {
    let (n, d, m) = (reg(a, 0), reg(b, 8), reg(b, 0));
    let (op1, op2) = (field(a, 4, 4), field(b, 4, 4));
    if b & 0xF000 != 0xF000 || barred(d) || barred(m) {
        return Op::Undefined;
    }
    match (op1, op2) {
        (0..=7, 0) if !barred(n) => {
            let shift = [Shift::Lsl, Shift::Lsr, Shift::Asr, Shift::Ror][(op1 >> 1) as usize];
            Op::ShiftBy { shift, flags: op1 & 1 != 0, d, n, m }
        }
        (0..=5, 8..=15) if n != 13 && op2 & 4 == 0 => {
            let kinds =
                [Extend::Sxth, Extend::Uxth, Extend::Sxtb16, Extend::Uxtb16, Extend::Sxtb, Extend::Uxtb];
            Op::Extend { kind: kinds[op1 as usize], d, n, m, rotate: (op2 & 3) as u8 * 8 }
        }
        (8..=15, 0..=7) if !barred(n) => parallel(op1 & 7, op2, d, n, m),
        (8..=11, 8..=11) if !barred(n) => unary_or_saturating(op1 & 3, op2 & 3, d, n, m),
        _ => Op::Undefined,
    }
}

fn parallel(op1: u32, op2: u32, d: u8, n: u8, m: u8) -> Op {
    let lanes = match op1 {
        0 => Lanes::Add8,
        1 => Lanes::Add16,
        2 => Lanes::Asx,
        4 => Lanes::Sub8,
        5 => Lanes::Sub16,
        6 => Lanes::Sax,
        _ => return Op::Undefined,
    };
    let prefix = match op2 {
        0 => Prefix::S,
        1 => Prefix::Q,
        2 => Prefix::Sh,
        4 => Prefix::U,
        5 => Prefix::Uq,
        6 => Prefix::Uh,
        _ => return Op::Undefined,
    };
    Op::Parallel { prefix, lanes, d, n, m }
}

fn unary_or_saturating(op1: u32, op2: u32, d: u8, n: u8, m: u8) -> Op {
    let unary = |kind| if n == m { Op::Unary { kind, d, m } } else { Op::Undefined };
    match (op1, op2) {
        (0, _) => Op::Saturating { double: op2 & 1 != 0, subtract: op2 & 2 != 0, d, n, m },
        (1, 0) => unary(Unary::Rev),
        (1, 1) => unary(Unary::Rev16),
        (1, 2) => unary(Unary::Rbit),
        (1, _) => unary(Unary::Revsh),
        (2, 0) => Op::Select { d, n, m },
        (3, 0) => unary(Unary::Clz),
        _ => Op::Undefined,
    }
}

/// A result of 32 bits.
pub(super) fn multiply(a: u32, b: u32) -> Op {
    let (n, acc, d, m) = (reg(a, 0), reg(b, 12), reg(b, 8), reg(b, 0));
    let (op, low) = (field(a, 4, 3), field(b, 4, 2));
    if b & 0xC0 != 0 || barred(d) || barred(n) || barred(m) || acc == 13 {
        return Op::Undefined;
    }
    let (n_top, m_top) = (low & 2 != 0, low & 1 != 0);
    let kind = match (op, low) {
        (0, 0) if acc == 15 => return Op::Mul { flags: false, d, n, m },
        (0, 0) => Multiply::Mla,
        (0, 1) if acc != 15 => Multiply::Mls,
        (1, _) => Multiply::Smlaxy { n_top, m_top },
        (2, 0 | 1) => Multiply::Smlad { exchange: m_top },
        (3, 0 | 1) => Multiply::Smlaw { m_top },
        (4, 0 | 1) => Multiply::Smlsd { exchange: m_top },
        (5, 0 | 1) => Multiply::Smmla { round: m_top },
        (6, 0 | 1) if acc != 15 => Multiply::Smmls { round: m_top },
        (7, 0) => Multiply::Usada8,
        _ => return Op::Undefined,
    };
    Op::Multiply { kind, d, n, m, a: acc }
}

/// A result of 64 bits, and divisions.
pub(super) fn long(a: u32, b: u32) -> Op {
    let (n, low, high, m) = (reg(a, 0), reg(b, 12), reg(b, 8), reg(b, 0));
    let (op1, op2) = (field(a, 4, 3), field(b, 4, 4));
    if barred(n) || barred(m) || barred(high) {
        return Op::Undefined;
    }
    let (n_top, m_top) = (op2 & 2 != 0, op2 & 1 != 0);
    let kind = match (op1, op2) {
        (1 | 3, 15) if low == 15 => return Op::Divide { signed: op1 == 1, d: high, n, m },
        (0, 0) => Long::Smull,
        (2, 0) => Long::Umull,
        (4, 0) => Long::Smlal,
        (4, 8..=11) => Long::Smlalxy { n_top, m_top },
        (4, 12 | 13) => Long::Smlald { exchange: m_top },
        (5, 12 | 13) => Long::Smlsld { exchange: m_top },
        (6, 0) => Long::Umlal,
        (6, 6) => Long::Umaal,
        _ => return Op::Undefined,
    };
    if barred(low) || low == high {
        return Op::Undefined;
    }
    Op::Long { kind, low, high, n, m }
}
