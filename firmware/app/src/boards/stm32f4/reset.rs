//! Cause of a start, and restart.

use embassy_stm32::pac;
use hums_onboard::ResetCause;

pub(crate) fn reset_cause() -> (ResetCause, u32) {
    let flags = pac::RCC.csr().read();
    pac::RCC.csr().modify(|w| w.set_rmvf(true));
    // Several flags are set together; the most specific one first.
    let cause = if flags.wdgrstf() || flags.wwdgrstf() {
        ResetCause::Watchdog
    } else if flags.sftrstf() {
        ResetCause::Software
    } else if flags.porrstf() {
        ResetCause::PowerOn
    } else if flags.borrstf() || flags.lpwrrstf() {
        ResetCause::BrownOut
    } else {
        ResetCause::Pin
    };
    (cause, flags.0)
}

/// Restarts the machine.
pub(crate) fn restart() -> ! {
    cortex_m::peripheral::SCB::sys_reset()
}
