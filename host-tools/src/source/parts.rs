//! The stream in parts, for commands that make much of each item and put it in order afterwards.
//!
//! A log of ours is decoded group by group, several at a time, and what is made of a group's items is made there too: so
//! `decode` and `info` use all cores. Such a command has a [`Collect`] for each part, and a [`Deliver`] that gets the parts
//! in their order. A recording of another format is one row of items: it is cut into parts of bounded size, on one thread.
//!
//! Parts have frames, observations, rows and records. What a frame says is not in them where it takes the frames before to
//! tell it (texts, modes, parameters), nor what must be known before the first part (clocks): a reading in order has all.

use anyhow::Result;
use hums_core::clock::Instant;

use super::item::{Gap, Item};
pub use crate::logs::reader::PART_BYTES;

/// Items of a part of a recording that is no log of ours.
pub const PART_ITEMS: u32 = 4_096;

/// What the items of one part become.
pub trait Collect: Send {
    /// Takes the next item of the part.
    fn item(&mut self, at: Instant, item: Item<'_>);

    /// Bytes of memory that it holds, roughly. Beyond [`PART_BYTES`] it is handed on, and another one goes on.
    fn held_bytes(&self) -> usize;
}

/// Where collected parts go, in order.
pub trait Deliver<C> {
    /// Something is missing here.
    fn gap(&mut self, gap: &Gap) -> Result<()>;
    /// What the items of the next part became.
    fn part(&mut self, collected: C) -> Result<()>;
}
