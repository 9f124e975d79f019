//! Errors of card operations.

use core::fmt;

use crate::layout::LayoutError;

/// The reason that a card operation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CardError<E> {
    /// The card failed or was pulled.
    Device(E),
    /// The card cannot be used as it is.
    Foreign(LayoutError<E>),
    /// The file system on it is damaged.
    Damaged,
    /// No free clusters.
    Full,
    /// The search for free clusters goes on: try again.
    Searching,
    /// The segment does not exist.
    NotFound,
    /// No segment is open.
    NotOpen,
}

impl<E: fmt::Debug> fmt::Display for CardError<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(error) => write!(f, "the card failed: {error:?}"),
            Self::Foreign(why) => write!(f, "{why}"),
            Self::Damaged => {
                write!(f, "the card's file system is damaged")
            }
            Self::Full => write!(f, "the card is full and holds no log to overwrite"),
            Self::Searching => write!(f, "room on the card is still looked for"),
            Self::NotFound => write!(f, "there is no such log"),
            Self::NotOpen => write!(f, "no log is open"),
        }
    }
}
