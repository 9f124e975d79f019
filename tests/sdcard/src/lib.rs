//! A simulated SD card at the level of SPI bytes and SD commands.
//!
//! ```text
//! Recorder -> SpiCard -> SimPort -> Slot (bus, time, events) -> SdCard (state machine, faults) -> Medium (blocks)
//! ```
//! Time is virtual: only bytes on the bus take any. Violations by a card or a driver are noted
//! ([`Slot::violations`]).
//!
//! Source: SD Specifications Part 1, Physical Layer Simplified Specification 9.10, chapter 7 (SPI mode).

mod card;
mod fault;
mod medium;
mod model;
mod slot;
mod wire;

pub use fault::{Fault, Plan};
pub use medium::Medium;
pub use model::{Kind, Model};
pub use slot::{Counts, Event, SimPort, Slot};
pub use wire::{Card, connect};

/// Nanoseconds of a millisecond.
pub const MS: u64 = 1_000_000;
