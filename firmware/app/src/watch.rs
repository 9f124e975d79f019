//! Watchdog monitor: finds the cause of a watchdog reset.
//!
//! A watchdog reset leaves no trace. So `SysTick`, the most urgent exception, counts the time since the last feeding. Before the
//! timeout it leaves a note of the interrupted code with its registers, so it catches a hanging task of any urgency. Only code
//! that masks all interrupts leaves no note; the next start reports that too.

use core::arch::naked_asm;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::ExceptionFrame;

use crate::boards::board;
use crate::fault;

/// The watchdog does not run yet.
const NEVER: u32 = u32::MAX;

/// Turns of `SysTick`.
static SINCE_FED: AtomicU32 = AtomicU32::new(NEVER);

pub(crate) fn fed() {
    let since = SINCE_FED.swap(0, Ordering::Relaxed);
    if since != NEVER && since >= board::LATE_TURNS {
        fault::not_late();
    }
}

/// The exception itself: [`turn`] with what it interrupted.
#[unsafe(no_mangle)]
#[unsafe(naked)]
unsafe extern "C" fn SysTick() {
    naked_asm!("mrs r0, msp", "b {turn}", turn = sym turn)
}

extern "C" fn turn(interrupted: *const ExceptionFrame) {
    // SAFETY: the processor stacked its registers there as this exception began.
    let frame = unsafe { &*interrupted };
    let since = SINCE_FED.load(Ordering::Relaxed);
    if since == NEVER {
        return;
    }
    let since = since.saturating_add(1).min(NEVER - 1);
    SINCE_FED.store(since, Ordering::Relaxed);
    if since >= board::LATE_TURNS {
        fault::late(frame);
    }
}
