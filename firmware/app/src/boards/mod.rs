//! The boards: what the app needs of a machine, and one file a board that provides it.
//!
//! A board module has `Board` (implements [`Board`]) and nothing above this module knows which one it is. A feature
//! of this crate chooses the board: `board-f405` the real one, `board-emulated` QEMU's `netduinoplus2`.

#[cfg(feature = "board-emulated")]
pub(crate) mod emulated;
#[cfg(feature = "board-emulated")]
pub(crate) use emulated as board;

#[cfg(feature = "board-f405")]
pub(crate) mod f405;
#[cfg(feature = "board-f405")]
pub(crate) use f405 as board;

#[cfg(all(feature = "board-f405", feature = "board-emulated"))]
compile_error!("one board at a time: choose `board-f405` or `board-emulated`");
#[cfg(not(any(feature = "board-f405", feature = "board-emulated")))]
compile_error!("no board: build with `--features board-f405` or `--features board-emulated`");

/// Bytes were lost on the line before they reached the reception task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub(crate) enum LineFault {
    /// The task came too late and the receive buffer ran over.
    Overrun,
    /// The port saw a damaged byte: framing, noise or parity.
    Damaged,
}

/// The receiving half of a port.
pub(crate) trait Receive {
    /// Waits for bytes and gives as many as have come and fit, at least one.
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, LineFault>;
}

/// The sending half of a port.
pub(crate) trait Transmit {
    /// Sends all of `bytes`; returns when the port has taken the last.
    async fn transmit(&mut self, bytes: &[u8]);
}
