//! The virtual clock: stands still while tasks run, and moves only when all of them wait.
//!
//! It is embassy-time's driver here. Because nothing but the recorded input moves it, two runs over the same input
//! see the same times, and see them as `hums sim --speed max` does.

use core::cell::RefCell;
use core::task::Waker;

use critical_section::Mutex;
use embassy_time_driver::Driver;
use embassy_time_queue_utils::Queue;

struct State {
    now_us: u64,
    alarms: Queue,
}

/// The clock of the emulated board.
pub(crate) struct VirtualClock {
    state: Mutex<RefCell<State>>,
}

embassy_time_driver::time_driver_impl!(static CLOCK: VirtualClock = VirtualClock {
    state: Mutex::new(RefCell::new(State { now_us: 0, alarms: Queue::new() })),
});

impl Driver for VirtualClock {
    fn now(&self) -> u64 {
        critical_section::with(|cs| self.state.borrow_ref(cs).now_us)
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            // The answer says whether the next alarm moved; nothing is armed here, idle asks each time.
            let _ = self.state.borrow_ref_mut(cs).alarms.schedule_wake(at, waker);
        });
    }
}

/// Microseconds since power-on.
pub(crate) fn now_us() -> u64 {
    CLOCK.now()
}

/// Moves the clock forward to `to_us`, never back, and wakes the tasks whose alarm has come.
pub(crate) fn advance(to_us: u64) {
    critical_section::with(|cs| {
        let mut state = CLOCK.state.borrow_ref_mut(cs);
        state.now_us = state.now_us.max(to_us);
        let now_us = state.now_us;
        let _ = state.alarms.next_expiration(now_us);
    });
}

/// When the next alarm is due, in microseconds; wakes whatever is due already. `u64::MAX` where there is none.
pub(crate) fn next_alarm() -> u64 {
    critical_section::with(|cs| {
        let mut state = CLOCK.state.borrow_ref_mut(cs);
        let now_us = state.now_us;
        state.alarms.next_expiration(now_us)
    })
}
