//! The boards: what the app needs of a machine, and one file a board that provides it.
//!
//! Nothing above this module knows which board it runs on. A feature of this crate chooses it: `board-f405` and `board-f429`
//! real ones, which share [`stm32f4`], `board-emulated` QEMU's `netduinoplus2`. A board is a file here and one for the
//! linker beside it, which names its memories (`f405.x`). A board module has
//!
//! | name | what |
//! |---|---|
//! | `NAME` | the board's name |
//! | `PORT_INTERRUPTS` | what moves the ports' bytes |
//! | `remember()` | brings back memory that survives a reset, where the machine does not do so itself; first of all |
//! | `take() -> Parts` | starts the machine; to be called once, first |
//! | the types in [`Parts`] | what is in each place there |
//! | `Idle::run()` | what the processor does while all tasks wait; never returns |
//! | `ended()` | waits for the end of the input; for ever on a board that flies |
//! | `cycles()` | a free running counter of [`CYCLE_BITS`] bits, for measuring |
//! | `busy_cycles()` | what `cycles()` counted while tasks ran, in the processor's cycles; 0 where it counts something else |
//! | `done(&Report)` | the log is closed after `ended()` |
//! | `LATE_TURNS`, `TIME_STOPS_WITH_TASKS` | when the watchdog counts as late (`watch`) |
//! | `bites_soon()` | the watchdog was not fed, and is about to bite: where it is not a device of its own, it does so now |
//! | `restart()` | after a fault |

#[cfg(feature = "board-emulated")]
pub(crate) mod emulated;
#[cfg(feature = "board-emulated")]
pub(crate) use emulated as board;

#[cfg(feature = "board-f405")]
pub(crate) mod f405;
#[cfg(feature = "board-f405")]
pub(crate) use f405 as board;

#[cfg(feature = "board-f429")]
pub(crate) mod f429;
#[cfg(feature = "board-f429")]
pub(crate) use f429 as board;

#[cfg(feature = "stm32f4")]
pub(crate) mod stm32f4;

#[cfg(any(
    all(feature = "board-f405", feature = "board-f429"),
    all(feature = "stm32f4", feature = "board-emulated")
))]
compile_error!("one board at a time: choose `board-f405`, `board-f429` or `board-emulated`");
#[cfg(not(any(feature = "board-f405", feature = "board-f429", feature = "board-emulated")))]
compile_error!("no board: build with `--features board-f405`, `board-f429` or `board-emulated`");

/// Bits of `cycles()` that count: `SysTick` has 24, and the cycle counter is read as if it had no more.
pub(crate) const CYCLE_BITS: u32 = 24;

/// What the app gets of a board.
pub(crate) struct Parts {
    /// [`Receive`] and [`Transmit`].
    pub(crate) autopilot: (board::AutopilotRx, board::AutopilotTx),
    /// [`Receive`] and [`Transmit`].
    pub(crate) gs: (board::GsRx, board::GsTx),
    /// `CardDevice`.
    pub(crate) card: board::Card,
    /// `NorFlash`, two sectors.
    pub(crate) store: Option<board::StoreFlash>,
    pub(crate) led: board::Led,
    pub(crate) watchdog: board::Watchdog,
    pub(crate) idle: board::Idle,
    pub(crate) boot: Boot,
}

/// Bytes were lost before the reception task could fetch them: it came too late and the receive buffer ran over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub(crate) struct Overrun;

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

    /// The port's baud rate, both ways, from the next frame on.
    fn set_baud(&mut self, baud: u32);
}

/// Why the machine started.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
#[cfg_attr(
    feature = "board-emulated",
    expect(dead_code, reason = "the emulator knows only how to be started")
)]
pub(crate) enum ResetCause {
    /// Power came.
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// The reset button or the debugger.
    Pin,
    /// The firmware itself, after a fault.
    Software,
    /// The watchdog was not fed.
    Watchdog,
}

impl ResetCause {
    /// Whether it may have come in flight. Power that comes on its own is a pilot's.
    pub(crate) const fn may_be_in_flight(self) -> bool {
        !matches!(self, Self::PowerOn | Self::Pin)
    }

    /// As the log names it.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::PowerOn => "power-on",
            Self::BrownOut => "brown-out",
            Self::Pin => "pin",
            Self::Software => "software",
            Self::Watchdog => "watchdog",
        }
    }
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
    /// Differs from one start to the next.
    pub(crate) entropy: u32,
}
