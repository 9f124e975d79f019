//! The loads and stores of 32 bits.

use super::fields::{Place, barred, field, reg};
use crate::op::{Index, Op, Width};

/// LDM, STM and their kin.
pub(super) fn multiple(a: u32, b: u32) -> Op {
    let (n, list, writeback, load) = (reg(a, 0), b as u16, a & 0x20 != 0, a & 0x10 != 0);
    let before = match field(a, 7, 2) {
        1 => false,
        2 => true,
        _ => return Op::Undefined,
    };
    let barred_in_list = if load { 0x2000 } else { 0xA000 };
    let both = load && list & 0xC000 == 0xC000;
    if n == 15
        || list.count_ones() < 2
        || list & barred_in_list != 0
        || both
        || writeback && list >> n & 1 == 1
    {
        return Op::Undefined;
    }
    if load {
        Op::LoadMultiple { n, list, before, writeback }
    } else {
        Op::StoreMultiple { n, list, before, writeback }
    }
}

/// LDRD, STRD, the exclusive ones, TBB and TBH.
pub(super) fn double_or_exclusive(a: u32, b: u32) -> Op {
    let (n, t, t2) = (reg(a, 0), reg(b, 12), reg(b, 8));
    let (before, up, writeback, load) = (a & 0x100 != 0, a & 0x80 != 0, a & 0x20 != 0, a & 0x10 != 0);
    if before || writeback {
        let offset = field(b, 0, 8) as i16 * 4;
        let offset = if up { offset } else { -offset };
        let index = match (before, writeback) {
            (true, false) => Index::Offset,
            (true, true) => Index::Pre,
            _ => Index::Post,
        };
        if barred(t) || barred(t2) || writeback && (n == 15 || n == t || n == t2) {
            return Op::Undefined;
        }
        return match load {
            true if t == t2 => Op::Undefined,
            true => Op::LoadDouble { t, t2, n, offset, index },
            false if n == 15 => Op::Undefined,
            false => Op::StoreDouble { t, t2, n, offset, index },
        };
    }
    let width = if b & 0x10 == 0 { Width::Byte } else { Width::Half };
    match (up, load, field(b, 4, 4)) {
        (false, false, _) => {
            let d = t2;
            if barred(d) || barred(t) || n == 15 || d == n || d == t {
                return Op::Undefined;
            }
            Op::StoreExclusive { width: Width::Word, d, t, n, offset: field(b, 0, 8) as u16 * 4 }
        }
        (false, true, _) if barred(t) || n == 15 || t2 != 15 => Op::Undefined,
        (false, true, _) => Op::LoadExclusive { width: Width::Word, t, n, offset: field(b, 0, 8) as u16 * 4 },
        (true, false, 4 | 5) => {
            let d = reg(b, 0);
            if barred(d) || barred(t) || n == 15 || d == n || d == t || t2 != 15 {
                return Op::Undefined;
            }
            Op::StoreExclusive { width, d, t, n, offset: 0 }
        }
        (true, true, 0 | 1) => {
            let m = reg(b, 0);
            if n == 13 || barred(m) || b & 0xFF00 != 0xF000 {
                return Op::Undefined;
            }
            Op::TableBranch { n, m, half: b & 0x10 != 0 }
        }
        (true, true, 4 | 5) if barred(t) || n == 15 || b & 0xF0F != 0xF0F => Op::Undefined,
        (true, true, 4 | 5) => Op::LoadExclusive { width, t, n, offset: 0 },
        _ => Op::Undefined,
    }
}

enum Form {
    Offset(i32),
    Indexed(i16, Index),
    Register(u8, u8),
    Unprivileged(u8),
}

/// None is not an instruction.
fn form(a: u32, b: u32) -> Option<Form> {
    if a & 0x80 != 0 {
        return Some(Form::Offset(field(b, 0, 12) as i32));
    }
    if b & 0x800 == 0 {
        let m = reg(b, 0);
        return (b & 0x7C0 == 0 && !barred(m)).then_some(Form::Register(m, field(b, 4, 2) as u8));
    }
    let offset = field(b, 0, 8) as i16;
    let signed = if b & 0x200 != 0 { offset } else { -offset };
    match field(b, 8, 3) {
        6 => Some(Form::Unprivileged(offset as u8)),
        4 => Some(Form::Offset(i32::from(signed))),
        5 | 7 => Some(Form::Indexed(signed, Index::Pre)),
        1 | 3 => Some(Form::Indexed(signed, Index::Post)),
        _ => None,
    }
}

pub(super) fn store(a: u32, b: u32) -> Op {
    let (n, t) = (reg(a, 0), reg(b, 12));
    let width = match field(a, 5, 2) {
        0 => Width::Byte,
        1 => Width::Half,
        2 => Width::Word,
        _ => return Op::Undefined,
    };
    if n == 15 || t == 15 || t == 13 && width != Width::Word {
        return Op::Undefined;
    }
    match form(a, b) {
        Some(Form::Offset(offset)) => Op::Store { width, t, n, offset },
        Some(Form::Indexed(offset, index)) if n != t => Op::StoreIndexed { width, t, n, offset, index },
        Some(Form::Register(m, shift)) => Op::StoreRegister { width, t, n, m, shift },
        Some(Form::Unprivileged(offset)) if t != 13 => Op::StoreUnprivileged { width, t, n, offset },
        _ => Op::Undefined,
    }
}

/// Loads in all forms, with the hints in their place (`t` 15).
pub(super) fn load(place: Place, a: u32, b: u32, width: Width) -> Op {
    let (n, t) = (reg(a, 0), reg(b, 12));
    let width = match (width, a & 0x100 != 0) {
        (Width::Byte, true) => Width::SByte,
        (Width::Half, true) => Width::SHalf,
        (Width::Word, true) => return Op::Undefined,
        (width, _) => width,
    };
    if n == 15 {
        let offset = field(b, 0, 12);
        let offset = if a & 0x80 != 0 { offset } else { offset.wrapping_neg() };
        return match (width, t) {
            (Width::Word, _) => Op::LoadLiteral { width, t, address: place.base().wrapping_add(offset) },
            (_, 15) => Op::Nop,
            (_, 13) => Op::Undefined,
            _ => Op::LoadLiteral { width, t, address: place.base().wrapping_add(offset) },
        };
    }
    let form = form(a, b);
    if width != Width::Word && barred(t) {
        return match form {
            Some(Form::Offset(_) | Form::Register(..)) if t == 15 => Op::Nop,
            _ => Op::Undefined,
        };
    }
    match form {
        Some(Form::Offset(offset)) => Op::Load { width, t, n, offset },
        Some(Form::Indexed(offset, index)) if n != t => Op::LoadIndexed { width, t, n, offset, index },
        Some(Form::Register(m, shift)) => Op::LoadRegister { width, t, n, m, shift },
        Some(Form::Unprivileged(offset)) if !barred(t) => Op::LoadUnprivileged { width, t, n, offset },
        _ => Op::Undefined,
    }
}
