//! Floating-point instructions; arithmetic is [`crate::softfloat`]'s.

use crate::bus::{Bus, Size};
use crate::op::{Float2, Float3, Op};
use crate::processor::Core;
use crate::registers::FPSCR;
use crate::softfloat::{self as soft, Rounding};
use crate::trap::Trap;

impl Core {
    #[inline(always)]
    fn float_of(&self, register: u8) -> u32 {
        self.s[usize::from(register & 31)]
    }

    #[inline(always)]
    fn set_float(&mut self, register: u8, value: u32) {
        self.s[usize::from(register & 31)] = value;
    }

    pub(super) fn execute_float<B: Bus>(&mut self, bus: &mut B, op: Op) -> Result<(), Trap> {
        if !self.fp_ready {
            self.prepare_float(bus)?;
        }
        match op {
            Op::FloatLoad { d, n, offset, double } => {
                let base = if n == 15 { self.get(15) & !3 } else { self.get(n) };
                self.stall_for(n);
                let address = base.wrapping_add_signed(i32::from(offset));
                self.float_load(bus, d, 1 + u8::from(double), address)?;
            }
            Op::FloatStore { d, n, offset, double } => {
                self.stall_for(n);
                let address = self.get(n).wrapping_add_signed(i32::from(offset));
                self.float_store(bus, d, 1 + u8::from(double), address)?;
            }
            Op::FloatLoadMultiple { d, count, n, before, writeback } => {
                let (start, end) = self.range(n, count, before);
                self.float_load(bus, d, count, start)?;
                if writeback {
                    self.set(n, end);
                }
            }
            Op::FloatStoreMultiple { d, count, n, before, writeback } => {
                let (start, end) = self.range(n, count, before);
                self.float_store(bus, d, count, start)?;
                if writeback {
                    self.set(n, end);
                }
            }
            Op::Float3 { kind, d, n, m } => {
                let result = self.float3(kind, self.float_of(d), self.float_of(n), self.float_of(m));
                self.set_float(d, result);
            }
            Op::Float2 { kind, d, m } => {
                let result = self.float2(kind, self.float_of(d), self.float_of(m));
                self.set_float(d, result);
            }
            Op::FloatCompare { d, m, quiet_too } => {
                let m = m.map_or(0, |m| self.float_of(m));
                let flags = soft::compare(self.float_of(d), m, quiet_too, &mut self.fpscr);
                self.fpscr = self.fpscr & 0x0FFF_FFFF | flags << 28;
            }
            Op::FloatImmediate { d, value } => self.set_float(d, value),
            _ => self.float_transfer(op),
        }
        Ok(())
    }

    fn float_transfer(&mut self, op: Op) {
        match op {
            Op::FloatFromCore { d, t } => self.set_float(d, self.get(t)),
            Op::FloatToCore { t, d } => self.set(t, self.float_of(d)),
            Op::FloatFromCore2 { d, t, t2 } => {
                self.set_float(d, self.get(t));
                self.set_float(d + 1, self.get(t2));
            }
            Op::FloatToCore2 { t, t2, d } => {
                self.set(t, self.float_of(d));
                self.set(t2, self.float_of(d + 1));
            }
            Op::FloatStatusToCore { t: 15 } => self.flags.set_nzcv(self.fpscr),
            Op::FloatStatusToCore { t } => self.set(t, self.fpscr),
            Op::FloatStatusFromCore { t } => self.fpscr = self.get(t) & FPSCR,
            _ => {}
        }
    }

    fn range(&self, n: u8, count: u8, before: bool) -> (u32, u32) {
        let (base, bytes) = (self.get(n), u32::from(count) * 4);
        if before {
            let start = base.wrapping_sub(bytes);
            (start, start)
        } else {
            (base, base.wrapping_add(bytes))
        }
    }

    fn float_load<B: Bus>(&mut self, bus: &mut B, d: u8, count: u8, address: u32) -> Result<(), Trap> {
        for i in 0..count {
            let at = address.wrapping_add(u32::from(i) * 4);
            let value = self.read_strict(bus, at, Size::Word)?;
            self.set_float(d + i, value);
        }
        Ok(())
    }

    fn float_store<B: Bus>(&mut self, bus: &mut B, d: u8, count: u8, address: u32) -> Result<(), Trap> {
        for i in 0..count {
            let at = address.wrapping_add(u32::from(i) * 4);
            self.write_strict(bus, at, Size::Word, self.float_of(d + i))?;
        }
        Ok(())
    }

    fn float3(&mut self, kind: Float3, d: u32, n: u32, m: u32) -> u32 {
        let status = &mut self.fpscr;
        match kind {
            Float3::Vadd => soft::add(n, m, status),
            Float3::Vsub => soft::subtract(n, m, status),
            Float3::Vmul => soft::multiply(n, m, status),
            Float3::Vnmul => soft::negate(soft::multiply(n, m, status)),
            Float3::Vdiv => soft::divide(n, m, status),
            Float3::Vmla => {
                let product = soft::multiply(n, m, status);
                soft::add(d, product, status)
            }
            Float3::Vmls => {
                let product = soft::negate(soft::multiply(n, m, status));
                soft::add(d, product, status)
            }
            Float3::Vnmla => {
                let product = soft::negate(soft::multiply(n, m, status));
                soft::add(soft::negate(d), product, status)
            }
            Float3::Vnmls => {
                let product = soft::multiply(n, m, status);
                soft::add(soft::negate(d), product, status)
            }
            Float3::Vfma => soft::multiply_add(d, n, m, status),
            Float3::Vfms => soft::multiply_add(d, soft::negate(n), m, status),
            Float3::Vfnma => soft::multiply_add(soft::negate(d), soft::negate(n), m, status),
            Float3::Vfnms => soft::multiply_add(soft::negate(d), n, m, status),
        }
    }

    fn float2(&mut self, kind: Float2, d: u32, m: u32) -> u32 {
        let status = &mut self.fpscr;
        let rounding = Rounding::of(*status);
        match kind {
            Float2::Move => m,
            Float2::Abs => m & 0x7FFF_FFFF,
            Float2::Neg => soft::negate(m),
            Float2::Sqrt => soft::square_root(m, status),
            Float2::FromHalf { top } => soft::from_half(if top { m >> 16 } else { m & 0xFFFF }, status),
            Float2::ToHalf { top } => {
                let half = soft::to_half(m, status);
                if top { d & 0xFFFF | half << 16 } else { d & 0xFFFF_0000 | half }
            }
            Float2::FromInt { signed } => soft::from_fixed(m, 0, signed, rounding, status),
            Float2::ToInt { signed, to_zero } => {
                let rounding = if to_zero { Rounding::Zero } else { rounding };
                soft::to_fixed(m, 32, 0, signed, rounding, status)
            }
            Float2::FromFixed { signed, half, fraction } => {
                let value = match (half, signed) {
                    (false, _) => d,
                    (true, true) => d as i16 as u32,
                    (true, false) => d & 0xFFFF,
                };
                soft::from_fixed(value, u32::from(fraction), signed, Rounding::Nearest, status)
            }
            Float2::ToFixed { signed, half, fraction } => {
                let bits = if half { 16 } else { 32 };
                soft::to_fixed(d, bits, u32::from(fraction), signed, Rounding::Zero, status)
            }
        }
    }
}
