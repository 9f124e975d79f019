//! Records of findings and of other marked moments.

use hums_core::clock::Instant;
use hums_core::health::{Finding, Level, Subsystem};

use super::stored::{Fields, Sink};

/// A check changed its level: `hums_core::health::Finding` with texts of any lifetime.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FindingRecord<'a> {
    /// When, after the debounce.
    pub at: Instant,
    /// The part of the vehicle.
    pub subsystem: Subsystem,
    /// Stable name.
    pub check: &'a str,
    /// The number of the part, if there are several.
    pub instance: u8,
    /// The new level.
    pub level: Level,
    /// The level before.
    pub previous: Level,
    /// Value, in `unit`.
    pub value: f32,
    /// Limit, in `unit`.
    pub limit: f32,
    /// The unit of both.
    pub unit: &'a str,
}

impl FindingRecord<'static> {
    /// A finding's record.
    pub fn new(now: Instant, finding: &Finding) -> Self {
        Self {
            at: Instant::of(finding.at, now),
            subsystem: finding.subsystem,
            check: finding.check,
            instance: finding.instance,
            level: finding.level,
            previous: finding.previous,
            value: finding.value,
            limit: finding.limit,
            unit: finding.unit,
        }
    }
}

impl<'a> FindingRecord<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(5).time(self.at).f32(self.value).f32(self.limit);
        sink.u8(self.subsystem as u8).name(self.check).u8(self.instance);
        sink.u8(self.level as u8).u8(self.previous as u8).name(self.unit);
    }

    /// `None` for an unknown subsystem or level.
    pub(super) fn read(fields: &mut Fields<'a>) -> Option<Self> {
        Some(Self {
            at: fields.instant(),
            subsystem: Subsystem::from_number(fields.u8())?,
            check: fields.text(),
            instance: fields.u8(),
            level: Level::from_number(fields.u8())?,
            previous: Level::from_number(fields.u8())?,
            value: fields.f32(),
            limit: fields.f32(),
            unit: fields.text(),
        })
    }
}

/// A mark in time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Event<'a> {
    /// The number of the event:
    ///
    /// - 0 other, 1 armed, 2 disarmed, 3 take-off, 4 landing;
    /// - 5 snapshot requested, 6 card in, 7 card out;
    /// - 8 a critical finding (its check), 9 phase of flight (its name);
    /// - 10 autopilot restarted, 11 another airframe.
    pub number: u8,
    /// Details, if any.
    pub text: &'a str,
}

impl<'a> Event<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(10).u8(self.number).text(self.text);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        Self { number: fields.u8(), text: fields.text() }
    }
}

/// Free text.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Note<'a> {
    /// `MAV_SEVERITY`: 0 emergency to 7 debug.
    pub severity: u8,
    /// The text.
    pub text: &'a str,
}

impl<'a> Note<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(11).u8(self.severity).text(self.text);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        Self { severity: fields.u8(), text: fields.text() }
    }
}
