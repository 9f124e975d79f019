//! Sectors that a test writes.

use hums_blackbox::{Sector, SectorSink};

/// Sealed sectors of session 7, one behind the other.
#[derive(Default)]
pub(crate) struct Memory(pub(crate) Vec<[u8; 512]>);

impl SectorSink for Memory {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        let mut sector = *sector;
        sector.seal(7);
        self.0.push(*sector.bytes());
    }
}
