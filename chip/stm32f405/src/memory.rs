//! Memories: flat, little-endian.

use cortex_m4_model::Size;

/// Start and size.
pub const FLASH: (u32, u32) = (0x0800_0000, 1024 * 1024);
/// The core coupled memory: only the processor reaches it.
pub const CCM: (u32, u32) = (0x1000_0000, 64 * 1024);
/// SRAM1 and SRAM2 in a row.
pub const SRAM: (u32, u32) = (0x2000_0000, 128 * 1024);

/// A memory.
#[derive(Clone)]
pub struct Memory {
    bytes: Box<[u8]>,
}

impl Memory {
    /// Size and fill.
    pub fn new(bytes: u32, fill: u8) -> Self {
        Self { bytes: vec![fill; bytes as usize].into_boxed_slice() }
    }

    /// Nothing beyond the end.
    #[inline]
    pub fn get(&self, offset: u32, size: Size) -> Option<u32> {
        let at = offset as usize;
        match size {
            Size::Byte => self.bytes.get(at).map(|byte| u32::from(*byte)),
            Size::Half => {
                let pair = self.bytes.get(at..at + 2)?;
                Some(u32::from(u16::from_le_bytes(pair.try_into().ok()?)))
            }
            Size::Word => Some(u32::from_le_bytes(self.bytes.get(at..at + 4)?.try_into().ok()?)),
        }
    }

    /// `None` beyond the end.
    #[inline]
    pub fn set(&mut self, offset: u32, size: Size, value: u32) -> Option<()> {
        let at = offset as usize;
        let bytes = value.to_le_bytes();
        let count = size.bytes() as usize;
        self.bytes.get_mut(at..at + count)?.copy_from_slice(&bytes[..count]);
        Some(())
    }

    /// All of it.
    pub fn all(&self) -> &[u8] {
        &self.bytes
    }

    /// All of it, to change.
    pub fn all_mut(&mut self) -> &mut [u8] {
        &mut self.bytes
    }
}

/// Content at power-on: neither zeros nor the same each time.
pub fn garbage(bytes: &mut [u8], seed: u64) {
    let mut state = seed | 1;
    for byte in bytes {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *byte = (state >> 56) as u8;
    }
}
