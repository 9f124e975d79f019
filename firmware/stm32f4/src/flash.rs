//! The flash of the chip (RM0090, 3.5).
//!
//! While a word is written (16 µs) or a sector erased (16 KiB: 0.25 s, 0.5 s at the longest; 128 KiB: 1 s, 2 s at the longest)
//! the flash delivers no instructions. The processor and its interrupts stop; only DMA continues.
//!
//! Writing 32 bits in parallel needs 2.7 V (RM0090, table 7): below that nothing is written.

use core::ptr;

use stm32_metapac::FLASH;
use stm32_metapac::flash::vals::Psize;

use crate::{supply, watchdog};

/// Bytes of a word, the unit of writing.
pub const WORD: usize = 4;
/// Unlock keys of the flash control (RM0090, 3.5.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// The flash refused a word or an erase, or the supply is too low.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashRefusal;

/// Writes words, the first one at this address. Bits go from one to zero.
///
/// # Safety
/// The words are aligned words of the flash, and no reference to them is alive.
pub unsafe fn write(at: usize, words: impl IntoIterator<Item = u32>) -> Result<(), FlashRefusal> {
    unlocked(|| {
        words.into_iter().enumerate().try_for_each(|(index, word)| {
            FLASH.cr().write(|w| {
                w.set_psize(Psize::PSIZE32);
                w.set_pg(true);
            });
            // SAFETY: by the caller. The flash takes the word.
            unsafe { ptr::with_exposed_provenance_mut::<u32>(at + index * WORD).write_volatile(word) };
            finish()
        })
    })
}

/// Sets all bits of a sector to one. The watchdog begins with its full time.
///
/// # Safety
/// No reference to the sector is alive.
pub unsafe fn erase(sector: u8) -> Result<(), FlashRefusal> {
    unlocked(|| {
        FLASH.cr().write(|w| {
            w.set_psize(Psize::PSIZE32);
            w.set_ser(true);
            w.set_snb(sector);
        });
        watchdog::feed();
        FLASH.cr().modify(|w| w.set_strt(true));
        finish()
    })
}

/// Runs `work` with the flash control unlocked, earlier errors cleared and the data cache off; the cache is empty afterwards. The
/// cache would keep erased data (RM0090, 3.5.2).
fn unlocked(work: impl FnOnce() -> Result<(), FlashRefusal>) -> Result<(), FlashRefusal> {
    if supply::is_low() {
        return Err(FlashRefusal);
    }
    while FLASH.sr().read().bsy() {}
    let is_cached = FLASH.acr().read().dcen();
    FLASH.acr().modify(|w| w.set_dcen(false));
    if FLASH.cr().read().lock() {
        for key in KEYS {
            FLASH.keyr().write_value(key);
        }
    }
    forget_errors();
    let outcome = work();
    FLASH.cr().write(|w| w.set_lock(true));
    FLASH.acr().modify(|w| w.set_dcrst(true));
    FLASH.acr().modify(|w| w.set_dcrst(false));
    FLASH.acr().modify(|w| w.set_dcen(is_cached));
    outcome
}

fn finish() -> Result<(), FlashRefusal> {
    cortex_m::asm::dsb();
    while FLASH.sr().read().bsy() {}
    let status = FLASH.sr().read();
    FLASH.cr().write(|_| {});
    if status.operr() || status.wrperr() || status.pgaerr() || status.pgperr() || status.pgserr() {
        forget_errors();
        return Err(FlashRefusal);
    }
    Ok(())
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
