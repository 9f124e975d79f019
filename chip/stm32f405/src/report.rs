//! What is told when a machine stops: why, the registers, where it was, the last instructions.

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

/// Why a machine stopped, and where.
#[derive(Clone, Debug)]
pub struct Report {
    /// Why.
    pub reason: String,
    /// Microseconds since the model began.
    pub us: u64,
    /// R0 to R15.
    pub registers: [u32; 16],
    /// The program counter's function.
    pub place: String,
    /// The addresses of the last instructions, the newest last, each with its function.
    pub trace: Vec<(u32, String)>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} at {} us, in {}", self.reason, self.us, self.place)?;
        for (row, registers) in self.registers.chunks(4).enumerate() {
            for (column, value) in registers.iter().enumerate() {
                write!(f, "  r{:<2} {value:08x}", 4 * row + column)?;
            }
            writeln!(f)?;
        }
        for (address, name) in &self.trace {
            writeln!(f, "  {address:08x} {name}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Report {}
