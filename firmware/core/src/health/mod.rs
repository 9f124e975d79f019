//! Health: checks of everything the vehicle says, what they find, and roll-ups of that.
//!
//! Each subsystem's checks are a table in a file of its own; `tables` puts them together. A roll-up is never better than
//! its worst part that is known, and where nothing is known it is not OK but stale.

mod attitude;
pub mod check;
mod common;
mod computer;
mod consequence;
mod engine;
pub mod exceedance;
pub mod finding;
mod inputs;
mod link;
mod mishap;
mod navigation;
mod power;
mod propulsion;
mod recorder;
mod structure;
mod tables;
mod vocabulary;

pub use check::{CLEAR, CLEAR_MAX, CLEAR_MAX_ALWAYS, Check, Side, State, When};
pub use finding::{Finding, Level, Subsystem};
pub use inputs::Inputs;
pub use tables::{check_named, checks, instances, words};
pub use vocabulary::{Scope, VOCABULARY, Words, vocabulary};

use crate::params::Param;
use crate::time::Span;
use exceedance::Exceedances;
use tables::{STATES, TABLES};

/// A vehicle that has not been heard for so long is silent.
const SILENT: Span = Span::from_secs(5);
/// Subsystems that every vehicle has, in the air and on the ground.
pub const EXPECTED: [Subsystem; 3] = [Subsystem::Power, Subsystem::Link, Subsystem::Computer];

/// The memory of all checks.
#[derive(Clone, Copy, Debug)]
pub struct Health {
    states: [State; STATES],
}

const _: () = assert!(size_of::<Health>() <= 5 * 1024);

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
        let heard = inputs.vehicle.heartbeat.within(inputs.now, SILENT).is_some();
        // What lies disarmed, or is silent, has nothing more to judge but itself.
        let over =
            inputs.mishap.is_going() && (!heard || (inputs.mishap.is_down() && !inputs.vehicle.armed()));
        let quiet = inputs.mishap.is_going() && !over;
        let mut slots = 0..STATES;
        for (place, check) in (0..).zip(TABLES.iter().copied().flatten()) {
            let quiet = quiet && check.when != When::Always;
            let applies = match check.when {
                When::Always => true,
                _ if over => false,
                _ if quiet => true,
                When::Armed => inputs.vehicle.armed(),
                When::InFlight => inputs.flight.airborne(),
            };
            for (instance, slot) in (0..check.instances).zip(&mut slots) {
                let Some(state) = self.states.get_mut(slot) else { return };
                // Most have nothing to say and never had: a step would change nothing.
                let is_new = state.is_new();
                if is_new && !applies {
                    continue;
                }
                let reading = (check.read)(inputs, instance);
                if is_new && reading.is_none() {
                    continue;
                }
                let before = *state;
                let change = state.step(check, inputs.now, reading, applies, inputs.params);
                if quiet {
                    // It would only echo the mishap: it stays as it was.
                    *state = before.seen_as(state);
                    continue;
                }
                let change = if latched { state.hold(&before, change) } else { state.release(change) };
                let Some(change) = change else {
                    if let (Some(Level::Warning | Level::Critical), Some(reading)) = (state.level(), reading)
                    {
                        exceedances.note(place, instance, check.side, reading.value);
                    }
                    continue;
                };
                let feeds = power::feeds(check, inputs, instance);
                let because = self.because(check, change.level);
                let finding = Finding { because, ..check.finding(instance, inputs.now, change, feeds) };
                exceedances.change(place, check.side, &finding);
                findings(&finding);
            }
        }
    }

    /// The check whose alarm explains another one's change to a level; empty where none does.
    fn because(&self, effect: &Check, level: Level) -> &'static str {
        let alarms = self.levels().filter(|(.., level)| matches!(level, Level::Warning | Level::Critical));
        let alarms = alarms.map(|(check, _, level)| (check.name, level));
        consequence::because(effect.name, level, alarms).unwrap_or_default()
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
        for (table, subsystem) in tables::TABLES.iter().zip(Subsystem::ALL) {
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
