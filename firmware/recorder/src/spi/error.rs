//! Errors of a card on an SPI bus.

use core::fmt;

use crate::Trouble;

/// The reason that an access failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SpiError {
    /// The board's bus failed.
    Port,
    /// Nothing answers: no card, no power, or no contact.
    NoAnswer,
    /// The device is not an SD card, or does not work at 3.3 V.
    NotSd,
    /// Another card answers than the identified one: it must be mounted anew.
    Changed,
    /// The card did not become ready in time.
    Busy,
    /// One service of the card took longer than [`super::SERVICE_MAX`] in all.
    OutOfTime,
    /// The card refused a command, with these bits (SD specification, 7.3.2.1).
    Refused(u8),
    /// The card sent no block in time.
    NoData,
    /// The card sent an error token in place of a block (7.3.3.3), or an unknown token.
    Token(u8),
    /// A block was damaged on its way, in either direction.
    Damaged,
    /// The card could not write a block; its data response, or its status (7.3.2.3).
    NotWritten(u8),
    /// The card is write protected, or locked with a password.
    Locked,
    /// The block is beyond the card's end.
    OutOfRange,
}

impl SpiError {
    /// A moment later.
    pub(super) const fn is_passing(self) -> bool {
        matches!(self, Self::NoAnswer | Self::Refused(_) | Self::NoData | Self::Token(_) | Self::Damaged)
    }

    pub(super) const fn has_lost_card(self) -> bool {
        const IDLE: u8 = 1;
        match self {
            Self::Refused(bits) => bits & IDLE != 0,
            Self::Port | Self::NoAnswer | Self::NotSd | Self::Changed | Self::Busy | Self::OutOfTime => true,
            Self::NoData
            | Self::Token(_)
            | Self::Damaged
            | Self::NotWritten(_)
            | Self::Locked
            | Self::OutOfRange => false,
        }
    }

    /// The consequence for recording.
    pub const fn trouble(self) -> Trouble {
        match self {
            Self::NoAnswer | Self::Changed => Trouble::Gone,
            Self::Locked => Trouble::Locked,
            Self::Port | Self::NotSd | Self::Busy | Self::OutOfTime => Trouble::Stuck,
            Self::Refused(_)
            | Self::NoData
            | Self::Token(_)
            | Self::Damaged
            | Self::NotWritten(_)
            | Self::OutOfRange => Trouble::Refusing,
        }
    }
}

impl fmt::Display for SpiError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Port => write!(f, "the board's bus to the card failed"),
            Self::NoAnswer => write!(f, "no card answers"),
            Self::NotSd => write!(f, "what is in the slot is no SD card for 3.3 V"),
            Self::Changed => write!(f, "another card is in the slot"),
            Self::Busy => write!(f, "the card did not become ready in time"),
            Self::OutOfTime => write!(f, "the card took too long in all"),
            Self::Refused(bits) => write!(f, "the card refused a command ({bits:#04x})"),
            Self::NoData => write!(f, "the card sent no block in time"),
            Self::Token(token) => write!(f, "the card sent {token:#04x} in place of a block"),
            Self::Damaged => write!(f, "a block was damaged on its way"),
            Self::NotWritten(status) => write!(f, "the card could not write a block ({status:#04x})"),
            Self::Locked => write!(f, "the card is write protected"),
            Self::OutOfRange => write!(f, "the block is beyond the card's end"),
        }
    }
}

impl core::error::Error for SpiError {}
