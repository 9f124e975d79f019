//! The two checksums of the SD specification (4.5).

use ::crc::{CRC_7_MMC, CRC_16_XMODEM, Crc, NoTable};

const COMMAND: Crc<u8, NoTable> = Crc::<u8, NoTable>::new(&CRC_7_MMC);
static BLOCK: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);

/// CRC-7 of a command, shifted and with the end bit, as its last byte is.
pub(super) fn crc7(bytes: &[u8]) -> u8 {
    COMMAND.checksum(bytes) << 1 | 1
}

/// CRC-16 of a block.
pub(super) fn crc16(bytes: &[u8]) -> u16 {
    BLOCK.checksum(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checksums_are_those_of_the_specification() {
        assert_eq!(crc7(&[0x40, 0, 0, 0, 0]), 0x95, "CMD0");
        assert_eq!(crc7(&[0x48, 0, 0, 1, 0xAA]), 0x87, "CMD8");
        assert_eq!(crc7(&[0x51, 0, 0, 0, 0]), 0b010_1010 << 1 | 1, "CMD17");
        assert_eq!(crc16(&[0xFF; 512]), 0x7FA1);
    }
}
