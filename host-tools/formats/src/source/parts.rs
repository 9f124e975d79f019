//! The stream in parts, for commands that compute much for each item.
//!
//! A HUMS log's groups are decoded, and their results made, in parallel. A command has an [`ItemCollector`] for each part,
//! and a [`PartReceiver`] that gets them in order. Another format is cut into parts of bounded size, on one thread.
//!
//! Parts lack items that need earlier frames (modes; in HUMS logs also texts and parameters) and items needed before the
//! first part (clocks).

use anyhow::Result;
use hums_core::clock::Instant;

use super::item::{Gap, Item};
pub use crate::logs::reader::PART_BYTES;

/// Items in a part of another format.
pub const PART_ITEMS: u32 = 4_096;

/// A part's result.
pub trait ItemCollector: Send {
    /// Takes the next item of the part.
    fn item(&mut self, at: Instant, item: Item<'_>);

    /// Roughly; beyond [`PART_BYTES`] it is handed on, and another one goes on.
    fn held_bytes(&self) -> usize;
}

/// Receives parts in order.
pub trait PartReceiver<C> {
    /// Something is missing here.
    fn gap(&mut self, gap: &Gap) -> Result<()>;
    /// Takes the result of the next part.
    fn part(&mut self, collected: C) -> Result<()>;
}
