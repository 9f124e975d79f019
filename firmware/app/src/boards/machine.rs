//! Data of any machine, and of a start.

use hums_onboard::ResetCause;

/// Reload value of `SysTick`: all bits set, 0.1 s at 168 MHz.
pub(crate) const SYSTICK_RELOAD: u32 = (1 << 24) - 1;

/// The receive buffer overflowed because the reception task ran too late. The number of lost bytes is unknown: at most those of
/// this many milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Overrun {
    pub(crate) blind_ms: u32,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Boot {
    pub(crate) id: [u8; 12],
    pub(crate) cause: ResetCause,
    /// Reset status register.
    pub(crate) cause_register: u32,
    /// Random number of this start; `None` if the board has none.
    pub(crate) entropy: Option<u32>,
}
