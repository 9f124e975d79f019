//! The app's interface to a machine.
//!
//! Code above this module does not depend on the board. [`board`] is the board of this image, made from
//! its file `boards/NAME.toml`; [`machine`] has the data of any machine; `stm32f4` has what all of them share. [`board`] has
//!
//! | name | what |
//! |---|---|
//! | `NAME` | the board's name |
//! | `PORT_INTERRUPTS` | what moves the bytes of ports and card |
//! | `take() -> Parts` | starts the machine; to be called once, first |
//! | `PortRx`, `Card` and so on | the types of its parts |
//! | `idle()` | what the processor does while all tasks wait; never returns |
//! | `crystal_failed()` | whether the clock has gone over to a less exact oscillator |
//! | `LATE_TURNS` | when the watchdog counts as late (`watch`) |
//! | `restart()` | after a fault |
//! | `feed_watchdog()` | for the monitor, and the watch in card-reader mode |
//! | the functions of the USB port | for its driver |

pub(crate) mod board;
pub(crate) mod machine;
// A board uses one of the two kinds of card ports.
#[cfg_attr(not(clippy), allow(dead_code, unused_imports))]
mod stm32f4;
