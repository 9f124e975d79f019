//! Cost of each stage in processor cycles.
//!
//! Stages interrupt each other, so time is charged to the stage that runs: entering one stops the clock of the one it
//! interrupts. Idle is a stage too; the load is the share of all others.

use core::cell::Cell;

use cortex_m::peripheral::DWT;
use critical_section::{CriticalSection, Mutex};
use hums_core::clock::Instant;

/// The parts that are measured apart; `hums sim --firmware --costs` has their names in this order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stage {
    /// Nothing else; also the interrupts of ports and clock.
    Idle,
    /// Everything in a task that is none of the below: the executors, waiting and waking.
    Tasks,
    /// Bytes to frames.
    Framer,
    Monitor,
    /// Frames to sectors.
    Encode,
    /// Frames to observations, and these into the monitor.
    Observe,
    /// Frames on to the ground station.
    Summary,
    Tick,
    Storage,
}

/// Number of stages.
const STAGES: usize = 9;

/// The processor's clock, 168 MHz on every board.
const CYCLES_A_MICROSECOND: u64 = 168;

/// Cycles of each stage since the start. The model of the chip reads it by its name.
#[unsafe(no_mangle)]
static STAGE_CYCLES: [Mutex<Cell<u64>>; STAGES] = [const { Mutex::new(Cell::new(0)) }; STAGES];
static CURRENT: Mutex<Cell<(Stage, u32)>> = Mutex::new(Cell::new((Stage::Idle, 0)));

/// Runs `work` on the account of `stage`. Longer than 2^32 cycles (25 s) in one go counts modulo that.
pub(crate) fn measure<R>(stage: Stage, work: impl FnOnce() -> R) -> R {
    let interrupted = switch_to(stage);
    let result = work();
    switch_to(interrupted);
    result
}

/// Within `measure`: later time counts for `stage`.
pub(crate) fn enter(stage: Stage) {
    switch_to(stage);
}

fn busy() -> u64 {
    let cycles = |cs: CriticalSection<'_>| {
        let all = STAGE_CYCLES.iter().skip(Stage::Idle as usize + 1);
        all.fold(0, |sum: u64, stage| sum.wrapping_add(stage.borrow(cs).get()))
    };
    critical_section::with(cycles)
}

#[inline(never)]
fn switch_to(stage: Stage) -> Stage {
    critical_section::with(|cs| {
        let now = DWT::cycle_count();
        let (before, since) = CURRENT.borrow(cs).replace((stage, now));
        let spent = now.wrapping_sub(since);
        if let Some(total) = STAGE_CYCLES.get(before as usize) {
            let total = total.borrow(cs);
            total.set(total.get().wrapping_add(u64::from(spent)));
        }
        before
    })
}

pub(crate) struct Load {
    since: Instant,
    busy: u64,
    worst: u16,
}

impl Load {
    pub(crate) const fn new() -> Self {
        Self { since: Instant::ZERO, busy: 0, worst: 0 }
    }

    /// The last second's and the worst second's, in thousandths, once a second has passed since the last answer.
    pub(crate) fn step(&mut self, now: Instant) -> Option<(u16, u16)> {
        let micros = now.since(self.since).as_micros();
        if micros < 1_000_000 {
            return None;
        }
        let busy = busy();
        let permille = 1_000 * busy.wrapping_sub(self.busy) / (micros * CYCLES_A_MICROSECOND);
        (self.since, self.busy) = (now, busy);
        let permille = permille.min(1_000) as u16;
        self.worst = self.worst.max(permille);
        Some((permille, self.worst))
    }
}
