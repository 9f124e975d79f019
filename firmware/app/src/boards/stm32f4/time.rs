//! The clock: TIM2 counts microseconds in 32 bits, and is embassy-time's driver here.
//!
//! The driver of embassy-stm32 counts 16-bit overflows by an interrupt. While an erase of flash stops the processor (0.5 s), it
//! loses all but one, each 65.536 ms of the record's time. This driver reads the time from the counter. A wrap (71.6 min) is
//! detected at the next reading of the time; reception reads it each millisecond.

use core::cell::RefCell;
use core::task::Waker;

use critical_section::Mutex;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::InterruptExt as _;
use embassy_stm32::pac::TIM2;
use embassy_stm32::peripherals;
use embassy_stm32::rcc;
use embassy_time_driver::{Driver, TICK_HZ};
use embassy_time_queue_utils::Queue;

use crate::costs::{Stage, measure};

/// Longest alarm: half of the counter's range, so that no alarm is mistaken for a later one.
const AHEAD_MAX: u64 = 1 << 31;

struct State {
    wraps: u32,
    last: u32,
    alarms: Queue,
}

struct Clock(Mutex<RefCell<State>>);

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock(
    Mutex::new(RefCell::new(State { wraps: 0, last: 0, alarms: Queue::new() }))
));

impl State {
    fn now(&mut self) -> u64 {
        let count = TIM2.cnt().read();
        if count < self.last {
            self.wraps = self.wraps.wrapping_add(1);
        }
        self.last = count;
        u64::from(self.wraps) << 32 | u64::from(count)
    }

    fn arm(&mut self) {
        loop {
            let now = self.now();
            let next = self.alarms.next_expiration(now).min(now + AHEAD_MAX);
            TIM2.ccr(0).write_value(next as u32);
            // An alarm in the past would not fire.
            if self.now() < next {
                return;
            }
        }
    }
}

impl Driver for Clock {
    fn now(&self) -> u64 {
        critical_section::with(|cs| self.0.borrow_ref_mut(cs).now())
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        critical_section::with(|cs| {
            let mut state = self.0.borrow_ref_mut(cs);
            if state.alarms.schedule_wake(at, waker) {
                state.arm();
            }
        });
    }
}

/// The clock tree is set; time begins at 0.
pub(super) fn start() {
    rcc::enable_and_reset::<peripherals::TIM2>();
    let ticks = rcc::frequency::<peripherals::TIM2>().0 / TICK_HZ as u32;
    TIM2.psc().write_value(ticks.saturating_sub(1) as u16);
    TIM2.arr().write_value(u32::MAX);
    // The prescaler is taken over by an update.
    TIM2.egr().write(|w| w.set_ug(true));
    TIM2.sr().write(|w| w.0 = 0);
    TIM2.dier().write(|w| w.set_ccie(0, true));
    TIM2.cr1().write(|w| w.set_cen(true));
    // SAFETY: the handler below is the driver's own, and no code relies on its being masked.
    unsafe { interrupt::TIM2.enable() };
}

/// Sleeps for this many microseconds or until an earlier interrupt, by WFI, or by WFE: not at all if an interrupt came since
/// the last time. It uses the counter's second channel, so only one task may call it: the least urgent.
pub(crate) fn nap(micros: u32, sleep: impl FnOnce()) {
    TIM2.ccr(1).write_value(TIM2.cnt().read().wrapping_add(micros));
    TIM2.dier().modify(|w| w.set_ccie(1, true));
    measure(Stage::Idle, sleep);
    TIM2.dier().modify(|w| w.set_ccie(1, false));
}

#[interrupt]
fn TIM2() {
    // Bits are cleared by a zero.
    embassy_stm32::pac::TIM2.sr().write(|w| w.0 = 0);
    critical_section::with(|cs| CLOCK.0.borrow_ref_mut(cs).arm());
}
