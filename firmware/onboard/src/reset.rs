//! Causes of a start.

/// Why the firmware started.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// Power came.
    PowerOn,
    /// The supply sagged.
    BrownOut,
    /// The reset button or the debugger.
    Pin,
    /// The firmware itself, after a fault.
    Software,
    /// The watchdog was not fed.
    Watchdog,
}

impl ResetCause {
    /// Whether the vehicle may be in flight. A pilot switches power on, while a brown-out, a fault or a watchdog
    /// comes at any time.
    pub const fn may_be_in_flight(self) -> bool {
        !matches!(self, Self::PowerOn | Self::Pin)
    }

    /// As the log names it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PowerOn => "power-on",
            Self::BrownOut => "brown-out",
            Self::Pin => "pin",
            Self::Software => "software",
            Self::Watchdog => "watchdog",
        }
    }
}
