//! Cycles of an instruction with memory that never waits.
//!
//! Source: Arm's Cortex-M4 Technical Reference Manual (DDI 0439), table 3-1 (instruction set summary), section 3.3.2
//! (load/store timings) and table 7-1 (FPU instructions). Cycles that depend on more than the instruction are added
//! at execution:
//! * a branch that is taken: the refill of the pipeline, P, which the manual gives as 1 to 3. Here: 2 if the distance
//!   is in the instruction (the processor fetches ahead to it), 3 if a register or memory gives the target;
//! * a load: 2 cycles, 1 if it directly follows a load that does not give its address (they are pipelined); a store:
//!   1;
//! * a load or store whose address depends on the result of the data-processing instruction before it: 1 more;
//! * a division: 2 to 12, here 2 and one for each 4 bits by which the quotient is long (early termination is by both
//!   operands);
//! * an access that is not aligned: 1 for each part more.
//!
//! Not modelled: the alignment of a branch's target (except in the chip's fetch hook), and the contention of literal
//! loads with the fetch unit. Nor do integer instructions run beside VDIV and VSQRT. IT takes 1 cycle, without
//! folding. A store's wait states count in full, without a write buffer.

use crate::op::{Float2, Float3, Op};

/// Branch with its distance in the instruction.
pub(crate) const REFILL_NEAR: u64 = 2;
/// Target in a register or memory.
pub(crate) const REFILL_FAR: u64 = 3;
/// From the interrupt to the handler's first instruction.
pub(crate) const ENTRY: u64 = 12;
/// From the return to the interrupted code.
pub(crate) const RETURN: u64 = 10;
/// From one handler to the next without unstacking.
pub(crate) const TAIL_CHAIN: u64 = 6;
/// Stacking the floating-point registers, at once or late.
pub(crate) const FLOAT_STATE: u64 = 17;

/// Irrelevant for the next instruction.
pub(crate) const NOTHING: u8 = 0x1F;
/// Written by a load.
pub(crate) const LOADED: u8 = 0x20;

/// Least cycles, and the register that the next load or store may wait for. One load has [`LOADED`].
pub(crate) fn of(op: Op) -> (u8, u8) {
    match op {
        Op::MovImmediate { d, .. }
        | Op::AddImmediate { d, .. }
        | Op::MovRegister { d, .. }
        | Op::AddRegister { d, .. }
        | Op::Immediate { d, .. }
        | Op::Register { d, .. }
        | Op::ShiftBy { d, .. }
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
        | Op::Mul { d, .. }
        | Op::Multiply { d, .. } => (1, d),
        Op::Long { high, .. } => (1, high),
        Op::Divide { d, .. } => (2, d),
        Op::Load { t, .. }
        | Op::LoadRegister { t, .. }
        | Op::LoadLiteral { t, .. }
        | Op::LoadIndexed { t, .. }
        | Op::LoadUnprivileged { t, .. }
        | Op::LoadExclusive { t, .. } => (1, LOADED | t),
        Op::StoreExclusive { .. }
        | Op::MoveFromSpecial { .. }
        | Op::MoveToSpecial { .. }
        | Op::FloatFromCore2 { .. }
        | Op::FloatToCore2 { .. } => (2, NOTHING),
        Op::LoadDouble { .. } | Op::StoreDouble { .. } | Op::TableBranch { .. } => (3, NOTHING),
        Op::LoadMultiple { list, .. } | Op::StoreMultiple { list, .. } => {
            (1 + list.count_ones() as u8, NOTHING)
        }
        Op::Float3 { kind, .. } => (float3(kind), NOTHING),
        Op::Float2 { kind: Float2::Sqrt, .. } => (14, NOTHING),
        Op::FloatLoad { double, .. } | Op::FloatStore { double, .. } => (2 + u8::from(double), NOTHING),
        Op::FloatLoadMultiple { count, .. } | Op::FloatStoreMultiple { count, .. } => (1 + count, NOTHING),
        _ => (1, NOTHING),
    }
}

fn float3(kind: Float3) -> u8 {
    match kind {
        Float3::Vdiv => 14,
        Float3::Vmul | Float3::Vnmul | Float3::Vadd | Float3::Vsub => 1,
        _ => 3,
    }
}

pub(crate) fn division(n: u32, m: u32) -> u64 {
    let quotient_bits = (n.max(1).ilog2() + 1).saturating_sub(m.max(1).ilog2());
    if m == 0 || n < m { 0 } else { u64::from(quotient_bits.div_ceil(4) + 2).min(10) }
}
