//! What every board is made of: the types of its parts, and what is known of its start.

use hums_onboard::ResetCause;

use super::stm32f4::{Card, Idle, Led, PortRx, PortTx, StoreFlash, Watchdog};

/// What `SysTick` begins again with: all of its bits, 0.1 s at 168 MHz.
pub(crate) const SYSTICK_RELOAD: u32 = (1 << 24) - 1;

/// Bytes that reception fetches at a time: 2.8 ms at 921,600 baud, nearly three times what comes between two looks. After a delay
/// it takes several, without a pause between them.
pub(crate) const FETCH_BYTES: usize = 256;

/// What the app gets of a board: each port's reception and transmission, and the rest.
pub(crate) struct Parts {
    pub(crate) autopilot: (PortRx, PortTx),
    pub(crate) gs: (PortRx, PortTx),
    pub(crate) card: Card,
    /// Two sectors.
    pub(crate) store: Option<StoreFlash>,
    pub(crate) led: Led,
    pub(crate) watchdog: Watchdog,
    pub(crate) idle: Idle,
    pub(crate) boot: Boot,
}

/// Bytes were lost before the reception task could fetch them: it came too late and the receive buffer ran over. How many is not
/// known; at most what comes in so many milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Overrun {
    pub(crate) blind_ms: u32,
}

/// What is known about this machine and this start of it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Boot {
    /// The processor's own number, the same for ever.
    pub(crate) id: [u8; 12],
    /// Why it started.
    pub(crate) cause: ResetCause,
    /// The register that says so.
    pub(crate) cause_register: u32,
    /// Differs from one start to the next; `None` where the board cannot tell such a number.
    pub(crate) entropy: Option<u32>,
}
