//! A log's place among the logs of its card.

/// The session just before a log on its card, by the log's boot record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SessionBefore {
    /// No boot record names one.
    #[default]
    NotNamed,
    /// The other log was read too.
    There,
    /// A session not among the inputs; old logs make room for new ones.
    NotLookedFor(u32),
    /// Missing although an older log of the card is there, or replaced in its files.
    Gone(u32),
}

impl SessionBefore {
    /// A part of a sentence.
    pub fn gone(self) -> Option<String> {
        match self {
            Self::Gone(number) => Some(format!(
                "session {number:05}, which was recorded just before it, is not there under that number"
            )),
            Self::NotNamed | Self::There | Self::NotLookedFor(_) => None,
        }
    }
}
