//! Instructions with a state in which they do no harm to the testing program.

use super::random::Random;
use super::{AT, SCRATCH, SLOT, SLOTS, STACK, patterns};
use cortex_m4_model::decode;
use cortex_m4_model::op::{Alu, Index, Op, Width};

#[derive(Clone)]
pub(crate) struct Case {
    pub(crate) name: &'static str,
    pub(crate) op: Op,
    pub(crate) code: [u16; 32],
    pub(crate) r: [u32; 15],
    pub(crate) xpsr: u32,
    pub(crate) s: [u32; 32],
    pub(crate) fpscr: u32,
    pub(crate) start: u32,
}

impl Case {
    pub(crate) fn input(&self) -> Vec<u32> {
        let mut words =
            vec![self.r[0], self.r[1], self.r[2], self.r[3], self.r[12], self.r[14], self.start, self.xpsr];
        words.extend(&self.s[..16]);
        words.extend([self.fpscr, 0]);
        words.extend(&self.s[16..]);
        words.extend(&self.r[4..12]);
        words
    }
}

/// Instructions on registers alone, with IT blocks of up to four.
pub(crate) fn sequence(random: &mut Random, number: u32) -> Case {
    let slot = SLOTS + number * SLOT;
    let mut case = state(random, "sequence", Op::Nop, slot + AT);
    let (mut place, mut in_it) = ((AT / 2) as usize, 0);
    while place < 20 || in_it > 0 {
        if in_it == 0 && random.one_in(3) {
            let mask = 1 + random.below(15);
            case.code[place] = 0xBF00 | (random.below(14) << 4 | mask) as u16;
            in_it = 4 - mask.trailing_zeros();
            place += 1;
            continue;
        }
        let (_, pattern) = random.of(patterns::PATTERNS);
        let bits = patterns::fill(pattern, random.next());
        let wide = pattern.len() > 20;
        let halfwords = if wide { [(bits >> 16) as u16, bits as u16] } else { [bits as u16, 0xDF00] };
        let (op, bytes) = decode(slot + place as u32 * 2, in_it > 0, halfwords);
        if on_registers_alone(op) && wide == (bytes == 4) {
            let halfwords = &halfwords[..bytes as usize / 2];
            case.code[place..place + halfwords.len()].copy_from_slice(halfwords);
            place += halfwords.len();
            in_it = in_it.saturating_sub(1);
        }
    }
    case
}

fn on_registers_alone(op: Op) -> bool {
    match op {
        Op::MovImmediate { d, .. }
        | Op::AddImmediate { d, .. }
        | Op::MovRegister { d, .. }
        | Op::AddRegister { d, .. }
        | Op::MovTop { d, .. }
        | Op::BitInsert { d, .. }
        | Op::BitClear { d, .. }
        | Op::BitExtract { d, .. }
        | Op::Saturate { d, .. }
        | Op::Saturate16 { d, .. }
        | Op::Extend { d, .. }
        | Op::Unary { d, .. }
        | Op::Select { d, .. }
        | Op::Parallel { d, .. }
        | Op::Saturating { d, .. }
        | Op::Pack { d, .. }
        | Op::Immediate { d, .. }
        | Op::Register { d, .. }
        | Op::ShiftBy { d, .. }
        | Op::Mul { d, .. }
        | Op::Multiply { d, .. }
        | Op::Divide { d, .. } => d != 13,
        Op::MoveToSpecial { special, .. } => special < 4,
        Op::CmpImmediate { .. }
        | Op::CmpRegister { .. }
        | Op::Long { .. }
        | Op::MoveFromSpecial { .. }
        | Op::Float3 { .. }
        | Op::Float2 { .. }
        | Op::FloatCompare { .. }
        | Op::FloatImmediate { .. }
        | Op::FloatFromCore { .. }
        | Op::FloatToCore { .. }
        | Op::FloatFromCore2 { .. }
        | Op::FloatToCore2 { .. }
        | Op::FloatStatusToCore { .. }
        | Op::FloatStatusFromCore { .. } => true,
        _ => false,
    }
}

fn state(random: &mut Random, name: &'static str, op: Op, start: u32) -> Case {
    let mut case = Case {
        name,
        op,
        code: core::array::from_fn(|i| 0xDF00 | i as u16),
        r: core::array::from_fn(|_| random.operand()),
        xpsr: random.next() & 0xF80F_0000 | 1 << 24,
        s: core::array::from_fn(|_| random.float()),
        fpscr: random.next() & 0xF000_009F | if random.one_in(2) { random.next() & 0x07C0_0000 } else { 0 },
        start,
    };
    case.r[13] = STACK;
    case
}

pub(crate) fn generate(random: &mut Random, number: u32) -> Option<Case> {
    let (name, pattern) = random.of(patterns::PATTERNS);
    let bits = patterns::fill(pattern, random.next());
    let halfwords =
        if pattern.len() > 20 { [(bits >> 16) as u16, bits as u16] } else { [bits as u16, 0xDF00] };
    let slot = SLOTS + number * SLOT;
    let in_it = random.one_in(4);
    let at = AT + 2 * random.below(2);
    let (op, _) = decode(slot + at, in_it, halfwords);
    let allowed_in_it = !matches!(op, Op::BranchIf { .. } | Op::BranchZero { .. } | Op::IfThen { .. });
    let in_it = in_it && allowed_in_it;
    let mut case = state(random, name, op, slot + at);
    let place = (at / 2) as usize;
    case.code[place] = halfwords[0];
    if pattern.len() > 20 {
        case.code[place + 1] = halfwords[1];
    }
    if in_it {
        let condition = random.below(15) as u16;
        case.code[place - 1] = 0xBF08 | condition << 4;
        case.start -= 2;
    }
    prepare(random, &mut case, slot).then_some(case)
}

fn prepare(random: &mut Random, case: &mut Case, slot: u32) -> bool {
    match case.op {
        // QEMU loads; the architecture has an unallocated hint here.
        Op::Nop => !case.name.starts_with("load"),
        Op::Undefined => case.name == "undefined",
        Op::TableBranch { n, m, .. } => {
            let index = random.below(8);
            if n == 15 || m == n || n == 13 {
                return false;
            }
            case.r[usize::from(m)] = index;
            case.r[usize::from(n)] = SCRATCH + 0x170;
            true
        }
        Op::Branch { target }
        | Op::BranchIf { target, .. }
        | Op::BranchZero { target, .. }
        | Op::Call { target } => good_target(target, slot),
        Op::BranchExchange { m } | Op::CallExchange { m } | Op::MovPc { m } => {
            let landing = slot + 32 + 4 * random.below(7);
            case.r[usize::from(m % 15)] =
                random.of(&[landing | 1, landing, 0x3000_0001, 0x9123_4567, 0x9123_4568, 0xFFFF_FFF9]);
            m < 13 || m == 14
        }
        Op::AddPc { m } => {
            case.r[usize::from(m % 15)] = random.of(&[4, 5, 8, 0x4000_0000, 0x4000_0001]);
            m < 13 || m == 14
        }
        Op::AddImmediate { d: 13, n, value } => n == 13 && (value as i32).abs() <= 0x60,
        Op::Register { d: 13, alu, .. } | Op::Immediate { d: 13, alu, .. } => {
            matches!(alu, Alu::Cmp | Alu::Cmn | Alu::Tst | Alu::Teq)
        }
        Op::MoveToSpecial { special, .. } => special < 4,
        Op::IfThen { state } => {
            // The slot is full of SVCs of 16 bits.
            state & 15 != 0
        }
        Op::MovImmediate { d: 13, .. }
        | Op::MovRegister { d: 13, .. }
        | Op::AddRegister { d: 13, .. }
        | Op::Breakpoint { .. }
        | Op::Cps { .. }
        | Op::Wfi
        | Op::Wfe
        | Op::Sev => false,
        Op::Float3 { d, n, m, .. } if random.one_in(2) => {
            for register in [d, n, m] {
                case.s[usize::from(register)] = random.special();
            }
            true
        }
        _ => prepare_memory(random, case, slot),
    }
}

fn prepare_memory(random: &mut Random, case: &mut Case, slot: u32) -> bool {
    let to_pc = to_pc(case.op);
    // An address without memory.
    let target = |size: u32, random: &mut Random| {
        let at = SCRATCH + if to_pc { random.below(0x94) } else { random.below(0x158) };
        if random.one_in(4) && !to_pc { at } else { at & !(size - 1) }
    };
    match case.op {
        Op::Load { width, t, n, offset } => t != 13 && base(case, n, target(bytes(width), random), offset),
        Op::Store { width, n, offset, .. } => base(case, n, target(bytes(width), random), offset),
        Op::LoadIndexed { width, t, n, offset, index } => {
            let at = target(bytes(width), random);
            t != 13 && n != 13 && base(case, n, at, if index == Index::Post { 0 } else { i32::from(offset) })
        }
        Op::StoreIndexed { width, n, offset, index, .. } => {
            let at = target(bytes(width), random);
            (n != 13 || i32::from(offset).abs() <= 0x60)
                && base(case, n, at, if index == Index::Post { 0 } else { i32::from(offset) })
        }
        Op::LoadRegister { width, t, n, m, shift } => {
            t != 13 && by_register(case, n, m, shift, target(bytes(width), random))
        }
        Op::StoreRegister { width, n, m, shift, .. } => {
            by_register(case, n, m, shift, target(bytes(width), random))
        }
        Op::LoadLiteral { t, address, .. } => t != 13 && t != 15 && address >= SLOTS,
        Op::LoadUnprivileged { width, n, offset, .. } | Op::StoreUnprivileged { width, n, offset, .. } => {
            base(case, n, target(bytes(width), random), i32::from(offset))
        }
        Op::LoadDouble { n: 15, .. } | Op::FloatLoad { n: 15, .. } => true,
        Op::LoadDouble { n, offset, index, .. } | Op::StoreDouble { n, offset, index, .. } => {
            let at = target(4, random);
            n != 13 && base(case, n, at, if index == Index::Post { 0 } else { i32::from(offset) })
        }
        Op::LoadExclusive { width, n, offset, .. } => {
            base(case, n, target(bytes(width), random), i32::from(offset))
        }
        Op::StoreExclusive { width, d, n, offset, .. } => {
            let at = target(bytes(width), random) & !(bytes(width) - 1);
            let first = case.code.iter().position(|halfword| halfword >> 8 != 0xDF).unwrap_or(0);
            if random.one_in(2) && case.start == slot + 2 * first as u32 && case.code[first] >= 0xE800 {
                let second = match width {
                    Width::Word => u16::from(d) << 12 | 0xF00 | (offset / 4),
                    Width::Half => u16::from(d) << 12 | 0xF5F,
                    _ => u16::from(d) << 12 | 0xF4F,
                };
                case.code[first - 2] = if width == Width::Word { 0xE850 } else { 0xE8D0 } | u16::from(n);
                case.code[first - 1] = second;
                case.start -= 4;
            }
            base(case, n, at, i32::from(offset))
        }
        Op::LoadMultiple { n, list, before, writeback }
        | Op::StoreMultiple { n, list, before, writeback } => {
            let bytes = 4 * list.count_ones();
            let to_pc = matches!(case.op, Op::LoadMultiple { .. }) && list >> 15 == 1;
            let reach = if to_pc { 0x54 } else { 0x140 };
            let skew = if random.one_in(8) { random.below(4) } else { 0 };
            let start = SCRATCH + (random.below(reach) & !3) + skew;
            let wild = n == 13 && (writeback && bytes > 0x60 || to_pc && before);
            !wild && base(case, n, if before { start + bytes } else { start }, 0)
        }
        Op::FloatLoad { n, offset, .. } | Op::FloatStore { n, offset, .. } => {
            base(case, n, target(4, random), i32::from(offset))
        }
        Op::FloatLoadMultiple { n, count, before, .. } | Op::FloatStoreMultiple { n, count, before, .. } => {
            let bytes = 4 * u32::from(count);
            let start = SCRATCH + (random.below(0x100) & !3);
            (n != 13 || bytes <= 0x60) && base(case, n, if before { start + bytes } else { start }, 0)
        }
        _ => true,
    }
}

fn to_pc(op: Op) -> bool {
    matches!(op, Op::Load { t: 15, .. } | Op::LoadIndexed { t: 15, .. } | Op::LoadRegister { t: 15, .. })
}

fn bytes(width: Width) -> u32 {
    match width {
        Width::Byte | Width::SByte => 1,
        Width::Half | Width::SHalf => 2,
        Width::Word => 4,
    }
}

fn base(case: &mut Case, n: u8, address: u32, offset: i32) -> bool {
    if n == 13 {
        return (0..0x3F0).contains(&offset) || (-0x100..0).contains(&offset) && !to_pc(case.op);
    }
    if n < 15 {
        case.r[usize::from(n)] = address.wrapping_sub(offset as u32);
    }
    n < 15
}

fn by_register(case: &mut Case, n: u8, m: u8, shift: u8, address: u32) -> bool {
    if n == m || m == 13 || m == 15 || n == 15 {
        return false;
    }
    if n == 13 {
        case.r[usize::from(m)] = address.wrapping_sub(STACK) >> shift & 0x3F;
        return true;
    }
    case.r[usize::from(n)] = address.wrapping_sub(case.r[usize::from(m)] << shift);
    true
}

/// A target in the slot, or empty: QEMU repeats its memories behind them, and has devices at `0x4000_0000`.
fn good_target(target: u32, slot: u32) -> bool {
    let outside = matches!(target >> 28, 3 | 6..=13);
    let within =
        (slot..slot + AT - 4).contains(&target) || (slot + AT + 6..slot + SLOT - 4).contains(&target);
    within || outside
}
