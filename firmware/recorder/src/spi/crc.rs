//! The two checksums of the SD specification (4.5), without tables: the card is slower.

/// CRC-7 of a command (x^7 + x^3 + 1), shifted and with the end bit, as its last byte is.
pub(super) fn crc7(bytes: &[u8]) -> u8 {
    let mut crc = 0_u8;
    for byte in bytes {
        crc ^= byte;
        for _ in 0..8 {
            crc = if crc & 0x80 == 0 { crc << 1 } else { (crc << 1) ^ (0x09 << 1) };
        }
    }
    crc | 1
}

/// CRC-16 of a block (x^16 + x^12 + x^5 + 1).
pub(super) fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc: u16, byte| {
        let mut crc = crc.rotate_left(8) ^ u16::from(*byte);
        crc ^= (crc & 0xFF) >> 4;
        crc ^= crc << 12;
        crc ^ (crc & 0xFF) << 5
    })
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
