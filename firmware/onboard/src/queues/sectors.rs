//! The queue of sectors, with its reserve for records.

use hums_blackbox::{Header, SECTOR_BYTES, Sector, SectorSink};
use hums_recorder::Block;

use super::capacities::SECTOR_QUEUE_SECTORS;
use super::ring::{In, Out, Ring};

/// Written to the card from where they lie.
pub(super) type SectorQueue = Ring<Block, SECTOR_QUEUE_SECTORS>;

#[expect(clippy::large_stack_arrays, reason = "of a static, made at compile time")]
pub(super) const fn sector_queue() -> SectorQueue {
    Ring::new([[0; SECTOR_BYTES]; SECTOR_QUEUE_SECTORS])
}

pub(super) fn split(queue: &mut SectorQueue, reserve: usize) -> (SectorsIn<'_>, SectorsOut<'_>) {
    let (to, from) = queue.split();
    (SectorsIn { queue: to, reserve, deepest: 0 }, SectorsOut { queue: from })
}

/// Refuses frames while only the reserve is left.
pub struct SectorsIn<'a> {
    queue: In<'a, Block, SECTOR_QUEUE_SECTORS>,
    reserve: usize,
    deepest: usize,
}

impl SectorsIn<'_> {
    pub(crate) fn with_reserve<R>(&mut self, write: impl FnOnce(&mut Self) -> R) -> R {
        let reserve = core::mem::replace(&mut self.reserve, 0);
        let result = write(self);
        self.reserve = reserve;
        result
    }

    /// Whether storage has caught up.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Sectors waiting, with those that are being written.
    pub fn len(&self) -> usize {
        self.queue.len()
    }

    /// The most sectors that waited at once.
    pub const fn deepest(&self) -> usize {
        self.deepest
    }
}

impl SectorSink for SectorsIn<'_> {
    fn room(&self) -> usize {
        SECTOR_QUEUE_SECTORS.saturating_sub(self.len()).saturating_sub(self.reserve)
    }

    fn put(&mut self, sector: &Sector) {
        // The writer asks for room first, so there is a place.
        if let Some(place) = self.queue.free() {
            place.copy_from_slice(sector.bytes());
            self.queue.commit();
        }
        self.deepest = self.deepest.max(self.len());
    }
}

/// Reading end.
pub struct SectorsOut<'a> {
    queue: Out<'a, Block, SECTOR_QUEUE_SECTORS>,
}

impl SectorsOut<'_> {
    /// Lends the oldest sectors in a row, or none. Those that `write` has finished are dropped.
    pub fn lend<E>(&mut self, write: impl FnOnce(&mut [Block]) -> Result<usize, E>) -> Result<usize, E> {
        let done = write(self.queue.waiting())?;
        self.queue.release(done);
        Ok(done)
    }

    /// Empties the queue without a card; returns the number of lost frames. Copies of a sector in progress hold no
    /// frames of their own.
    pub fn abandon(&mut self) -> u64 {
        let mut frames = 0;
        let mut count = |blocks: &mut [Block]| {
            for block in &mut *blocks {
                // Only a sealed sector's header is readable; the session in it does not matter here.
                let mut sector = Sector::from_bytes(*block);
                sector.seal(0);
                let header = Header::read(sector.bytes()).ok().filter(|header| !header.partial);
                frames += header.map_or(0, |header| u64::from(header.frames));
            }
            Ok::<_, ()>(blocks.len())
        };
        while self.lend(&mut count).is_ok_and(|done| done > 0) {}
        frames
    }

    /// Sectors waiting.
    pub fn len(&self) -> usize {
        self.queue.len()
    }

    /// Whether the queue is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
