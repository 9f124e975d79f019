//! The two sectors, as [`sequential_storage`] sees them: without the marks at their beginning, never half-erased, and
//! with erases only when they are allowed.

use core::fmt;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind};
use embedded_storage_async::nor_flash as nonblocking;

use crate::look::{Look, look_through};
use crate::marks::{ERASED, GENERATION_AT, HEADER_BYTES, MAGIC, Marks, WORD, coded};

/// How many sectors.
pub const SECTORS: usize = 2;

/// What a start found in the flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Found {
    /// What was stored.
    Kept,
    /// What was stored, but for places that are damaged: of an item there the value before it counts, or none.
    Damaged,
    /// Erased flash: nothing was ever stored.
    Blank,
    /// Something that cannot be read: what was stored is lost, and the store was made anew.
    Unreadable,
}

/// Why the flash did not do it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal<E> {
    /// It would need an erase, and none is allowed now.
    NotNow,
    /// Beyond the sectors: a fault of the caller's.
    OutOfBounds,
    /// The flash itself.
    Flash(E),
}

impl<E: fmt::Debug> NorFlashError for Refusal<E> {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotNow | Self::Flash(_) => NorFlashErrorKind::Other,
        }
    }
}

/// Two sectors of `F`, which has no more and no fewer.
pub struct Sectors<F> {
    flash: F,
    may_erase: bool,
}

type Outcome<T, F> = Result<T, Refusal<<F as ErrorType>::Error>>;

impl<F: NorFlash> Sectors<F> {
    /// Bytes of a sector that are left to the items.
    pub(crate) const PAGE_BYTES: usize = F::ERASE_SIZE - HEADER_BYTES;

    /// Looks what is there, ends an erase that power cut short, and makes the store anew where it cannot be read.
    pub(crate) fn mount(flash: F) -> Outcome<(Self, Found), F> {
        const {
            assert!(F::WRITE_SIZE == WORD && F::READ_SIZE == 1, "the layout is made for words of four bytes");
            assert!(F::ERASE_SIZE > 2 * HEADER_BYTES && F::ERASE_SIZE.is_multiple_of(WORD));
        }
        let mut sectors = Self { flash, may_erase: true };
        let marks = [sectors.marks(0)?, sectors.marks(1)?];
        let void = [is_void(marks, 0), is_void(marks, 1)];
        let found = match void {
            [false, false] => {
                let in_use = [sectors.is_in_use(0)?, sectors.is_in_use(1)?];
                let mut found = Found::Kept;
                for sector in 0..SECTORS {
                    let is_begun = sectors.is_begun(sector)?;
                    if if is_begun { in_use != [true, true] } else { sectors.is_bare(sector)? } {
                        continue;
                    }
                    let mut look = Look::default();
                    sectors.look_through(sector, &mut look)?;
                    if !is_begun && look.items > 0 && !sectors.is_begun(other(sector))? {
                        // The mark of the sector in use is damaged.
                        sectors.write_word(sector, HEADER_BYTES, 0)?;
                        found = Found::Damaged;
                    } else if !is_begun || look.items == 0 {
                        // Nothing is stored there, and it would be taken for a sector in use, or not be fit to be one.
                        sectors.erase_sector(sector)?;
                    }
                }
                found
            }
            [true, true] => {
                let blank = sectors.is_bare(0)? && sectors.is_bare(1)?;
                sectors.remake()?;
                if blank { Found::Blank } else { Found::Unreadable }
            }
            [first, _] => {
                let sector = usize::from(!first);
                let other_is_begun = sectors.is_begun(other(sector))?;
                if marks[sector].generation.is_none() && sectors.is_begun(sector)? && !other_is_begun {
                    // No erase has begun, because nothing was copied: its marks are damaged, and all that is stored is here.
                    Found::Damaged
                } else {
                    // Its erase was announced, when everything had been copied, or the store was just being made.
                    let announced = marks[other(sector)].void.is_some() && other_is_begun;
                    let expected = announced || sectors.is_bare(sector)?;
                    sectors.erase_sector(sector)?;
                    if expected { Found::Kept } else { Found::Unreadable }
                }
            }
        };
        Ok((sectors, found))
    }

    /// Erases everything.
    pub(crate) fn remake(&mut self) -> Outcome<(), F> {
        if !self.may_erase {
            return Err(Refusal::NotNow);
        }
        (0..SECTORS).try_for_each(|sector| self.erase_sector(sector))
    }

    pub(crate) fn allow_erase(&mut self, allowed: bool) {
        self.may_erase = allowed;
    }

    /// Bytes at the end of the sector in use that are still erased; a whole sector's where none is in use.
    pub(crate) fn room(&mut self) -> Outcome<usize, F> {
        match self.in_use()? {
            Some(sector) => self.room_of(sector),
            None => Ok(Self::PAGE_BYTES - 2 * WORD),
        }
    }

    /// Bytes at the end of a sector that are still erased.
    fn room_of(&mut self, sector: usize) -> Outcome<usize, F> {
        const PIECE: usize = 64;
        let begin = HEADER_BYTES + WORD;
        let (mut end, mut room) = (F::ERASE_SIZE - WORD, 0);
        let mut piece = [0; PIECE];
        while end > begin {
            let bytes = piece.get_mut(..PIECE.min(end - begin)).ok_or(Refusal::OutOfBounds)?;
            end -= bytes.len();
            self.read_raw(sector, end, bytes)?;
            let erased = bytes.iter().rev().take_while(|byte| **byte == 0xFF).count();
            room += erased;
            if erased < bytes.len() {
                break;
            }
        }
        Ok(room - room % WORD)
    }

    /// The sector that items go into: its first word is marked and its last is not.
    pub(crate) fn in_use(&mut self) -> Outcome<Option<usize>, F> {
        for sector in 0..SECTORS {
            if self.is_in_use(sector)? {
                return Ok(Some(sector));
            }
        }
        Ok(None)
    }

    fn is_in_use(&mut self, sector: usize) -> Outcome<bool, F> {
        Ok(self.is_begun(sector)? && !self.is_marked(sector, F::ERASE_SIZE - 1)?)
    }

    /// Looks through all that was ever written into the sectors.
    pub(crate) fn look(&mut self) -> Outcome<Look, F> {
        let mut look = Look::default();
        for sector in 0..SECTORS {
            if self.is_begun(sector)? {
                self.look_through(sector, &mut look)?;
            }
        }
        Ok(look)
    }

    fn look_through(&mut self, sector: usize, look: &mut Look) -> Outcome<(), F> {
        let erased = self.room_of(sector)?;
        look_through(F::ERASE_SIZE - WORD, erased, |at, bytes| self.read_raw(sector, at, bytes), look)
    }

    /// Whether items go or went into the sector.
    fn is_begun(&mut self, sector: usize) -> Outcome<bool, F> {
        self.is_marked(sector, HEADER_BYTES)
    }

    /// Whether the library wrote its mark, as it tells that itself: most of the bits of half a byte are enough.
    fn is_marked(&mut self, sector: usize, at: usize) -> Outcome<bool, F> {
        let mut byte = [0];
        self.read_raw(sector, at, &mut byte)?;
        Ok(byte[0].count_zeros() >= 4)
    }

    /// Erases a sector so that power loss at any instant is noticed: announced, erased, and made ours again.
    fn erase_sector(&mut self, sector: usize) -> Outcome<(), F> {
        let (own, announcer) = (self.marks(sector)?, self.marks(other(sector))?);
        if let (Some(generation), Some(_), Some(at)) =
            (own.generation, announcer.generation, announcer.free_at)
            && announcer.void.is_none_or(|void| void < generation)
        {
            self.write_word(other(sector), at, coded(generation))?;
        }
        let past = announcer.void.max(own.generation).unwrap_or(0);
        let at = (sector * F::ERASE_SIZE) as u32;
        self.flash.erase(at, at + F::ERASE_SIZE as u32).map_err(Refusal::Flash)?;
        self.write_word(sector, GENERATION_AT, coded(past.saturating_add(1)))?;
        self.write_word(sector, 0, MAGIC)
    }

    fn marks(&mut self, sector: usize) -> Outcome<Marks, F> {
        let mut header = [0; HEADER_BYTES];
        self.read_raw(sector, 0, &mut header)?;
        Ok(Marks::read(&header))
    }

    /// Whether nothing is behind a sector's marks.
    fn is_bare(&mut self, sector: usize) -> Outcome<bool, F> {
        let mut piece = [0; HEADER_BYTES];
        for at in (HEADER_BYTES..F::ERASE_SIZE).step_by(HEADER_BYTES) {
            let bytes = piece.get_mut(..HEADER_BYTES.min(F::ERASE_SIZE - at)).ok_or(Refusal::OutOfBounds)?;
            self.read_raw(sector, at, bytes)?;
            if bytes.chunks(WORD).any(|word| word != ERASED.to_le_bytes()) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn read_raw(&mut self, sector: usize, at: usize, bytes: &mut [u8]) -> Outcome<(), F> {
        self.flash.read((sector * F::ERASE_SIZE + at) as u32, bytes).map_err(Refusal::Flash)
    }

    fn write_word(&mut self, sector: usize, at: usize, word: u32) -> Outcome<(), F> {
        let at = (sector * F::ERASE_SIZE + at) as u32;
        self.flash.write(at, &word.to_le_bytes()).map_err(Refusal::Flash)
    }

    /// Where an address of the library's is: which sector, and where in it. What it names lies in one sector.
    fn place(address: u32, length: usize) -> Outcome<(usize, usize), F> {
        let (sector, at) = (address as usize / Self::PAGE_BYTES, address as usize % Self::PAGE_BYTES);
        if sector < SECTORS && at + length <= Self::PAGE_BYTES {
            Ok((sector, HEADER_BYTES + at))
        } else {
            Err(Refusal::OutOfBounds)
        }
    }
}

/// Whether nothing in the sector counts.
fn is_void(marks: [Marks; SECTORS], sector: usize) -> bool {
    let announced = marks[other(sector)].generation.and(marks[other(sector)].void);
    match marks[sector].generation {
        Some(generation) => announced.is_some_and(|void| void >= generation),
        None => true,
    }
}

const fn other(sector: usize) -> usize {
    1 - sector
}

impl<F: NorFlash> ErrorType for Sectors<F> {
    type Error = Refusal<F::Error>;
}

impl<F: NorFlash> nonblocking::ReadNorFlash for Sectors<F> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        let (sector, at) = Self::place(offset, bytes.len())?;
        self.read_raw(sector, at, bytes)
    }

    fn capacity(&self) -> usize {
        SECTORS * Self::PAGE_BYTES
    }
}

impl<F: NorFlash> nonblocking::NorFlash for Sectors<F> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = Self::PAGE_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        if !self.may_erase {
            return Err(Refusal::NotNow);
        }
        for address in (from..to).step_by(Self::PAGE_BYTES) {
            let (sector, _) = Self::place(address, 0)?;
            self.erase_sector(sector)?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        let (sector, at) = Self::place(offset, bytes.len())?;
        // A sector's last word is written when it is full and items go on into the other one, which ends with an erase:
        // refused here, nothing of that has begun.
        if !self.may_erase && at + bytes.len() == F::ERASE_SIZE {
            return Err(Refusal::NotNow);
        }
        self.flash.write((sector * F::ERASE_SIZE + at) as u32, bytes).map_err(Refusal::Flash)
    }
}
