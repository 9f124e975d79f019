//! The checksum of a MAVLink frame: CRC-16/MCRF4XX over everything after the start byte, then over one more byte, the
//! `crc_extra` of the message definition, which is never sent.
//!
//! It runs over every byte of every frame, in the firmware and in every reader: four bytes are taken in one step. Because
//! the last byte is known only to those who have the definition, the last step can also be run backwards: [`extra_of`]
//! tells which `crc_extra`, if any, makes a checksum right. Of random damage only 1 in 256 has one.

/// The start value.
pub const START: u16 = 0xffff;

/// The reflected polynomial 0x1021.
const POLYNOMIAL: u16 = 0x8408;

/// Effect of a byte on the checksum, without and with one, two or three bytes behind it.
static TABLES: [[u16; 256]; 4] = tables();

/// For each value of the high byte of an entry of the first table, the entry's index: in a reflected CRC it is a
/// permutation.
static INDEX_OF_HIGH: [u8; 256] = index_of_high();

const fn tables() -> [[u16; 256]; 4] {
    let mut tables = [[0; 256]; 4];
    let mut index = 0;
    while index < 256 {
        let (mut crc, mut bit) = (index as u16, 0);
        while bit < 32 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ POLYNOMIAL } else { crc >> 1 };
            bit += 1;
            if bit % 8 == 0 {
                tables[bit / 8 - 1][index] = crc;
            }
        }
        index += 1;
    }
    tables
}

const fn index_of_high() -> [u8; 256] {
    let [table, ..] = tables();
    let mut inverse = [0; 256];
    let mut index = 0;
    while index < 256 {
        inverse[(table[index] >> 8) as usize] = index as u8;
        index += 1;
    }
    inverse
}

/// The checksum after `bytes`, with `crc` before them.
#[inline]
pub fn update(crc: u16, bytes: &[u8]) -> u16 {
    let [last, third, second, first] = &TABLES;
    let (words, rest) = bytes.as_chunks();
    let crc = words.iter().fold(crc, |crc, word| {
        // By shifts: optimised for size, an array of the bytes would become a loop.
        let four = u32::from(crc) ^ u32::from_le_bytes(*word);
        let at = |shift: u32| usize::from((four >> shift) as u8);
        first[at(0)] ^ second[at(8)] ^ third[at(16)] ^ last[at(24)]
    });
    rest.iter().fold(crc, |crc, byte| step(crc, *byte))
}

/// The checksum after one more byte.
#[inline]
pub fn step(crc: u16, byte: u8) -> u16 {
    (crc >> 8) ^ TABLES[0][usize::from(crc as u8 ^ byte)]
}

/// The byte that leads from checksum `before` to checksum `after`, if there is one; there are never two.
pub fn extra_of(before: u16, after: u16) -> Option<u8> {
    let wanted = after ^ (before >> 8);
    let index = INDEX_OF_HIGH[usize::from(wanted >> 8)];
    (TABLES[0][usize::from(index)] == wanted).then_some(index ^ before as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_check_value() {
        // The CRC catalogue's check value of CRC-16/MCRF4XX.
        assert_eq!(update(START, b"123456789"), 0x6f91);
    }

    #[test]
    fn four_bytes_a_step_do_what_each_does() {
        let bytes: Vec<u8> = (0..270_u32).map(|at| ((at * 97) >> 2) as u8).collect();
        for len in 0..bytes.len() {
            let each = bytes[..len].iter().fold(START, |crc, byte| step(crc, *byte));
            assert_eq!(update(START, &bytes[..len]), each, "{len}");
        }
    }

    #[test]
    fn the_last_step_runs_backwards_for_every_byte() {
        for before in (0..=u16::MAX).step_by(37) {
            for byte in 0..=u8::MAX {
                assert_eq!(extra_of(before, step(before, byte)), Some(byte));
            }
        }
    }

    #[test]
    fn one_wrong_checksum_in_256_has_an_extra() {
        let found = (0..=u16::MAX).filter(|&after| extra_of(0x1234, after).is_some()).count();
        assert_eq!(found, 256);
    }
}
