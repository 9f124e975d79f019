//! Usage counters at one moment: of the session, and of the airframe's life.

use super::stored::{Field, Fields, HEAD_BYTES, Sink, numbered};
use crate::limits::RECORD_BYTES_MAX;

numbered! {
    /// The numbers are stored.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Moment {
        /// At the start of the session.
        Start = 0 "start",
        /// While running.
        #[default]
        Periodic = 1 "periodic",
        /// At the end of a flight or of the session.
        End = 2 "end",
    } else Periodic
}

/// Head, moment and entries fit `RECORD_BYTES_MAX` whatever the numbers are.
pub const USAGE_ENTRIES_MAX: usize = 84;
const _: () = assert!(HEAD_BYTES + 1 + USAGE_ENTRIES_MAX * ENTRY_BYTES <= RECORD_BYTES_MAX);

/// Entries of a lifetime record at most.
pub const LIFETIME_ENTRIES_MAX: usize = 80;
const _: () = assert!(HEAD_BYTES + 4 * 4 + 2 + LIFETIME_ENTRIES_MAX * ENTRY_BYTES <= RECORD_BYTES_MAX);

/// A value, and a run of numbers for it alone.
const ENTRY_BYTES: usize = 4 + 2;

/// Usage counters at one moment: up to `USAGE_ENTRIES_MAX`, more are cut off. Another record has the rest; a reader
/// takes the latest value of each counter.
#[derive(Clone, Copy, Debug)]
pub struct Usage<'a> {
    /// See [`Moment`].
    pub moment: Moment,
    entries: Entries<'a>,
}

/// The airframe's life at one moment, this session included: up to `LIFETIME_ENTRIES_MAX` counters, then another record.
#[derive(Clone, Copy, Debug)]
pub struct Lifetime<'a> {
    /// See [`Moment`].
    pub moment: Moment,
    /// MAVLink id of the airframe, 0 unknown.
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
    List(&'a [(u8, f32)]),
    /// As stored: the values as words, and runs of numbers (the first one u8, how many u8).
    Stored {
        values: &'a [u8],
        runs: &'a [u8],
    },
}

impl<'a> Entries<'a> {
    fn iter(self, entries_max: usize) -> impl Iterator<Item = (u8, f32)> + 'a {
        let (list, values, runs) = match self {
            Self::List(list) => (list, &[][..], &[][..]),
            Self::Stored { values, runs } => (&[][..], values, runs),
        };
        let values = values.as_chunks().0.iter().map(|value| f32::from_le_bytes(*value));
        let numbers = runs.as_chunks().0.iter().flat_map(|&[first, count]| {
            let first = u16::from(first);
            (first..first + u16::from(count)).map(|number| number as u8)
        });
        list.iter().copied().chain(numbers.zip(values)).take(entries_max)
    }

    fn store_values(self, entries_max: usize, sink: &mut Sink<'_>) {
        for (_, value) in self.iter(entries_max) {
            sink.f32(value);
        }
    }

    fn store_numbers(self, entries_max: usize, sink: &mut Sink<'_>) {
        let mut run: Option<(u8, u8)> = None;
        for (number, _) in self.iter(entries_max) {
            run = Some(match run {
                Some((first, count)) if first.checked_add(count) == Some(number) => (first, count + 1),
                ended => {
                    end_run(ended, sink);
                    (number, 1)
                }
            });
        }
        end_run(run, sink);
    }

    fn read(fields: &mut Fields<'a>) -> Self {
        Self::Stored { values: fields.words(), runs: fields.bytes() }
    }
}

fn end_run(run: Option<(u8, u8)>, sink: &mut Sink<'_>) {
    if let Some((first, count)) = run {
        sink.u8(first).u8(count);
    }
}

impl<'a> Usage<'a> {
    /// Numbers with values, to be written.
    pub const fn new(moment: Moment, entries: &'a [(u8, f32)]) -> Self {
        Self { moment, entries: Entries::List(entries) }
    }

    /// Numbers with values.
    pub fn iter(&self) -> impl Iterator<Item = (u8, f32)> + 'a {
        self.entries.iter(USAGE_ENTRIES_MAX)
    }
}

impl<'a> Field<'a> for Usage<'a> {
    fn numbers(&self, sink: &mut Sink<'_>) {
        self.entries.store_values(USAGE_ENTRIES_MAX, sink);
    }

    fn bytes(&self, sink: &mut Sink<'_>) {
        self.entries.store_numbers(USAGE_ENTRIES_MAX, sink.u8(self.moment as u8));
    }

    fn read(fields: &mut Fields<'a>) -> Option<Self> {
        Some(Self { moment: Field::read(fields)?, entries: Entries::read(fields) })
    }
}

impl<'a> Lifetime<'a> {
    /// Numbers with values, to be written.
    pub const fn new(moment: Moment, life: &hums_core::lifetime::Lifetime, entries: &'a [(u8, f32)]) -> Self {
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

    /// Numbers with values.
    pub fn iter(&self) -> impl Iterator<Item = (u8, f32)> + 'a {
        self.entries.iter(LIFETIME_ENTRIES_MAX)
    }
}

impl<'a> Field<'a> for Lifetime<'a> {
    fn numbers(&self, sink: &mut Sink<'_>) {
        sink.u64(self.uid).u32(self.boots).u32(self.sessions);
        self.entries.store_values(LIFETIME_ENTRIES_MAX, sink);
    }

    fn bytes(&self, sink: &mut Sink<'_>) {
        sink.u8(self.moment as u8).u8(self.system);
        self.entries.store_numbers(LIFETIME_ENTRIES_MAX, sink);
    }

    fn read(fields: &mut Fields<'a>) -> Option<Self> {
        Some(Self {
            moment: Field::read(fields)?,
            system: fields.u8(),
            uid: fields.u64(),
            boots: fields.u32(),
            sessions: fields.u32(),
            entries: Entries::read(fields),
        })
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
