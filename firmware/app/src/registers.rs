//! Processor registers for a fault note.

use core::arch::asm;

use cortex_m::peripheral::SCB;
use cortex_m_rt::ExceptionFrame;

/// In the order of [`hums_blackbox::record::Fault::registers`]: the stacked registers, then four fault registers.
pub(crate) type Registers = [u32; 12];

pub(crate) fn stacked(frame: &ExceptionFrame) -> Registers {
    let f = frame;
    let [cfsr, hfsr, mmfar, bfar] = status();
    [f.r0(), f.r1(), f.r2(), f.r3(), f.r12(), f.lr(), f.pc(), f.xpsr(), cfsr, hfsr, mmfar, bfar]
}

/// The useful registers of the caller: return address, current address and status.
#[inline]
pub(crate) fn now() -> Registers {
    let mut registers = Registers::default();
    let xpsr: u32;
    // SAFETY: reads the status register into another one.
    unsafe { asm!("mrs {}, xpsr", out(reg) xpsr, options(nomem, nostack, preserves_flags)) };
    registers[5] = cortex_m::register::lr::read();
    registers[6] = cortex_m::register::pc::read();
    registers[7] = xpsr;
    registers
}

/// The fault registers: CFSR, HFSR, MMFAR, BFAR.
pub(crate) fn status() -> [u32; 4] {
    // SAFETY: reading the status registers that every Cortex-M4 has (ARMv7-M, B3.2.2) has no side effect.
    unsafe {
        let scb = &*SCB::PTR;
        [scb.cfsr.read(), scb.hfsr.read(), scb.mmfar.read(), scb.bfar.read()]
    }
}
