//! The instructions of 16 bits.

use super::fields::{Place, field, reg, sign_extend};
use crate::op::{Alu, Extend, Op, Shift, Unary, Width};

pub(super) fn decode(place: Place, halfword: u16) -> Op {
    let h = u32::from(halfword);
    match h >> 10 {
        0x00..=0x0F => shift_add_move(place, h),
        0x10 => data_processing(place, h),
        0x11 => special(h),
        0x12..=0x13 => {
            let address = place.base().wrapping_add(field(h, 0, 8) * 4);
            Op::LoadLiteral { width: Width::Word, t: reg3(h, 8), address }
        }
        0x14..=0x27 => memory(h),
        0x28..=0x29 => {
            // ADR
            Op::MovImmediate { d: reg3(h, 8), value: place.base().wrapping_add(field(h, 0, 8) * 4) }
        }
        0x2A..=0x2B => Op::AddImmediate { d: reg3(h, 8), n: 13, value: field(h, 0, 8) * 4 },
        0x2C..=0x2F => miscellaneous(place, h),
        0x30..=0x33 if h & 0xFF == 0 => Op::Undefined,
        0x30..=0x31 => {
            Op::StoreMultiple { n: reg3(h, 8), list: field(h, 0, 8) as u16, before: false, writeback: true }
        }
        0x32..=0x33 => {
            let (n, list) = (reg3(h, 8), field(h, 0, 8) as u16);
            Op::LoadMultiple { n, list, before: false, writeback: list >> n & 1 == 0 }
        }
        0x34..=0x37 => conditional(place, h),
        0x38..=0x39 => Op::Branch { target: place.target(sign_extend(field(h, 0, 11) << 1, 12)) },
        _ => Op::Undefined,
    }
}

fn reg3(h: u32, low: u32) -> u8 {
    (h >> low & 7) as u8
}

fn shift_add_move(place: Place, h: u32) -> Op {
    let flags = !place.in_it;
    let (d, n, m) = (reg3(h, 0), reg3(h, 3), reg3(h, 6));
    let (d8, value) = (reg3(h, 8), field(h, 0, 8));
    match h >> 9 & 31 {
        op @ 0..=11 => {
            let (shift, amount) = immediate_shift(op >> 2, field(h, 6, 5));
            Op::Register { alu: Alu::Mov, flags, d, n: 0, m: n, shift, amount }
        }
        12 if flags => Op::Register { alu: Alu::Add, flags, d, n, m, shift: Shift::Lsl, amount: 0 },
        12 => Op::AddRegister { d, n, m },
        13 => Op::Register { alu: Alu::Sub, flags, d, n, m, shift: Shift::Lsl, amount: 0 },
        14 => immediate(Alu::Add, flags, d, n, u32::from(m)),
        15 => immediate(Alu::Sub, flags, d, n, u32::from(m)),
        16..=19 => immediate(Alu::Mov, flags, d8, 0, value),
        20..=23 => Op::CmpImmediate { n: d8, value },
        24..=27 => immediate(Alu::Add, flags, d8, d8, value),
        _ => immediate(Alu::Sub, flags, d8, d8, value),
    }
}

/// The plain forms set no flags.
fn immediate(alu: Alu, flags: bool, d: u8, n: u8, value: u32) -> Op {
    match (alu, flags) {
        (Alu::Mov, false) => Op::MovImmediate { d, value },
        (Alu::Add, false) => Op::AddImmediate { d, n, value },
        (Alu::Sub, false) => Op::AddImmediate { d, n, value: value.wrapping_neg() },
        _ => Op::Immediate { alu, flags, d, n, carry: None, value },
    }
}

/// `DecodeImmShift`: 0 to the right is 32, rotation by 0 is RRX.
pub(super) fn immediate_shift(kind: u32, amount: u32) -> (Shift, u8) {
    match (kind, amount) {
        (0, amount) => (Shift::Lsl, amount as u8),
        (1, 0) => (Shift::Lsr, 32),
        (1, amount) => (Shift::Lsr, amount as u8),
        (2, 0) => (Shift::Asr, 32),
        (2, amount) => (Shift::Asr, amount as u8),
        (_, 0) => (Shift::Rrx, 1),
        (_, amount) => (Shift::Ror, amount as u8),
    }
}

fn data_processing(place: Place, h: u32) -> Op {
    let flags = !place.in_it;
    let (d, m) = (reg3(h, 0), reg3(h, 3));
    let plain = |alu| Op::Register { alu, flags, d, n: d, m, shift: Shift::Lsl, amount: 0 };
    let by = |shift| Op::ShiftBy { shift, flags, d, n: d, m };
    match field(h, 6, 4) {
        0 => plain(Alu::And),
        1 => plain(Alu::Eor),
        2 => by(Shift::Lsl),
        3 => by(Shift::Lsr),
        4 => by(Shift::Asr),
        5 => plain(Alu::Adc),
        6 => plain(Alu::Sbc),
        7 => by(Shift::Ror),
        8 => Op::Register { alu: Alu::Tst, flags: true, d: 0, n: d, m, shift: Shift::Lsl, amount: 0 },
        9 => Op::Immediate { alu: Alu::Rsb, flags, d, n: m, carry: None, value: 0 },
        10 => Op::CmpRegister { n: d, m },
        11 => Op::Register { alu: Alu::Cmn, flags: true, d: 0, n: d, m, shift: Shift::Lsl, amount: 0 },
        12 => plain(Alu::Orr),
        13 => Op::Mul { flags, d, n: m, m: d },
        14 => plain(Alu::Bic),
        _ => Op::Register { alu: Alu::Mvn, flags, d, n: 0, m, shift: Shift::Lsl, amount: 0 },
    }
}

/// ADD, CMP, MOV of all registers, BX, BLX.
fn special(h: u32) -> Op {
    let m = reg(h, 3);
    let d = reg3(h, 0) | (h >> 4 & 8) as u8;
    match field(h, 8, 2) {
        0 if d == 15 && m == 15 => Op::Undefined,
        0 if d == 15 => Op::AddPc { m },
        0 => Op::AddRegister { d, n: d, m },
        1 if d == 15 || m == 15 || (d < 8 && m < 8) => Op::Undefined,
        1 => Op::CmpRegister { n: d, m },
        2 if d == 15 => Op::MovPc { m },
        2 => Op::MovRegister { d, m },
        _ if h & 7 != 0 => Op::Undefined,
        _ if h & 0x80 == 0 => Op::BranchExchange { m },
        _ if m == 15 => Op::Undefined,
        _ => Op::CallExchange { m },
    }
}

fn memory(h: u32) -> Op {
    let (t, n, m) = (reg3(h, 0), reg3(h, 3), reg3(h, 6));
    let amount = field(h, 6, 5);
    let load = |width, offset: u32| Op::Load { width, t, n, offset: offset as i32 };
    let store = |width, offset: u32| Op::Store { width, t, n, offset: offset as i32 };
    match h >> 9 {
        0x28 => Op::StoreRegister { width: Width::Word, t, n, m, shift: 0 },
        0x29 => Op::StoreRegister { width: Width::Half, t, n, m, shift: 0 },
        0x2A => Op::StoreRegister { width: Width::Byte, t, n, m, shift: 0 },
        0x2B => Op::LoadRegister { width: Width::SByte, t, n, m, shift: 0 },
        0x2C => Op::LoadRegister { width: Width::Word, t, n, m, shift: 0 },
        0x2D => Op::LoadRegister { width: Width::Half, t, n, m, shift: 0 },
        0x2E => Op::LoadRegister { width: Width::Byte, t, n, m, shift: 0 },
        0x2F => Op::LoadRegister { width: Width::SHalf, t, n, m, shift: 0 },
        0x30..=0x33 => store(Width::Word, amount * 4),
        0x34..=0x37 => load(Width::Word, amount * 4),
        0x38..=0x3B => store(Width::Byte, amount),
        0x3C..=0x3F => load(Width::Byte, amount),
        0x40..=0x43 => store(Width::Half, amount * 2),
        0x44..=0x47 => load(Width::Half, amount * 2),
        op => {
            let (t, offset) = (reg3(h, 8), field(h, 0, 8) as i32 * 4);
            if op < 0x4C {
                Op::Store { width: Width::Word, t, n: 13, offset }
            } else {
                Op::Load { width: Width::Word, t, n: 13, offset }
            }
        }
    }
}

fn miscellaneous(place: Place, h: u32) -> Op {
    let (d, m) = (reg3(h, 0), reg3(h, 3));
    let extend = |kind| Op::Extend { kind, d, n: 15, m, rotate: 0 };
    match field(h, 8, 4) {
        0 => {
            let value = field(h, 0, 7) * 4;
            let value = if h & 0x80 == 0 { value } else { value.wrapping_neg() };
            Op::AddImmediate { d: 13, n: 13, value }
        }
        2 => extend([Extend::Sxth, Extend::Sxtb, Extend::Uxth, Extend::Uxtb][field(h, 6, 2) as usize]),
        1 | 3 | 9 | 11 => {
            if place.in_it {
                return Op::Undefined;
            }
            let distance = field(h, 3, 5) << 1 | field(h, 9, 1) << 6;
            Op::BranchZero { n: d, non_zero: h & 0x800 != 0, target: place.target(distance as i32) }
        }
        4 | 5 if h & 0x1FF != 0 => {
            let list = field(h, 0, 8) as u16 | (field(h, 8, 1) << 14) as u16;
            Op::StoreMultiple { n: 13, list, before: true, writeback: true }
        }
        6 if h & 0xE8 == 0x60 && h & 3 != 0 && !place.in_it => {
            Op::Cps { disable: h & 0x10 != 0, primask: h & 2 != 0, faultmask: h & 1 != 0 }
        }
        10 => match field(h, 6, 2) {
            0 => Op::Unary { kind: Unary::Rev, d, m },
            1 => Op::Unary { kind: Unary::Rev16, d, m },
            3 => Op::Unary { kind: Unary::Revsh, d, m },
            _ => Op::Undefined,
        },
        12 | 13 if h & 0x1FF != 0 => {
            let list = field(h, 0, 8) as u16 | (field(h, 8, 1) << 15) as u16;
            Op::LoadMultiple { n: 13, list, before: false, writeback: true }
        }
        14 => Op::Breakpoint { number: field(h, 0, 8) as u8 },
        15 => if_then_or_hint(place, h),
        _ => Op::Undefined,
    }
}

fn if_then_or_hint(place: Place, h: u32) -> Op {
    let (first, mask) = (field(h, 4, 4), field(h, 0, 4));
    if mask != 0 {
        let always_with_else = first == 14 && mask.count_ones() != 1;
        if first == 15 || always_with_else || place.in_it {
            return Op::Undefined;
        }
        return Op::IfThen { state: field(h, 0, 8) as u8 };
    }
    match first {
        2 => Op::Wfe,
        3 => Op::Wfi,
        4 => Op::Sev,
        _ => Op::Nop,
    }
}

fn conditional(place: Place, h: u32) -> Op {
    match field(h, 8, 4) {
        14 => Op::Undefined,
        15 => Op::Svc { number: field(h, 0, 8) as u8 },
        _ if place.in_it => Op::Undefined,
        condition => Op::BranchIf {
            condition: condition as u8,
            target: place.target(sign_extend(field(h, 0, 8) << 1, 9)),
        },
    }
}
