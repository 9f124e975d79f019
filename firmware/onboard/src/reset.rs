//! Causes of a start.

/// The reason of a start.
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
    /// The firmware itself, to begin card-reader mode.
    CardReader,
    /// The firmware itself, after a host ejected the card in card-reader mode.
    Eject,
    /// The resident program, after work for an update.
    Update,
}

impl ResetCause {
    /// Mark in surviving memory before a restart that begins card-reader mode.
    pub const MARK_CARD_READER: u32 = 0x5553_4244;
    /// Mark in surviving memory before a restart after an eject.
    pub const MARK_EJECT: u32 = 0x454A_4354;

    /// The cause by the reset and by the mark that survived it. Only a reset by the firmware itself keeps memory.
    #[must_use]
    pub const fn with_mark(self, mark: u32) -> Self {
        match (self, mark) {
            (Self::Software, Self::MARK_CARD_READER) => Self::CardReader,
            (Self::Software, Self::MARK_EJECT) => Self::Eject,
            _ => self,
        }
    }

    /// Whether the vehicle may be in flight. A pilot switches power on, and a PC that ejects the card is on a cable. A
    /// brown-out, a fault or a watchdog comes at any time.
    pub const fn may_be_in_flight(self) -> bool {
        matches!(self, Self::BrownOut | Self::Software | Self::Watchdog)
    }

    /// As the log names it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::PowerOn => "power-on",
            Self::BrownOut => "brown-out",
            Self::Pin => "pin",
            Self::Software => "software",
            Self::Watchdog => "watchdog",
            Self::CardReader => "card reader",
            Self::Eject => "eject",
            Self::Update => "update",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_counts_after_a_reset_by_the_firmware_only_and_other_words_never() {
        const MARKS: [(u32, ResetCause); 2] = [
            (ResetCause::MARK_CARD_READER, ResetCause::CardReader),
            (ResetCause::MARK_EJECT, ResetCause::Eject),
        ];
        for (mark, cause) in MARKS {
            assert_eq!(ResetCause::Software.with_mark(mark), cause);
            for reset in [ResetCause::PowerOn, ResetCause::BrownOut, ResetCause::Pin, ResetCause::Watchdog] {
                assert_eq!(reset.with_mark(mark), reset);
            }
            for bit in 0..32 {
                assert_eq!(ResetCause::Software.with_mark(mark ^ 1 << bit), ResetCause::Software);
            }
        }
        assert_eq!(ResetCause::Software.with_mark(0), ResetCause::Software);
    }
}
