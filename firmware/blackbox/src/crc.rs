//! CRC-32C (Castagnoli, reflected 0x82F63B78, initial value and final exclusive-or all ones): the check of a sector.
//!
//! It finds every burst of up to 32 bits and, over 508 bytes, every pattern of up to five bit errors
//! (Koopman, "32-Bit Cyclic Redundancy Codes for Internet Applications", DSN 2002).

const POLYNOMIAL: u32 = 0x82f6_3b78;

const TABLE: [u32; 256] = table();

const fn table() -> [u32; 256] {
    let mut table = [0; 256];
    let mut index = 0;
    while index < 256 {
        let mut crc = index as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ POLYNOMIAL } else { crc >> 1 };
            bit += 1;
        }
        table[index] = crc;
        index += 1;
    }
    table
}

/// A CRC-32C in the making.
pub(crate) struct Crc32c(u32);

impl Crc32c {
    pub(crate) const fn new() -> Self {
        Self(u32::MAX)
    }

    pub(crate) fn add(&mut self, bytes: &[u8]) {
        let step = |crc: u32, &byte: &u8| (crc >> 8) ^ TABLE[usize::from(crc as u8 ^ byte)];
        self.0 = bytes.iter().fold(self.0, step);
    }

    pub(crate) const fn value(&self) -> u32 {
        !self.0
    }
}

/// The CRC-32C of all bytes given.
pub(crate) fn crc32c(bytes: &[u8]) -> u32 {
    let mut crc = Crc32c::new();
    crc.add(bytes);
    crc.value()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_value_is_the_published_one() {
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
    }
}
