//! Watchdog monitor: finds the cause of a watchdog reset.
//!
//! A watchdog reset leaves no trace. So `SysTick`, the most urgent exception, counts the time since the last
//! feeding. Before the timeout it notes the interrupted code with its registers, for a hanging task of any
//! urgency. Only code that masks all interrupts leaves no note; the next start reports that too.
//!
//! In card-reader mode `SysTick` itself feeds the watchdog for some time ([`allow`]), while the card's driver
//! blocks.

use core::arch::naked_asm;
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m_rt::ExceptionFrame;

use crate::boards::board;
use crate::fault;

/// The watchdog does not run yet.
const NEVER: u32 = u32::MAX;

static SINCE_FED: AtomicU32 = AtomicU32::new(NEVER);
/// Turns that `SysTick` itself feeds the watchdog for.
static ALLOWED: AtomicU32 = AtomicU32::new(0);

pub(crate) fn allow(turns: u32) {
    ALLOWED.store(turns, Ordering::Relaxed);
    fed();
}

pub(crate) fn fed() {
    let since = SINCE_FED.swap(0, Ordering::Relaxed);
    if since != NEVER && since >= board::LATE_TURNS {
        fault::not_late();
    }
}

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
    if since < ALLOWED.load(Ordering::Relaxed) {
        board::feed_watchdog();
    } else if since >= board::LATE_TURNS {
        fault::late(frame);
    }
}
