//! The instructions of 32 bits that process data, branch, or control the processor.

use super::fields::{Place, barred, field, reg, sign_extend};
use super::narrow::immediate_shift;
use crate::op::{Alu, Op, Shift};

/// By the four bits of immediate and register forms. With `d` 15 and flags it is a comparison, with `n` 15 a move.
fn alu(op: u32, d: u8, n: u8, flags: bool) -> Option<Alu> {
    let compares = d == 15 && flags;
    Some(match op {
        0 if compares => Alu::Tst,
        0 => Alu::And,
        1 => Alu::Bic,
        2 if n == 15 => Alu::Mov,
        2 => Alu::Orr,
        3 if n == 15 => Alu::Mvn,
        3 => Alu::Orn,
        4 if compares => Alu::Teq,
        4 => Alu::Eor,
        8 if compares => Alu::Cmn,
        8 => Alu::Add,
        10 => Alu::Adc,
        11 => Alu::Sbc,
        13 if compares => Alu::Cmp,
        13 => Alu::Sub,
        14 => Alu::Rsb,
        _ => return None,
    })
}

fn allowed(alu: Alu, d: u8, n: u8) -> bool {
    let d_unused = matches!(alu, Alu::Tst | Alu::Teq | Alu::Cmn | Alu::Cmp);
    let n_unused = matches!(alu, Alu::Mov | Alu::Mvn);
    let stack = n == 13 && matches!(alu, Alu::Add | Alu::Sub);
    let d_good = d_unused || !barred(d) || (d == 13 && stack);
    let n_good = n_unused || !barred(n) || stack || (n == 13 && matches!(alu, Alu::Cmp | Alu::Cmn));
    d_good && n_good
}

/// Data processing (modified immediate): `ThumbExpandImm_C`.
pub(super) fn modified_immediate(a: u32, b: u32) -> Op {
    let (n, d, flags) = (reg(a, 0), reg(b, 8), a & 0x10 != 0);
    let Some(alu) = alu(field(a, 5, 4), d, n, flags) else { return Op::Undefined };
    if !allowed(alu, d, n) {
        return Op::Undefined;
    }
    let (value, carry) = expand(field(a, 10, 1) << 11 | field(b, 12, 3) << 8 | field(b, 0, 8));
    match alu {
        Alu::Mov if !flags => Op::MovImmediate { d, value },
        Alu::Add if !flags => Op::AddImmediate { d, n, value },
        Alu::Sub if !flags => Op::AddImmediate { d, n, value: value.wrapping_neg() },
        Alu::Cmp => Op::CmpImmediate { n, value },
        _ => Op::Immediate { alu, flags, d, n, carry, value },
    }
}

fn expand(constant: u32) -> (u32, Option<bool>) {
    let byte = constant & 0xFF;
    match constant >> 8 {
        0 => (byte, None),
        1 => (byte << 16 | byte, None),
        2 => (byte << 24 | byte << 8, None),
        3 => (byte * 0x0101_0101, None),
        _ => {
            let value = (0x80 | constant & 0x7F).rotate_right(constant >> 7);
            (value, Some(value >> 31 == 1))
        }
    }
}

/// Data processing (plain binary immediate).
pub(super) fn plain_immediate(place: Place, a: u32, b: u32) -> Op {
    let (n, d) = (reg(a, 0), reg(b, 8));
    let value = field(a, 10, 1) << 11 | field(b, 12, 3) << 8 | field(b, 0, 8);
    let wide_value = field(a, 0, 4) << 12 | value;
    let (lsb, low5) = ((field(b, 12, 3) << 2 | field(b, 6, 2)) as u8, field(b, 0, 5) as u8);
    let stack = n == 13 && d == 13;
    let op = field(a, 4, 5);
    if barred(d) && !(stack && matches!(op, 0 | 10)) {
        return Op::Undefined;
    }
    match op {
        0 if n == 15 => Op::MovImmediate { d, value: place.base().wrapping_add(value) },
        0 => Op::AddImmediate { d, n, value },
        10 if n == 15 => Op::MovImmediate { d, value: place.base().wrapping_sub(value) },
        10 => Op::AddImmediate { d, n, value: value.wrapping_neg() },
        4 => Op::MovImmediate { d, value: wide_value },
        12 => Op::MovTop { d, value: wide_value as u16 },
        _ if n == 13 || b & 0x20 != 0 || a & 0x400 != 0 => Op::Undefined,
        16 | 18 | 24 | 26 => {
            let signed = op < 24;
            if n == 15 {
                return Op::Undefined;
            }
            if op & 2 != 0 && lsb == 0 {
                if b & 0x10 != 0 {
                    return Op::Undefined;
                }
                return Op::Saturate16 { signed, d, n, to: (low5 & 15) + u8::from(signed) };
            }
            let (shift, amount) = immediate_shift(op & 2, u32::from(lsb));
            Op::Saturate { signed, d, n, to: low5 + u8::from(signed), shift, amount }
        }
        20 | 28 if n != 15 && lsb + low5 < 32 => {
            Op::BitExtract { signed: op == 20, d, n, lsb, width: low5 + 1 }
        }
        22 if low5 >= lsb => {
            let mask = (u32::MAX >> (31 - (low5 - lsb))) << lsb;
            if n == 15 { Op::BitClear { d, mask } } else { Op::BitInsert { d, n, lsb, mask } }
        }
        _ => Op::Undefined,
    }
}

pub(super) fn shifted_register(a: u32, b: u32) -> Op {
    let (n, d, m, flags) = (reg(a, 0), reg(b, 8), reg(b, 0), a & 0x10 != 0);
    let amount = field(b, 12, 3) << 2 | field(b, 6, 2);
    let op = field(a, 5, 4);
    if b & 0x8000 != 0 {
        return Op::Undefined;
    }
    if op == 6 {
        let top = b & 0x20 != 0;
        if flags || b & 0x10 != 0 || barred(d) || barred(n) || barred(m) {
            return Op::Undefined;
        }
        let amount = if top && amount == 0 { 32 } else { amount as u8 };
        return Op::Pack { top, d, n, m, amount };
    }
    let Some(alu) = alu(op, d, n, flags) else { return Op::Undefined };
    let (shift, amount) = immediate_shift(field(b, 4, 2), amount);
    // MOV without a shift may move the stack pointer.
    let plain_move = alu == Alu::Mov && shift == Shift::Lsl && amount == 0 && !flags;
    if plain_move && d != 15 && m != 15 && !(d == 13 && m == 13) {
        return Op::MovRegister { d, m };
    }
    let stack_shift = d == 13 && !(shift == Shift::Lsl && amount <= 3);
    if !allowed(alu, d, n) || barred(m) || stack_shift && !matches!(alu, Alu::Cmp | Alu::Cmn) {
        return Op::Undefined;
    }
    match (alu, flags, shift, amount) {
        (Alu::Add, false, Shift::Lsl, 0) => Op::AddRegister { d, n, m },
        (Alu::Cmp, _, Shift::Lsl, 0) => Op::CmpRegister { n, m },
        _ => Op::Register { alu, flags, d, n, m, shift, amount },
    }
}

pub(super) fn branch_or_control(place: Place, a: u32, b: u32) -> Op {
    let sign = field(a, 10, 1);
    match (b >> 12 & 5, field(a, 7, 3)) {
        (0, 7) => control(a, b),
        (0, _) => {
            if place.in_it {
                return Op::Undefined;
            }
            let distance = sign << 20
                | field(b, 11, 1) << 19
                | field(b, 13, 1) << 18
                | field(a, 0, 6) << 12
                | field(b, 0, 11) << 1;
            Op::BranchIf { condition: field(a, 6, 4) as u8, target: place.target(sign_extend(distance, 21)) }
        }
        (1 | 5, _) => {
            let i1 = !(field(b, 13, 1) ^ sign) & 1;
            let i2 = !(field(b, 11, 1) ^ sign) & 1;
            let distance = sign << 24 | i1 << 23 | i2 << 22 | field(a, 0, 10) << 12 | field(b, 0, 11) << 1;
            let target = place.target(sign_extend(distance, 25));
            if b & 0x4000 == 0 { Op::Branch { target } } else { Op::Call { target } }
        }
        _ => Op::Undefined,
    }
}

fn control(a: u32, b: u32) -> Op {
    match field(a, 4, 7) {
        0x38 | 0x39 => {
            let mask = field(b, 10, 2) as u8;
            let n = reg(a, 0);
            if barred(n) || mask == 0 || b & 0x2300 != 0 {
                return Op::Undefined;
            }
            let special = field(b, 0, 8) as u8;
            let known = matches!(special, 0..=3 | 8 | 9 | 16..=20);
            if known { Op::MoveToSpecial { n, special, mask } } else { Op::Undefined }
        }
        0x3A if reg(a, 0) == 15 && b & 0x2700 == 0 => match field(b, 0, 8) {
            2 => Op::Wfe,
            3 => Op::Wfi,
            4 => Op::Sev,
            _ => Op::Nop,
        },
        0x3B if b & 0x2F00 == 0x0F00 && reg(a, 0) == 15 => match field(b, 4, 4) {
            2 if b & 15 == 15 => Op::ClearExclusive,
            4 | 5 => Op::Barrier { flush: false },
            6 => Op::Barrier { flush: true },
            _ => Op::Undefined,
        },
        0x3E | 0x3F => {
            let d = reg(b, 8);
            if barred(d) || reg(a, 0) != 15 || b & 0x2000 != 0 {
                return Op::Undefined;
            }
            let special = field(b, 0, 8) as u8;
            let known = matches!(special, 0..=3 | 5..=9 | 16..=20);
            if known { Op::MoveFromSpecial { d, special } } else { Op::Undefined }
        }
        _ => Op::Undefined,
    }
}
