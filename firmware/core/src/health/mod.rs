//! Health: checks of everything the vehicle says, what they find, and roll-ups of that.
//!
//! Each subsystem's checks are a table in a file of its own; `tables` puts them together. A roll-up is never better than
//! its worst part that is known, and where nothing is known it is not OK but stale.
//!
//! A step looks at what may change. Left out are checks that do not apply and have nothing to forget, and checks that rest: their
//! states are good or have no value, and stay so until somebody says something of the part that they are of ([`check::Part`]), until the
//! flight, a mishap or a setting changes what is judged, or until the first of their values grows stale. No value is kept for that. Where
//! assertions are on, what is left out is looked at all the same, and has to rest.

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

pub use check::{CLEAR, CLEAR_MAX, CLEAR_MAX_ALWAYS, Check, Parts, Side, State, When};
use check::{Change, How, Part, REST_MAX};
pub use consequence::{because, explains, is_of_mishap, is_with_mishap};
pub use finding::{Finding, Level, OFF_MEANING, Orders, Subsystem, is_off, off_alarm};
pub use inputs::Inputs;
pub use tables::{check_named, checks, instances};
pub use vocabulary::{Said, Scope, VOCABULARY, Words, said, vocabulary};

use crate::latest::Reading;
use crate::observation::Observation;
use crate::params::{Param, Params};
use crate::time::{Instant, Span};
use exceedance::Exceedances;
use tables::{Kinds, MAY_REST, Places, STATES};

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
    /// Kinds of checks whose states may not be new: of all others a step changes nothing while they do not apply.
    awake: Kinds,
    /// Checks that are left out until something is said of them, or this time: all their states rest.
    rest: Places,
    rest_until: Instant,
    /// Parts of which something was said since the last step, a bit each.
    heard: u16,
    /// How checks were stepped last: [`Now::mark`].
    stepped: u8,
}

const _: () = assert!(size_of::<Health>() <= 5 * 1024 + 128);

impl Default for Health {
    fn default() -> Self {
        Self::new()
    }
}

impl Health {
    /// Nothing seen yet.
    pub const fn new() -> Self {
        Self {
            states: [const { State::new() }; STATES],
            looked_at: 0,
            awake: Kinds::NONE,
            rest: Places::NONE,
            rest_until: Instant::ZERO,
            heard: 0,
            stepped: 0,
        }
    }

    /// As if nothing had been seen.
    pub(crate) fn clear(&mut self) {
        let Self { states, looked_at, awake, rest, .. } = self;
        states.fill(State::new());
        (*looked_at, *awake, *rest) = (0, Kinds::NONE, Places::NONE);
    }

    /// An observation was taken in: what it is of is looked at again.
    pub(crate) const fn hear(&mut self, observation: &Observation) {
        self.heard |= Part::told_by(observation);
    }

    /// Something else changed that checks read: all of them are looked at again.
    pub(crate) const fn look_again(&mut self) {
        self.rest = Places::NONE;
    }

    /// One step of all checks, at least every 50 ms; each change of level is a finding, and so is an alarm that outlives the one that
    /// explained it.
    pub fn step(
        &mut self,
        inputs: &Inputs<'_>,
        exceedances: &mut Exceedances,
        findings: &mut impl FnMut(&Finding),
    ) {
        let now = Now::of(inputs);
        let parts = Parts::of(inputs);
        debug_assert_eq!(speaks(&parts, inputs), None, "has a value, though its part never spoke");
        let kinds = Kinds::of(parts.spoken(), now.times());
        let stepped = kinds.and(self.awake);
        let restless = self.restless(stepped.places(), inputs, &parts, &now);
        for (place, check, first) in restless.checks() {
            let (how, there) = (now.how(check), parts.stepped(check));
            for instance in 0..there {
                let slot = first + usize::from(instance);
                let Some(state) = self.states.get_mut(slot) else { break };
                // The only one is known not to rest.
                if there > 1 && state.rests(check, instance, inputs, how).is_some() {
                    continue;
                }
                if let Some(finding) = self.turn((place, check, instance, slot), inputs, how, exceedances) {
                    findings(&finding);
                }
            }
        }
        self.looked_at = ((usize::from(self.looked_at) + 1) % STATES) as u8;
        self.awake = if stepped == kinds { kinds } else { self.awake(stepped, kinds) };
        debug_assert_eq!(self.awake(Kinds::ALL, self.awake), self.awake, "what is left out is new");
    }

    /// Those of the checks that have a state which does not rest, as nearly all do.
    fn restless(&mut self, places: Places, inputs: &Inputs<'_>, parts: &Parts, now: &Now) -> Places {
        if self.stepped != now.mark() || inputs.now.is_after(self.rest_until) {
            (self.stepped, self.rest, self.rest_until) = (now.mark(), Places::NONE, inputs.now + REST_MAX);
        }
        // What the autopilot says rests while it does not say it.
        let on = Places::of_causes(inputs.vehicle.alerts.may_be_on(inputs.now));
        let heard = Places::of_parts(core::mem::take(&mut self.heard));
        let left_out = self.rest.without(heard).without(on);
        debug_assert!({ *self }.look(left_out, inputs, parts, now).is_empty(), "what is left out changes");
        let restless = self.look(places.without(left_out), inputs, parts, now);
        self.rest = places.without(restless).within(MAY_REST);
        restless
    }

    /// Looks whether the states of these checks rest: those of which one does not. Apart, so that the many looks need few registers.
    #[inline(never)]
    fn look(&mut self, places: Places, inputs: &Inputs<'_>, parts: &Parts, now: &Now) -> Places {
        let (mut restless, mut until) = (Places::NONE, self.rest_until);
        for (place, check, first) in places.checks() {
            let how = now.how(check);
            let states = self.states.iter_mut().skip(first).take(usize::from(parts.stepped(check)));
            for (instance, state) in (0..).zip(states) {
                match state.rests(check, instance, inputs, how) {
                    Some(rests_until) => until = until.earlier(rests_until),
                    None => restless.add(place),
                }
            }
        }
        self.rest_until = until;
        restless
    }

    /// A step of one state that may change it.
    #[inline(never)]
    fn turn(
        &mut self,
        (place, check, instance, slot): (u8, &'static Check, u8, usize),
        inputs: &Inputs<'_>,
        How { applies, quiet, latched }: How,
        exceedances: &mut Exceedances,
    ) -> Option<Finding> {
        let reading = (check.read)(inputs, instance);
        let state = self.states.get_mut(slot)?;
        let before = *state;
        let change = state.step(check, inputs.now, reading, applies, inputs.params);
        if quiet {
            // It would only echo the mishap: it stays as it was.
            *state = before.seen_as(state);
            return None;
        }
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

    /// These `kinds` of checks, and of the `others` those that have a state which is not new.
    fn awake(&self, others: Kinds, kinds: Kinds) -> Kinds {
        let others = others.places().checks().filter(|(_, check, _)| !kinds.has(check));
        others.fold(kinds, |awake, (_, check, first)| {
            let mut states = self.states.iter().skip(first).take(usize::from(check.instances));
            if states.all(State::is_new) { awake } else { awake.and(Kinds::of_check(check)) }
        })
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
    /// Each cause that the autopilot may tell has a level.
    has_flags: bool,
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
        Self { hows, has_flags: vehicle.alerts.has_flags() }
    }

    const fn how(&self, check: &Check) -> How {
        self.hows[check.when as usize]
    }

    fn times(&self) -> [bool; When::ALL.len()] {
        self.hows.map(|how| how.applies)
    }

    /// All of it in a byte: checks are stepped otherwise where it differs.
    fn mark(&self) -> u8 {
        let [always, armed, in_flight] = self.hows;
        let differs = [armed.applies, in_flight.applies, armed.quiet, always.latched, self.has_flags];
        differs.into_iter().fold(0, |mark, is_so| mark << 1 | u8::from(is_so))
    }
}

/// A check of which more instances have a value than of its part have spoken; there is none.
fn speaks(parts: &Parts, inputs: &Inputs<'_>) -> Option<&'static str> {
    let has_more = |check: &&Check| {
        (parts.count(check)..check.instances).any(|instance| (check.read)(inputs, instance).is_some())
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
