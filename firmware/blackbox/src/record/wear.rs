//! Records of exceeded limits and of components.

use hums_core::component::{ComponentFigures, ComponentKind, Status};
use hums_core::health::exceedance::{self, Crossings};

use super::Moment;
use super::stored::{Field, Fields, Sink, numbered, record};

record! {
    /// Limits of one check that were crossed: of the session and of the airframe's life.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    Exceedance<'a> {
        /// See [`Moment`].
        moment: Moment,
        /// Stable name.
        check: &'a str,
        /// The number of the part, if there are several.
        instance: u8,
        /// The unit of the peaks.
        unit: &'a str,
        /// In this session.
        session: Crossings,
        /// This session included.
        lifetime: Crossings,
    }
}

impl Exceedance<'_> {
    /// To be written.
    pub const fn new(moment: Moment, of: &exceedance::Exceedance) -> Self {
        Self {
            moment,
            check: of.check.name,
            instance: of.instance,
            unit: of.check.unit.name(),
            session: of.session,
            lifetime: of.lifetime,
        }
    }
}

numbered! {
    /// The reason of a component's record. The numbers are stored.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    RecordReason {
        /// As it stood at the start of the session.
        Start = 0 "start",
        /// The status, now or at the end.
        #[default]
        Status = 1 "status",
        /// It was replaced: the figures are those of the old part.
        Replaced = 2 "replaced",
        /// It got a name or a serial number.
        Named = 3 "named",
    } else Status
}

record! {
    /// A part that wears, with its figures.
    #[derive(Clone, Copy, Debug, PartialEq)]
    Component<'a> {
        /// Reason.
        why: RecordReason,
        /// Its place, from 0.
        place: u8,
        /// Its kind.
        kind: ComponentKind,
        /// Which of its kind, from 1; 0 is all.
        number: u8,
        /// Green, yellow or red.
        status: Status,
        /// How often the part in this place was replaced.
        replaced: u32,
        /// The operator's name.
        name: &'a str,
        /// Its serial number.
        serial: &'a str,
        /// Accumulated use.
        figures: ComponentFigures,
        /// Percent; NaN without a limit.
        used_percent: f32,
        /// MAVLink system and component id; 0, 0 for the monitor.
        by: (u8, u8),
        /// Serial number of the new part after a replacement.
        new_serial: &'a str,
    }
}
