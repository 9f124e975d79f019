//! Small items in two sectors of NOR flash, each of which reads as its old or as its new value whatever word power went
//! at: lifetime counters, baselines, components and changed parameters.
//!
//! A sector is a log of checked items (`sector` has its layout); of a key the newest whole item counts. When the sector in use is
//! full the store turns: it erases the other sector, copies all that counts into it, and marks it as complete. Until that mark is
//! there the old sector is the one in use, and an erase that power cut short is never of a sector in use. Of two complete sectors the
//! newer one counts. The older one then has a mark that it is superseded: so damage of the newer one's header is noticed, and its
//! items still count.
//!
//! An item that is damaged later is passed over: the value before it counts, as long as that is there. Each start looks for such
//! places ([`Found::Damaged`]), and turns to the other sector without them.
//!
//! An erase also stops the processor for up to half a second where the program runs from the same flash. So it is
//! refused unless [`Store::allow_erase`] said otherwise, and a save that would need one leaves the flash as it is:
//! [`Error::NotNow`]. [`Store::turn_ahead`] does it at a moment of the caller's choice.
//!
//! # Costs
//! An item takes 12 bytes and its value, rounded up to a word; a value that is stored already costs nothing. All calls
//! return when the flash is done; nothing waits for anything else. A value of n bytes takes n / 4 + 3 word writes.
#![cfg_attr(not(any(test, feature = "sim")), no_std)]

mod key;
#[cfg(test)]
mod power_cuts;
mod sector;
#[cfg(any(test, feature = "sim"))]
pub mod sim;
mod store;
#[cfg(test)]
mod tests;

pub use key::{Key, NAME_BYTES_MAX, PARAM_BYTES_MAX, param, param_value};
pub use store::{Error, Found, Saved, Store, VALUE_BYTES_MAX};
