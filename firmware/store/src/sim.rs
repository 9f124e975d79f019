//! Simulated NOR flash: a write only turns ones into zeros, an erase clears a whole sector, and a power cut may interrupt both.

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

use crate::sector::{HEADER_BYTES, MAGIC};

/// Whether bytes look like two sectors of `SECTOR` bytes with a store. Either a sector has the magic, or a sector is empty after
/// its header. A power cut before the magic is written leaves the second case.
pub fn is_store<const SECTOR: usize>(bytes: &[u8]) -> bool {
    let mut sectors = bytes.chunks(SECTOR);
    let is_erased = |sector: &[u8]| sector.iter().skip(HEADER_BYTES).all(|byte| *byte == 0xFF);
    bytes.len() == 2 * SECTOR
        && (sectors.clone().any(|sector| sector.starts_with(&MAGIC.to_le_bytes())) || sectors.any(is_erased))
}

/// Two sectors of `SECTOR` bytes, words of four.
#[derive(Clone, Debug)]
pub struct SimFlash<const SECTOR: usize> {
    bytes: Vec<u8>,
    /// Words written and sectors erased, ever.
    steps: u64,
    erases: u64,
    cut_at: Option<u64>,
    is_dead: bool,
    random: u64,
}

impl<const SECTOR: usize> SimFlash<SECTOR> {
    /// Erased.
    pub fn blank() -> Self {
        Self::with(&[])
    }

    /// Flash with as many of these bytes as fit; the rest is erased.
    pub fn with(bytes: &[u8]) -> Self {
        let mut all = bytes.to_vec();
        all.resize(2 * SECTOR, 0xFF);
        Self { bytes: all, steps: 0, erases: 0, cut_at: None, is_dead: false, random: 0x9E37_79B9_7F4A_7C15 }
    }

    /// Contents.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Words and erases so far.
    pub const fn steps(&self) -> u64 {
        self.steps
    }

    /// Erases so far.
    pub const fn erases(&self) -> u64 {
        self.erases
    }

    /// Cuts in the middle of the `steps`-th step, from 1; `seed` decides its result.
    pub const fn cut_after(&mut self, steps: u64, seed: u64) {
        self.cut_at = Some(self.steps + steps);
        self.random ^= seed.wrapping_mul(0x2545_F491_4F6C_DD1D) | 1;
    }

    /// Whether power is cut.
    pub const fn is_dead(&self) -> bool {
        self.is_dead
    }

    /// Contents stay as the cut left them.
    pub const fn revive(&mut self) {
        (self.is_dead, self.cut_at) = (false, None);
    }

    fn step(&mut self) -> bool {
        self.steps += 1;
        self.is_dead = self.cut_at.is_some_and(|at| self.steps >= at);
        self.is_dead
    }

    /// xorshift64 (Marsaglia).
    fn random(&mut self) -> u32 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 16) as u32
    }

    fn word(&self, at: usize) -> u32 {
        self.bytes[at..at + 4].iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
    }

    fn set(&mut self, at: usize, word: u32) {
        self.bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
    }

    fn check(&self, from: usize, to: usize, unit: usize) -> Result<(), NorFlashErrorKind> {
        if self.is_dead {
            Err(NorFlashErrorKind::Other)
        } else if from > to || to > self.bytes.len() {
            Err(NorFlashErrorKind::OutOfBounds)
        } else if !from.is_multiple_of(unit) || !to.is_multiple_of(unit) {
            Err(NorFlashErrorKind::NotAligned)
        } else {
            Ok(())
        }
    }

    fn torn(&mut self, old: u32, new: u32) -> u32 {
        match self.random() % 4 {
            0 => old,
            1 => new,
            _ => {
                let mask = self.random();
                (old & mask) | (new & !mask)
            }
        }
    }
}

impl<const SECTOR: usize> ErrorType for SimFlash<SECTOR> {
    type Error = NorFlashErrorKind;
}

impl<const SECTOR: usize> ReadNorFlash for SimFlash<SECTOR> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        let at = offset as usize;
        self.check(at, at + bytes.len(), 1)?;
        bytes.copy_from_slice(&self.bytes[at..at + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const SECTOR: usize> NorFlash for SimFlash<SECTOR> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        let (from, to) = (from as usize, to as usize);
        self.check(from, to, SECTOR)?;
        for sector in (from..to).step_by(SECTOR) {
            let cut = self.step();
            self.erases += 1;
            for at in (sector..sector + SECTOR).step_by(4) {
                let word = if cut { self.torn(self.word(at), u32::MAX) } else { u32::MAX };
                self.set(at, word);
            }
            if cut {
                return Err(NorFlashErrorKind::Other);
            }
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let begin = offset as usize;
        self.check(begin, begin + bytes.len(), 4)?;
        for (at, word) in (begin..).step_by(4).zip(bytes.chunks_exact(4)) {
            let old = self.word(at);
            let new = old & word.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte));
            let cut = self.step();
            let left = if cut { self.torn(old, new) } else { new };
            self.set(at, left);
            if cut {
                return Err(NorFlashErrorKind::Other);
            }
        }
        Ok(())
    }
}
