//! Sectors of the processor's own flash for the store and the state of an update (ARCHITECTURE.md).
//!
//! While a word is written (16 µs) or a sector erased (0.25 s, 0.5 s at the longest) the flash delivers no instructions. The
//! processor and its interrupts stop; only DMA continues. `hums_onboard::persist` describes the consequences.
//!
//! Writing 32 bits in parallel needs 2.7 V (RM0090, 3.5.1, table 7). Below that the supply monitor stops everything, so no write
//! happens.

use core::ptr;

use embassy_stm32::pac::FLASH;
use embassy_stm32::pac::flash::vals::Psize;
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use super::{supply, watchdog};

const FLASH_BEGIN: usize = 0x0800_0000;
/// Of each of the first four sectors (RM0090, table 5).
const SECTOR_BYTES: usize = 16 * 1024;
const WORD: usize = 4;
/// Unlock keys of the flash control (RM0090, 3.5.1).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FlashError {
    /// Outside the sectors, or not whole words or sectors.
    Place,
    Supply,
    Refused(u32),
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place => NorFlashErrorKind::OutOfBounds,
            Self::Supply | Self::Refused(_) => NorFlashErrorKind::Other,
        }
    }
}

/// `COUNT` of the first four sectors, from sector `FIRST` on.
pub(crate) struct Sectors<const FIRST: u8, const COUNT: usize>(());

pub(crate) type StoreFlash = Sectors<1, 2>;
pub(crate) type StateFlash = Sectors<{ hums_update::map::STATE_SECTOR }, 1>;

impl<const FIRST: u8, const COUNT: usize> Sectors<FIRST, COUNT> {
    const BEGIN: usize = FLASH_BEGIN + FIRST as usize * SECTOR_BYTES;
    const BYTES: usize = COUNT * SECTOR_BYTES;

    /// To be called once.
    pub(crate) const fn new() -> Self {
        Self(())
    }

    fn place(offset: u32, bytes: usize) -> Result<usize, FlashError> {
        let end = (offset as usize).checked_add(bytes).ok_or(FlashError::Place)?;
        if end <= Self::BYTES { Ok(Self::BEGIN + offset as usize) } else { Err(FlashError::Place) }
    }
}

impl<const FIRST: u8, const COUNT: usize> ErrorType for Sectors<FIRST, COUNT> {
    type Error = FlashError;
}

impl<const FIRST: u8, const COUNT: usize> ReadNorFlash for Sectors<FIRST, COUNT> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let from = ptr::with_exposed_provenance::<u8>(Self::place(offset, bytes.len())?);
        for (index, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: within these sectors, which are always readable and hold no variable of the program.
            *byte = unsafe { from.add(index).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        Self::BYTES
    }
}

impl<const FIRST: u8, const COUNT: usize> NorFlash for Sectors<FIRST, COUNT> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let begin = Self::place(offset, bytes.len())?;
        if !begin.is_multiple_of(WORD) || !bytes.len().is_multiple_of(WORD) {
            return Err(FlashError::Place);
        }
        unlocked(|| {
            let words = bytes.as_chunks::<WORD>().0;
            words.iter().enumerate().try_for_each(|(index, word)| {
                FLASH.cr().write(|w| {
                    w.set_psize(Psize::PSIZE32);
                    w.set_pg(true);
                });
                let at = ptr::with_exposed_provenance_mut::<u32>(begin + index * WORD);
                // SAFETY: an aligned word within these sectors, which hold no variable of the program; the
                // flash takes it.
                unsafe { at.write_volatile(u32::from_le_bytes(*word)) };
                cortex_m::asm::dsb();
                finish()
            })
        })
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let length = (to as usize).checked_sub(from as usize).ok_or(FlashError::Place)?;
        Self::place(from, length)?;
        if !(from as usize).is_multiple_of(SECTOR_BYTES) || !length.is_multiple_of(SECTOR_BYTES) {
            return Err(FlashError::Place);
        }
        let sectors = from as usize / SECTOR_BYTES..to as usize / SECTOR_BYTES;
        unlocked(|| {
            sectors.into_iter().try_for_each(|sector| {
                FLASH.cr().write(|w| {
                    w.set_psize(Psize::PSIZE32);
                    w.set_ser(true);
                    w.set_snb(FIRST + sector as u8);
                });
                // The watchdog is not fed during an erase.
                watchdog::reload();
                FLASH.cr().modify(|w| w.set_strt(true));
                cortex_m::asm::dsb();
                finish()
            })
        })
    }
}

/// Runs `work` with the flash control unlocked, earlier errors cleared and the data cache off; the cache is empty afterwards. The
/// cache would keep erased data (RM0090, 3.5.2).
fn unlocked(work: impl FnOnce() -> Result<(), FlashError>) -> Result<(), FlashError> {
    if supply::is_low() {
        return Err(FlashError::Supply);
    }
    while FLASH.sr().read().bsy() {}
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
    FLASH.acr().modify(|w| w.set_dcen(true));
    outcome
}

fn finish() -> Result<(), FlashError> {
    while FLASH.sr().read().bsy() {}
    let status = FLASH.sr().read();
    FLASH.cr().write(|_| {});
    if status.operr() || status.wrperr() || status.pgaerr() || status.pgperr() || status.pgserr() {
        forget_errors();
        return Err(FlashError::Refused(status.0));
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
