//! Why an instruction did not end normally.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trap {
    /// `UsageFault`s, by bits of CFSR's upper half.
    Undefined,
    InvalidState,
    NoCoprocessor,
    Unaligned,
    DivideByZero,
    /// Refused by the bus.
    Bus(u32),
    FetchBus,
    /// Refused by the MPU.
    Memory(u32),
    /// An instruction fetch from a forbidden place.
    FetchMemory,
    /// While floating-point registers were stored late.
    LazyBus,
    LazyMemory,
    /// SVC.
    Supervisor,
    /// BKPT.
    Breakpoint(u8),
    /// A branch to an `EXC_RETURN` in handler mode.
    Return(u32),
    /// AIRCR.SYSRESETREQ.
    Reset,
}
