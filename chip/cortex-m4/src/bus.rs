//! The seam between the processor and the chip round it: what the processor asks of the bus.
//!
//! The processor's own registers (`0xE000_0000` to `0xE00F_FFFF`: SCS, NVIC, `SysTick`, DWT, ...) never reach the bus; bit-band
//! aliases (`0x2200_0000`, `0x4200_0000`) reach it as a read, and for a store a write after it, of the byte, halfword or word (the
//! size of the access) that holds the bit. All else does, device and memory alike.
//!
//! `now` is the processor's count of cycles ([`crate::Core::cycles`]) at the start of the access: what a timer's counter is read by.

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

/// What the bus refuses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// An error response (nothing there, or not to be accessed so): a `BusFault` of the processor.
    Bus,
}

/// The chip, as the processor sees it. All addresses are aligned to the access: the core splits what is not.
pub trait Bus {
    /// A load. The value is zero-extended.
    fn read(&mut self, address: u32, size: Size, now: u64) -> Result<u32, Fault>;

    /// A store. Of `value` the low bits of `size` count.
    fn write(&mut self, address: u32, size: Size, value: u32, now: u64) -> Result<(), Fault>;

    /// An instruction's halfword. The core asks once and keeps what it decoded: whoever changes memory that may hold code by
    /// another way than the core's own stores (DMA, the flash controller) calls [`crate::Core::forget_code`].
    fn fetch(&mut self, address: u32) -> Result<u16, Fault>;

    /// The wait states (processor cycles beyond the zero-wait time) of fetching an instruction of `bytes` (2 or 4) at `address`;
    /// called once for each instruction executed, in order. `branched`: the pipeline was refilled at this address.
    fn fetch_wait(&mut self, address: u32, bytes: u32, branched: bool, now: u64) -> u32;

    /// The wait states that the loads and stores since the last call had, in processor cycles.
    fn take_wait(&mut self) -> u32;

    /// Whether the chip wants control back after this instruction (a line to the NVIC changed, its next event moved):
    /// [`crate::Core::run`] then returns. Asked after each instruction that loads or stores.
    fn attention(&self) -> bool;
}
