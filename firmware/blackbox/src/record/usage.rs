//! Usage counters at one moment.

use super::RECORD_BYTES_MAX;
use crate::bytes::{Fields, Sink};

/// When a usage snapshot was taken. The numbers are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Moment {
    /// At the start of the session.
    Start = 0,
    /// While running.
    #[default]
    Periodic = 1,
    /// At the end of a flight or of the session.
    End = 2,
}

/// The value of a usage counter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UsageValue {
    /// A quantity, in the counter's unit.
    Real(f64),
    /// A count.
    Count(u64),
}

/// Entries of a usage record at most: its count, kind, version and entries fit `RECORD_BYTES_MAX`.
pub const USAGE_ENTRIES_MAX: usize = 50;

/// Usage counters at one moment: up to `USAGE_ENTRIES_MAX`, more are cut off.
#[derive(Clone, Copy, Debug)]
pub struct Usage<'a> {
    /// When it was taken.
    pub moment: Moment,
    entries: UsageEntries<'a>,
}

#[derive(Clone, Copy, Debug)]
enum UsageEntries<'a> {
    List(&'a [(u8, UsageValue)]),
    /// As stored: number u8, type u8 (0 real, 1 count), value u64.
    Stored(&'a [u8]),
}

const USAGE_ENTRY_BYTES: usize = 10;
const _: () = assert!(4 + USAGE_ENTRIES_MAX * USAGE_ENTRY_BYTES <= RECORD_BYTES_MAX);

impl<'a> Usage<'a> {
    /// A snapshot to be written: counter numbers with their values.
    pub const fn new(moment: Moment, entries: &'a [(u8, UsageValue)]) -> Self {
        Self { moment, entries: UsageEntries::List(entries) }
    }

    /// Counter numbers with their values.
    pub fn iter(&self) -> impl Iterator<Item = (u8, UsageValue)> + 'a {
        let (list, stored) = match self.entries {
            UsageEntries::List(list) => (list, &[][..]),
            UsageEntries::Stored(stored) => (&[][..], stored),
        };
        let stored = stored.chunks_exact(USAGE_ENTRY_BYTES).map(|entry| {
            let mut fields = Fields::new(entry);
            let (number, real, bits) = (fields.u8(), fields.u8() == 0, fields.u64());
            (number, if real { UsageValue::Real(f64::from_bits(bits)) } else { UsageValue::Count(bits) })
        });
        list.iter().copied().chain(stored).take(USAGE_ENTRIES_MAX)
    }
}

impl<'a> Usage<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(6).u8(self.moment as u8).u8(self.iter().count() as u8);
        for (number, value) in self.iter() {
            let (count, bits) = match value {
                UsageValue::Real(real) => (false, real.to_bits()),
                UsageValue::Count(count) => (true, count),
            };
            sink.u8(number).u8(u8::from(count)).u64(bits);
        }
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        let moment = match fields.u8() {
            0 => Moment::Start,
            2 => Moment::End,
            _ => Moment::Periodic,
        };
        let count = usize::from(fields.u8());
        Self { moment, entries: UsageEntries::Stored(fields.bytes(count * USAGE_ENTRY_BYTES)) }
    }
}

impl PartialEq for Usage<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.moment == other.moment && self.iter().eq(other.iter())
    }
}
