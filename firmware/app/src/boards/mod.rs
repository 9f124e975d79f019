//! Boards: the app's interface to a machine, and one file per board that implements it.
//!
//! Code above this module does not depend on the board. [`machine`] has the parts of a board. A feature of this crate selects the
//! board: `board-f405` or `board-f429`; both share `stm32f4`. A board is a source file here and a linker file beside it with its
//! memories (`f405.x`). A board module has
//!
//! | name | what |
//! |---|---|
//! | `NAME` | the board's name |
//! | `PORT_INTERRUPTS` | what moves the bytes of ports and card |
//! | `take() -> Parts` | starts the machine; to be called once, first |
//! | `PortRx`, `Card` and so on | the types of its parts, which `stm32f4` has for all |
//! | `Idle::run()` | what the processor does while all tasks wait; never returns |
//! | `crystal_failed()` | whether the clock has gone over to a less exact oscillator |
//! | `LATE_TURNS` | when the watchdog counts as late (`watch`) |
//! | `restart()` | after a fault |

pub(crate) mod machine;

#[cfg(feature = "board-f405")]
pub(crate) mod f405;
#[cfg(feature = "board-f405")]
pub(crate) use f405 as board;

#[cfg(feature = "board-f429")]
pub(crate) mod f429;
#[cfg(feature = "board-f429")]
pub(crate) use f429 as board;

pub(crate) mod stm32f4;

#[cfg(all(feature = "board-f405", feature = "board-f429"))]
compile_error!("one board at a time: choose `board-f405` or `board-f429`");
#[cfg(not(any(feature = "board-f405", feature = "board-f429")))]
compile_error!("no board: build with `--features board-f405` or `board-f429`");
