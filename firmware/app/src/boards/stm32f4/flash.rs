//! Sectors of the processor's own flash for the store and the state of an update (ARCHITECTURE.md).
//! `hums_onboard::persist` describes the consequences of its waits ([`hums_stm32f4::flash`]).

use core::ptr;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use hums_stm32f4::flash::{self, FlashRefusal, WORD};

const FLASH_BEGIN: usize = 0x0800_0000;
/// Of each of the first four sectors (RM0090, table 5).
const SECTOR_BYTES: usize = 16 * 1024;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FlashError {
    /// Outside the sectors, or not whole words or sectors.
    Place,
    Refused,
}

impl From<FlashRefusal> for FlashError {
    fn from(_: FlashRefusal) -> Self {
        Self::Refused
    }
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place => NorFlashErrorKind::OutOfBounds,
            Self::Refused => NorFlashErrorKind::Other,
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
        let words = bytes.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word));
        // SAFETY: within these sectors, which hold no variable of the program.
        Ok(unsafe { flash::write(begin, words) }?)
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let length = (to as usize).checked_sub(from as usize).ok_or(FlashError::Place)?;
        Self::place(from, length)?;
        if !(from as usize).is_multiple_of(SECTOR_BYTES) || !length.is_multiple_of(SECTOR_BYTES) {
            return Err(FlashError::Place);
        }
        let sectors = from as usize / SECTOR_BYTES..to as usize / SECTOR_BYTES;
        // SAFETY: as above.
        Ok(sectors.into_iter().try_for_each(|sector| unsafe { flash::erase(FIRST + sector as u8) })?)
    }
}
