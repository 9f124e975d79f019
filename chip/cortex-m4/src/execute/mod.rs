//! Execution by `ARMv7-M`'s manual, chapter A7.
//!
//! Frequent operations are inlined here; others are a call away, so that this stays in the host's cache.

mod alu;
mod float;
mod memory;
mod multiply;
mod simd;
mod system;

use crate::bus::Bus;
use crate::op::{Alu, Op};
use crate::processor::Core;
use crate::timing::{LOADED, REFILL_FAR, REFILL_NEAR};
use crate::trap::Trap;

impl Core {
    #[inline(always)]
    pub(crate) fn get(&self, register: u8) -> u32 {
        self.r[usize::from(register & 15)]
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, register: u8, value: u32) {
        self.r[usize::from(register & 15)] = value;
    }

    /// On a trap, registers are as before, but for those that a load of several has reached.
    #[inline(always)]
    pub(crate) fn execute<B: Bus>(&mut self, bus: &mut B, op: Op) -> Result<(), Trap> {
        match op {
            Op::MovImmediate { d, value } => self.set(d, value),
            Op::MovRegister { d, m } => self.set(d, self.get(m)),
            Op::AddImmediate { d, n, value } => self.set(d, self.get(n).wrapping_add(value)),
            Op::AddRegister { d, n, m } => self.set(d, self.get(n).wrapping_add(self.get(m))),
            Op::CmpImmediate { n, value } => self.compare(self.get(n), value),
            Op::CmpRegister { n, m } => self.compare(self.get(n), self.get(m)),
            Op::Immediate { alu, flags, d, n, carry, value } => {
                let carry = carry.unwrap_or(self.flags.c);
                self.alu(alu, flags, d, self.get(n), value, carry);
            }
            Op::Register { alu, flags, d, n, m, shift, amount } => {
                let (value, carry) = alu::shift(self.get(m), shift, amount, self.flags.c);
                self.alu(alu, flags, d, self.get(n), value, carry);
            }
            Op::ShiftBy { shift, flags, d, n, m } => {
                let amount = self.get(m) as u8;
                let (value, carry) = alu::shift(self.get(n), shift, amount, self.flags.c);
                self.alu(Alu::Mov, flags, d, 0, value, carry);
            }
            Op::BitExtract { signed, d, n, lsb, width } => {
                let high = self.get(n) << (32 - lsb - width);
                let value =
                    if signed { ((high as i32) >> (32 - width)) as u32 } else { high >> (32 - width) };
                self.set(d, value);
            }
            Op::Extend { kind, d, n, m, rotate } => self.extend(kind, d, n, m, rotate),
            Op::IfThen { state } => self.it = state,
            Op::Nop => {}
            _ => return self.execute_flow(bus, op),
        }
        Ok(())
    }

    #[inline(always)]
    fn execute_flow<B: Bus>(&mut self, bus: &mut B, op: Op) -> Result<(), Trap> {
        match op {
            Op::Load { width, t, n, offset } => {
                self.wait_for(n);
                let value = self.load(bus, self.get(n).wrapping_add_signed(offset), width)?;
                return self.loaded(t, value);
            }
            Op::Store { width, t, n, offset } => {
                self.stall_for(n);
                return self.store(bus, self.get(n).wrapping_add_signed(offset), width, self.get(t));
            }
            Op::LoadRegister { width, t, n, m, shift } => {
                self.wait_for2(n, m);
                let value = self.load(bus, self.get(n).wrapping_add(self.get(m) << shift), width)?;
                return self.loaded(t, value);
            }
            Op::StoreRegister { width, t, n, m, shift } => {
                self.stall_for(n);
                self.stall_for(m);
                let address = self.get(n).wrapping_add(self.get(m) << shift);
                return self.store(bus, address, width, self.get(t));
            }
            Op::LoadLiteral { width, t, address } => {
                self.wait_for(15);
                let value = self.load(bus, address, width)?;
                return self.loaded(t, value);
            }
            Op::BranchIf { condition, target } => {
                if self.flags.holds(condition) {
                    self.jump(target, REFILL_NEAR);
                }
            }
            Op::Branch { target } => self.jump(target, REFILL_NEAR),
            Op::BranchZero { n, non_zero, target } => {
                if (self.get(n) == 0) != non_zero {
                    self.jump(target, REFILL_NEAR);
                }
            }
            Op::Call { target } => {
                self.r[14] = self.next | 1;
                self.jump(target, REFILL_NEAR);
            }
            Op::BranchExchange { m } => return self.exchange(self.get(m)),
            Op::LoadMultiple { n, list, before, writeback } => {
                return self.load_multiple(bus, n, list, before, writeback);
            }
            Op::StoreMultiple { n, list, before, writeback } => {
                return self.store_multiple(bus, n, list, before, writeback);
            }
            _ => return self.execute_others(bus, op),
        }
        Ok(())
    }

    #[inline(never)]
    fn execute_others<B: Bus>(&mut self, bus: &mut B, op: Op) -> Result<(), Trap> {
        match op {
            Op::Float3 { .. }
            | Op::Float2 { .. }
            | Op::FloatCompare { .. }
            | Op::FloatImmediate { .. }
            | Op::FloatLoad { .. }
            | Op::FloatStore { .. }
            | Op::FloatLoadMultiple { .. }
            | Op::FloatStoreMultiple { .. }
            | Op::FloatFromCore { .. }
            | Op::FloatToCore { .. }
            | Op::FloatFromCore2 { .. }
            | Op::FloatToCore2 { .. }
            | Op::FloatStatusToCore { .. }
            | Op::FloatStatusFromCore { .. } => self.execute_float(bus, op),
            Op::LoadIndexed { .. }
            | Op::StoreIndexed { .. }
            | Op::LoadUnprivileged { .. }
            | Op::StoreUnprivileged { .. }
            | Op::LoadDouble { .. }
            | Op::StoreDouble { .. }
            | Op::LoadExclusive { .. }
            | Op::StoreExclusive { .. }
            | Op::ClearExclusive
            | Op::TableBranch { .. } => self.execute_memory(bus, op),
            Op::BitInsert { .. }
            | Op::BitClear { .. }
            | Op::MovTop { .. }
            | Op::Unary { .. }
            | Op::Mul { .. }
            | Op::Multiply { .. }
            | Op::Long { .. }
            | Op::Divide { .. } => self.execute_multiply(op),
            Op::Saturate { .. }
            | Op::Saturate16 { .. }
            | Op::Select { .. }
            | Op::Parallel { .. }
            | Op::Saturating { .. }
            | Op::Pack { .. } => {
                self.execute_simd(op);
                Ok(())
            }
            _ => self.execute_system(op),
        }
    }

    #[inline(always)]
    pub(crate) fn jump(&mut self, target: u32, refill: u64) {
        self.next = target & !1;
        self.branched = true;
        self.cycles += refill;
    }

    /// The lowest bit is the instruction set; or a return from an exception.
    #[inline(always)]
    pub(crate) fn exchange(&mut self, target: u32) -> Result<(), Trap> {
        self.jump(target, REFILL_FAR);
        if target >= 0xF000_0000 && self.ipsr != 0 {
            return Err(Trap::Return(target));
        }
        if target & 1 == 0 {
            self.thumb = false;
            self.deadline = 0;
        }
        Ok(())
    }

    /// A load's register, which may be the program counter.
    #[inline(always)]
    pub(crate) fn loaded(&mut self, register: u8, value: u32) -> Result<(), Trap> {
        if register == 15 {
            return self.exchange(value);
        }
        self.set(register, value);
        Ok(())
    }

    /// The cycles of a load beyond the first. One more unless pipelined with a load before; one more if the base was computed
    /// just before.
    #[inline(always)]
    pub(crate) fn wait_for(&mut self, n: u8) {
        self.cycles += u64::from(self.previous & LOADED == 0 || self.previous == LOADED | n);
        self.stall_for(n);
    }

    #[inline(always)]
    fn wait_for2(&mut self, n: u8, m: u8) {
        self.wait_for(n);
        self.cycles += u64::from(self.previous == LOADED | m && m != n);
        self.stall_for(if m == n { 16 } else { m });
    }

    /// Costs a cycle if computed just before.
    #[inline(always)]
    pub(crate) fn stall_for(&mut self, n: u8) {
        self.cycles += u64::from(self.previous == n);
    }
}
