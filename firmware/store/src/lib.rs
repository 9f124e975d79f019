//! Store of small items in two sectors of NOR flash: lifetime counters, components and changed parameters. After a
//! power cut at any word, each item reads as its old or its new value.
//!
//! A sector is a log of items with checksums (layout: `sector`). For each key the newest complete item counts. When the active
//! sector is full, the store erases the other one, copies all live items into it and marks it complete. Until that mark is
//! written the old sector stays active, so an erase never touches the active sector. Of two complete sectors the newer one
//! counts. The older one is marked as superseded. This mark reveals damage of the newer header, and the newer items still count.
//!
//! A damaged item is skipped: the previous value of its key counts, if there is one. Each start reports damage
//! ([`StoreCondition::Damaged`]) and copies the live items to the other sector.
//!
//! An erase stops a processor that runs from the same flash, for up to 0.5 s. It needs permission by [`Store::allow_erase`].
//! Without it, a save that needs an erase returns [`Error::NotNow`] and changes nothing. [`Store::turn_ahead`] erases early, at a
//! moment of the caller's choice.
//!
//! # Costs
//! An item takes 12 bytes and its value, rounded up to a word. A value of n bytes takes n / 4 + 3 word writes. Saving an
//! unchanged value costs nothing. Calls block until the flash is done.
#![cfg_attr(not(any(test, feature = "sim")), no_std)]

mod key;
#[cfg(test)]
mod power_cut_tests;
mod sector;
#[cfg(any(test, feature = "sim"))]
pub mod sim;
mod store;
#[cfg(test)]
mod tests;

pub use key::{Key, NAME_BYTES_MAX, PARAM_BYTES_MAX, param, param_value};
pub use store::{Error, SaveResult, Store, StoreCondition, VALUE_BYTES_MAX};
