//! The words at a sector's beginning.
//!
//! | word | what |
//! |---|---|
//! | 0 | [`MAGIC`], written last: the sector was erased whole and is ours |
//! | 1 | its generation, counted up at each erase, [`coded`] |
//! | 2.. | the generations of the *other* sector that are void, because its erase was begun, [`coded`] |

/// Bytes of all marks.
pub(crate) const HEADER_BYTES: usize = 128;
/// Bytes of a word.
pub(crate) const WORD: usize = 4;
/// Where the generation stands.
pub(crate) const GENERATION_AT: usize = WORD;
/// Where the void generations begin.
const VOID_AT: usize = 2 * WORD;
/// "HST1": a layout that differs needs another number.
pub(crate) const MAGIC: u32 = u32::from_be_bytes(*b"HST1");
/// What erased flash reads as.
pub(crate) const ERASED: u32 = u32::MAX;

/// A number so that no part of it, and no word that was written only in part, is taken for a number: each bit stands
/// beside its opposite, and what power cut short lacks a zero somewhere.
pub(crate) const fn coded(number: u16) -> u32 {
    number as u32 | ((!number as u32) << 16)
}

const fn decoded(word: u32) -> Option<u16> {
    let number = word as u16;
    if coded(number) == word { Some(number) } else { None }
}

/// A sector's marks, as they are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Marks {
    /// Its generation; `None`: it is not ours, or not yet.
    pub(crate) generation: Option<u16>,
    /// Up to which generation the other sector is void.
    pub(crate) void: Option<u16>,
    /// Where the next void generation goes, if there is room.
    pub(crate) free_at: Option<usize>,
}

impl Marks {
    pub(crate) fn read(header: &[u8; HEADER_BYTES]) -> Self {
        let mut words = header.chunks_exact(WORD).map(word);
        let magic = words.next();
        let generation = words.next().and_then(decoded).filter(|_| magic == Some(MAGIC));
        let (mut void, mut free_at) = (None, None);
        for (place, word) in words.enumerate() {
            void = void.max(decoded(word));
            if word == ERASED {
                free_at = free_at.or(Some(VOID_AT + place * WORD));
            } else {
                // Torn or not, what follows was written later.
                free_at = None;
            }
        }
        Self { generation, void, free_at }
    }
}

fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(words: &[u32]) -> [u8; HEADER_BYTES] {
        let mut bytes = [0xFF; HEADER_BYTES];
        for (place, word) in words.iter().enumerate() {
            bytes[place * WORD..][..WORD].copy_from_slice(&word.to_le_bytes());
        }
        bytes
    }

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
    fn marks_read_as_they_were_written() {
        let blank = Marks { generation: None, void: None, free_at: Some(VOID_AT) };
        assert_eq!(Marks::read(&header(&[])), blank);
        let ours = Marks::read(&header(&[MAGIC, coded(7)]));
        assert_eq!(ours, Marks { generation: Some(7), ..blank });
        let void = Marks::read(&header(&[MAGIC, coded(7), coded(6) | 1 << 20, coded(6)]));
        assert_eq!(void, Marks { generation: Some(7), void: Some(6), free_at: Some(VOID_AT + 2 * WORD) });
        assert_eq!(Marks::read(&header(&[ERASED, coded(7)])).generation, None, "the magic comes last");
        assert_eq!(Marks::read(&[0; HEADER_BYTES]).free_at, None);
    }
}
