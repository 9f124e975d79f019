//! The queue of sectors, with its reserve for records.

use heapless::spsc;
use hums_blackbox::{Header, Sector, SectorSink};

/// The sector queue's writing end: refuses frames while only the reserve is left.
pub struct SectorsIn<'a> {
    pub(super) queue: spsc::Producer<'a, Sector>,
    pub(super) reserve: usize,
    pub(super) deepest: usize,
}

impl SectorsIn<'_> {
    /// Lets what follows use the reserve as well: for records.
    pub(crate) fn with_reserve<R>(&mut self, write: impl FnOnce(&mut Self) -> R) -> R {
        let reserve = core::mem::replace(&mut self.reserve, 0);
        let result = write(self);
        self.reserve = reserve;
        result
    }

    /// Whether storage has caught up.
    pub fn is_empty(&self) -> bool {
        self.queue.len() == 0
    }

    /// Sectors waiting.
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
        self.queue.capacity().saturating_sub(self.queue.len()).saturating_sub(self.reserve)
    }

    fn put(&mut self, sector: &Sector) {
        // The writer asked for room first; there is no more to be done here if it did not.
        let _ = self.queue.enqueue(*sector);
        self.deepest = self.deepest.max(self.queue.len());
    }
}

/// The sector queue's reading end.
pub struct SectorsOut<'a>(pub(super) spsc::Consumer<'a, Sector>);

impl SectorsOut<'_> {
    /// The oldest sector, which stays in the queue.
    pub fn oldest(&mut self) -> Option<&Sector> {
        self.0.peek()
    }

    /// Takes the oldest sector out.
    pub(crate) fn drop_oldest(&mut self) {
        let _ = self.0.dequeue();
    }

    /// Empties the queue because there is no card to write to; how many frames are lost with it. Copies of a sector in
    /// progress hold no frames of their own.
    pub fn abandon(&mut self) -> u64 {
        let mut frames = 0;
        while let Some(mut sector) = self.0.dequeue() {
            // Only a sealed sector's header can be read; which session it names does not matter here.
            sector.seal(0);
            if let Ok(header) = Header::read(sector.bytes()) {
                frames += if header.partial { 0 } else { u64::from(header.frames) };
            }
        }
        frames
    }

    /// Sectors waiting.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.0.len() == 0
    }
}
