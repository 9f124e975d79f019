//! What the driver needs of a board: a bus, a select pin and a clock.

use hums_core::clock::Instant;

/// How fast the bus runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// At most 400 kHz: what a card must be able to take before it is identified (SD specification, 4.2.1).
    Identification,
    /// As fast as the board can, at most 25 MHz: what every card takes afterwards (default speed, 4.3).
    Transfer,
}

/// The bus failed by itself: a matter of the board, not of the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PortFailed;

/// A board's SPI port to a card: mode 0, most significant bit first, what the card sends pulled up.
pub trait Port {
    /// Drives the select pin: low when `selected`.
    fn select(&mut self, selected: bool);

    /// Sends these bytes, and puts in their place what comes back.
    fn exchange(&mut self, bytes: &mut [u8]) -> Result<(), PortFailed>;

    /// Sends these bytes; what comes back is dropped.
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortFailed>;

    /// Sets the bus's speed.
    fn set_clock(&mut self, clock: Clock);

    /// The time: what the driver's limits are counted by.
    fn now(&self) -> Instant;
}
