//! The processor's own fault, caught whatever became of the stack.
//!
//! Every fault ends as `HardFault`, as the milder ones are not switched on. A stack that overflows does so below the
//! memory that it lies at the bottom of (`memory.x`): nothing else is hurt, but the handler has no stack either. So it
//! begins with a stack of its own: the other end of the same memory, whose contents nobody will ever go back to.

use core::arch::{asm, naked_asm};

use cortex_m::peripheral::SCB;
use cortex_m_rt::ExceptionFrame;

use crate::fault::{self, Registers};
use crate::{executors, memory};

/// Stack that is left to the handler: where less is, it takes the other end.
const HANDLER_BYTES: usize = 1_024;
/// Words of the stack that are searched for a return address: with one in a dozen, the caller's is among them.
const SEARCHED_WORDS: usize = 128;
/// Bits of CFSR that say that the registers could not be stacked: STKERR and MSTKERR.
const STACKING: u32 = 1 << 12 | 1 << 4;

/// The exception itself. Goes on in [`caught`] with the stack pointer as it was.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "mrs r0, msp",
        "ldr r1, ={end} + {room}",
        "cmp r0, r1",
        "bhs 2f",
        "ldr r1, ={start}",
        "msr msp, r1",
        "2:",
        "b {caught}",
        end = sym memory::_stack_end,
        start = sym memory::_stack_start,
        room = const HANDLER_BYTES,
        caught = sym caught,
    )
}

extern "C" fn caught(stack: usize) -> ! {
    let status = status();
    let (bottom, top) = memory::stack_bounds();
    if stack < bottom || status[0] & STACKING != 0 {
        let mut registers = Registers::default();
        registers[8..].copy_from_slice(&status);
        let near = return_address();
        registers[5] = near;
        fault::processor(executors::begun(), registers, true, format_args!("called from {near:08x}"));
    }
    if stack + size_of::<ExceptionFrame>() > top {
        fault::processor(executors::begun(), Registers::default(), false, format_args!("stack {stack:08x}"));
    }
    // SAFETY: the processor stacked its registers there, in memory that is the stack's by the checks above.
    let frame = unsafe { &*core::ptr::with_exposed_provenance::<ExceptionFrame>(stack) };
    // What ran before this exception is in the stacked status.
    let running = (frame.xpsr() & 0x1FF) as u16;
    fault::processor(running, stacked(frame), false, format_args!("pc {:08x}", frame.pc()));
}

/// What was stacked, and why.
pub(crate) fn stacked(frame: &ExceptionFrame) -> Registers {
    let f = frame;
    let [cfsr, hfsr, mmfar, bfar] = status();
    [f.r0(), f.r1(), f.r2(), f.r3(), f.r12(), f.lr(), f.pc(), f.xpsr(), cfsr, hfsr, mmfar, bfar]
}

/// The registers of whoever calls, as far as they tell something: where it returns to, where it is, and as what it runs.
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

fn status() -> [u32; 4] {
    // SAFETY: reading the status registers that every Cortex-M4 has (ARMv7-M, B3.2.2) has no side effect.
    unsafe {
        let scb = &*SCB::PTR;
        [scb.cfsr.read(), scb.hfsr.read(), scb.mmfar.read(), scb.bfar.read()]
    }
}

/// The innermost address on a full stack that a function of ours would return to; 0 where there is none.
fn return_address() -> u32 {
    let code = memory::code();
    let is_return = |word: &u32| word & 1 == 1 && code.contains(&(*word as usize));
    memory::stack_words().take(SEARCHED_WORDS).find(is_return).map_or(0, |word| word & !1)
}
