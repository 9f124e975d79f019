//! A stopped machine: reason, registers, place, last instructions.

use std::fmt;

use crate::chip::Trouble;

impl fmt::Display for Trouble {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Trouble::Register(at, None) => write!(f, "the register at {at:#010x} is not modelled (read)"),
            Trouble::Register(at, Some(value)) => {
                write!(f, "the register at {at:#010x} is not modelled, or not with {value:#010x} (written)")
            }
            Trouble::Width(at, bytes) => write!(f, "a store of {bytes} bytes at {at:#010x} is not modelled"),
            Trouble::FlashTooSlow(hz, latency) => {
                write!(f, "the flash does not follow {} MHz with {latency} wait states", hz / 1_000_000)
            }
            Trouble::StandsStill(slot) => write!(f, "event {slot} does not pass: a fault of the model's"),
        }
    }
}

/// A fault in words (DDI 0403E, B3.2.15 and B3.2.16).
pub(crate) fn fault([cfsr, hfsr, mmfar, bfar]: [u32; 4], at: u32) -> String {
    let causes = [
        (cfsr & (1 | 1 << 8), format!("an instruction is wanted from {at:#010x}, where none may be")),
        (cfsr & 1 << 1, format!("the MPU refuses a load or store at {mmfar:#010x}")),
        (cfsr & 1 << 9, format!("a load or store at {bfar:#010x}, where nothing answers")),
        (cfsr & 1 << 10, "a store where nothing answers, before this".to_owned()),
        (cfsr & (0x38 | 0x3800), "the stack is where registers cannot be kept".to_owned()),
        (cfsr & 1 << 16, "what is there is no instruction".to_owned()),
        (cfsr & 1 << 17, "a jump to an even address: no Thumb code".to_owned()),
        (cfsr & 1 << 18, "a return from an exception that is none".to_owned()),
        (cfsr & 1 << 19, "a coprocessor that is off or not there".to_owned()),
        (cfsr & 1 << 24, "an address that is not aligned".to_owned()),
        (cfsr & 1 << 25, "a division by zero".to_owned()),
        (hfsr & 1 << 1, "a vector that cannot be read".to_owned()),
        (hfsr & 1 << 31, "a breakpoint, and no debugger is there".to_owned()),
    ];
    let words: Vec<String> =
        causes.into_iter().filter(|(bits, _)| *bits != 0).map(|(_, words)| words).collect();
    format!("a fault of the processor: {}", words.join(", "))
}

/// Reason and place of a stop.
#[derive(Clone, Debug)]
pub struct Report {
    /// Why.
    pub reason: String,
    /// Microseconds since the model began.
    pub us: u64,
    /// R0 to R15.
    pub registers: [u32; 16],
    /// The function; outside of any, with the last instruction's.
    pub place: String,
    /// The newest last, with functions.
    pub trace: Vec<(u32, String)>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {} us, in {}", self.reason, self.us, self.place)?;
        for (row, registers) in self.registers.chunks(4).enumerate() {
            writeln!(f)?;
            for (column, value) in registers.iter().enumerate() {
                write!(f, "  r{:<2} {value:08x}", 4 * row + column)?;
            }
        }
        for (address, name) in &self.trace {
            write!(f, "\n  {address:08x} {name}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Report {}
