//! The floating-point instructions (`FPv4-SP`): coprocessors 10 and 11.

use super::fields::{barred, field, reg};
use crate::op::{Float2, Float3, Op};

/// All but coprocessors 10 and 11 are missing.
pub(super) fn coprocessor(a: u32, b: u32) -> Op {
    if field(b, 9, 3) != 5 {
        // An M profile lacks Advanced SIMD.
        return if field(a, 8, 2) == 3 { Op::Undefined } else { Op::NoCoprocessor };
    }
    if a & 0x1000 != 0 {
        return Op::Undefined;
    }
    let double = b & 0x100 != 0;
    if a & 0x200 == 0 {
        return if field(a, 5, 4) == 2 { transfer2(a, b) } else { memory(a, b, double) };
    }
    if a & 0x100 != 0 {
        return Op::Undefined;
    }
    match (b & 0x10 != 0, double) {
        (true, _) => transfer(a, b, double),
        (false, true) => Op::Undefined,
        (false, false) => processing(a, b),
    }
}

fn single(word: u32, four: u32, other: u32, one: u32) -> u8 {
    (field(word, four, 4) << 1 | field(other, one, 1)) as u8
}

/// VLDR, VSTR, VLDM, VSTM, VPUSH, VPOP.
fn memory(a: u32, b: u32, double: bool) -> Op {
    let (before, up, writeback, load) = (a & 0x100 != 0, a & 0x80 != 0, a & 0x20 != 0, a & 0x10 != 0);
    let n = reg(a, 0);
    let words = field(b, 0, 8);
    // A double's even single register; doubles 16 to 31 are missing.
    let d = if double { reg(b, 12) * 2 } else { single(b, 12, a, 6) };
    if double && a & 0x40 != 0 {
        return Op::Undefined;
    }
    if before && !writeback {
        let offset = words as i16 * 4;
        let offset = if up { offset } else { -offset };
        return match load {
            true => Op::FloatLoad { d, n, offset, double },
            false if n == 15 => Op::Undefined,
            false => Op::FloatStore { d, n, offset, double },
        };
    }
    // FLDMX and FSTMX with an odd count move their even count.
    let count = if double { words as u8 & !1 } else { words as u8 };
    let fits = words != 0 && words <= 32 && u32::from(d) + u32::from(count) <= 32 && count != 0;
    let mode = matches!((before, up, writeback), (false, true, _) | (true, false, true));
    if !fits || !mode || n == 15 || double && words & 1 != 0 {
        return Op::Undefined;
    }
    if load {
        Op::FloatLoadMultiple { d, count, n, before, writeback }
    } else {
        Op::FloatStoreMultiple { d, count, n, before, writeback }
    }
}

/// VMOV of two core registers.
fn transfer2(a: u32, b: u32) -> Op {
    let (t, t2, to_core) = (reg(b, 12), reg(a, 0), a & 0x10 != 0);
    let double = b & 0x100 != 0;
    let d = if double { reg(b, 0) * 2 } else { single(b, 0, b, 5) };
    let wrong = a & 0x40 == 0 || b & 0xD0 != 0x10 || double && b & 0x20 != 0;
    if wrong || barred(t) || barred(t2) || d == 31 || to_core && t == t2 {
        return Op::Undefined;
    }
    if to_core { Op::FloatToCore2 { t, t2, d } } else { Op::FloatFromCore2 { d, t, t2 } }
}

/// VMOV of one core register, VMRS, VMSR.
fn transfer(a: u32, b: u32, double: bool) -> Op {
    let (t, to_core, op) = (reg(b, 12), a & 0x10 != 0, field(a, 5, 3));
    match (double, op) {
        (false, 0) if !barred(t) && b & 0x6F == 0 => {
            let d = single(a, 0, b, 7);
            if to_core { Op::FloatToCore { t, d } } else { Op::FloatFromCore { d, t } }
        }
        (false, 7) if reg(a, 0) == 1 && b & 0xEF == 0 => match to_core {
            true if t != 13 => Op::FloatStatusToCore { t },
            false if !barred(t) => Op::FloatStatusFromCore { t },
            _ => Op::Undefined,
        },
        // A word of a double register.
        (true, 0 | 1) if !barred(t) && b & 0xEF == 0 => {
            let d = reg(a, 0) * 2 + op as u8;
            if to_core { Op::FloatToCore { t, d } } else { Op::FloatFromCore { d, t } }
        }
        _ => Op::Undefined,
    }
}

/// Data processing.
fn processing(a: u32, b: u32) -> Op {
    let (d, n, m) = (single(b, 12, a, 6), single(a, 0, b, 7), single(b, 0, b, 5));
    let second = b & 0x40 != 0;
    let kind = match (field(a, 4, 4) & 0xB, second) {
        (0, false) => Float3::Vmla,
        (0, true) => Float3::Vmls,
        (1, false) => Float3::Vnmls,
        (1, true) => Float3::Vnmla,
        (2, false) => Float3::Vmul,
        (2, true) => Float3::Vnmul,
        (3, false) => Float3::Vadd,
        (3, true) => Float3::Vsub,
        (8, false) => Float3::Vdiv,
        (9, false) => Float3::Vfnms,
        (9, true) => Float3::Vfnma,
        (10, false) => Float3::Vfma,
        (10, true) => Float3::Vfms,
        (11, false) if b & 0xA0 == 0 => return Op::FloatImmediate { d, value: expand(reg(a, 0), reg(b, 0)) },
        (11, true) => return two(a, b, d, m),
        _ => return Op::Undefined,
    };
    Op::Float3 { kind, d, n, m }
}

/// `VFPExpandImm` of 32 bits.
fn expand(high: u8, low: u8) -> u32 {
    let byte = u32::from(high) << 4 | u32::from(low);
    let exponent = if byte & 0x40 == 0 { 0x80 } else { 0x7C };
    (byte & 0x80) << 24 | (exponent | byte >> 4 & 3) << 23 | (byte & 15) << 19
}

/// VMOV to VCVT.
fn two(a: u32, b: u32, d: u8, m: u8) -> Op {
    let top = b & 0x80 != 0;
    let kind = match field(a, 0, 4) {
        0 if top => Float2::Abs,
        0 => Float2::Move,
        1 if top => Float2::Sqrt,
        1 => Float2::Neg,
        2 => Float2::FromHalf { top },
        3 => Float2::ToHalf { top },
        4 => return Op::FloatCompare { d, m: Some(m), quiet_too: top },
        5 if b & 0x2F == 0 => return Op::FloatCompare { d, m: None, quiet_too: top },
        8 => Float2::FromInt { signed: top },
        12 => Float2::ToInt { signed: false, to_zero: top },
        13 => Float2::ToInt { signed: true, to_zero: top },
        op @ (10 | 11 | 14 | 15) => {
            let half = b & 0x80 == 0;
            let size = if half { 16 } else { 32 };
            let immediate = (field(b, 0, 4) << 1 | field(b, 5, 1)) as u8;
            if immediate > size {
                return Op::Undefined;
            }
            let (signed, fraction) = (op & 1 == 0, size - immediate);
            let kind = match op & 4 {
                0 => Float2::FromFixed { signed, half, fraction },
                _ => Float2::ToFixed { signed, half, fraction },
            };
            return Op::Float2 { kind, d, m: d };
        }
        _ => return Op::Undefined,
    };
    Op::Float2 { kind, d, m }
}
