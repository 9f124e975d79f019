//! The app's interface to a machine.
//!
//! Code above this module does not depend on the board. [`machine`] has the parts of a board, [`board`] the one that this image is
//! for, made from its file `boards/NAME.toml`; `stm32f4` has what all of them share. [`board`] has
//!
//! | name | what |
//! |---|---|
//! | `NAME` | the board's name |
//! | `PORT_INTERRUPTS` | what moves the bytes of ports and card |
//! | `take() -> Parts` | starts the machine; to be called once, first |
//! | `PortRx`, `Card` and so on | the types of its parts |
//! | `Idle::run()` | what the processor does while all tasks wait; never returns |
//! | `crystal_failed()` | whether the clock has gone over to a less exact oscillator |
//! | `LATE_TURNS` | when the watchdog counts as late (`watch`) |
//! | `restart()` | after a fault |

pub(crate) mod board;
pub(crate) mod machine;
mod stm32f4;
