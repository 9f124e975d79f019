//! Sectors of the processor's own flash for the store (ARCHITECTURE.md). `hums_onboard::persist` describes the consequences of its
//! waits ([`hums_stm32f4::flash`]).

use core::ptr;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use hums_stm32f4::flash::{self, FlashRefusal, WORD};

/// The first of two sectors, its address, and the bytes of each (RM0090, table 5).
const FIRST: u8 = 1;
const BEGIN: usize = 0x0800_4000;
const SECTOR_BYTES: usize = 16 * 1024;
const BYTES: usize = 2 * SECTOR_BYTES;

/// The two sectors.
pub(crate) struct StoreFlash(());

impl StoreFlash {
    /// To be called once.
    pub(crate) const fn new() -> Self {
        Self(())
    }
}

/// The address, if the bytes are within the sectors, and whole units.
fn place(offset: u32, bytes: usize, unit: usize) -> Result<usize, NorFlashErrorKind> {
    let offset = offset as usize;
    if offset.checked_add(bytes).is_none_or(|end| end > BYTES) {
        return Err(NorFlashErrorKind::OutOfBounds);
    }
    let is_whole = offset.is_multiple_of(unit) && bytes.is_multiple_of(unit);
    if is_whole { Ok(BEGIN + offset) } else { Err(NorFlashErrorKind::NotAligned) }
}

impl ErrorType for StoreFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for StoreFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let from = ptr::with_exposed_provenance::<u8>(place(offset, bytes.len(), Self::READ_SIZE)?);
        for (index, byte) in bytes.iter_mut().enumerate() {
            // SAFETY: within these sectors, which are always readable and hold no variable of the program.
            *byte = unsafe { from.add(index).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for StoreFlash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let begin = place(offset, bytes.len(), WORD)?;
        let words = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word));
        // SAFETY: within these sectors, which hold no variable of the program.
        unsafe { flash::write(begin, words) }.map_err(|FlashRefusal| NorFlashErrorKind::Other)
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let bytes = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)? as usize;
        let first = FIRST + ((place(from, bytes, SECTOR_BYTES)? - BEGIN) / SECTOR_BYTES) as u8;
        let sectors = first..first + (bytes / SECTOR_BYTES) as u8;
        // SAFETY: as above.
        let mut erased = sectors.into_iter().map(|sector| unsafe { flash::erase(sector) });
        erased.try_for_each(|erased| erased.map_err(|FlashRefusal| NorFlashErrorKind::Other))
    }
}
