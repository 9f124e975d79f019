//! The boards: what the app needs of a machine, and one file a board that provides it.
//!
//! Nothing above this module knows which board it runs on; what a board is made of is in [`machine`]. A feature of this crate chooses it: `board-f405` and `board-f429`
//! real ones, which share `stm32f4`, `board-emulated` QEMU's `netduinoplus2`. A board is a file here and one for the
//! linker beside it, which names its memories (`f405.x`). A board module has
//!
//! | name | what |
//! |---|---|
//! | `NAME` | the board's name |
//! | `PORT_INTERRUPTS` | what moves the ports' bytes |
//! | `remember()` | brings back memory that survives a reset, where the machine does not do so itself; first of all |
//! | `take() -> Parts<Board>` | starts the machine; to be called once, first |
//! | `Board` | its [`Machine`](machine::Machine): the type of each of its parts |
//! | `Idle::run()` | what the processor does while all tasks wait; never returns |
//! | `crystal_failed()` | whether the clock has gone over to a less exact oscillator |
//! | `ended()` | waits for the end of the input; for ever on a board that flies |
//! | `cycles()` | a free running counter of [`CYCLE_BITS`](machine::CYCLE_BITS) bits, for measuring |
//! | `busy_cycles()` | what `cycles()` counted while tasks ran, in the processor's cycles; 0 where it counts something else |
//! | `done(&Report)` | the log is closed after `ended()` |
//! | `LATE_TURNS`, `TIME_STOPS_WITH_TASKS` | when the watchdog counts as late (`watch`) |
//! | `is_watched()` | whether the watchdog is to be fed |
//! | `bites_soon()` | the watchdog was not fed, and is about to bite: where it is not a device of its own, it does so now |
//! | `restart()` | after a fault |

pub(crate) mod machine;

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
