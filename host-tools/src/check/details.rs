//! What a check of several things was of: which failsafe, which sensor. The monitor counts and compares; names are for
//! people.

use hums_core::Monitor;
use hums_core::health::{Level, checks};
use hums_core::observation::{Source, SystemStatus};
use hums_core::params::{Param, Params};
use hums_core::time::Instant;
use hums_core::vehicle::BATTERIES_MAX;

use super::problem::Problems;
use crate::source::told::Finding;
use crate::states;

/// The check of the autopilot's own state.
pub(super) const FAILSAFE: &str = "autopilot_state";
/// The check of the autopilot's sensors.
const SENSORS: &str = "sensors";

/// What is so now.
#[derive(Debug, Default)]
pub(super) struct Details {
    failsafes: String,
    sensors: u32,
    /// Batteries in the order in which they came: component and id.
    batteries: Vec<(u8, u8)>,
}

/// Batteries that are told apart: `ArduPilot` has 16.
const TOLD_APART_MAX: usize = 32;

impl Details {
    /// These failsafes are in force from here on.
    pub(super) fn failsafes(&mut self, words: &str, problems: &mut Problems) {
        words.clone_into(&mut self.failsafes);
        self.tell(FAILSAFE, problems);
    }

    /// The vehicle says which of its sensors are not healthy.
    pub(super) fn sensors(
        &mut self,
        source: Source,
        status: &SystemStatus,
        monitor: &Monitor,
        problems: &mut Problems,
    ) {
        if monitor.vehicle().source == Some(source)
            && let Some(unhealthy) = status.unhealthy.filter(|unhealthy| *unhealthy != self.sensors)
        {
            self.sensors = unhealthy;
            self.tell(SENSORS, problems);
        }
    }

    /// A battery tells of itself.
    pub(super) fn battery(&mut self, source: Source, id: u8) {
        let battery = (source.component, id);
        if self.batteries.len() < TOLD_APART_MAX && !self.batteries.contains(&battery) {
            self.batteries.push(battery);
        }
    }

    /// What there is more of than the monitor has room for.
    pub(super) fn remarks(&self) -> Vec<String> {
        let beyond = self.batteries.get(BATTERIES_MAX..).unwrap_or_default();
        let words = |(component, id): &(u8, u8)| {
            let number = u16::from(*id) + 1;
            let of = if *component == 1 { String::new() } else { format!(" of component {component}") };
            format!("battery {number}{of} is not judged: the monitor follows {BATTERIES_MAX} batteries")
        };
        beyond.iter().map(words).collect()
    }

    /// A check's level has changed, or what it is of.
    pub(super) fn tell(&self, check: &str, problems: &mut Problems) {
        if !problems.is_open(check) {
            return;
        }
        match check {
            FAILSAFE => {
                let names = self.failsafes.split(", ").filter(|name| !name.is_empty());
                names.for_each(|name| problems.detail(check, name));
            }
            SENSORS => states::sensors(self.sensors).for_each(|name| problems.detail(check, name)),
            _ => {}
        }
    }
}

/// The findings of an emergency that is over at once: the state (`MAV_STATE`), and its end.
pub(super) fn emergency(at: Instant, params: &Params) -> Vec<Finding> {
    const EMERGENCY: f32 = 6.0;
    let limit = params.get(Param::StateCrit);
    let Some(check) = checks().find(|check| check.name == FAILSAFE).filter(|_| EMERGENCY > limit) else {
        return Vec::new();
    };
    let change = |previous, level| Finding {
        at,
        subsystem: check.subsystem,
        check: FAILSAFE.to_owned(),
        instance: 0,
        level,
        previous,
        value: EMERGENCY,
        limit,
        unit: check.unit.to_owned(),
    };
    vec![change(Level::Ok, Level::Critical), change(Level::Critical, Level::Ok)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn batteries_beyond_those_that_are_judged_are_named() {
        let mut details = Details::default();
        for id in [0, 1, 2, 3, 1, 8, 8] {
            details.battery(Source { system: 1, component: 1 }, id);
        }
        assert_eq!(details.remarks(), ["battery 9 is not judged: the monitor follows 4 batteries"]);
    }
}
