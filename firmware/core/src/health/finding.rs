//! A finding: one check changed its level. The numbers and names here are stored in logs and never change meaning.

use crate::observation::Feeds;
use crate::time::Instant;

/// How bad it is. The numbers are stored in logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Level {
    /// Within limits, seen recently.
    Ok = 0,
    /// Worth knowing, nothing to do in flight.
    Advisory = 1,
    /// Outside the normal range: act soon.
    Warning = 2,
    /// Act now.
    Critical = 3,
    /// The input has stopped (or never came): nobody knows, which is not the same as healthy.
    Stale = 4,
}

impl Level {
    /// All levels, by number.
    pub const ALL: [Self; 5] = [Self::Ok, Self::Advisory, Self::Warning, Self::Critical, Self::Stale];

    /// The name that logs, JSON and reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Advisory => "advisory",
            Self::Warning => "warning",
            Self::Critical => "critical",
            Self::Stale => "stale",
        }
    }

    /// The level of a stored number.
    pub const fn from_number(number: u8) -> Option<Self> {
        if (number as usize) < Self::ALL.len() { Some(Self::ALL[number as usize]) } else { None }
    }
}

/// The part of the vehicle that a check watches. The numbers are stored in logs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Subsystem {
    /// Batteries and rails.
    Power = 0,
    /// Motors, ESCs and propellers.
    Propulsion = 1,
    /// Combustion engine (EFI).
    Engine = 2,
    /// Vibration, clipping and load factor.
    Structure = 3,
    /// Estimator and GNSS.
    Navigation = 4,
    /// Autopilot, RC and telemetry links.
    Link = 5,
    /// The autopilot's processor.
    Computer = 6,
    /// Roll and pitch.
    Attitude = 7,
    /// This monitor: its card, its queues, its own losses.
    Recorder = 8,
    /// Falls, impacts, tumbling: what ends a flight otherwise than by landing.
    Mishap = 9,
}

impl Subsystem {
    /// All subsystems, by number.
    pub const ALL: [Self; 10] = [
        Self::Power,
        Self::Propulsion,
        Self::Engine,
        Self::Structure,
        Self::Navigation,
        Self::Link,
        Self::Computer,
        Self::Attitude,
        Self::Recorder,
        Self::Mishap,
    ];

    /// The name that logs, JSON and reports use.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Power => "power",
            Self::Propulsion => "propulsion",
            Self::Engine => "engine",
            Self::Structure => "structure",
            Self::Navigation => "navigation",
            Self::Link => "link",
            Self::Computer => "computer",
            Self::Attitude => "attitude",
            Self::Recorder => "recorder",
            Self::Mishap => "mishap",
        }
    }

    /// The subsystem of a stored number.
    pub const fn from_number(number: u8) -> Option<Self> {
        if (number as usize) < Self::ALL.len() { Some(Self::ALL[number as usize]) } else { None }
    }
}

/// One check changed its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// When the level changed (after the debounce).
    pub at: Instant,
    /// The part of the vehicle.
    pub subsystem: Subsystem,
    /// The check's stable name, at most 16 characters of `a-z0-9_`, for instance `batt_remaining`.
    pub check: &'static str,
    /// Which one, where there are several: battery id, motor number from 0, axis; 0 where there is only one.
    pub instance: u8,
    /// The new level.
    pub level: Level,
    /// The level before.
    pub previous: Level,
    /// The value that decided, in the check's unit; NaN where the input stopped, where the check no longer applies, and where the
    /// autopilot no longer says what it said.
    pub value: f32,
    /// The limit that it crossed, in the same unit; NaN where there is none (stale).
    pub limit: f32,
    /// The unit of both, for instance `V`, `%`, `degC`; empty for a plain number.
    pub unit: &'static str,
    /// Of a battery: what it feeds.
    pub feeds: Feeds,
    /// The check whose alarm explains this one; empty where none does. Such a finding is recorded and not told to the ground.
    pub because: &'static str,
    /// What its text orders where it is critical, as it fits the vehicle.
    pub orders: Orders,
}

/// What the text of a finding orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orders {
    /// What its check's words say.
    Own,
    /// DISARM IF DOWN.
    Disarm,
    /// WATCH IT.
    Watch,
    /// Nothing: what is disarmed is not to be disarmed.
    Nothing,
}

impl Finding {
    /// The check whose order its text gives; empty for none.
    #[inline(never)]
    pub const fn ordering(&self) -> &'static str {
        match self.orders {
            Orders::Own => self.check,
            Orders::Disarm => "overturned",
            Orders::Watch => "failsafe_alert",
            Orders::Nothing => "",
        }
    }

    /// Whether its check no longer applies, as after landing, or nobody says it any more: what was bad is not known to be good.
    pub fn is_unjudged(&self) -> bool {
        self.level == Level::Ok && self.value.is_nan()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_and_name_of_a_level_is_what_logs_know() {
        let known = ["ok", "advisory", "warning", "critical", "stale"];
        for number in 0..=u8::MAX {
            let level = Level::from_number(number);
            assert_eq!(level.map(Level::name), known.get(usize::from(number)).copied());
            assert!(level.is_none_or(|level| level as u8 == number), "{number}");
        }
        assert_eq!(Level::ALL.map(Level::name), known);
    }

    #[test]
    fn every_number_and_name_of_a_subsystem_is_what_logs_know() {
        let known = [
            "power",
            "propulsion",
            "engine",
            "structure",
            "navigation",
            "link",
            "computer",
            "attitude",
            "recorder",
            "mishap",
        ];
        for number in 0..=u8::MAX {
            let subsystem = Subsystem::from_number(number);
            assert_eq!(subsystem.map(Subsystem::name), known.get(usize::from(number)).copied());
            assert!(subsystem.is_none_or(|subsystem| subsystem as u8 == number), "{number}");
        }
    }
}
