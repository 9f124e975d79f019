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
use check::{Change, Parts};
pub use consequence::{because, is_of_mishap};
pub use finding::{Finding, Level, Subsystem};
pub use inputs::Inputs;
pub use tables::{check_named, checks, instances};
pub use vocabulary::{Said, Scope, VOCABULARY, Words, said, vocabulary};

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
    /// The state that is looked at next: whether what explained its alarm still does. One a step, each every 8 s.
    looked_at: u8,
}

const _: () = assert!(size_of::<Health>() <= 5 * 1024 && STATES <= u8::MAX as usize);

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
        let Self { states, looked_at } = self;
        states.fill(State::new());
        *looked_at = 0;
    }

    /// One step of all checks, at least every 50 ms; each change of level is a finding, and so is an alarm that outlives the one that
    /// explained it.
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
        let parts = Parts::of(inputs);
        let looked_at = usize::from(self.looked_at);
        self.looked_at = ((looked_at + 1) % STATES) as u8;
        // Most have nothing to say and never had: a step would change nothing.
        let is_idle = |states: &[State]| states.iter().all(State::is_new);
        let mut first = 0;
        for (place, check) in (0..).zip(TABLES.iter().copied().flatten()) {
            let quiet = quiet && check.when != When::Always;
            let applies = quiet || (check.when == When::Always || !over) && is_now(check.when, inputs);
            let slots = first..first + usize::from(check.instances);
            first = slots.end;
            let there = parts.count(check);
            debug_assert!(
                silent(check, there, inputs),
                "{} has a value, though its part never spoke",
                check.name
            );
            if (!applies || there == 0) && self.states.get(slots.clone()).is_none_or(is_idle) {
                continue;
            }
            // What is not idle is stepped, though it is not known any more.
            let there = if there == 0 { check.instances } else { there };
            for (instance, slot) in (0..there).zip(slots) {
                let Some(state) = self.states.get_mut(slot) else { return };
                // Of what is new, a step without a value changes nothing.
                let is_new = state.is_new();
                let reading = if is_new && !applies { None } else { (check.read)(inputs, instance) };
                if is_new && reading.is_none() {
                    continue;
                }
                if !quiet && state.rests(check, inputs, reading, applies, latched) {
                    continue;
                }
                let before = *state;
                let change = state.step(check, inputs.now, reading, applies, inputs.params);
                if quiet {
                    // It would only echo the mishap: it stays as it was.
                    *state = before.seen_as(state);
                    continue;
                }
                let change = if latched { state.hold(&before, change) } else { change };
                let is_change = change.is_some();
                let told = if let Some(change) = change {
                    let because = self.because(check, change.level);
                    if let Some(state) = self.states.get_mut(slot) {
                        state.explain(!because.is_empty());
                    }
                    Some((change, because))
                } else if let (Some(level @ (Level::Warning | Level::Critical)), Some(reading)) =
                    (state.level(), reading)
                {
                    exceedances.note(place, instance, check.side, reading.value);
                    let is_alone =
                        slot == looked_at && state.was_explained() && self.outlives(slot, check, level);
                    let limit = check.limit(level, inputs.params);
                    is_alone.then_some((Change { level, previous: level, value: reading.value, limit }, ""))
                } else {
                    None
                };
                let Some((change, because)) = told else { continue };
                let feeds = power::feeds(check, inputs, instance);
                let finding = Finding { because, ..check.finding(instance, inputs.now, change, feeds) };
                if is_change {
                    exceedances.change(place, check.side, &finding);
                }
                // In one place: the compiler puts what is done with it here, with its stack.
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

    /// Whether nothing has explained an alarm any more for a while, though something did.
    fn outlives(&mut self, slot: usize, check: &Check, level: Level) -> bool {
        let explained = !self.because(check, level).is_empty();
        self.states.get_mut(slot).is_some_and(|state| state.outlives(explained))
    }

    /// Every check instance that has had something to say, with its level.
    pub fn levels(&self) -> impl Iterator<Item = (&'static Check, u8, Level)> {
        checks()
            .flat_map(|check| (0..check.instances).map(move |instance| (check, instance)))
            .zip(&self.states)
            .filter_map(|((check, instance), state)| state.level().map(|level| (check, instance, level)))
    }

    /// Of each check, in the order of [`checks`], whether an instance has a level that is known.
    pub fn judged(&self) -> impl Iterator<Item = bool> {
        let mut states = self.states.iter();
        checks().map(move |check| {
            let mine = states.by_ref().take(usize::from(check.instances));
            mine.fold(false, |known, state| known | state.level().is_some_and(|level| level != Level::Stale))
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

/// Whether it is so now.
fn is_now(when: When, inputs: &Inputs<'_>) -> bool {
    match when {
        When::Always => true,
        When::Armed => inputs.vehicle.armed(),
        When::InFlight => inputs.flight.airborne(),
    }
}

/// Whether none but the first instances of a check have a value.
fn silent(check: &Check, there: u8, inputs: &Inputs<'_>) -> bool {
    (there..check.instances).all(|instance| (check.read)(inputs, instance).is_none())
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
