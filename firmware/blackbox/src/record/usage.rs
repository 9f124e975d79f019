//! Usage counters at one moment: of the session, and of the airframe's life.

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

const ENTRY_BYTES: usize = 10;
const _: () = assert!(4 + USAGE_ENTRIES_MAX * ENTRY_BYTES <= RECORD_BYTES_MAX);
/// Entries of a lifetime record at most.
pub const LIFETIME_ENTRIES_MAX: usize = 48;
const _: () = assert!(2 + 1 + 1 + 8 + 4 + 4 + 1 + LIFETIME_ENTRIES_MAX * ENTRY_BYTES <= RECORD_BYTES_MAX);

/// Usage counters at one moment: up to `USAGE_ENTRIES_MAX`, more are cut off. Where there are more, another record
/// follows; a reader keeps the latest value of each counter.
#[derive(Clone, Copy, Debug)]
pub struct Usage<'a> {
    /// When it was taken.
    pub moment: Moment,
    entries: Entries<'a>,
}

/// The airframe's life at one moment, this session included: up to `LIFETIME_ENTRIES_MAX` counters, then another record.
#[derive(Clone, Copy, Debug)]
pub struct Lifetime<'a> {
    /// When it was taken.
    pub moment: Moment,
    /// MAVLink system id of the airframe, 0 unknown.
    pub system: u8,
    /// The autopilot's unique id, 0 unknown.
    pub uid: u64,
    /// Power-ons of the monitor.
    pub boots: u32,
    /// Power-ons in which the airframe was heard.
    pub sessions: u32,
    entries: Entries<'a>,
}

#[derive(Clone, Copy, Debug)]
enum Entries<'a> {
    List(&'a [(u8, UsageValue)]),
    /// As stored: number u8, type u8 (0 real, 1 count), value u64.
    Stored(&'a [u8]),
}

impl<'a> Entries<'a> {
    fn iter(self, entries_max: usize) -> impl Iterator<Item = (u8, UsageValue)> + 'a {
        let (list, stored) = match self {
            Self::List(list) => (list, &[][..]),
            Self::Stored(stored) => (&[][..], stored),
        };
        let stored = stored.chunks_exact(ENTRY_BYTES).map(|entry| {
            let mut fields = Fields::new(entry);
            let (number, real, bits) = (fields.u8(), fields.u8() == 0, fields.u64());
            (number, if real { UsageValue::Real(f64::from_bits(bits)) } else { UsageValue::Count(bits) })
        });
        list.iter().copied().chain(stored).take(entries_max)
    }

    fn store(self, entries_max: usize, sink: &mut Sink<'_>) {
        sink.u8(self.iter(entries_max).count() as u8);
        for (number, value) in self.iter(entries_max) {
            let (count, bits) = match value {
                UsageValue::Real(real) => (false, real.to_bits()),
                UsageValue::Count(count) => (true, count),
            };
            sink.u8(number).u8(u8::from(count)).u64(bits);
        }
    }

    fn read(fields: &mut Fields<'a>) -> Self {
        let count = usize::from(fields.u8());
        Self::Stored(fields.bytes(count * ENTRY_BYTES))
    }
}

impl Moment {
    pub(super) const fn from_number(number: u8) -> Self {
        match number {
            0 => Self::Start,
            2 => Self::End,
            _ => Self::Periodic,
        }
    }

    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Periodic => "periodic",
            Self::End => "end",
        }
    }
}

impl<'a> Usage<'a> {
    /// A snapshot to be written: counter numbers with their values.
    pub const fn new(moment: Moment, entries: &'a [(u8, UsageValue)]) -> Self {
        Self { moment, entries: Entries::List(entries) }
    }

    /// Counter numbers with their values.
    pub fn iter(&self) -> impl Iterator<Item = (u8, UsageValue)> + 'a {
        self.entries.iter(USAGE_ENTRIES_MAX)
    }

    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(6).u8(self.moment as u8);
        self.entries.store(USAGE_ENTRIES_MAX, sink);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        Self { moment: Moment::from_number(fields.u8()), entries: Entries::read(fields) }
    }
}

impl<'a> Lifetime<'a> {
    /// To be written: counter numbers with their values.
    pub const fn new(
        moment: Moment,
        life: &hums_core::lifetime::Lifetime,
        entries: &'a [(u8, UsageValue)],
    ) -> Self {
        let hums_core::lifetime::Lifetime { airframe, boots, sessions, .. } = *life;
        Self {
            moment,
            system: airframe.system,
            uid: airframe.uid,
            boots,
            sessions,
            entries: Entries::List(entries),
        }
    }

    /// Counter numbers with their values.
    pub fn iter(&self) -> impl Iterator<Item = (u8, UsageValue)> + 'a {
        self.entries.iter(LIFETIME_ENTRIES_MAX)
    }

    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(12).u8(self.moment as u8).u8(self.system).u64(self.uid);
        sink.u32(self.boots).u32(self.sessions);
        self.entries.store(LIFETIME_ENTRIES_MAX, sink);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        Self {
            moment: Moment::from_number(fields.u8()),
            system: fields.u8(),
            uid: fields.u64(),
            boots: fields.u32(),
            sessions: fields.u32(),
            entries: Entries::read(fields),
        }
    }
}

impl PartialEq for Usage<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.moment == other.moment && self.iter().eq(other.iter())
    }
}

impl PartialEq for Lifetime<'_> {
    fn eq(&self, other: &Self) -> bool {
        let head = |life: &Self| (life.moment, life.system, life.uid, life.boots, life.sessions);
        head(self) == head(other) && self.iter().eq(other.iter())
    }
}
