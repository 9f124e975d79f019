//! Faults of a card, and their times.

/// The fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// A command gets no answer.
    Silent,
    /// The checksum shows it.
    DamagedCommand,
    /// A block that is read is damaged on its way.
    DamagedRead,
    /// A block that is written is damaged on its way.
    DamagedWrite,
    /// A block that is written is refused with a write error.
    WriteError,
    /// Only the status shows it.
    NotProgrammed,
    /// This comes in place of a block's token.
    Token(u8),
    /// A requested block never comes.
    NoBlock,
    /// Nanoseconds.
    Busy(u64),
    /// The line carries noise.
    Noise,
}

/// A fault and its time.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    pub(crate) fault: Fault,
    from_ns: u64,
    until_ns: u64,
    skip: u32,
    times: u32,
}

impl Plan {
    /// Always.
    pub const fn always(fault: Fault) -> Self {
        Self { fault, from_ns: 0, until_ns: u64::MAX, skip: 0, times: u32::MAX }
    }

    /// Nanoseconds since the slot got its power.
    pub const fn from(mut self, ns: u64) -> Self {
        self.from_ns = ns;
        self
    }

    /// Ends the fault at this moment.
    pub const fn until(mut self, ns: u64) -> Self {
        self.until_ns = ns;
        self
    }

    /// Skips the first times that the fault could strike.
    pub const fn skip(mut self, skip: u32) -> Self {
        self.skip = skip;
        self
    }

    /// Limits the number of faults.
    pub const fn times(mut self, times: u32) -> Self {
        self.times = times;
        self
    }

    pub(crate) fn strikes(&mut self, now_ns: u64) -> bool {
        if !(self.from_ns..self.until_ns).contains(&now_ns) || self.times == 0 {
            return false;
        }
        if self.skip > 0 {
            self.skip -= 1;
            return false;
        }
        self.times -= 1;
        true
    }
}
