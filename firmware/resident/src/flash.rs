//! The flash of the chip (RM0090, 3.5). The program stands still during each word (16 µs) and each erase (2 s at the longest).

use core::ptr;
use core::slice;

use hums_update::map;
use hums_update::resident::{self, FlashFailed, Region};
use stm32_metapac::FLASH;
use stm32_metapac::flash::vals::Psize;

use crate::{board, chip};

/// Unlock keys of the flash control (RM0090, 3.5.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

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

    fn program(&mut self, region: Region, offset: usize, word: u32) -> Result<(), FlashFailed> {
        let (from, bytes, _) = place(region);
        if offset + 4 > bytes || !offset.is_multiple_of(4) {
            return Err(FlashFailed);
        }
        unlock()?;
        FLASH.cr().write(|w| {
            w.set_psize(Psize::PSIZE32);
            w.set_pg(true);
        });
        let at = ptr::with_exposed_provenance_mut::<u32>(from as usize + offset);
        // SAFETY: an aligned word of the region; the flash takes it.
        unsafe { at.write_volatile(word) };
        finish()
    }

    fn erase(&mut self, region: Region, sector: usize) -> Result<(), FlashFailed> {
        let (_, _, first) = place(region);
        unlock()?;
        chip::feed();
        FLASH.cr().write(|w| {
            w.set_psize(Psize::PSIZE32);
            w.set_ser(true);
            w.set_snb(first + sector as u8);
        });
        FLASH.cr().modify(|w| w.set_strt(true));
        finish()
    }

    fn progress(&mut self) {
        chip::feed();
        board::show_progress();
    }
}

fn unlock() -> Result<(), FlashFailed> {
    if chip::is_supply_low() {
        return Err(FlashFailed);
    }
    while FLASH.sr().read().bsy() {}
    if FLASH.cr().read().lock() {
        for key in KEYS {
            FLASH.keyr().write_value(key);
        }
    }
    forget_errors();
    Ok(())
}

fn finish() -> Result<(), FlashFailed> {
    cortex_m::asm::dsb();
    while FLASH.sr().read().bsy() {}
    let status = FLASH.sr().read();
    FLASH.cr().write(|w| w.set_lock(true));
    let failed = status.operr() || status.wrperr() || status.pgaerr() || status.pgperr() || status.pgserr();
    if failed { Err(FlashFailed) } else { Ok(()) }
}

/// Error bits are cleared by a one. While one is set the flash accepts no word.
fn forget_errors() {
    FLASH.sr().write(|w| {
        w.set_eop(true);
        w.set_operr(true);
        w.set_wrperr(true);
        w.set_pgaerr(true);
        w.set_pgperr(true);
        w.set_pgserr(true);
    });
}
