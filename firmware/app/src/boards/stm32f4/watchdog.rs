//! The independent watchdog.

use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;

/// The watchdog's time. The monitor feeds it every 50 ms.
const WATCHDOG_US: u32 = 1_000_000;

/// The independent watchdog: its own oscillator, and once it runs nothing stops it.
pub(crate) struct Watchdog {
    timer: IndependentWatchdog<'static, IWDG>,
    running: bool,
}

impl Watchdog {
    /// Not running yet: it starts with its first feeding.
    pub(crate) fn new(timer: Peri<'static, IWDG>) -> Self {
        Self { timer: IndependentWatchdog::new(timer, WATCHDOG_US), running: false }
    }

    pub(crate) fn feed(&mut self) {
        if self.running {
            self.timer.pet();
        } else {
            self.timer.unleash();
            self.running = true;
        }
    }
}
