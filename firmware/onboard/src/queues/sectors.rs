//! The queue of sectors, with its reserve for records.

use core::sync::atomic::{AtomicUsize, Ordering};

use bbqueue::nicknames::Churrasco;
use bbqueue::prod_cons::stream::{StreamConsumer, StreamProducer};
use hums_blackbox::{Header, SECTOR_BYTES, Sector, SectorSink};
use hums_recorder::Block;

use super::capacities::SECTOR_QUEUE_SECTORS;

// The queue keeps one place empty to tell full from empty.
type Queue = Churrasco<{ (SECTOR_QUEUE_SECTORS + 1) * SECTOR_BYTES }>;

/// Written to the card from where they lie.
pub(super) struct SectorQueue {
    queue: Queue,
    len: AtomicUsize,
}

impl SectorQueue {
    pub(super) const fn new() -> Self {
        Self { queue: Queue::new(), len: AtomicUsize::new(0) }
    }

    pub(super) fn split(&self, reserve: usize) -> (SectorsIn<'_>, SectorsOut<'_>) {
        let Self { queue, len } = self;
        (
            SectorsIn { queue: queue.stream_producer(), len, reserve, deepest: 0 },
            SectorsOut { queue: queue.stream_consumer(), len },
        )
    }
}

/// Refuses frames while only the reserve is left.
pub struct SectorsIn<'a> {
    queue: StreamProducer<&'a Queue>,
    len: &'a AtomicUsize,
    reserve: usize,
    deepest: usize,
}

impl SectorsIn<'_> {
    /// Lends the reserve too, for records.
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
        self.len.load(Ordering::Acquire)
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
        // The writer asks for room first, so this does not fail.
        if let Ok(mut grant) = self.queue.grant_exact(SECTOR_BYTES) {
            grant.copy_from_slice(sector.bytes());
            // Before the reader can take it out.
            let before = self.len.fetch_add(1, Ordering::AcqRel);
            self.deepest = self.deepest.max(before + 1);
            grant.commit(SECTOR_BYTES);
        }
    }
}

/// Reading end.
pub struct SectorsOut<'a> {
    queue: StreamConsumer<&'a Queue>,
    len: &'a AtomicUsize,
}

impl SectorsOut<'_> {
    /// Lends the oldest sectors in a row, or none. Those that `write` has finished are dropped.
    pub fn lend<E>(&mut self, write: impl FnOnce(&mut [Block]) -> Result<usize, E>) -> Result<usize, E> {
        let Ok(mut grant) = self.queue.read() else { return write(&mut []) };
        let done = write(grant.as_chunks_mut().0)?;
        grant.release(done * SECTOR_BYTES);
        self.len.fetch_sub(done, Ordering::AcqRel);
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
        self.len.load(Ordering::Acquire)
    }

    /// Whether the queue is empty.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}
