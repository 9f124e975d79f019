//! Values around a critical finding, and the request to the autopilot because of one.

use hums_core::clock::{Instant, Span};
use hums_core::half;
use hums_core::health::Subsystem;
use hums_core::protect::{Action, Stage};
use hums_core::snapshot::{COLUMNS_MAX, INTERVAL, SAMPLES, columns};

use super::stored::{Field, Fields, Sink, record};
use crate::limits::RECORD_BYTES_MAX;

const VALUES_MAX: usize = 2 * COLUMNS_MAX * SAMPLES;
// A check's name has 16 characters at most.
const _: () = assert!(2 + 8 + 1 + 16 + 3 + 8 + 2 + 1 + VALUES_MAX <= RECORD_BYTES_MAX);

/// Half of a snapshot: the seconds before a critical finding, or those after it.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot<'a> {
    /// When the finding was made.
    pub at: Instant,
    /// The finding's check.
    pub check: &'a str,
    /// The finding's instance.
    pub instance: u8,
    /// Its subsystem.
    pub subsystem: Subsystem,
    /// `false`: before the finding; `true`: after it.
    pub after: bool,
    /// The time of the first sample.
    pub first: Instant,
    /// Between two samples.
    pub interval: Span,
    /// Columns of a sample.
    pub width: u8,
    /// Half-precision numbers, sample by sample, column by column, little endian. Each is stored less the previous
    /// sample's in its column (modulo 2^16), the first sample unchanged.
    values: &'a [u8],
}

impl<'a> Snapshot<'a> {
    /// `values`: room; taken at about `now`.
    pub fn new(now: Instant, of: &hums_core::snapshot::Snapshot<'_>, values: &'a mut SnapshotValues) -> Self {
        let SnapshotValues { bytes, .. } = values;
        let (mut length, mut last) = (0, [0; COLUMNS_MAX]);
        let columns = (0..of.width().clamp(1, COLUMNS_MAX)).cycle();
        for ((place, half), column) in bytes.as_chunks_mut().0.iter_mut().zip(of.values()).zip(columns) {
            *place = half.wrapping_sub(last[column]).to_le_bytes();
            last[column] = half;
            length += 2;
        }
        Self {
            at: Instant::of(of.at, now),
            check: of.check,
            instance: of.instance,
            subsystem: of.subsystem,
            after: of.after,
            first: Instant::of(of.first, now),
            interval: INTERVAL.into(),
            width: of.width() as u8,
            values: bytes.get(..length).unwrap_or_default(),
        }
    }

    /// Values with time and column's name; `None` for an unknown column.
    pub fn iter(&self) -> impl Iterator<Item = (Instant, Option<&'static str>, f32)> + 'a {
        let Self { first, interval, width, subsystem, values, .. } = *self;
        let width = usize::from(width).clamp(1, COLUMNS_MAX);
        let mut last = [0_u16; COLUMNS_MAX];
        (0_u64..).zip(values.chunks_exact(2 * width)).flat_map(move |(sample, changes)| {
            let at = first + Span::from_micros(interval.as_micros().saturating_mul(sample));
            for (last, change) in last.iter_mut().zip(changes.as_chunks().0) {
                *last = last.wrapping_add(u16::from_le_bytes(*change));
            }
            let names = columns(subsystem).map(Some).chain(core::iter::repeat(None));
            names.zip(last).take(width).map(move |(name, half)| (at, name, half::from_bits(half)))
        })
    }
}

impl<'a> Field<'a> for Snapshot<'a> {
    fn times(&self, sink: &mut Sink<'_>) {
        sink.time(self.at).time(self.first);
    }

    fn numbers(&self, sink: &mut Sink<'_>) {
        for change in self.values.as_chunks().0 {
            sink.half(u16::from_le_bytes(*change));
        }
    }

    fn bytes(&self, sink: &mut Sink<'_>) {
        sink.name(self.check).u8(self.instance).u8(self.subsystem as u8).u8(u8::from(self.after));
        sink.bytes(&(self.interval.as_millis() as u16).to_le_bytes()).u8(self.width);
    }

    fn read(fields: &mut Fields<'a>) -> Option<Self> {
        Some(Self {
            at: fields.instant(),
            check: fields.text(),
            instance: fields.u8(),
            subsystem: Subsystem::from_number(fields.u8())?,
            after: fields.u8() != 0,
            first: fields.instant(),
            interval: Span::from_millis(u64::from(u16::from_le_bytes(fields.array()))),
            width: fields.u8(),
            values: fields.halves(),
        })
    }
}

impl PartialEq for Snapshot<'_> {
    fn eq(&self, other: &Self) -> bool {
        let head = |snapshot: &Self| {
            let Self { at, instance, subsystem, after, first, interval, width, .. } = *snapshot;
            (at, instance, subsystem, after, first, interval, width)
        };
        // Compared by bits: an unknown value is NaN.
        head(self) == head(other) && self.check == other.check && self.values == other.values
    }
}

/// Room for the values of a snapshot.
#[derive(Clone, Copy, Debug)]
pub struct SnapshotValues {
    bytes: [u8; VALUES_MAX],
}

impl Default for SnapshotValues {
    fn default() -> Self {
        Self { bytes: [0; VALUES_MAX] }
    }
}

record! {
    /// A step of the protective action.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    Protection {
        /// Requested action.
        action: Action,
        /// The stage.
        stage: Stage,
        /// Seconds, attempt or `MAV_RESULT`, by the stage.
        detail: u8,
        /// `MAV_CMD`
        command: u16,
    }
}

impl Protection {
    /// To be written.
    pub const fn new(step: &hums_core::protect::Step) -> Self {
        Self { action: step.action, stage: step.stage, detail: step.detail, command: step.action.command() }
    }
}
