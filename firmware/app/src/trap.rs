//! Handlers of fatal errors: panics and processor faults, even with a broken stack. Each leaves a note ([`fault`])
//! and restarts the board.
//!
//! Every fault becomes a `HardFault`, because the milder ones are disabled. The stack is at the bottom of its memory
//! (`memory.x`). So an overflow damages no data, but leaves the handler without a stack. The handler therefore starts
//! a stack of its own at the other end of that memory, which is free by then.

use core::arch::naked_asm;
use core::fmt;
use core::panic::PanicInfo;

use cortex_m_rt::ExceptionFrame;

use crate::boards::board;
use crate::fault::Reason;
use crate::registers::{self, Registers, stacked};
use crate::{exceptions, fault, memory};

/// Stack that the handler needs; with less it uses the other end.
const HANDLER_BYTES: usize = 1_024;
/// Words of the stack that are searched for a return address: with one in a dozen, the caller's is among them.
const SEARCHED_WORDS: usize = 128;
/// Bits of CFSR for registers that could not be stacked: STKERR and MSTKERR.
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
    let status = registers::status();
    let (bottom, top) = memory::stack_bounds();
    if stack < bottom || status[0] & STACKING != 0 {
        let mut registers = Registers::default();
        registers[8..].copy_from_slice(&status);
        let near = return_address();
        registers[5] = near;
        give_up(
            Reason::StackOverflow,
            exceptions::begun(),
            registers,
            format_args!("called from {near:08x}"),
        );
    }
    if stack + size_of::<ExceptionFrame>() > top {
        let place = format_args!("stack {stack:08x}");
        give_up(Reason::ProcessorFault, exceptions::begun(), Registers::default(), place);
    }
    // SAFETY: the processor stacked its registers there, in memory that is the stack's by the checks above.
    let frame = unsafe { &*core::ptr::with_exposed_provenance::<ExceptionFrame>(stack) };
    // The stacked status has the interrupted exception.
    let running = (frame.xpsr() & 0x1FF) as u16;
    give_up(Reason::ProcessorFault, running, stacked(frame), format_args!("pc {:08x}", frame.pc()));
}

/// The innermost return address on a full stack in our code; 0 if there is none.
fn return_address() -> u32 {
    let code = memory::code();
    let is_return = |word: &u32| word & 1 == 1 && code.contains(&(*word as usize));
    memory::stack_words().take(SEARCHED_WORDS).find(is_return).map_or(0, |word| word & !1)
}

fn give_up(reason: Reason, running: u16, registers: Registers, place: fmt::Arguments) -> ! {
    fault::processor(reason, running, registers, place);
    board::restart();
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    fault::panicked(registers::now(), info);
    board::restart();
}
