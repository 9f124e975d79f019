//! One sector: its header, and the items behind it.
//!
//! | word | header |
//! |---|---|
//! | 0 | [`MAGIC`] |
//! | 1 | the sector's generation, [`coded`]: counts up with each change of the active sector |
//! | 2 | [`COMPLETE`]: all live items were copied into it |
//! | 3 | the generation of the sector that supersedes it, [`coded`] |
//!
//! | word | item |
//! |---|---|
//! | 0 | the value's length in bytes, [`coded`] |
//! | 1 | the key |
//! | 2.. | the value, zeros up to a word |
//! | last | CRC-32C of length, key and value |
//!
//! Words are written in this order. A power cut in the middle of an item leaves an invalid length or a partly written last word.
//! Bits only go from 1 to 0, so a partly written last word has all ones of the correct one ([`Check::Cut`]). Any other invalid
//! item is damage.

use crc::{CRC_32_ISCSI, Crc};
use embedded_storage::nor_flash::NorFlash;

use crate::key::Key;

pub(crate) const WORD: usize = 4;
pub(crate) const HEADER_BYTES: usize = 4 * WORD;
pub(crate) const ITEM_BYTES: usize = 3 * WORD;
pub(crate) const ERASED: u32 = u32::MAX;
/// "HST2". Change it with the layout.
pub(crate) const MAGIC: u32 = u32::from_be_bytes(*b"HST2");
const COMPLETE: u32 = u32::from_be_bytes(*b"done");

const GENERATION_AT: usize = WORD;
const COMPLETE_AT: usize = 2 * WORD;
const SUPERSEDED_AT: usize = 3 * WORD;

/// A number with its complement in the other half. A partly written word lacks a zero in one half, so it is never taken for a
/// number.
const fn coded(number: u16) -> u32 {
    number as u32 | ((!number as u32) << 16)
}

const fn decoded(word: u32) -> Option<u16> {
    let number = word as u16;
    if coded(number) == word { Some(number) } else { None }
}

/// A sector's header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Header {
    /// Generation; readable even if the rest of the header is damaged.
    pub(crate) generation: Option<u16>,
    pub(crate) is_complete: bool,
    pub(crate) superseded_by: Option<u16>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Item {
    pub(crate) at: usize,
    pub(crate) key: Key,
    pub(crate) length: usize,
}

impl Item {
    pub(crate) const fn value_at(&self) -> usize {
        self.at + 2 * WORD
    }

    pub(crate) const fn bytes(&self) -> usize {
        ITEM_BYTES + self.length.next_multiple_of(WORD)
    }

    pub(crate) const fn end(&self) -> usize {
        self.at + self.bytes()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Check {
    Whole,
    /// Cut short by a loss of power.
    Cut,
    Damaged,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Content {
    /// Complete items.
    pub(crate) items: usize,
    /// The sector holds bytes that are neither an item nor the trace of a power cut.
    pub(crate) is_damaged: bool,
    pub(crate) end: usize,
}

pub(crate) struct Sector<'f, F> {
    flash: &'f mut F,
    start: usize,
    /// Upper limit of the items.
    end: usize,
}

impl<'f, F: NorFlash> Sector<'f, F> {
    pub(crate) const fn new(flash: &'f mut F, index: usize, end: usize) -> Self {
        const {
            assert!(F::WRITE_SIZE == WORD && F::READ_SIZE == 1, "the layout is made for words of four bytes");
            assert!(F::ERASE_SIZE.is_multiple_of(WORD) && F::ERASE_SIZE <= u16::MAX as usize);
        }
        Self { flash, start: index * F::ERASE_SIZE, end }
    }

    pub(crate) fn read(&mut self, at: usize, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.flash.read((self.start + at) as u32, bytes)
    }

    pub(crate) fn word(&mut self, at: usize) -> Result<u32, F::Error> {
        let mut bytes = [0; WORD];
        self.read(at, &mut bytes)?;
        Ok(u32::from_le_bytes(bytes))
    }

    pub(crate) fn write_word(&mut self, at: usize, word: u32) -> Result<(), F::Error> {
        self.flash.write((self.start + at) as u32, &word.to_le_bytes())
    }

    pub(crate) fn header(&mut self) -> Result<Header, F::Error> {
        let generation = decoded(self.word(GENERATION_AT)?);
        let is_ours = self.word(0)? == MAGIC && generation.is_some();
        let is_complete = is_ours && self.word(COMPLETE_AT)? == COMPLETE;
        Ok(Header { generation, is_complete, superseded_by: decoded(self.word(SUPERSEDED_AT)?) })
    }

    pub(crate) fn begin(&mut self, generation: u16) -> Result<(), F::Error> {
        self.flash.erase(self.start as u32, (self.start + F::ERASE_SIZE) as u32)?;
        self.write_word(GENERATION_AT, coded(generation))?;
        self.write_word(0, MAGIC)
    }

    pub(crate) fn complete(&mut self) -> Result<(), F::Error> {
        self.write_word(COMPLETE_AT, COMPLETE)
    }

    /// The mark matters only if the newer header is damaged later, so this write may fail.
    pub(crate) fn supersede(&mut self, generation: u16) -> Result<(), F::Error> {
        if self.word(SUPERSEDED_AT)? == ERASED {
            self.write_word(SUPERSEDED_AT, coded(generation))?;
        }
        Ok(())
    }

    pub(crate) fn append(&mut self, at: usize, key: Key, value: &[u8]) -> Result<(), F::Error> {
        let mut crc = CRC.digest();
        for (place, word) in [coded(value.len() as u16), key.stored()].into_iter().enumerate() {
            crc.update(&word.to_le_bytes());
            self.write_word(at + place * WORD, word)?;
        }
        for (place, bytes) in value.chunks(WORD).enumerate() {
            let word = bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte));
            crc.update(&word.to_le_bytes());
            self.write_word(at + (2 + place) * WORD, word)?;
        }
        self.write_word(at + 2 * WORD + value.len().next_multiple_of(WORD), check_of(crc.finalize()))
    }

    /// Complete or not.
    fn item(&mut self, at: usize) -> Result<Option<Item>, F::Error> {
        if at + ITEM_BYTES > self.end {
            return Ok(None);
        }
        let Some(length) = decoded(self.word(at)?) else { return Ok(None) };
        let item = Item { at, key: Key::from_stored(self.word(at + WORD)?), length: usize::from(length) };
        Ok(Some(item).filter(|item| item.end() <= self.end))
    }

    fn check(&mut self, item: &Item) -> Result<Check, F::Error> {
        let mut crc = CRC.digest();
        let last = item.end() - WORD;
        for at in (item.at..last).step_by(WORD) {
            crc.update(&self.word(at)?.to_le_bytes());
        }
        let stored = self.word(last)?;
        Ok(match check_of(crc.finalize()) {
            check if check == stored => Check::Whole,
            check if check & stored == check => Check::Cut,
            _ => Check::Damaged,
        })
    }

    pub(crate) fn holds(&mut self, item: &Item, value: &[u8]) -> Result<bool, F::Error> {
        if item.length != value.len() {
            return Ok(false);
        }
        for (at, bytes) in (item.value_at()..).step_by(WORD).zip(value.chunks(WORD)) {
            if !self.word(at)?.to_le_bytes().starts_with(bytes) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    pub(crate) fn next(&mut self, mut at: usize) -> Result<Option<Item>, F::Error> {
        while at + ITEM_BYTES <= self.end {
            match self.item(at)? {
                Some(item) if self.check(&item)? == Check::Whole => return Ok(Some(item)),
                _ => at += WORD,
            }
        }
        Ok(None)
    }

    pub(crate) fn is_newest(&mut self, item: &Item) -> Result<bool, F::Error> {
        let mut at = item.end();
        while let Some(later) = self.next(at)? {
            if later.key == item.key {
                return Ok(false);
            }
            at = later.end();
        }
        Ok(true)
    }

    /// Scans the whole sector.
    ///
    /// An item cut short by a power loss is not damage. Only free space or the mount count of the next start follows it.
    pub(crate) fn content(&mut self) -> Result<Content, F::Error> {
        // Two starts in a row lost power at the first word of their first item.
        const CUT_WORDS: usize = 2;
        let mut content = Content { end: HEADER_BYTES, ..Content::default() };
        let (mut cut, mut words) = (false, 0);
        let mut at = HEADER_BYTES;
        while at < F::ERASE_SIZE && self.word(at)? != ERASED {
            let item = self.item(at)?;
            let check = item.map_or(Ok(Check::Damaged), |item| self.check(&item))?;
            match (item, check) {
                (Some(item), Check::Whole) => {
                    content.items += 1;
                    content.is_damaged |= words > CUT_WORDS || (cut || words > 0) && item.key != Key::MOUNTS;
                    (cut, words, at) = (false, 0, item.end());
                }
                (Some(item), Check::Cut) => {
                    cut = true;
                    at = item.end();
                }
                _ => {
                    words += 1;
                    at += WORD;
                }
            }
            content.end = at;
        }
        content.is_damaged |= words > CUT_WORDS;
        while at < F::ERASE_SIZE {
            at += WORD;
            if self.word(at - WORD)? != ERASED {
                (content.is_damaged, content.end) = (true, at);
            }
        }
        Ok(content)
    }
}

/// CRC-32C (Castagnoli).
static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Never the erased word: an item without a written checksum is incomplete.
const fn check_of(crc: u32) -> u32 {
    if crc == ERASED { 0 } else { crc }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_word_that_power_cut_short_is_no_number() {
        for number in [0, 1, 0x8001, 0xFFFF, 12_345] {
            let whole = coded(number);
            assert_eq!(decoded(whole), Some(number));
            for bit in (0..32).filter(|bit| whole & (1 << bit) == 0) {
                assert_eq!(decoded(whole | 1 << bit), None, "{number} without bit {bit}");
            }
        }
        assert_eq!(decoded(ERASED), None);
        assert_eq!(decoded(0), None);
    }

    #[test]
    fn the_check_is_crc_32c() {
        let mut crc = CRC.digest();
        // RFC 3720, B.4: 32 bytes of zeros.
        (0..8).for_each(|_| crc.update(&[0; WORD]));
        assert_eq!(check_of(crc.finalize()), 0x8A91_36AA);
    }
}
