//! The flash of an STM32F405RG (RM0090, table 5), as both programs and the tools divide it (ARCHITECTURE.md).

/// First address of the flash: the resident program's vector table, in sector 0.
pub const FLASH: u32 = 0x0800_0000;
/// Sector of [`crate::state`].
pub const STATE_SECTOR: u8 = 3;
/// Its first address.
pub const STATE: u32 = 0x0800_C000;
/// Its bytes.
pub const STATE_BYTES: usize = 16 * 1024;
/// The application's first sector.
pub const APPLICATION_SECTOR: u8 = 5;
/// First address of the application's region: its header.
pub const APPLICATION: u32 = 0x0802_0000;
/// Bytes of each of its sectors, 5 to 11.
pub const SECTOR_BYTES: usize = 128 * 1024;
/// Bytes of the region.
pub const APPLICATION_BYTES: usize = 7 * SECTOR_BYTES;
/// The application's vector table, behind its header.
pub const VECTORS: u32 = APPLICATION + crate::header::BYTES as u32;
