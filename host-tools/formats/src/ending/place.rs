//! A log's place among the logs of its card.

/// The session that was recorded on a card just before a log, as the log's boot record names it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SessionBefore {
    /// No boot record names one.
    #[default]
    NotNamed,
    /// It was read too.
    There,
    /// It is not among the inputs, and may be gone: the oldest logs make room for new ones.
    NotLookedFor(u32),
    /// It is not there, and an older log of the card is; or its files hold another session.
    Gone(u32),
}

impl SessionBefore {
    /// The missing session, as a part of a sentence.
    pub fn gone(self) -> Option<String> {
        match self {
            Self::Gone(number) => Some(format!(
                "session {number:05}, which was recorded just before it, is not there under that number"
            )),
            Self::NotNamed | Self::There | Self::NotLookedFor(_) => None,
        }
    }
}
