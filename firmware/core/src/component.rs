//! Components: parts that wear and are replaced, each with its own hours, flights and cycles and its own limits.
//!
//! Kind and limits of a component are parameters (`CMP1_KIND` and so on). Its name, serial number and figures are an
//! item that outlives power. It is green, from [`Param::CompYellow`] percent of whichever limit trips first yellow,
//! and from [`Param::CompRed`] percent red. Replacing one is recorded with the old part's figures.

use crate::bytes::{Fields, Item, Unreadable, fields};
use crate::health::finding::Subsystem;
use crate::observation::MOTORS_MAX;
use crate::parameters::{Param, Params};
use crate::usage::{Totals, UsageCounter};

/// Components at most.
pub const COMPONENTS_MAX: usize = 8;
/// The longest name, and the longest serial number, in bytes.
pub const LABEL_BYTES: usize = 16;

/// A short text: a name or a serial number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Label([u8; LABEL_BYTES]);

impl Label {
    /// The first [`LABEL_BYTES`] printable ASCII characters of a text; others are left out.
    pub fn new(text: &str) -> Self {
        Self::of(text.bytes())
    }

    fn of(bytes: impl Iterator<Item = u8>) -> Self {
        let mut label = Self::default();
        let printable = bytes.filter(|byte| (b' '..=b'~').contains(byte));
        for (place, byte) in label.0.iter_mut().zip(printable) {
            *place = byte;
        }
        label
    }

    /// As text.
    pub fn as_str(&self) -> &str {
        let length = self.0.iter().position(|byte| *byte == 0).unwrap_or(LABEL_BYTES);
        core::str::from_utf8(&self.0[..length]).unwrap_or_default()
    }
}

numbered! {
    /// The kind of a component. The numbers are those of `CMPn_KIND`, and are stored.
    #[derive(Default)]
    pub enum ComponentKind {
        /// No component.
        #[default]
        None "none",
        /// The whole airframe.
        Airframe "airframe",
        /// A battery, by its place.
        Battery "battery",
        /// A motor by its number, or all of them.
        Motor "motor",
        /// A propeller by its motor's number, or all of them.
        Propeller "propeller",
        /// An ESC by its motor's number, or all of them.
        Esc "esc",
        /// The card that we record on.
        Card "card",
        /// A combustion engine.
        Engine "engine",
        /// Anything else that wears with the hours powered.
        Other "other",
    }
}

impl ComponentKind {
    /// The part of the vehicle whose health it is.
    pub const fn subsystem(self) -> Option<Subsystem> {
        match self {
            Self::None => None,
            Self::Battery => Some(Subsystem::Power),
            Self::Motor | Self::Propeller | Self::Esc => Some(Subsystem::Propulsion),
            Self::Engine => Some(Subsystem::Engine),
            Self::Airframe | Self::Other => Some(Subsystem::Structure),
            Self::Card => Some(Subsystem::Recorder),
        }
    }
}

/// Wear figures of a component.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ComponentFigures {
    /// Seconds powered.
    pub powered_s: f64,
    /// Seconds in the air.
    pub flight_s: f64,
    /// Seconds that its motor turned; of several motors, the longest.
    pub motor_s: f64,
    /// Take-offs.
    pub flights: f64,
    /// Full discharges of its battery; of several batteries, of all together.
    pub cycles: f64,
}

impl ComponentFigures {
    fn zip(self, other: Self, with: fn(f64, f64) -> f64) -> Self {
        Self {
            powered_s: with(self.powered_s, other.powered_s),
            flight_s: with(self.flight_s, other.flight_s),
            motor_s: with(self.motor_s, other.motor_s),
            flights: with(self.flights, other.flights),
            cycles: with(self.cycles, other.cycles),
        }
    }

    /// The figures of a part of this kind and number in one session.
    pub fn after(totals: &Totals, kind: ComponentKind, number: u8) -> Self {
        if kind == ComponentKind::None {
            return Self::default();
        }
        let total = |counter| totals.value(counter).unwrap_or(0.0);
        let motors = &totals.motors;
        let place = usize::from(number).checked_sub(1);
        let motor_s = match (kind, place) {
            (ComponentKind::Motor | ComponentKind::Propeller | ComponentKind::Esc, Some(place)) => {
                motors.get(place).map_or(0.0, |motor| motor.seconds)
            }
            _ => motors.iter().fold(0.0, |longest: f64, motor| longest.max(motor.seconds)),
        };
        let cycles = match (kind, place) {
            (ComponentKind::Battery, Some(place)) => totals.battery_cycles.get(place).copied().unwrap_or(0.0),
            _ => total(UsageCounter::BatteryCycles),
        };
        Self {
            powered_s: total(UsageCounter::Powered),
            flight_s: total(UsageCounter::Flight),
            motor_s,
            flights: total(UsageCounter::Flights),
            cycles,
        }
    }
}

#[derive(Clone, Copy)]
enum Setting {
    Kind,
    Number,
    Hours,
    Flights,
    Cycles,
    MotorHours,
}

const _: () = {
    let settings = Param::Cmp8MotorHours as usize + 1 - Param::Cmp1Kind as usize;
    assert!(settings == COMPONENTS_MAX * Setting::COUNT);
};

impl Setting {
    const COUNT: usize = 6;

    /// The component's value; 0 for a place beyond the last.
    fn of(self, place: usize, params: &Params) -> f32 {
        let index = Param::Cmp1Kind as usize + place * Self::COUNT + self as usize;
        let param = Param::ALL.get(index).filter(|_| place < COMPONENTS_MAX);
        param.map_or(0.0, |param| params.get(*param))
    }
}

numbered! {
    /// Whether a component may go on. The numbers are stored.
    pub enum Status {
        /// Well within its limits, or without any.
        Green "green",
        /// Soon due.
        Yellow "yellow",
        /// Due.
        Red "red",
    }
}

/// One component.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Component {
    /// The operator's name for it.
    pub name: Label,
    /// Its serial number.
    pub serial: Label,
    /// Its kind.
    pub kind: ComponentKind,
    /// Which of its kind, from 1; 0 is all of them, or the only one.
    pub number: u8,
    /// How often the part in this place was replaced.
    pub replaced: u16,
    /// Its figures of earlier sessions.
    pub ran: ComponentFigures,
    /// The power-on before which `ran` counts; stored items only.
    pub(crate) as_of: u32,
}

impl Component {
    /// Its figures over its life.
    pub fn figures(&self, totals: &Totals) -> ComponentFigures {
        self.ran
            .zip(ComponentFigures::after(totals, self.kind, self.number), |base, ran| (base + ran).max(0.0))
    }

    /// The part of its life that is used, percent, by the limit that trips first; `None` if it has no limit.
    pub fn used_percent(&self, place: usize, totals: &Totals, params: &Params) -> Option<f32> {
        if self.kind == ComponentKind::None {
            return None;
        }
        let figures = self.figures(totals);
        let is_powered = matches!(self.kind, ComponentKind::Card | ComponentKind::Other);
        let hours = if is_powered { figures.powered_s } else { figures.flight_s };
        let used = [
            (hours / 3_600.0, Setting::Hours),
            (figures.flights, Setting::Flights),
            (figures.cycles, Setting::Cycles),
            (figures.motor_s / 3_600.0, Setting::MotorHours),
        ];
        used.into_iter()
            .map(|(used, limit)| (used, limit.of(place, params)))
            .filter(|(_, limit)| *limit > 0.0)
            .map(|(used, limit)| (used / f64::from(limit) * 100.0) as f32)
            .reduce(f32::max)
    }

    /// Green, yellow or red.
    pub fn status(&self, place: usize, totals: &Totals, params: &Params) -> Status {
        let used_percent = self.used_percent(place, totals, params).unwrap_or(0.0);
        if used_percent >= params.get(Param::CompRed) {
            Status::Red
        } else if used_percent >= params.get(Param::CompYellow) {
            Status::Yellow
        } else {
            Status::Green
        }
    }

    /// `true` if kind or number changed; the figures stay.
    pub(crate) fn describe(&mut self, place: usize, totals: &Totals, params: &Params) -> bool {
        let kind = ComponentKind::from_number(Setting::Kind.of(place, params) as u8).unwrap_or_default();
        let number = (Setting::Number.of(place, params) as u8).min(MOTORS_MAX as u8);
        let is_new = (kind, number) != (self.kind, self.number);
        if is_new {
            let figures = self.figures(totals);
            (self.kind, self.number) = (kind, number);
            self.set_figures(figures, totals);
        }
        is_new
    }

    /// Sets its figures. They include the part that this session has counted.
    pub(crate) fn set_figures(&mut self, figures: ComponentFigures, totals: &Totals) {
        let counted = ComponentFigures::after(totals, self.kind, self.number);
        self.ran = figures.zip(counted, |figure, counted| figure - counted);
    }

    pub(crate) fn replace(&mut self, serial: Label, totals: &Totals) -> Self {
        let old = Self { ran: self.figures(totals), ..*self };
        self.serial = serial;
        self.replaced = self.replaced.saturating_add(1);
        self.set_figures(ComponentFigures::default(), totals);
        old
    }

    pub(crate) const fn begin(&mut self, boots: u32) -> bool {
        let begins = self.as_of != boots;
        self.as_of = boots;
        begins
    }

    /// Adds the session of power-on `boots`, unless its figures include that session.
    pub(crate) fn add(&mut self, boots: u32, totals: &Totals) {
        if boots == self.as_of {
            self.ran = self.figures(totals);
        }
    }
}

/// Version, kind, number, replaced, name, serial; powered, flight and motor time in tenths of a second, flights,
/// cycles. Figures are negative if the session had counted before the component came into it. Since version 2 the
/// power-on follows.
impl Item for Component {
    const VERSION: u8 = 2;
    const BYTES: usize = 65;

    fn fields(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        let ComponentFigures { powered_s, flight_s, motor_s, flights, cycles } = &mut self.ran;
        let mut kind = self.kind as u8;
        let mut ran = [*powered_s, *flight_s, *motor_s].map(|seconds| libm::round(seconds * 10.0) as i32);
        let mut flown = *flights as i32;
        fields!(fields: kind, self.number, self.replaced, self.name.0, self.serial.0, ran, flown, cycles, self.as_of);
        self.kind = ComponentKind::from_number(kind).unwrap_or_default();
        [self.name, self.serial] = [self.name, self.serial].map(|label| Label::of(label.0.into_iter()));
        [*powered_s, *flight_s, *motor_s] = ran.map(|tenths| f64::from(tenths) / 10.0);
        *flights = f64::from(flown);
        *cycles = Some(*cycles).filter(|cycles| cycles.is_finite()).unwrap_or(0.0);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
