//! The store's flash: a file of the host as long as two sectors, which behaves as flash does (a write only turns ones into
//! zeros). The same file serves `hums sim`.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use semihosting::fs::File;
use semihosting::io::{Read, Seek, SeekFrom, Write};

/// As on the real board.
const SECTOR_BYTES: usize = 16 * 1024;
const BYTES: usize = 2 * SECTOR_BYTES;
/// Bytes read or written at a time.
const PIECE_BYTES: usize = 64;

/// The file as flash.
pub(crate) struct StoreFlash(File);

impl StoreFlash {
    pub(super) const fn new(file: File) -> Self {
        Self(file)
    }

    fn at(&mut self, offset: usize, bytes: usize) -> Result<&mut File, NorFlashErrorKind> {
        if offset + bytes > BYTES {
            return Err(NorFlashErrorKind::OutOfBounds);
        }
        self.0.seek(SeekFrom::Start(offset as u64)).map_err(|_| NorFlashErrorKind::Other)?;
        Ok(&mut self.0)
    }
}

impl ErrorType for StoreFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for StoreFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, mut rest: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let file = self.at(offset as usize, rest.len())?;
        while !rest.is_empty() {
            match file.read(rest) {
                Ok(0) | Err(_) => return Err(NorFlashErrorKind::Other),
                Ok(count) => rest = rest.get_mut(count..).ok_or(NorFlashErrorKind::Other)?,
            }
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for StoreFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let mut piece = [0; PIECE_BYTES];
        for (at, new) in (offset as usize..).step_by(PIECE_BYTES).zip(bytes.chunks(PIECE_BYTES)) {
            let piece = piece.get_mut(..new.len()).ok_or(NorFlashErrorKind::Other)?;
            self.read(at as u32, piece)?;
            for (old, new) in piece.iter_mut().zip(new) {
                *old &= new;
            }
            self.at(at, piece.len())?.write_all(piece).map_err(|_| NorFlashErrorKind::Other)?;
        }
        Ok(())
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        const ERASED: [u8; PIECE_BYTES] = [0xFF; PIECE_BYTES];
        for at in (from as usize..to as usize).step_by(PIECE_BYTES) {
            self.at(at, PIECE_BYTES)?.write_all(&ERASED).map_err(|_| NorFlashErrorKind::Other)?;
        }
        Ok(())
    }
}
