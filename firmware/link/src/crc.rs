//! The checksum of a MAVLink frame: CRC-16/MCRF4XX over everything after the start byte, then over one more byte,
//! the `crc_extra` of the message definition, which is never sent.
//!
//! One table look-up a byte (about 5 instructions on a Cortex-M4). Because the last byte is known only to those who
//! have the definition, the last step can also be run backwards: [`extra_of`] tells which `crc_extra`, if any, makes
//! a checksum right. Of random damage only 1 in 256 has one.

/// The start value.
pub(crate) const START: u16 = 0xffff;

/// The reflected polynomial 0x1021.
const POLYNOMIAL: u16 = 0x8408;

static TABLE: [u16; 256] = table();

/// For each value of the high byte of a table entry, the entry's index: in a reflected CRC it is a permutation.
static INDEX_OF_HIGH: [u8; 256] = index_of_high();

const fn table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut index = 0;
    while index < 256 {
        let mut value = index as u16;
        let mut bit = 0;
        while bit < 8 {
            value = if value & 1 == 1 { (value >> 1) ^ POLYNOMIAL } else { value >> 1 };
            bit += 1;
        }
        table[index] = value;
        index += 1;
    }
    table
}

const fn index_of_high() -> [u8; 256] {
    let table = table();
    let mut inverse = [0; 256];
    let mut index = 0;
    while index < 256 {
        inverse[(table[index] >> 8) as usize] = index as u8;
        index += 1;
    }
    inverse
}

/// The checksum after `bytes`, where `crc` is the one before them.
#[inline]
pub(crate) fn update(mut crc: u16, bytes: &[u8]) -> u16 {
    for &byte in bytes {
        crc = step(crc, byte);
    }
    crc
}

/// The checksum after one more byte.
#[inline]
pub(crate) fn step(crc: u16, byte: u8) -> u16 {
    (crc >> 8) ^ TABLE[usize::from(crc as u8 ^ byte)]
}

/// The byte that leads from checksum `before` to checksum `after`, if there is one.
pub(crate) fn extra_of(before: u16, after: u16) -> Option<u8> {
    let wanted = after ^ (before >> 8);
    let index = INDEX_OF_HIGH[usize::from(wanted >> 8)];
    (TABLE[usize::from(index)] == wanted).then_some(index ^ before as u8)
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
