//! What each stage costs: cycles of the processor, or, in the emulator under `-icount`, instructions.
//!
//! Stages interrupt each other, so time is charged to the stage that runs: entering one stops the clock of the one it
//! interrupts. Idle is a stage too; what it leaves of the whole is the load.

use core::cell::RefCell;

use critical_section::Mutex;
use hums_core::time::Instant;

use crate::boards::board;
use crate::boards::machine::CYCLE_BITS;
use crate::report::{STAGES, Stage};

/// The processor's clock, 168 MHz on every board.
const CYCLES_A_MICROSECOND: u64 = 168;

struct Meter {
    current: Stage,
    since: u32,
    totals: [u64; STAGES],
}

static METER: Mutex<RefCell<Meter>> =
    Mutex::new(RefCell::new(Meter { current: Stage::Idle, since: 0, totals: [0; STAGES] }));

/// Runs `work` on the account of `stage`. Longer than 2^24 cycles (0.1 s) in one go counts modulo that.
pub(crate) fn measure<R>(stage: Stage, work: impl FnOnce() -> R) -> R {
    let interrupted = switch_to(stage);
    let result = work();
    switch_to(interrupted);
    result
}

/// Within `measure`: what follows is on the account of `stage`.
pub(crate) fn enter(stage: Stage) {
    switch_to(stage);
}

/// Cycles of each stage since power-on, in the order of [`Stage::NAMES`].
pub(crate) fn totals() -> [u64; STAGES] {
    critical_section::with(|cs| METER.borrow_ref(cs).totals)
}

fn switch_to(stage: Stage) -> Stage {
    critical_section::with(|cs| {
        let mut meter = METER.borrow_ref_mut(cs);
        let now = board::cycles();
        let spent = now.wrapping_sub(meter.since) & ((1 << CYCLE_BITS) - 1);
        meter.since = now;
        let before = meter.current;
        meter.current = stage;
        if let Some(total) = meter.totals.get_mut(before as usize) {
            *total = total.wrapping_add(u64::from(spent));
        }
        before
    })
}

/// What the processor was busy, second by second.
pub(crate) struct Load {
    since: Instant,
    busy: u64,
    worst: u16,
}

impl Load {
    /// Nothing is known yet.
    pub(crate) const fn new() -> Self {
        Self { since: Instant::ZERO, busy: 0, worst: 0 }
    }

    /// The last second's and the worst second's, in thousandths, once a second has passed since the last answer.
    pub(crate) fn step(&mut self, now: Instant) -> Option<(u16, u16)> {
        let micros = now.since(self.since).as_micros();
        if micros < 1_000_000 {
            return None;
        }
        let idle = Stage::Idle as usize;
        let counted =
            totals().iter().enumerate().filter(|(stage, _)| *stage != idle).map(|(_, cycles)| cycles).sum();
        let busy = board::busy_cycles(counted);
        let permille = 1_000 * busy.wrapping_sub(self.busy) / (micros * CYCLES_A_MICROSECOND);
        (self.since, self.busy) = (now, busy);
        let permille = permille.min(1_000) as u16;
        self.worst = self.worst.max(permille);
        Some((permille, self.worst))
    }
}
