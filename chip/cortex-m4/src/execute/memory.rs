//! Loads and stores of several registers, exclusive and unprivileged ones, branches by a table.

use crate::bus::{Bus, Size};
use crate::op::{Index, Op, Width};
use crate::processor::Core;
use crate::timing::REFILL_FAR;
use crate::trap::Trap;

impl Core {
    #[inline(always)]
    pub(crate) fn load_multiple<B: Bus>(
        &mut self,
        bus: &mut B,
        n: u8,
        list: u16,
        before: bool,
        writeback: bool,
    ) -> Result<(), Trap> {
        let base = self.get(n);
        let bytes = 4 * list.count_ones();
        let mut address = if before { base.wrapping_sub(bytes) } else { base };
        let mut left = list & 0x7FFF;
        // After a fault in the middle the instruction can be repeated.
        let mut new_base = None;
        while left != 0 {
            let register = left.trailing_zeros() as u8;
            left &= left - 1;
            let value = self.read_strict(bus, address, Size::Word)?;
            address = address.wrapping_add(4);
            if register == n { new_base = Some(value) } else { self.set(register, value) }
        }
        let target = if list >> 15 == 1 { Some(self.read_strict(bus, address, Size::Word)?) } else { None };
        if let Some(value) = new_base {
            self.set(n, value);
        } else if writeback {
            self.set(n, if before { base.wrapping_sub(bytes) } else { base.wrapping_add(bytes) });
        }
        match target {
            Some(target) => {
                // Code after a change looks at it.
                self.r[13] &= !3;
                self.exchange(target)
            }
            None => Ok(()),
        }
    }

    #[inline(always)]
    pub(crate) fn store_multiple<B: Bus>(
        &mut self,
        bus: &mut B,
        n: u8,
        list: u16,
        before: bool,
        writeback: bool,
    ) -> Result<(), Trap> {
        let base = self.get(n);
        let bytes = 4 * list.count_ones();
        let mut address = if before { base.wrapping_sub(bytes) } else { base };
        let mut left = list;
        while left != 0 {
            let register = left.trailing_zeros() as u8;
            left &= left - 1;
            self.write_strict(bus, address, Size::Word, self.get(register))?;
            address = address.wrapping_add(4);
        }
        if writeback {
            self.set(n, if before { base.wrapping_sub(bytes) } else { base.wrapping_add(bytes) });
        }
        Ok(())
    }

    /// Address, and the base after it.
    fn indexed(&self, n: u8, offset: i16, index: Index) -> (u32, u32) {
        // The program counter as a base is aligned.
        let base = if n == 15 { self.get(15) & !3 } else { self.get(n) };
        let moved = base.wrapping_add_signed(i32::from(offset));
        match index {
            Index::Offset => (moved, base),
            Index::Pre => (moved, moved),
            Index::Post => (base, moved),
        }
    }

    pub(super) fn execute_memory<B: Bus>(&mut self, bus: &mut B, op: Op) -> Result<(), Trap> {
        match op {
            Op::LoadIndexed { width, t, n, offset, index } => {
                self.wait_for(n);
                let (address, base) = self.indexed(n, offset, index);
                let value = self.load(bus, address, width)?;
                self.set(n, base);
                self.r[13] &= !3;
                return self.loaded(t, value);
            }
            Op::StoreIndexed { width, t, n, offset, index } => {
                self.stall_for(n);
                let (address, base) = self.indexed(n, offset, index);
                self.store(bus, address, width, self.get(t))?;
                self.set(n, base);
            }
            Op::LoadUnprivileged { width, t, n, offset } => {
                self.wait_for(n);
                let value =
                    self.as_user(|core| core.load(bus, core.get(n).wrapping_add(u32::from(offset)), width))?;
                self.set(t, value);
            }
            Op::StoreUnprivileged { width, t, n, offset } => {
                self.stall_for(n);
                let (address, value) = (self.get(n).wrapping_add(u32::from(offset)), self.get(t));
                self.as_user(|core| core.store(bus, address, width, value))?;
            }
            Op::LoadDouble { t, t2, n, offset, index } => {
                self.stall_for(n);
                let (address, base) = self.indexed(n, offset, index);
                let first = self.read_strict(bus, address, Size::Word)?;
                let second = self.read_strict(bus, address.wrapping_add(4), Size::Word)?;
                if n != 15 {
                    self.set(n, base);
                }
                self.set(t, first);
                self.set(t2, second);
            }
            Op::StoreDouble { t, t2, n, offset, index } => {
                self.stall_for(n);
                let (address, base) = self.indexed(n, offset, index);
                self.write_strict(bus, address, Size::Word, self.get(t))?;
                self.write_strict(bus, address.wrapping_add(4), Size::Word, self.get(t2))?;
                self.set(n, base);
            }
            Op::TableBranch { n, m, half } => {
                let (index, width) =
                    if half { (self.get(m) << 1, Width::Half) } else { (self.get(m), Width::Byte) };
                let distance = self.load(bus, self.get(n).wrapping_add(index), width)?;
                self.jump(self.get(15).wrapping_add(distance * 2), REFILL_FAR);
            }
            _ => return self.execute_exclusive(bus, op),
        }
        Ok(())
    }

    fn execute_exclusive<B: Bus>(&mut self, bus: &mut B, op: Op) -> Result<(), Trap> {
        match op {
            Op::LoadExclusive { width, t, n, offset } => {
                self.wait_for(n);
                let address = self.get(n).wrapping_add(u32::from(offset));
                let value = self.read_strict(bus, address, size(width))?;
                self.exclusive = true;
                self.set(t, value);
            }
            Op::StoreExclusive { width, d, t, n, offset } => {
                self.stall_for(n);
                let address = self.get(n).wrapping_add(u32::from(offset));
                if address & (size(width).bytes() - 1) != 0 {
                    return Err(Trap::Unaligned);
                }
                if self.exclusive {
                    self.store(bus, address, width, self.get(t))?;
                }
                self.set(d, u32::from(!self.exclusive));
                self.exclusive = false;
            }
            Op::ClearExclusive => self.exclusive = false,
            _ => return Err(Trap::Undefined),
        }
        Ok(())
    }

    fn as_user<R>(&mut self, access: impl FnOnce(&mut Self) -> R) -> R {
        let (ipsr, unprivileged) = (self.ipsr, self.unprivileged);
        (self.ipsr, self.unprivileged) = (0, true);
        let result = access(self);
        (self.ipsr, self.unprivileged) = (ipsr, unprivileged);
        result
    }
}

fn size(width: Width) -> Size {
    match width {
        Width::Byte | Width::SByte => Size::Byte,
        Width::Half | Width::SHalf => Size::Half,
        Width::Word => Size::Word,
    }
}
