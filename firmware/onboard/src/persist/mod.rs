//! Items that outlive power: parameters, lifetime counters and components. The monitor has them in RAM, the store in
//! flash.
//!
//! ```text
//!            Handover (monitor's task)     Mailbox      StoreWriter (storage's task)
//! Monitor ---------------------------> items (queue) ----------------------> flash
//!     ^------------------------------- StoreStatus -----------------------------/
//! ```
//! At the start [`StoreWriter::load`] gives the stored items to the monitor, before the first frame. Later the
//! monitor's task hands over due items ([`Handover::step`]). If the mailbox is full, an item stays due and is handed
//! over later with its new value, so waiting loses nothing. The least urgent task writes.
//!
//! # What a save costs
//! A word of the STM32F405's flash takes 16 µs to write and 100 µs at most (datasheet, table 40). In that time the
//! processor gets no instruction out of the flash; between two words more urgent tasks run. So a save of the
//! session's counters, 43 words, delays a task by at most 0.1 ms, and the autopilot port's ring holds 22 ms.
//!
//! An erase takes 0.25 s, 0.5 s at the longest (datasheet, table 40, 16 KiB, words of 32 bits). There are three times
//! for it:
//!
//! | when | what is lost |
//! |---|---|
//! | at power-on, before reception begins ([`StoreWriter::turn_ahead`]); at least five eighths of a sector are free afterwards | nothing |
//! | disarmed, and no frame for [`handover::QUIET`]: room is made for the next flight | nothing |
//! | disarmed on the ground for [`handover::GROUNDED`] while the autopilot talks, and only where the sector is more than three quarters full | frames of up to 0.5 s; it is recorded and told |
//!
//! The third is for a board that stays powered beside an autopilot that never falls silent. A save that would need an
//! erase at any other time stays in the mailbox, and later items stay with their owner. It is counted and reported.
//!
//! # How long a sector lasts
//! | item | bytes in the flash | how often |
//! |---|---|---|
//! | lifetime | 490 at most | once a power-on |
//! | a component | 78 | once a power-on |
//! | the session's counters, of a quad | 170 | in flight every two minutes, after an hour every thirtieth of the time; twice at the end of a flight |
//! | times of signatures | 40 | with a key: at first every two minutes, later every thirtieth of the time since power-on, every ten minutes at most; not out of the reserve |
//! | exceedances | 36 with one, 520 with 24 | a quarter of an hour in which a limit was crossed, and landing |
//!
//! A power-on with four components begins with 0.8 KB. At least 10 KB are free then, and 1.25 KB are reserved for
//! landing and disarming ([`Room::Reserve`](hums_core::lifetime::Room)). The other 8 KB hold 46 saves in flight: 1.7
//! hours, after which nothing is saved until the landing. A new sector with 14 KB holds 70 saves: 3.8 hours.
//!
//! A flight of 20 minutes takes 3 KB with all of this. So about every second power-on has an erase. Each of the two
//! sectors lasts for 10,000 erases (datasheet, table 41), together 40,000 flights: ten a day for eleven years.

pub mod handover;
pub mod mailbox;
pub mod status;
pub mod store_writer;
#[cfg(test)]
mod tests;

pub use handover::{Handover, News, STORE_NEW};
pub use mailbox::Mailbox;
pub use status::{EraseMoment, StoreState, StoreStatus};
pub use store_writer::{SaveStep, StoreWriter};
