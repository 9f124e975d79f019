//! Health: checks of everything the vehicle says, what they find, and roll-ups of that.
//!
//! Each subsystem's checks are a table in a file of its own; [`CHECKS`] is all of them. A roll-up is never better than
//! its worst part that is known, and where nothing is known it is not OK but stale.

mod attitude;
pub mod check;
mod computer;
mod engine;
pub mod finding;
mod link;
mod navigation;
mod power;
mod propulsion;
mod recorder;
mod structure;

pub use check::{CLEAR, Check, Reading, Side, State, When};
pub use finding::{Finding, Level, Subsystem};

use crate::baseline::{Baselines, Quantity};
use crate::component::COMPONENTS_MAX;
use crate::exceedance::Exceedances;
use crate::flight::Flight;
use crate::params::{Param, Params};
use crate::status::{LinkReading, RecorderStatus};
use crate::time::{Instant, Span};
use crate::trends::Trends;
use crate::vehicle::Vehicle;

/// What checks read. Nothing here changes while they do.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    /// Now.
    pub now: Instant,
    /// The vehicle as it is known.
    pub vehicle: &'a Vehicle,
    /// On the ground or in the air.
    pub flight: &'a Flight,
    /// What the raw messages do not say by themselves.
    pub derived: &'a crate::derived::Derived,
    /// The autopilot's port.
    pub link: &'a LinkReading,
    /// Our own recording.
    pub recorder: &'a RecorderStatus,
    /// Quantities of steady flight.
    pub trends: &'a Trends,
    /// What is normal for this airframe.
    pub baselines: &'a Baselines,
    /// Of each component, whose health it is and the part of its life that is used, percent.
    pub wear: &'a [Option<(Subsystem, f32)>; COMPONENTS_MAX],
    /// Limits and settings.
    pub params: &'a Params,
}

/// Most streams come at 1 Hz or more even over a radio; some batteries at 0.5 Hz.
pub(crate) const STALE: Option<Span> = Some(Span::from_secs(5));
/// For streams that come at 0.5 Hz.
pub(crate) const STALE_SLOW: Option<Span> = Some(Span::from_secs(12));

/// Of a subsystem's components, the one that is nearest to its limit.
const fn due(subsystem: Subsystem) -> Check {
    Check {
        name: "",
        words: "",
        subsystem,
        unit: "%",
        side: Side::Above,
        warn: Some(Param::CompYellow),
        critical: Some(Param::CompRed),
        hysteresis: 0.0,
        debounce_warn: Span::from_secs(1),
        debounce_critical: Span::from_secs(1),
        when: When::Always,
        stale_after: None,
        instances: 1,
        // That a part is not due does not make its subsystem healthy.
        alarm_only: true,
        read: match subsystem {
            Subsystem::Power => |inputs, _| used(inputs, Subsystem::Power),
            Subsystem::Propulsion => |inputs, _| used(inputs, Subsystem::Propulsion),
            Subsystem::Engine => |inputs, _| used(inputs, Subsystem::Engine),
            Subsystem::Structure => |inputs, _| used(inputs, Subsystem::Structure),
            Subsystem::Recorder => |inputs, _| used(inputs, Subsystem::Recorder),
            _ => |_, _| None,
        },
    }
}

fn used(inputs: &Inputs<'_>, subsystem: Subsystem) -> Option<Reading> {
    let mine = inputs.wear.iter().flatten().filter(|(of, _)| *of == subsystem);
    // What has reached its limit is due, while a check's value must be beyond it.
    Reading::new(Some(inputs.now), mine.map(|(_, percent)| percent.next_up()).reduce(f32::max))
}

/// How far a quantity is from what is normal for this airframe.
fn departure(inputs: &Inputs<'_>, quantity: Quantity) -> Option<Reading> {
    Reading::new(Some(inputs.now), inputs.trends.departure(quantity, inputs.baselines))
}

const TABLES: [&[Check]; 9] = [
    power::CHECKS,
    propulsion::CHECKS,
    engine::CHECKS,
    structure::CHECKS,
    navigation::CHECKS,
    link::CHECKS,
    computer::CHECKS,
    attitude::CHECKS,
    recorder::CHECKS,
];

/// Subsystems that every vehicle has, in the air and on the ground.
pub const EXPECTED: [Subsystem; 3] = [Subsystem::Power, Subsystem::Link, Subsystem::Computer];

const STATES: usize = {
    let mut states = 0;
    let mut table = 0;
    while table < TABLES.len() {
        let mut check = 0;
        while check < TABLES[table].len() {
            states += TABLES[table][check].instances as usize;
            check += 1;
        }
        table += 1;
    }
    states
};

/// All checks, by subsystem.
pub fn checks() -> impl Iterator<Item = &'static Check> {
    TABLES.into_iter().flatten()
}

/// What a check means, in a few words that a pilot understands; its name where there is no such check.
pub fn words(name: &'static str) -> &'static str {
    checks().find(|check| check.name == name).map_or(name, |check| check.words)
}

/// How many instances a check has; 0 where there is no such check.
pub fn instances(name: &str) -> u8 {
    checks().find(|check| check.name == name).map_or(0, |check| check.instances)
}

/// The memory of all checks.
#[derive(Clone, Copy, Debug)]
pub struct Health {
    states: [State; STATES],
}

const _: () = assert!(size_of::<Health>() <= 4 * 1024);

impl Default for Health {
    fn default() -> Self {
        Self::new()
    }
}

impl Health {
    /// Nothing seen yet.
    pub const fn new() -> Self {
        Self { states: [const { State::new() }; STATES] }
    }

    /// One step of all checks, at least every 50 ms; each change of level is a finding.
    pub fn step(
        &mut self,
        inputs: &Inputs<'_>,
        exceedances: &mut Exceedances,
        findings: &mut impl FnMut(&Finding),
    ) {
        let latched = inputs.params.get(Param::Latch) >= 0.5 && inputs.vehicle.armed();
        for (place, check, instance, state) in self.each_mut() {
            let applies = match check.when {
                When::Always => true,
                When::Armed => inputs.vehicle.armed(),
                When::InFlight => inputs.flight.airborne(),
            };
            let reading = (check.read)(inputs, instance);
            let before = *state;
            let Some(change) = state.step(check, inputs.now, reading, applies, inputs.params) else {
                if let (Some(Level::Warning | Level::Critical), Some(reading)) = (state.level(), reading) {
                    exceedances.note(place, instance, check.side, reading.value);
                }
                continue;
            };
            let falls = matches!(change.previous, Level::Warning | Level::Critical)
                && (change.level as u8) < change.previous as u8;
            if latched && falls {
                *state = before;
                continue;
            }
            let finding = Finding {
                at: inputs.now,
                subsystem: check.subsystem,
                check: check.name,
                instance,
                level: change.level,
                previous: change.previous,
                value: change.value,
                limit: change.limit,
                unit: check.unit,
            };
            exceedances.change(place, check.side, &finding);
            findings(&finding);
        }
    }

    /// Each check by its place among all, and its instances.
    fn each_mut(&mut self) -> impl Iterator<Item = (u8, &'static Check, u8, &mut State)> {
        (0..)
            .zip(checks())
            .flat_map(|(place, check)| (0..check.instances).map(move |instance| (place, check, instance)))
            .zip(&mut self.states)
            .map(|((place, check, instance), state)| (place, check, instance, state))
    }

    /// Every check instance that has had something to say, with its level.
    pub fn levels(&self) -> impl Iterator<Item = (&'static Check, u8, Level)> {
        checks()
            .flat_map(|check| (0..check.instances).map(move |instance| (check, instance)))
            .zip(&self.states)
            .filter_map(|((check, instance), state)| state.level().map(|level| (check, instance, level)))
    }

    /// A subsystem's level: its worst known part; stale where nothing is known.
    pub fn subsystem(&self, subsystem: Subsystem) -> Level {
        let part = self.levels().filter(|(check, ..)| check.subsystem == subsystem);
        worst(
            part.filter(|(check, _, level)| !check.alarm_only || *level != Level::Ok)
                .map(|(.., level)| level),
        )
    }

    /// The whole vehicle's level: its worst known part. It is not healthy while nothing is known of a subsystem that
    /// every vehicle has ([`EXPECTED`]).
    pub fn overall(&self) -> Level {
        let unknown = EXPECTED.into_iter().any(|subsystem| self.subsystem(subsystem) == Level::Stale);
        worst(self.levels().map(|(.., level)| level).chain(unknown.then_some(Level::Stale)))
    }
}

/// Critical before stale before warning: not knowing is worse than a known warning, and better than a known danger.
fn worst(levels: impl Iterator<Item = Level>) -> Level {
    let rank = |level: Level| match level {
        Level::Ok => 0,
        Level::Advisory => 1,
        Level::Warning => 2,
        Level::Stale => 3,
        Level::Critical => 4,
    };
    levels.max_by_key(|level| rank(*level)).unwrap_or(Level::Stale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_stable_identifiers() {
        let mut seen = Vec::new();
        for check in checks() {
            assert!(check.name.len() <= 16, "{}", check.name);
            let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
            assert!(check.name.bytes().all(plain), "{}", check.name);
            assert!(!seen.contains(&check.name), "{} twice", check.name);
            seen.push(check.name);
        }
    }

    #[test]
    fn every_subsystem_has_checks_under_its_own_name() {
        for (table, subsystem) in TABLES.iter().zip(Subsystem::ALL) {
            assert!(
                !table.is_empty() && table.iter().all(|check| check.subsystem == subsystem),
                "{subsystem:?}"
            );
        }
    }

    #[test]
    fn nothing_known_is_not_ok() {
        let health = Health::new();
        assert_eq!(health.overall(), Level::Stale);
        assert_eq!(worst([Level::Ok, Level::Stale].into_iter()), Level::Stale);
        assert_eq!(worst([Level::Critical, Level::Stale].into_iter()), Level::Critical);
    }
}
