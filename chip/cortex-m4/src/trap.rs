//! Why an instruction did not end as others do.

/// An interruption of the flow by an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trap {
    /// `UsageFault`s, by their bit of the upper half of CFSR.
    Undefined,
    InvalidState,
    NoCoprocessor,
    Unaligned,
    DivideByZero,
    /// A load or store that the bus refuses.
    Bus(u32),
    /// An instruction that the bus refuses.
    FetchBus,
    /// A load or store that the MPU refuses.
    Memory(u32),
    /// An instruction fetch from a forbidden place.
    FetchMemory,
    /// The same two while the floating-point registers were stored late.
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
