//! Small items in two sectors of NOR flash, each of which reads as its old or as its new value whatever word power went
//! at: lifetime counters, baselines, components and changed parameters.
//!
//! [`sequential_storage`] keeps the items: a log of checked items (CRC-32 each) in the sector in use, the old value
//! staying where it is until all that is live was copied into the other sector. What it does not survive is power loss
//! in the middle of an *erase*, after which a sector may read as anything, its marks still in place: then it would take
//! the half-erased sector for the whole one, or for a blank one. [`sectors`] puts that right below it, with a few words
//! at each sector's beginning: an erase is announced in the *other* sector before it begins, and the next start ends
//! what was begun.
//!
//! An item that is damaged later is passed over: the value before it counts, as long as that is there. Each start looks for such
//! places ([`Found::Damaged`]), and goes on in the other sector without them.
//!
//! An erase also stops the processor for up to half a second where the program runs from the same flash. So it is
//! refused unless [`Store::allow_erase`] said otherwise, and a save that would need one leaves the flash as it is:
//! [`Error::NotNow`]. [`Store::turn_ahead`] does it at a moment of the caller's choice.
//!
//! # Costs
//! An item takes 13 bytes and its value, rounded up to a word; a value that is stored already costs nothing. All calls
//! return when the flash is done; nothing waits for anything else. A value of n bytes takes n / 4 + 4 word writes.
#![cfg_attr(not(any(test, feature = "sim")), no_std)]

mod key;
mod look;
mod marks;
#[cfg(test)]
mod power_cuts;
pub mod sectors;
#[cfg(any(test, feature = "sim"))]
pub mod sim;
mod store;
#[cfg(test)]
mod tests;

pub use key::{Key, NAME_BYTES_MAX, PARAM_BYTES_MAX, param, param_value};
pub use sectors::Found;
pub use store::{Error, Saved, Store, VALUE_BYTES_MAX};
