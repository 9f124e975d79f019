//! What a log of ours tells besides frames, as far as a command that reads recordings takes it.

use hums_blackbox::Record;
use hums_blackbox::record::{FindingRecord, Lost, Why};
use hums_core::clock::Instant;
use hums_core::component::{COMPONENTS_MAX, Component, Label};
use hums_core::health::{self, Level, Subsystem};
use hums_onboard::monitoring::CELLS_UNKNOWN;
use hums_onboard::persist::STORE_NEW;

use super::item::Gap;
use crate::loss;

/// One of the monitor's own records.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// A setting of the monitor.
    Parameter {
        /// Its name.
        name: String,
        /// Its value.
        value: f32,
        /// It is part of the table as it stood at the session's start.
        start: bool,
    },
    /// A part that wears, with all that it has run.
    Part {
        /// Its place, from 0.
        place: usize,
        /// What it is.
        component: Component,
    },
    /// A check changed its level.
    Finding(Box<Finding>),
    /// The worst value of a check of this session so far.
    Peak {
        /// The check's stable name.
        check: String,
        /// Which one of several, from 0.
        instance: u8,
        /// In the check's unit.
        value: f32,
    },
    /// The log has nothing from here to there.
    Missing {
        /// The first of what is missing.
        from: Instant,
        /// The last.
        to: Instant,
        /// Frames that are missing, where it is known how many.
        frames: u64,
    },
    /// Nothing told the box how many cells a battery has.
    CellsUnknown,
    /// The box knows nothing of earlier flights.
    StoreNew,
    /// What only a monitor writes that checks the vehicle's health: its findings are all that there were.
    Checked,
}

/// A check's change of level, whoever found it.
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
    /// What decided; NaN where the input stopped.
    pub value: f32,
    /// What it crossed; NaN where there is none.
    pub limit: f32,
    /// The unit of both.
    pub unit: String,
}

impl Finding {
    /// From a finding of the monitor's, found at about `now`.
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
            limit: finding.limit,
            unit: finding.unit.to_owned(),
        }
    }
}

impl Told {
    /// What sectors that cannot be read had; `None` where nobody knows from when to when they are.
    pub fn missing(gap: &Gap) -> Option<Self> {
        let (own, (from, to)) = (gap.own?, gap.from.zip(gap.to)?);
        Some(Self::Missing { from, to, frames: u64::from(own.frames.unwrap_or(0)) })
    }

    /// What a record tells, where it is of use here.
    pub fn of(record: &Record<'_>) -> Option<Self> {
        match record {
            Record::Parameter(parameter) => {
                let (value, start) = (parameter.value as f32, !parameter.changed);
                Some(Self::Parameter { name: parameter.name.to_owned(), value, start })
            }
            // Of a part that was replaced the figures are those of the old one.
            Record::Component(recorded) => {
                let place = usize::from(recorded.place);
                let mut component = Component::NONE;
                (component.kind, component.number) = (recorded.kind, recorded.number);
                component.replaced = recorded.replaced.try_into().unwrap_or(u16::MAX);
                component.name = Label::new(recorded.name);
                if recorded.why == Why::Replaced {
                    component.serial = Label::new(recorded.new_serial);
                } else {
                    component.serial = Label::new(recorded.serial);
                    component = component.having_run(recorded.figures);
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
                let frames = if loss.what == Lost::QueueFull { loss.count } else { 0 };
                loss::words(loss).map(|_| Self::Missing { from: loss.from, to: loss.to, frames })
            }
            Record::Note(note) if note.text == CELLS_UNKNOWN => Some(Self::CellsUnknown),
            Record::Note(note) if note.text == STORE_NEW => Some(Self::StoreNew),
            Record::Boot(_) | Record::Usage(_) => Some(Self::Checked),
            _ => None,
        }
    }
}
