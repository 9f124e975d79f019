//! A finding: one check changed its level. The numbers and names here are stored in logs and never change meaning.

use crate::observation::Feeds;
use crate::time::BootMs;

numbered! {
    /// How bad it is. The numbers are stored in logs.
    pub enum Level {
        /// Within limits, seen recently.
        Ok "ok",
        /// Worth knowing, nothing to do in flight.
        Advisory "advisory",
        /// Outside the normal range: act soon.
        Warning "warning",
        /// Act now.
        Critical "critical",
        /// The input has stopped, or never came: unknown, which is not healthy.
        Stale "stale",
    }
}

numbered! {
    /// The part of the vehicle that a check watches. The numbers are stored in logs.
    pub enum Subsystem {
        /// Batteries and rails.
        Power "power",
        /// Motors, ESCs and propellers.
        Propulsion "propulsion",
        /// Combustion engine (EFI).
        Engine "engine",
        /// Vibration, clipping and load factor.
        Structure "structure",
        /// Estimator and GNSS.
        Navigation "navigation",
        /// Autopilot, RC and telemetry links.
        Link "link",
        /// The autopilot's processor.
        Computer "computer",
        /// Roll and pitch.
        Attitude "attitude",
        /// This monitor: its card, its queues, its own losses.
        Recorder "recorder",
        /// Falls, impacts, tumbling: what ends a flight otherwise than by landing.
        Mishap "mishap",
    }
}

impl Level {
    /// 1 of a warning, 2 of a critical level; 0 of one that is no alarm.
    pub(super) const fn alarm(self) -> u8 {
        match self {
            Self::Warning => 1,
            Self::Critical => 2,
            Self::Ok | Self::Advisory | Self::Stale => 0,
        }
    }
}

/// One check changed its level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// When the level changed (after the debounce).
    pub at: BootMs,
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
    /// The value that decided, in the check's unit. NaN if the input stopped, if the check no longer applies, or if the autopilot
    /// no longer reports the flag.
    pub value: f32,
    /// The limit that it crossed, in the same unit; NaN where there is none (stale).
    pub limit: f32,
    /// The unit of both, for instance `V`, `%`, `degC`; empty for a plain number.
    pub unit: &'static str,
    /// The consumer of a battery.
    pub feeds: Feeds,
    /// The check whose alarm explains this one; empty where none does. Such a finding is recorded and not told to the ground.
    pub because: &'static str,
    /// The order in its text if it is critical, which depends on the vehicle.
    pub orders: Orders,
}

/// The order in the text of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Orders {
    /// The words of its check.
    Own,
    /// DISARM IF DOWN.
    Disarm,
    /// WATCH IT.
    Watch,
    /// Nothing: the vehicle is disarmed already.
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

    /// Whether its check no longer applies (after landing), or its flag is no longer reported. The value is not known
    /// to be good then.
    pub fn is_unjudged(&self) -> bool {
        self.level == Level::Ok && self.value.is_nan()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_and_name_of_a_level_and_a_subsystem_is_what_logs_know() {
        let levels = |number| Level::from_number(number).map(|level| (level as u8, level.name()));
        let subsystems = |number| Subsystem::from_number(number).map(|part| (part as u8, part.name()));
        let parts = "power propulsion engine structure navigation link computer attitude recorder mishap";
        for number in 0..=u8::MAX {
            let known = |names: &'static str| Some((number, names.split(' ').nth(number.into())?));
            assert_eq!(levels(number), known("ok advisory warning critical stale"));
            assert_eq!(subsystems(number), known(parts));
        }
    }
}
