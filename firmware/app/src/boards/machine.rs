//! What every board is made of: the types of its parts, and what is known of its start.

use embedded_storage::nor_flash::NorFlash;
use hums_onboard::ResetCause;
use hums_recorder::CardDevice;

/// What `SysTick` begins again with: all of its bits, 0.1 s at 168 MHz.
pub(crate) const SYSTICK_RELOAD: u32 = (1 << 24) - 1;

/// Bytes that reception fetches at a time: 5 ms at 921,600 baud, five times what comes between two looks. After a delay
/// it takes several, without a pause between them.
pub(crate) const FETCH_BYTES: usize = 512;

/// The types of a board's parts.
pub(crate) trait Machine {
    type AutopilotRx: Receive;
    type AutopilotTx: Transmit;
    type GsRx: Receive;
    type GsTx: Transmit;
    type Card: CardDevice;
    /// Two sectors.
    type StoreFlash: NorFlash;
    type Led;
    type Watchdog;
    type Idle;
}

/// What the app gets of a board.
pub(crate) struct Parts<M: Machine> {
    pub(crate) autopilot: (M::AutopilotRx, M::AutopilotTx),
    pub(crate) gs: (M::GsRx, M::GsTx),
    pub(crate) card: M::Card,
    pub(crate) store: Option<M::StoreFlash>,
    pub(crate) led: M::Led,
    pub(crate) watchdog: M::Watchdog,
    pub(crate) idle: M::Idle,
    pub(crate) boot: Boot,
}

/// Bytes were lost before the reception task could fetch them: it came too late and the receive buffer ran over. How many is not
/// known; at most what comes in so many milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Overrun {
    pub(crate) blind_ms: u32,
}

/// The receiving half of a port.
pub(crate) trait Receive {
    /// Waits for bytes and gives as many as have come and fit, at least one. Damaged bytes are given like others: the
    /// frame's checksum finds them.
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, Overrun>;
}

/// The sending half of a port.
pub(crate) trait Transmit {
    /// Sends all of `bytes`; returns when the port has taken the last.
    async fn transmit(&mut self, bytes: &[u8]);

    /// Begins anew after a transmission that did not come to its end.
    fn restart(&mut self) {}

    /// Sets the port's baud rate, both ways, once the last frame has gone out.
    async fn set_baud(&mut self, baud: u32);
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
