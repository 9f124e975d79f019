//! What of a session is kept, where not all of it is.

use super::stored::{Fields, Sink};

/// Which sectors are kept. While a vehicle recorded by arming is disarmed, only the latest part is kept. Every group of that time
/// has this record, also the group in which it ends. A reader that misses sectors from `from` up to this record knows that they
/// are missing on purpose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keep {
    /// From here on everything is kept; otherwise only the last while, until a record says `all`.
    pub all: bool,
    /// The number of the sector from which on only the last while is kept, or was until now.
    pub from: u32,
    /// How much is kept at least, in seconds.
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
