//! Records of exceeded limits and of components.

use hums_core::component::{ComponentFigures, ComponentKind, Status};
use hums_core::health::exceedance::{self, Crossings};

use super::Moment;
use super::stored::{Fields, Sink};

/// Limits of one check that were crossed: of the session and of the airframe's life.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Exceedance<'a> {
    /// See [`Moment`].
    pub moment: Moment,
    /// Stable name.
    pub check: &'a str,
    /// The number of the part, if there are several.
    pub instance: u8,
    /// The unit of the peaks.
    pub unit: &'a str,
    /// In this session.
    pub session: Crossings,
    /// This session included.
    pub lifetime: Crossings,
}

impl<'a> Exceedance<'a> {
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

    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(13);
        for crossings in [self.session, self.lifetime] {
            sink.u32(u32::from(crossings.warnings)).u32(u32::from(crossings.criticals));
            sink.u32(crossings.warning_tenths).u32(crossings.critical_tenths);
            sink.f32(crossings.peak);
        }
        sink.u8(self.moment as u8).name(self.check).u8(self.instance).name(self.unit);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        let moment = Moment::from_number(fields.u8());
        let (check, instance, unit) = (fields.text(), fields.u8(), fields.text());
        let mut crossings = || Crossings {
            warnings: fields.u32().try_into().unwrap_or(u16::MAX),
            criticals: fields.u32().try_into().unwrap_or(u16::MAX),
            warning_tenths: fields.u32(),
            critical_tenths: fields.u32(),
            peak: fields.f32(),
        };
        Self { moment, check, instance, unit, session: crossings(), lifetime: crossings() }
    }
}

/// The reason of a component's record. The numbers are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum RecordReason {
    /// As it stood at the start of the session.
    Start = 0,
    /// The status, now or at the end.
    #[default]
    Status = 1,
    /// It was replaced: the figures are those of the old part.
    Replaced = 2,
    /// It got a name or a serial number.
    Named = 3,
}

impl RecordReason {
    /// The name that reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Status => "status",
            Self::Replaced => "replaced",
            Self::Named => "named",
        }
    }

    const fn from_number(number: u8) -> Self {
        match number {
            0 => Self::Start,
            2 => Self::Replaced,
            3 => Self::Named,
            _ => Self::Status,
        }
    }
}

/// A part that wears, with its figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Component<'a> {
    /// Reason.
    pub why: RecordReason,
    /// Its place, from 0.
    pub place: u8,
    /// Its kind.
    pub kind: ComponentKind,
    /// Which of its kind, from 1; 0 is all.
    pub number: u8,
    /// Green, yellow or red.
    pub status: Status,
    /// How often the part in this place was replaced.
    pub replaced: u32,
    /// The operator's name.
    pub name: &'a str,
    /// Its serial number.
    pub serial: &'a str,
    /// Accumulated use.
    pub figures: ComponentFigures,
    /// Percent; NaN without a limit.
    pub used_percent: f32,
    /// MAVLink system and component id; 0, 0 for the monitor.
    pub by: (u8, u8),
    /// Serial number of the new part after a replacement.
    pub new_serial: &'a str,
}

impl<'a> Component<'a> {
    pub(super) fn store(&self, sink: &mut Sink<'_>) {
        sink.head(14).u32(self.replaced);
        let ComponentFigures { powered_s, flight_s, motor_s, flights, cycles } = self.figures;
        for figure in [powered_s, flight_s, motor_s, flights, cycles] {
            sink.f64(figure);
        }
        sink.f32(self.used_percent);
        sink.u8(self.why as u8).u8(self.place).u8(self.kind as u8).u8(self.number).u8(self.status as u8);
        sink.name(self.name).name(self.serial).u8(self.by.0).u8(self.by.1).name(self.new_serial);
    }

    pub(super) fn read(fields: &mut Fields<'a>) -> Self {
        Self {
            why: RecordReason::from_number(fields.u8()),
            place: fields.u8(),
            kind: ComponentKind::from_number(fields.u8()).unwrap_or_default(),
            number: fields.u8(),
            status: Status::from_number(fields.u8()).unwrap_or(Status::Red),
            replaced: fields.u32(),
            name: fields.text(),
            serial: fields.text(),
            figures: ComponentFigures {
                powered_s: fields.f64(),
                flight_s: fields.f64(),
                motor_s: fields.f64(),
                flights: fields.f64(),
                cycles: fields.f64(),
            },
            used_percent: fields.f32(),
            by: (fields.u8(), fields.u8()),
            new_serial: fields.text(),
        }
    }
}
