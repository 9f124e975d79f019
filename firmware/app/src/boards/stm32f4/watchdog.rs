//! Independent watchdog with its own oscillator. Once started, only a debugger's halt stops it.
//!
//! It starts early, so it also ends a hanging start. Its second is 0.68 s at its fastest oscillator (47 kHz, datasheet, table
//! 36), and the monitor feeds it every 50 ms. An erase of flash stops all code for at most 0.5 s and begins with the full time
//! ([`reload`]).

use embassy_stm32::pac::iwdg::vals::{Key, Pr};
use embassy_stm32::pac::{DBGMCU, IWDG};

/// A second of 32 kHz by 8.
const RELOAD: u16 = 4_000 - 1;

/// A debugger that halts the processor halts it as well.
pub(super) fn start() {
    DBGMCU.apb1fzr().modify(|w| w.set_iwdg(true));
    IWDG.kr().write(|w| w.set_key(Key::START));
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    IWDG.pr().write(|w| w.set_pr(Pr::DIVIDE_BY8));
    IWDG.rlr().write(|w| w.set_rl(RELOAD));
    // Written values take effect within five of its clocks (RM0090, 21.4.4); until then it counts from 0.5 s.
    let mut tries = 0_u32;
    while (IWDG.sr().read().pvu() || IWDG.sr().read().rvu()) && tries < TRIES_MAX {
        tries += 1;
    }
    reload();
}

/// Looks until the watchdog's registers are taken over: 0.3 ms of its clock, some twenty times of that at the processor's first one.
const TRIES_MAX: u32 = 20_000;

/// Restarts its time.
pub(crate) fn reload() {
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}

pub(crate) struct Watchdog(());

impl Watchdog {
    /// It runs already.
    pub(crate) const fn new() -> Self {
        Self(())
    }

    #[expect(clippy::unused_self, reason = "whoever has it may feed it")]
    pub(crate) fn feed(&mut self) {
        reload();
    }
}
