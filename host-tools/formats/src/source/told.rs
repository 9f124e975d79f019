//! A HUMS log's records besides frames.

use hums_blackbox::Record;
use hums_blackbox::record::{FindingRecord, LossKind, RecordReason};
use hums_core::clock::Instant;
use hums_core::component::{COMPONENTS_MAX, Component, Label};
use hums_core::health::{self, Check, Level, Orders, Subsystem, check_named};
use hums_core::observation::Feeds;
use hums_onboard::monitoring::CELLS_UNKNOWN;
use hums_onboard::persist::STORE_NEW;

use super::item::Gap;
use crate::loss;
use crate::names::{check_name, vocabulary};

/// A record of the monitor's.
#[derive(Clone, Debug, PartialEq)]
pub enum MonitorRecord {
    /// A setting of the monitor.
    Parameter {
        /// Its name.
        name: String,
        /// Its value.
        value: f32,
        /// The table as of the session's start.
        start: bool,
    },
    /// A part with all that it has run.
    Part {
        /// Its place, from 0.
        place: usize,
        /// The part.
        component: Component,
    },
    /// A check changed its level.
    Finding(Box<Finding>),
    /// The worst so far in this session.
    Peak {
        /// The check's stable name.
        check: String,
        /// Which one of several, from 0.
        instance: u8,
        /// In the check's unit.
        value: f32,
    },
    /// A gap between these times.
    Missing {
        /// Start of the gap.
        from: Instant,
        /// The last.
        to: Instant,
        /// Number of missing frames, if known.
        frames: u64,
    },
    /// The box does not know the cell count of a battery.
    CellsUnknown,
    /// The box has no data of earlier flights.
    StoreNew,
    /// A record that only a monitor with checks writes: its findings are complete.
    Checked,
}

/// A check's change of level, by any finder.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// When, after the debounce.
    pub at: Instant,
    /// The part of the vehicle.
    pub subsystem: Subsystem,
    /// The check's stable name.
    pub check: String,
    /// Which one of several, from 0.
    pub instance: u8,
    /// The new level.
    pub level: Level,
    /// The level before.
    pub previous: Level,
    /// Decided; NaN if the input stopped.
    pub value: f32,
    /// The worst value of this check and part in the log, in the finding from which the problem counts.
    pub worst: Option<f32>,
    /// The limit it crossed; NaN without one.
    pub limit: f32,
    /// The unit of both.
    pub unit: String,
}

impl Finding {
    /// Unjudged: after landing the check no longer applies, and is not known to be good.
    pub fn is_unjudged(&self) -> bool {
        self.level == Level::Ok && self.value.is_nan()
    }

    /// The finding of a check that judges one part only.
    pub fn of(check: &Check, at: Instant, (previous, level): (Level, Level), value: f32, limit: f32) -> Self {
        Self {
            at,
            subsystem: check.subsystem,
            check: check.name.to_owned(),
            instance: 0,
            level,
            previous,
            value,
            worst: None,
            limit,
            unit: check.unit.name().to_owned(),
        }
    }

    /// As the box has it; `None` of a check that no box makes.
    pub fn of_box(&self) -> Option<health::Finding> {
        let check = check_named(&self.check)?;
        Some(health::Finding {
            at: self.at.into(),
            subsystem: check.subsystem,
            check: check.name,
            instance: self.instance,
            level: self.level,
            previous: self.previous,
            value: self.value,
            limit: self.limit,
            unit: check.unit.name(),
            feeds: Feeds::Unsaid,
            because: "",
            orders: Orders::Own,
        })
    }

    /// In the box's words: `battery 1 cell low`, `over: battery 1 cell low`, `no data: battery 1 cell voltage`.
    pub fn name(&self) -> String {
        let fault = || check_name(&self.check, &[self.instance]);
        let value = || {
            let words = vocabulary(&self.check);
            words.map_or_else(fault, |words| words.said.name_of(self.instance).to_string())
        };
        match (self.level, self.previous) {
            (Level::Stale, _) => format!("no data: {}", value()),
            (Level::Ok, _) if self.is_unjudged() => format!("no longer judged: {}", fault()),
            (Level::Ok, Level::Stale) => format!("data again: {}", value()),
            (Level::Ok, _) => format!("over: {}", fault()),
            _ => fault(),
        }
    }

    /// Whether its level is a warning or critical.
    pub const fn is_bad(&self) -> bool {
        matches!(self.level, Level::Warning | Level::Critical)
    }

    /// Found at about `now`.
    pub fn new(now: Instant, finding: &health::Finding) -> Self {
        Self::from(&FindingRecord::new(now, finding))
    }
}

impl From<&FindingRecord<'_>> for Finding {
    fn from(finding: &FindingRecord<'_>) -> Self {
        Self {
            at: finding.at,
            subsystem: finding.subsystem,
            check: finding.check.to_owned(),
            instance: finding.instance,
            level: finding.level,
            previous: finding.previous,
            value: finding.value,
            worst: None,
            limit: finding.limit,
            unit: finding.unit.to_owned(),
        }
    }
}

impl MonitorRecord {
    /// Unreadable sectors; `None` if its times are unknown.
    pub fn missing(gap: &Gap) -> Option<Self> {
        let (own, (from, to)) = (gap.own?, gap.from.zip(gap.to)?);
        Some(Self::Missing { from, to, frames: u64::from(own.frames.unwrap_or(0)) })
    }

    /// A record's report, if of use here.
    pub fn of(record: &Record<'_>) -> Option<Self> {
        match record {
            Record::Parameter(parameter) => {
                let (value, start) = (parameter.value as f32, !parameter.changed);
                Some(Self::Parameter { name: parameter.name.to_owned(), value, start })
            }
            // After a replacement, figures belong to the old part.
            Record::Component(recorded) => {
                let place = usize::from(recorded.place);
                let mut component = Component::default();
                (component.kind, component.number) = (recorded.kind, recorded.number);
                component.replaced = recorded.replaced.try_into().unwrap_or(u16::MAX);
                component.name = Label::new(recorded.name);
                if recorded.why == RecordReason::Replaced {
                    component.serial = Label::new(recorded.new_serial);
                } else {
                    component.serial = Label::new(recorded.serial);
                    component.ran = recorded.figures;
                }
                (place < COMPONENTS_MAX).then_some(Self::Part { place, component })
            }
            Record::Finding(finding) => Some(Self::Finding(Box::new(Finding::from(finding)))),
            Record::Exceedance(exceedance) => Some(Self::Peak {
                check: exceedance.check.to_owned(),
                instance: exceedance.instance,
                value: exceedance.session.peak,
            }),
            Record::Loss(loss) => {
                let frames = if loss.what == LossKind::QueueFull { loss.count } else { 0 };
                loss::words(loss).map(|_| Self::Missing { from: loss.from, to: loss.to, frames })
            }
            Record::Note(note) if note.text == CELLS_UNKNOWN => Some(Self::CellsUnknown),
            Record::Note(note) if note.text == STORE_NEW => Some(Self::StoreNew),
            Record::Boot(_) | Record::Usage(_) => Some(Self::Checked),
            _ => None,
        }
    }
}
