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

pub use check::{CLEAR, CLEAR_MAX, CLEAR_MAX_ALWAYS, Check, Debounce, InstanceOf, Side, State, Unit, When};
use check::{Change, How, Reported};
pub use consequence::{because, explains, is_of_mishap, is_with_mishap};
pub use finding::{Finding, Level, OFF_MEANING, Orders, Subsystem, is_off, off_alarm};
pub use inputs::Inputs;
pub use tables::{check_named, checks, instances};
pub use vocabulary::{Said, Scope, VOCABULARY, Words, said, vocabulary};

use crate::latest::Reading;
use crate::params::{Param, Params};
use crate::time::{Instant, Span};
use exceedance::Exceedances;
use tables::STATES;

/// A vehicle that has not been heard for so long is silent.
const SILENT: Span = Span::from_secs(5);
/// Subsystems that every vehicle has, in the air and on the ground.
pub const EXPECTED: [Subsystem; 3] = [Subsystem::Power, Subsystem::Link, Subsystem::Computer];

/// The memory of all checks.
#[derive(Clone, Copy, Debug)]
pub struct Health {
    states: [State; STATES],
    /// The state that is looked at next: whether the alarm that explained it goes on. One a step.
    looked_at: u16,
}

const _: () = assert!(size_of::<Health>() <= 20 * STATES + 4);

impl Default for Health {
    fn default() -> Self {
        Self::new()
    }
}

impl Health {
    /// Nothing seen yet.
    pub const fn new() -> Self {
        Self { states: [const { State::new() }; STATES], looked_at: 0 }
    }

    /// As if nothing had been seen.
    pub(crate) fn clear(&mut self) {
        self.states.fill(State::new());
        self.looked_at = 0;
    }

    /// One step of all checks, at least every 50 ms; each change of level is a finding, and so is an alarm that outlives the one that
    /// explained it.
    pub fn step(
        &mut self,
        inputs: &Inputs<'_>,
        exceedances: &mut Exceedances,
        findings: &mut impl FnMut(&Finding),
    ) {
        let (now, reported) = (Now::of(inputs), Reported::of(inputs));
        debug_assert_eq!(unreported(&reported, inputs), None, "has a value, though it never reported");
        let mut first = 0;
        for (place, check) in (0..).zip(checks()) {
            let (how, count) = (now.how(check), reported.count(check));
            for instance in 0..check.instances {
                let slot = first + usize::from(instance);
                let Some(state) = self.states.get_mut(slot) else { break };
                let is_read = how.applies && instance < count;
                if !is_read && state.is_new() {
                    continue;
                }
                let reading = if is_read { (check.read)(inputs, instance) } else { None };
                if !how.quiet && !how.latched {
                    state.release();
                }
                if how.quiet {
                    state.see(inputs.now, reading);
                } else if reading
                    .is_none_or(|reading| !state.stays_good(check, inputs.now, reading, inputs.params))
                    && let Some(finding) =
                        self.turn((place, check, instance, slot), inputs, reading, how, exceedances)
                {
                    findings(&finding);
                }
            }
            first += usize::from(check.instances);
        }
        self.looked_at = (self.looked_at + 1) % STATES as u16;
    }

    /// A step of one state that may change it.
    #[inline(never)]
    fn turn(
        &mut self,
        (place, check, instance, slot): (u16, &'static Check, u8, usize),
        inputs: &Inputs<'_>,
        reading: Option<Reading>,
        How { applies, latched, .. }: How,
        exceedances: &mut Exceedances,
    ) -> Option<Finding> {
        let state = self.states.get_mut(slot)?;
        let before = *state;
        let change = state.step(check, inputs.now, reading, applies, inputs.params);
        let change = if latched { state.hold(&before, change) } else { change };
        if let (None, Some(Level::Warning | Level::Critical), Some(reading)) =
            (change, state.level(), reading)
        {
            exceedances.note(place, instance, check.side, reading.value);
        }
        let (told, because) = match change {
            Some(change) => self.explained(slot, check, change),
            None if slot == usize::from(self.looked_at) => self.alone(slot, check, reading, inputs.params)?,
            None => return None,
        };
        let feeds = power::feeds(check, inputs, instance);
        let orders = mishap::orders(check, inputs, || self.has_lost_drive());
        let finding = Finding { because, orders, ..check.finding(instance, inputs.now, told, feeds) };
        if change.is_some() {
            exceedances.change(place, check.side, &finding);
        }
        Some(finding)
    }

    /// A change, and the check whose alarm explains it.
    fn explained(&mut self, slot: usize, check: &Check, change: Change) -> (Change, &'static str) {
        let because = self.because(check, change.level);
        if let Some(state) = self.states.get_mut(slot) {
            state.explain(!because.is_empty());
        }
        (change, because)
    }

    /// An alarm that outlives the one that explained it, as a change of its own.
    fn alone(
        &mut self,
        slot: usize,
        check: &Check,
        reading: Option<Reading>,
        params: &Params,
    ) -> Option<(Change, &'static str)> {
        let state = self.states.get(slot).filter(|state| state.was_explained())?;
        let level = state.level().filter(|level| matches!(level, Level::Warning | Level::Critical))?;
        let value = reading?.value;
        let change = Change { level, previous: level, value, limit: check.limit(level, params) };
        self.outlives(slot, check, level).then_some((change, ""))
    }

    /// The check whose alarm explains another one's change to a level; empty where none does.
    fn because(&self, effect: &Check, level: Level) -> &'static str {
        let alarms = self.levels().filter(|(.., level)| matches!(level, Level::Warning | Level::Critical));
        // All of them were found before.
        let alarms = alarms.map(|(check, _, level)| (Instant::ZERO, check.name, level));
        consequence::because(effect.name, level, Instant::ZERO, alarms).unwrap_or_default()
    }

    /// Whether nothing has explained an alarm any more for a while, though something did.
    fn outlives(&mut self, slot: usize, check: &Check, level: Level) -> bool {
        let explained = !self.because(check, level).is_empty();
        self.states.get_mut(slot).is_some_and(|state| state.outlives(explained))
    }

    /// Whether something that drives the vehicle has a critical alarm.
    fn has_lost_drive(&self) -> bool {
        self.levels()
            .any(|(check, _, level)| level == Level::Critical && consequence::is_of_drive(check.name))
    }

    /// Every check instance that has had something to say, with its level.
    pub fn levels(&self) -> impl Iterator<Item = (&'static Check, u8, Level)> + Clone {
        checks()
            .flat_map(|check| (0..check.instances).map(move |instance| (check, instance)))
            .zip(&self.states)
            .filter_map(|((check, instance), state)| state.level().map(|level| (check, instance, level)))
    }

    /// Whether an alarm's value is good just now, and its level about to fall.
    pub fn gets_better(&self, check: &str, instance: u8) -> bool {
        let places = checks().flat_map(|check| (0..check.instances).map(move |instance| (check, instance)));
        let mut states = places.zip(&self.states);
        let mine = states.find(|((of, number), _)| of.name == check && *number == instance);
        mine.is_some_and(|(_, state)| state.gets_better())
    }

    /// Of each check, in the order of [`checks`], the levels of its instances.
    pub fn by_check(&self) -> impl Iterator<Item = impl Iterator<Item = Level>> {
        let mut states = &self.states[..];
        checks().map(move |check| {
            let (mine, rest) = states.split_at_checked(usize::from(check.instances)).unwrap_or_default();
            states = rest;
            mine.iter().filter_map(State::level)
        })
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

/// What is common to all checks of a step.
struct Now {
    /// How checks are stepped, by [`When`] they apply.
    hows: [How; When::ALL.len()],
}

impl Now {
    fn of(inputs: &Inputs<'_>) -> Self {
        let Inputs { now, vehicle, mishap, .. } = *inputs;
        let armed = vehicle.armed();
        let is_silent = || vehicle.heartbeat.within(now, SILENT).is_none();
        // What lies disarmed, or is silent, has nothing more to judge but itself.
        let over = mishap.is_going() && ((mishap.is_down() && !armed) || is_silent());
        // A mishap goes on: all but those that always apply would only echo it.
        let quiet = mishap.is_going() && !over;
        let latched = armed && inputs.params.get(Param::Latch) >= 0.5;
        let hows = When::ALL.map(|when| {
            let applies = match when {
                When::Always => return How { applies: true, quiet: false, latched },
                When::Armed => armed,
                When::InFlight => inputs.flight.airborne(),
            };
            How { applies: quiet || (!over && applies), quiet, latched }
        });
        Self { hows }
    }

    const fn how(&self, check: &Check) -> How {
        self.hows[check.when as usize]
    }
}

/// A check of which an instance has a value that never reported; there is none.
fn unreported(reported: &Reported, inputs: &Inputs<'_>) -> Option<&'static str> {
    let has_more = |check: &&Check| {
        (reported.count(check)..check.instances).any(|instance| (check.read)(inputs, instance).is_some())
    };
    checks().find(has_more).map(|check| check.name)
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
