//! The stream in parts, for commands that make much of each item and put it in order afterwards.
//!
//! A log of ours is decoded group by group, several at a time, and what is made of a group's items is made there too: so
//! `decode` and `info` use all cores. Such a command has a [`Collect`] for each part, and a [`Deliver`] that gets the parts
//! in their order. A recording of another format is one row of items: it is cut into parts of bounded size, on one thread.
//!
//! Parts have frames, observations, rows and records. What a frame says is not in them where it takes the frames before to
//! tell it (texts, modes, parameters), nor what must be known before the first part (clocks): [`Recording::read`] hands on all.
//!
//! [`Recording::read`]: super::recording::Recording::read

use std::mem;

use anyhow::Result;
use hums_core::time::Instant;

use super::item::{Gap, Item, Summary, Want};
use super::own::OwnReader;
use super::recording::Place;
use crate::logs::reader::PART_BYTES;
use crate::progress;

/// Items of a part of a recording that is no log of ours.
const PART_ITEMS: u32 = 4_096;

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

impl Place {
    /// Reads it in parts: `new` makes the collector of a part, `deliver` gets them in order.
    pub fn in_parts<C: Collect>(
        &self,
        want: Want<'_>,
        new: impl Fn() -> C + Sync,
        deliver: &mut impl Deliver<C>,
    ) -> Result<Summary> {
        if let Some(log) = self.own() {
            let bar = progress::bytes(Some(log.bytes()), &self.title);
            let summary =
                OwnReader::new(log.clone()).in_parts(want, new, deliver, |bytes| bar.set_position(bytes));
            bar.finish_and_clear();
            return summary;
        }
        let recording = self.open()?;
        let (is_of_link, seen) = (recording.format.is_of_link(), recording.progress.clone());
        let bar = progress::bytes(seen.total(), &self.title);
        let (mut part, mut items) = (new(), 0);
        let summary = recording.read(want, &mut |at, item| {
            match item {
                Item::Gap(gap) => {
                    items = 0;
                    deliver.part(mem::replace(&mut part, new()))?;
                    deliver.gap(gap)?;
                }
                // Those of a link are told by frames, which are counted.
                Item::Observation(..) if is_of_link => return Ok(part.item(at, item)),
                Item::Frame(_) | Item::Row(_) | Item::Observation(..) => part.item(at, item),
                _ => return Ok(()),
            }
            items += 1;
            if items >= PART_ITEMS || part.held_bytes() >= PART_BYTES {
                items = 0;
                bar.set_position(seen.taken());
                deliver.part(mem::replace(&mut part, new()))?;
            }
            Ok(())
        })?;
        deliver.part(part)?;
        bar.finish_and_clear();
        Ok(summary)
    }
}
