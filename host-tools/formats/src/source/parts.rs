//! The stream in parts, for commands that compute much for each item and put the results in order afterwards.
//!
//! A HUMS log is decoded group by group, several in parallel, and the results of a group's items are made
//! there too. So `decode` and `info` use all cores. Such a command has a [`Collect`] for each part, and a
//! [`Deliver`] that gets the parts in their order. A recording of another format is one row of items: it is
//! cut into parts of bounded size, on one thread.
//!
//! Parts have frames, observations, rows and records. They lack items that need earlier frames (modes; in logs of
//! ours also texts and parameters) and items needed before the first part (clocks): a reading in order has all.

use anyhow::Result;
use hums_core::clock::Instant;

use super::item::{Gap, Item};
pub use crate::logs::reader::PART_BYTES;

/// Items in a part of a recording of another format.
pub const PART_ITEMS: u32 = 4_096;

/// The result of the items of one part.
pub trait Collect: Send {
    /// Takes the next item of the part.
    fn item(&mut self, at: Instant, item: Item<'_>);

    /// Bytes of memory that it holds, roughly. Beyond [`PART_BYTES`] it is handed on, and another one goes on.
    fn held_bytes(&self) -> usize;
}

/// Receives the collected parts, in order.
pub trait Deliver<C> {
    /// Something is missing here.
    fn gap(&mut self, gap: &Gap) -> Result<()>;
    /// Takes the result of the next part.
    fn part(&mut self, collected: C) -> Result<()>;
}
