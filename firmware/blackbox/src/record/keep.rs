//! The stored part of a session, if it is not all of it.

use super::stored::{Field, Fields, Sink, record};

record! {
    /// The range of stored sectors: of a disarmed vehicle recorded by arming only the latest part. Every group of that
    /// time has this record, also the group in which it ends. A reader knows that sectors missing from `from` up to this
    /// record are missing on purpose.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Keep {
        /// From here on everything is stored; otherwise only the latest part, until a record with `all`.
        all: bool,
        /// Start of the part that is, or was, stored only briefly.
        from: u32,
        /// Minimum length of the stored part, in seconds.
        seconds: u32,
    }
}
