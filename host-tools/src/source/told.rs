//! What a log of ours tells besides frames, as far as a command that reads recordings takes it.

use hums_blackbox::Record;
use hums_blackbox::record::Why;
use hums_core::component::{COMPONENTS_MAX, Component, Label};

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
}

impl Told {
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
            _ => None,
        }
    }
}
