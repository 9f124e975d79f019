//! The independent watchdog with its own oscillator of 17 to 47 kHz (DS8626, table 36). Once started, only a debugger's halt
//! stops it.

use stm32_metapac::iwdg::vals::Key;
pub use stm32_metapac::iwdg::vals::Pr as Divider;
use stm32_metapac::{DBGMCU, IWDG};

/// Looks until the watchdog's registers are taken over: 0.3 ms of its clock, some twenty times of that at the processor's first one.
const TRIES_MAX: u32 = 20_000;

/// Starts it: `turns` of the oscillator's divided clock, at most 4,096. A debugger that halts the processor halts it as well.
pub fn start(divider: Divider, turns: u16) {
    DBGMCU.apb1fzr().modify(|w| w.set_iwdg(true));
    IWDG.kr().write(|w| w.set_key(Key::START));
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    IWDG.pr().write(|w| w.set_pr(divider));
    IWDG.rlr().write(|w| w.set_rl(turns - 1));
    // Written values take effect within five of its clocks (RM0090, 21.4.4); until then it counts from 0.5 s.
    let mut tries = 0_u32;
    while (IWDG.sr().read().pvu() || IWDG.sr().read().rvu()) && tries < TRIES_MAX {
        tries += 1;
    }
    feed();
}

/// Restarts its time.
pub fn feed() {
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}
