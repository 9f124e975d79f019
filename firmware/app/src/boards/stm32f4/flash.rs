//! Two sectors of the processor's own flash for the store, behind the vector table and before the program (`memory.x`).
//!
//! While a word is written (16 µs) or a sector erased (0.25 to 0.5 s) the flash gives no instructions: the processor
//! stands still, interrupts and all, and only DMA goes on. What that means is in `hums_onboard::persist`.

use embassy_stm32::flash::{Blocking, Error, Flash};
use embassy_stm32::pac;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// Sector 1 begins here (RM0090, table 5).
const BEGIN: u32 = 16 * 1024;
/// A sector from 0 to 3.
const SECTOR_BYTES: usize = 16 * 1024;
/// Sectors 1 and 2.
const BYTES: usize = 2 * SECTOR_BYTES;

/// The store's part of the flash.
pub(crate) struct StoreFlash(Flash<'static, Blocking>);

impl StoreFlash {
    pub(crate) const fn new(flash: Flash<'static, Blocking>) -> Self {
        Self(flash)
    }

    fn place(offset: u32, bytes: usize) -> Result<u32, Error> {
        if offset as usize + bytes <= BYTES { Ok(BEGIN + offset) } else { Err(Error::Size) }
    }
}

impl ErrorType for StoreFlash {
    type Error = Error;
}

impl ReadNorFlash for StoreFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.0.blocking_read(Self::place(offset, bytes.len())?, bytes)
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for StoreFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.blocking_write(Self::place(offset, bytes.len())?, bytes)
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        let outcome = self.0.blocking_erase(Self::place(from, 0)?, Self::place(to, 0)?);
        forget_what_was_read();
        outcome
    }
}

/// The data cache still holds what was erased (RM0090, 3.5.2); it can be cleared only while it is off.
fn forget_what_was_read() {
    pac::FLASH.acr().modify(|w| w.set_dcen(false));
    pac::FLASH.acr().modify(|w| w.set_dcrst(true));
    pac::FLASH.acr().modify(|w| w.set_dcrst(false));
    pac::FLASH.acr().modify(|w| w.set_dcen(true));
}
