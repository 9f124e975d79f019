//! CRC-32C (Castagnoli, reflected 0x82F63B78, initial value and final exclusive-or all ones): the check of a sector.
//!
//! It finds every burst of up to 32 bits. Over 508 bytes it finds every pattern of up to five bit errors (Koopman,
//! "32-Bit Cyclic Redundancy Codes for Internet Applications", DSN 2002).

const POLYNOMIAL: u32 = 0x82f6_3b78;

/// Tables for a byte followed by zero, one, two or three bytes. Four bytes take one step, which more than halves the cost of a
/// sector.
static TABLES: [[u32; 256]; 4] = tables();

const fn tables() -> [[u32; 256]; 4] {
    let mut tables = [[0; 256]; 4];
    let mut index = 0;
    while index < 256 {
        let (mut crc, mut bit) = (index as u32, 0);
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

pub(crate) struct Crc32c(u32);

impl Crc32c {
    pub(crate) const fn new() -> Self {
        Self(u32::MAX)
    }

    pub(crate) const fn going_on(value: u32) -> Self {
        Self(!value)
    }

    pub(crate) const fn of_constant(bytes: &[u8]) -> u32 {
        let tables = tables();
        let (mut crc, mut at) = (u32::MAX, 0);
        while at < bytes.len() {
            crc = (crc >> 8) ^ tables[0][(crc as u8 ^ bytes[at]) as usize];
            at += 1;
        }
        !crc
    }

    pub(crate) fn add(&mut self, bytes: &[u8]) {
        #[cfg(target_arch = "x86_64")]
        if let Some(crc) = sse42::add(self.0, bytes) {
            self.0 = crc;
            return;
        }
        self.add_by_table(bytes);
    }

    fn add_by_table(&mut self, bytes: &[u8]) {
        let [last, third, second, first] = &TABLES;
        let (words, rest) = bytes.as_chunks();
        let crc = words.iter().fold(self.0, |crc, word| {
            let [a, b, c, d] = (crc ^ u32::from_le_bytes(*word)).to_le_bytes().map(usize::from);
            first[a] ^ second[b] ^ third[c] ^ last[d]
        });
        self.0 = rest.iter().fold(crc, |crc, byte| (crc >> 8) ^ last[usize::from(crc as u8 ^ byte)]);
    }

    pub(crate) const fn value(&self) -> u32 {
        !self.0
    }
}

/// The CRC instruction of a PC. With the tables this checksum took a tenth of the reading time.
#[cfg(target_arch = "x86_64")]
mod sse42 {
    use core::arch::x86_64::{__cpuid, _mm_crc32_u8, _mm_crc32_u64};
    use core::sync::atomic::{AtomicU8, Ordering};

    /// Whether the processor has it: read once, because that is slow on a virtual machine.
    static HAS: AtomicU8 = AtomicU8::new(UNKNOWN);
    const UNKNOWN: u8 = 0;
    const YES: u8 = 1;
    const NO: u8 = 2;

    /// `None` if the processor lacks the instruction.
    #[inline]
    pub(super) fn add(crc: u32, bytes: &[u8]) -> Option<u32> {
        let has = match HAS.load(Ordering::Relaxed) {
            UNKNOWN => ask(),
            has => has,
        };
        // SAFETY: the processor has SSE4.2.
        (has == YES).then(|| unsafe { step(crc, bytes) })
    }

    #[cold]
    fn ask() -> u8 {
        let has = if __cpuid(1).ecx & 1 << 20 == 0 { NO } else { YES };
        HAS.store(has, Ordering::Relaxed);
        has
    }

    #[target_feature(enable = "sse4.2")]
    fn step(crc: u32, bytes: &[u8]) -> u32 {
        let (words, rest) = bytes.as_chunks();
        let crc =
            words.iter().fold(u64::from(crc), |crc, word| _mm_crc32_u64(crc, u64::from_le_bytes(*word)));
        rest.iter().fold(crc as u32, |crc, byte| _mm_crc32_u8(crc, *byte))
    }
}

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

    #[test]
    fn the_tables_give_what_the_processor_gives() {
        let bytes: Vec<u8> = (0..97_u8).map(|index| index.wrapping_mul(37)).collect();
        for len in 0..=bytes.len() {
            let mut crc = Crc32c::new();
            crc.add_by_table(&bytes[..len]);
            assert_eq!(crc.value(), crc32c(&bytes[..len]), "{len} bytes");
        }
    }

    #[test]
    fn it_does_not_matter_in_which_pieces_the_bytes_come() {
        let bytes: Vec<u8> = (0..41_u8).map(|index| index.wrapping_mul(37)).collect();
        for cut in 0..=bytes.len() {
            let mut crc = Crc32c::new();
            crc.add(&bytes[..cut]);
            bytes[cut..].iter().for_each(|byte| crc.add(&[*byte]));
            assert_eq!(crc.value(), crc32c(&bytes), "cut at {cut}");
        }
    }
}
