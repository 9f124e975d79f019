//! The interface between the processor and the chip round it.
//!
//! The processor's own registers (`0xE000_0000` to `0xE00F_FFFF`: SCS, NVIC, `SysTick`, DWT, ...) never reach the
//! bus. Bit-band aliases (`0x2200_0000`, `0x4200_0000`) reach it as a read of the byte, halfword or word with the
//! bit, by the access size. A store adds a write. All other accesses reach it.
//!
//! `now` is the processor's count of cycles ([`crate::Core::cycles`]) at the start of the access. A timer's counter
//! is read at this time.

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
    /// The width in bytes: 1, 2 or 4.
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
    /// An error response (nothing there, or not to be accessed so): a `BusFault` of the processor.
    Bus,
}

/// The chip, as the processor sees it. All addresses are aligned to the access: the core splits unaligned ones.
pub trait Bus {
    /// A load. The value is zero-extended.
    fn read(&mut self, address: u32, size: Size, now: u64) -> Result<u32, Fault>;

    /// A store. Of `value` the low bits of `size` count.
    fn write(&mut self, address: u32, size: Size, value: u32, now: u64) -> Result<(), Fault>;

    /// An instruction's halfword. The core asks once and keeps the decoded instruction. DMA and the flash controller, which change
    /// memory without a store of the core, must call [`crate::Core::forget_code`].
    fn fetch(&mut self, address: u32) -> Result<u16, Fault>;

    /// The wait states of a fetch of `bytes` (2 or 4) at `address`, in processor cycles beyond the zero-wait time. Called once for
    /// each executed instruction, in order. `branched`: the pipeline was refilled at this address.
    fn fetch_wait(&mut self, address: u32, bytes: u32, branched: bool, now: u64) -> u32;

    /// The wait states that the loads and stores since the last call had, in processor cycles.
    fn take_wait(&mut self) -> u32;

    /// Whether the chip wants control back after this instruction (a line to the NVIC changed, its next event moved):
    /// [`crate::Core::run`] then returns. Asked after each instruction that loads or stores.
    fn attention(&self) -> bool;
}
