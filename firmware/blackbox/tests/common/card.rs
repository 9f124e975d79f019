//! A card that takes every sector: for the tests and the example `sizes`.

use hums_blackbox::{Sector, SectorSink};

#[derive(Default)]
pub(crate) struct Card(pub(crate) Vec<Sector>);

impl SectorSink for Card {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        let mut sector = *sector;
        sector.seal(0x4855_4d53);
        self.0.push(sector);
    }
}
