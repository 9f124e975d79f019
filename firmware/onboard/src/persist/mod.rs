//! What outlives power: parameters, lifetime counters, baselines and components, between the monitor, which has them in
//! RAM, and the store, which has them in flash.
//!
//! ```text
//!            Handover (monitor's task)     Mailbox      Keeper (storage's task)
//! Monitor ---------------------------> items (queue) ----------------------> flash
//!     ^------------------------------- StoreStatus -----------------------------/
//! ```
//! At the start [`Keeper::load`] gives the monitor what is stored, before the first frame. Later the monitor's task
//! hands over what is due ([`Handover::step`]); an item that finds the mailbox full stays due, and so is handed over
//! later with its value of then: the owner keeps what is not taken, and nothing is lost by waiting. The least urgent
//! task writes.
//!
//! # What a save costs
//! A word of the STM32F405's flash takes 16 µs to write and 100 µs at most (datasheet, table 40), in which the processor
//! gets no instruction out of the flash; between two words everything more urgent goes on. So a save of all lifetime
//! counters, 95 words, delays nobody by more than 0.1 ms, and the ports' rings hold 44 ms.
//!
//! An erase takes 0.25 to 0.5 s. It is done at power-on before reception begins ([`Keeper::turn_ahead`]: at least half
//! a sector is free afterwards), and otherwise only while nothing can be missed: disarmed, and no frame for
//! [`handover::QUIET`]. A save that would need one in flight stays in the mailbox, and what comes after it with
//! its owner; it is counted and told.
//!
//! # How long a sector lasts
//! The lifetime counters take about 400 bytes, the baselines 100, a component 80: 0.8 KB for an airframe with four
//! components. In flight what changed is saved every 15 minutes (`hums_core::lifetime`), so that the half sector that
//! is free at the least lasts 8 KB / 0.8 KB / 4 = 2.5 hours of one power-on, and a whole one twice as long; whoever flies
//! on loses nothing as long as power stays. A short flight takes 2 KB: one save after power-on, one for landing and one
//! for disarming. So there is an erase at every fourth power-on or so, and the 10,000 erases that each of the two sectors
//! stands (datasheet, table 41) last for 80,000 flights.

pub mod handover;
pub mod keeper;
pub mod mailbox;
pub mod status;
#[cfg(test)]
mod tests;

pub use handover::{Handover, News};
pub use keeper::{Keeper, Kept};
pub use mailbox::Mailbox;
pub use status::{StoreState, StoreStatus};
