//! The interface between processor and chip.
//!
//! The processor's own registers (`0xE000_0000` to `0xE00F_FFFF`: SCS, NVIC, `SysTick`, DWT, ...) never reach the bus. Bit-band
//! aliases (`0x2200_0000`, `0x4200_0000`) reach it as a read of the unit with the bit, by the access size; a store adds a
//! write.
//!
//! `now` is the count of cycles ([`crate::Core::cycles`]) at the start of the access; a timer's counter is read at it.

/// The width of an access.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// 8 bits.
    Byte,
    /// 16 bits.
    Half,
    /// 32 bits.
    Word,
}

impl Size {
    /// 1, 2 or 4 bytes.
    #[inline]
    pub const fn bytes(self) -> u32 {
        match self {
            Size::Byte => 1,
            Size::Half => 2,
            Size::Word => 4,
        }
    }
}

/// An access that the bus refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// An error response: a `BusFault`.
    Bus,
}

/// The chip, as the processor sees it; accesses are aligned.
pub trait Bus {
    /// Zero-extended.
    fn read(&mut self, address: u32, size: Size, now: u64) -> Result<u32, Fault>;

    /// Of `value` the low bits of `size` count.
    fn write(&mut self, address: u32, size: Size, value: u32, now: u64) -> Result<(), Fault>;

    /// An instruction's halfword, asked once. Changes without a store of the core (DMA, the flash controller) must call
    /// [`crate::Core::forget_code`].
    fn fetch(&mut self, address: u32) -> Result<u16, Fault>;

    /// Wait states of a fetch of `bytes` (2 or 4), processor cycles. Called once for each executed instruction, in order.
    /// `branched`: the pipeline was refilled at this address.
    fn fetch_wait(&mut self, address: u32, bytes: u32, branched: bool, now: u64) -> u32;

    /// Wait states of loads and stores since the last call, processor cycles.
    fn take_wait(&mut self) -> u32;

    /// Whether the chip wants control back (a line to the NVIC changed, its next event moved): [`crate::Core::run`] returns.
    /// Asked after each instruction that loads or stores.
    fn attention(&self) -> bool;
}
