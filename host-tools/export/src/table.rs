//! The tables that a log becomes.

use hums_link::Frame;

use crate::names::message_name;

/// A table of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Table {
    /// Frames of one message that we have the definition of.
    Message(u32),
    /// Frames of an id that we have a definition of, made with another one.
    Unverified(u32),
    /// Frames of an id that we have no definition of.
    Unknown(u32),
    /// Frames of all ids that we have no definition of.
    Unknowns,
    /// The monitor's own.
    Hums(&'static str),
}

impl Table {
    /// The table of a frame; `known` says that its definition is ours.
    pub fn of(frame: &Frame<'_>, known: bool) -> Self {
        match (known, hums_dialect::message(frame.id())) {
            (true, _) => Self::Message(frame.id()),
            (false, Some(_)) => Self::Unverified(frame.id()),
            (false, None) => Self::Unknown(frame.id()),
        }
    }

    /// Its name, also for its file and for the points of the line protocol.
    pub fn name(self) -> String {
        match self {
            Self::Message(id) | Self::Unknown(id) => message_name(id).into_owned(),
            Self::Unverified(id) => format!("UNVERIFIED_{}", message_name(id)),
            Self::Unknowns => "UNKNOWN".to_owned(),
            Self::Hums(name) => name.to_owned(),
        }
    }
}
