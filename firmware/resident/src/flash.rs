//! The regions of the flash that the program writes.

use core::ptr;
use core::slice;

use crate::board;
use hums_stm32f4::flash::{self, FlashRefusal};
use hums_stm32f4::watchdog;
use hums_update::map;
use hums_update::resident::{self, FlashFailure, Region};

pub(crate) struct Flash(());

impl Flash {
    pub(crate) const fn new() -> Self {
        Self(())
    }
}

const fn place(region: Region) -> (u32, usize, u8) {
    match region {
        Region::State => (map::STATE, map::STATE_BYTES, map::STATE_SECTOR),
        Region::Application => (map::APPLICATION, map::APPLICATION_BYTES, map::APPLICATION_SECTOR),
    }
}

impl resident::Flash for Flash {
    fn read(&self, region: Region) -> &[u8] {
        let (from, bytes, _) = place(region);
        // SAFETY: flash that no variable of the program lies in. It changes only in functions that borrow `self` alone.
        unsafe { slice::from_raw_parts(ptr::with_exposed_provenance(from as usize), bytes) }
    }

    fn sector_bytes(&self) -> usize {
        map::SECTOR_BYTES
    }

    fn program(&mut self, region: Region, offset: usize, word: u32) -> Result<(), FlashFailure> {
        let (from, bytes, _) = place(region);
        if offset + 4 > bytes || !offset.is_multiple_of(4) {
            return Err(FlashFailure);
        }
        // SAFETY: an aligned word of the region, which is borrowed alone.
        unsafe { flash::write(from as usize + offset, [word]) }.map_err(|FlashRefusal| FlashFailure)
    }

    fn erase(&mut self, region: Region, sector: usize) -> Result<(), FlashFailure> {
        let (_, _, first) = place(region);
        // SAFETY: a sector of the region, which is borrowed alone.
        unsafe { flash::erase(first + sector as u8) }.map_err(|FlashRefusal| FlashFailure)
    }

    fn progress(&mut self) {
        watchdog::feed();
        board::show_progress();
    }
}
