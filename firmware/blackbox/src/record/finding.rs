//! Records of findings and of other marked moments.

use hums_core::clock::Instant;
use hums_core::health::{Finding, Level, Subsystem};

use super::stored::{Field, Fields, Sink, record};

record! {
    /// A check changed its level: `hums_core::health::Finding` with texts of any lifetime.
    #[derive(Clone, Copy, Debug, PartialEq)]
    FindingRecord<'a> {
        /// When, after the debounce.
        at: Instant,
        /// The part of the vehicle.
        subsystem: Subsystem,
        /// Stable name.
        check: &'a str,
        /// The number of the part, if there are several.
        instance: u8,
        /// The new level.
        level: Level,
        /// The level before.
        previous: Level,
        /// Value, in `unit`.
        value: f32,
        /// Limit, in `unit`.
        limit: f32,
        /// The unit of both.
        unit: &'a str,
    }
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

record! {
    /// A mark in time.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Event<'a> {
        /// The number of the event:
        ///
        /// - 0 other, 1 armed, 2 disarmed, 3 take-off, 4 landing;
        /// - 5 snapshot requested, 6 card in, 7 card out;
        /// - 8 a critical finding (its check), 9 phase of flight (its name);
        /// - 10 autopilot restarted, 11 another airframe.
        number: u8,
    }
    text {
        /// Details, if any.
        text: &'a str,
    }
}

record! {
    /// Free text.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    Note<'a> {
        /// `MAV_SEVERITY`: 0 emergency to 7 debug.
        severity: u8,
    }
    text {
        /// The text.
        text: &'a str,
    }
}
