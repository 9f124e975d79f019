//! The card's own data: the CSD (SD specification, 5.3).

/// Relevant fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Csd {
    /// Blocks of 512 bytes.
    pub(super) blocks: u32,
    /// Writing is forbidden, for now or for ever.
    pub(super) is_locked: bool,
}

impl Csd {
    /// `None`: a structure that is not in this specification.
    pub(super) const fn read(raw: &[u8; 16]) -> Option<Self> {
        let size = match raw[0] >> 6 {
            0 => size_v1(raw),
            1 => ((raw[7] as u64 & 0x3F) << 16 | (raw[8] as u64) << 8 | raw[9] as u64).wrapping_add(1) << 10,
            _ => return None,
        };
        let blocks = if size > u32::MAX as u64 { u32::MAX } else { size as u32 };
        Some(Self { blocks, is_locked: raw[14] & 0x30 != 0 })
    }
}

/// Cards up to 2 GB: a size in blocks of 512, 1024 or 2048 bytes.
const fn size_v1(raw: &[u8; 16]) -> u64 {
    let block_exponent = (raw[5] & 0x0F) as u32;
    let size = (raw[6] as u64 & 3) << 10 | (raw[7] as u64) << 2 | raw[8] as u64 >> 6;
    let multiplier = (raw[9] as u32 & 3) << 1 | raw[10] as u32 >> 7;
    ((size + 1) << (multiplier + 2) << block_exponent) >> 9
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Registers of real cards, with the same results as in `embedded-sdmmc`'s tests.
    #[test]
    fn sizes_are_those_of_known_cards() {
        let v1 =
            [0x00, 0x26, 0x00, 0x32, 0x5F, 0x59, 0x83, 0xC8, 0xAD, 0xDB, 0xCF, 0xFF, 0xD2, 0x40, 0x40, 0xA5];
        assert_eq!(Csd::read(&v1), Some(Csd { blocks: 1_984_000, is_locked: false }));
        let v2 =
            [0x40, 0x0E, 0x00, 0x32, 0x5B, 0x59, 0x00, 0x00, 0x3A, 0x91, 0x7F, 0x80, 0x0A, 0x40, 0x40, 0x19];
        assert_eq!(Csd::read(&v2), Some(Csd { blocks: 14_994 * 1_024, is_locked: false }));
    }

    #[test]
    fn both_kinds_of_write_protection_are_seen() {
        let mut raw =
            [0x40, 0x0E, 0x00, 0x32, 0x5B, 0x59, 0x00, 0x00, 0x3A, 0x91, 0x7F, 0x80, 0x0A, 0x40, 0, 0];
        for bit in [0x10, 0x20] {
            raw[14] = bit;
            assert!(Csd::read(&raw).is_some_and(|csd| csd.is_locked));
        }
    }

    #[test]
    fn no_register_is_too_strange() {
        for byte in 0..=255 {
            let _ = Csd::read(&[byte; 16]);
        }
        assert_eq!(Csd::read(&[0xFF; 16]), None);
    }
}
