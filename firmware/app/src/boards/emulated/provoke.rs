//! Faults on purpose (`provoke=WHAT[:TASK][@SECONDS]`), so that a test sees what becomes of them: in one task (the
//! downlink), from some moment of virtual time on (0), once.
//!
//! | what | the task |
//! |---|---|
//! | `panic` | panics |
//! | `bus-fault` | reads where there is no memory |
//! | `overflow` | calls itself until the stack is full |
//! | `spin` | never comes back |
//! | `silence` | waits for ever; only the downlink waits for something that nothing ends |
//! | `supply` | is interrupted by a supply that is too low |
//!
//! `TASK` is `reception`, `monitor`, `downlink` or `storage`.

use core::sync::atomic::{AtomicU32, Ordering};

use hums_onboard::Task;

use super::clock;
use super::reset::reset;
use crate::boards::machine::ResetCause;
use crate::fault;

/// What is to go wrong.
#[derive(Clone, Copy, PartialEq, Eq)]
enum What {
    Panic,
    Bus,
    Overflow,
    Spin,
    Silence,
    Supply,
}

impl What {
    const ALL: [(Self, &str); 6] = [
        (Self::Panic, "panic"),
        (Self::Bus, "bus-fault"),
        (Self::Overflow, "overflow"),
        (Self::Spin, "spin"),
        (Self::Silence, "silence"),
        (Self::Supply, "supply"),
    ];
}

/// What is to go wrong, where and when.
#[derive(Clone, Copy)]
pub(super) struct Plan {
    what: usize,
    task: Task,
    at_s: u32,
}

/// The number of [`What`] in its table and of the task, plus one; 0: nothing, or it has been.
static PLAN: AtomicU32 = AtomicU32::new(0);
static AT_S: AtomicU32 = AtomicU32::new(0);

impl Plan {
    /// As on the command line.
    pub(super) fn parse(text: &str) -> Option<Self> {
        let (what, at_s) = text.split_once('@').unwrap_or((text, "0"));
        let (what, task) = what.split_once(':').unwrap_or((what, Task::Downlink.name()));
        Some(Self {
            what: What::ALL.iter().position(|(_, name)| *name == what)?,
            task: Task::ALL.into_iter().find(|known| known.name() == task)?,
            at_s: at_s.parse().ok()?,
        })
    }
}

/// Makes it go wrong later.
pub(super) fn arm(plan: Option<Plan>) {
    if let Some(Plan { what, task, at_s }) = plan {
        AT_S.store(at_s, Ordering::Relaxed);
        PLAN.store(((what as u32) << 8 | task as u32) + 1, Ordering::Relaxed);
    }
}

/// A place where it may go wrong. `true`: the caller is to wait for ever.
#[expect(clippy::panic, reason = "it is the purpose")]
pub(super) fn here(task: Task) -> bool {
    /// Between the flash and the system's own memory there is nothing.
    const NOWHERE: *const u32 = core::ptr::without_provenance(0x0900_0000);
    let Some(plan) = PLAN.load(Ordering::Relaxed).checked_sub(1) else { return false };
    if plan & 0xFF != task as u32 || clock::now_us() < 1_000_000 * u64::from(AT_S.load(Ordering::Relaxed)) {
        return false;
    }
    PLAN.store(0, Ordering::Relaxed);
    match What::ALL.get(plan as usize >> 8).map(|(what, _)| *what) {
        Some(What::Panic) => panic!("provoked"),
        // SAFETY: there is no memory and no device at this address, so nothing can come of it but the fault.
        Some(What::Bus) => {
            unsafe { NOWHERE.read_volatile() };
            false
        }
        Some(What::Overflow) => fill_stack(0) == 0,
        Some(What::Spin) => loop {
            core::hint::spin_loop();
        },
        Some(What::Silence) => true,
        Some(What::Supply) => {
            fault::supply_low();
            reset(ResetCause::Software)
        }
        None => false,
    }
}

/// Never comes back: the stack ends first.
#[inline(never)]
#[expect(unconditional_recursion, reason = "it is the purpose")]
fn fill_stack(depth: u32) -> u32 {
    let kept = core::hint::black_box([depth; 16]);
    fill_stack(depth + 1) + kept.iter().sum::<u32>()
}
