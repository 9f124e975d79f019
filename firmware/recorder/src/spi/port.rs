//! The driver's needs of a board.

use hums_core::clock::Instant;

use crate::WaitWork;

/// Bytes between two calls of other work: 30 µs of a port that the processor moves.
const PART_BYTES: usize = 32;

/// The speed of the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// At most 400 kHz, which every card takes before identification (SD specification, 4.2.1).
    Identification,
    /// As fast as the board can, at most 25 MHz, which every card takes afterwards (default speed, 4.3).
    Transfer,
}

/// The bus failed by itself: a fault of the board, not of the card.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PortFailure;

/// A board's SPI port to a card: mode 0, most significant bit first, input pulled up.
pub trait Port {
    /// Low when `selected`.
    fn select(&mut self, selected: bool);

    /// Replaces bytes by the received ones.
    fn exchange(&mut self, bytes: &mut [u8]) -> Result<(), PortFailure>;

    /// Receives bytes. `meanwhile` is called often.
    fn receive(&mut self, bytes: &mut [u8], meanwhile: WaitWork<'_>) -> Result<(), PortFailure> {
        bytes.fill(0xFF);
        bytes.chunks_mut(PART_BYTES).try_for_each(|part| {
            meanwhile();
            self.exchange(part)
        })
    }

    /// Drops received bytes.
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortFailure>;

    /// Sets the bus's speed.
    fn set_clock(&mut self, clock: Clock);

    /// The time for the driver's limits.
    fn now(&self) -> Instant;
}
