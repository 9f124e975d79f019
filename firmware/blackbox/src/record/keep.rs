//! The stored part of a session, if it is not all of it.

use super::stored::{Fields, Sink};

/// The range of stored sectors: of a disarmed vehicle recorded by arming only the latest part. Every group of that
/// time has this record, also the group in which it ends. A reader knows that sectors missing from `from` up to this
/// record are missing on purpose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keep {
    /// From here on everything is stored; otherwise only the latest part, until a record with `all`.
    pub all: bool,
    /// Start of the part that is, or was, stored only briefly.
    pub from: u32,
    /// Minimum length of the stored part, in seconds.
    pub seconds: u32,
}

impl Keep {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(15).u32(self.from).u32(self.seconds).u8(u8::from(self.all));
    }

    pub(super) fn read(fields: &mut Fields<'_>) -> Self {
        Self { all: fields.u8() != 0, from: fields.u32(), seconds: fields.u32() }
    }
}
