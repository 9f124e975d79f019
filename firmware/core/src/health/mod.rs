//! Health: the checks of all values, their findings, and the level of each subsystem and of the vehicle.
//!
//! Each subsystem's checks are a table in a file of its own; `tables` puts them together. A roll-up is never better
//! than its worst known part. With nothing known it is stale, not OK.

mod alarms;
mod attitude;
pub mod check;
mod computer;
mod engine;
pub mod exceedance;
pub mod finding;
mod inputs;
mod link;
mod mishap;
mod navigation;
mod power;
mod prelude;
mod propulsion;
mod recorder;
mod structure;
mod suppression;
mod tables;

pub use check::{
    CLEAR, CLEAR_MAX, CLEAR_MAX_ALWAYS, Check, CheckPhase, InstanceKind, Limits, Side, State, Unit,
};
use check::{CheckStep, LevelChange};
pub use finding::{Finding, Level, Orders, Subsystem};
pub use inputs::Inputs;
pub use suppression::{Alarm, Role, explains, is_of_mishap, is_with_mishap, root_cause};
pub use tables::{check_named, checks, instances};

use crate::latest::Reading;
use crate::parameters::Param;
use crate::time::{BootMs, Millis, SILENT};
use alarms::{ALARMS_MAX, Alarms, OpenAlarm};
use exceedance::Exceedances;
use tables::{STATES, check_of, slot_of, slots};

/// Subsystems that every vehicle has, in the air and on the ground.
pub const EXPECTED: [Subsystem; 3] = [Subsystem::Power, Subsystem::Link, Subsystem::Computer];

state! {
    /// The memory of all checks.
    pub struct Health {
        states: [State; STATES] = [State::default(); STATES],
        alarms: Alarms,
    }
}

const _: () = assert!(size_of::<Health>() <= 20 * STATES + 512 + 80);

impl Health {
    pub(crate) fn clear(&mut self) {
        self.states.fill(State::default());
        self.alarms = Alarms::default();
    }

    /// One step of all checks, at least every 50 ms. Each change of level is a finding, and so is an alarm that
    /// outlives its cause.
    pub fn step(
        &mut self,
        inputs: &Inputs<'_>,
        exceedances: &mut Exceedances,
        findings: &mut dyn FnMut(&Finding),
    ) {
        let hows = hows(inputs);
        let mut first = 0;
        for (place, check) in (0..).zip(checks()) {
            let how = hows[check.when as usize];
            // A mishap's level falls even where levels are latched: it explains other alarms only while it goes on.
            let how = CheckStep { latched: how.latched && check.subsystem != Subsystem::Mishap, ..how };
            for instance in 0..check.instances {
                let slot = first + usize::from(instance);
                let Some(state) = self.states.get_mut(slot) else { break };
                let reading = if how.applies { (check.read)(inputs, instance) } else { None };
                if reading.is_none() && state.is_new() {
                    continue;
                }
                if !how.quiet && !how.latched {
                    state.held = None;
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
        if let Some(slot) = self.alarms.outliving_silence(inputs.now)
            && let Some(finding) = self.outlives(slot, inputs)
        {
            findings(&finding);
        }
        for place in 0..ALARMS_MAX {
            if let Some(slot) = self.alarms.outliving(place, inputs.now)
                && let Some(finding) = self.outlives(slot, inputs)
            {
                self.alarms.explain(place, None);
                findings(&finding);
            }
        }
    }

    #[inline(never)]
    fn turn(
        &mut self,
        (place, check, instance, slot): (u16, &'static Check, u8, usize),
        inputs: &Inputs<'_>,
        reading: Option<Reading>,
        CheckStep { applies, latched, .. }: CheckStep,
        exceedances: &mut Exceedances,
    ) -> Option<Finding> {
        let state = self.states.get_mut(slot)?;
        let before = *state;
        let change = state.step(check, inputs.now, reading, applies, inputs.params);
        let change = if latched { state.hold(&before, change) } else { change };
        if let (None, true, Some(reading)) = (change, state.has_alarm(), reading) {
            exceedances.note(place, instance, check.limits.side, reading.value);
        }
        let change = change?;
        let because = self.explain(slot as u16, change.level, inputs.now);
        let finding = self.finding(check, instance, inputs, change, because);
        exceedances.change(place, check.limits.side, &finding);
        Some(finding)
    }

    fn finding(
        &self,
        check: &Check,
        instance: u8,
        inputs: &Inputs<'_>,
        change: LevelChange,
        because: &'static str,
    ) -> Finding {
        let LevelChange { level, previous, value, limit } = change;
        // Neither a flag that is no longer reported nor a mishap that ended is known to be good.
        let is_unknown = (check.unit.is_flag() && value < 0.0)
            || (check.subsystem == Subsystem::Mishap && level == Level::Ok);
        Finding {
            at: inputs.now,
            subsystem: check.subsystem,
            check: check.name,
            instance,
            level,
            previous,
            value: if is_unknown { f32::NAN } else { value },
            limit,
            unit: check.unit.name(),
            feeds: power::feeds(check, inputs, instance),
            because,
            orders: mishap::orders(check, inputs, || self.has_lost_drive()),
        }
    }

    /// The check whose alarm explains a change to a level; empty where none does. An alarm keeps its cause while that goes on and is as
    /// bad, until it rises itself. An earlier alarm without a cause has one from now on if this one explains it.
    fn explain(&mut self, slot: u16, level: Level, now: BootMs) -> &'static str {
        self.alarms.change(slot, level, now);
        let cause = if level == Level::Stale {
            let cause = self.cause(Alarm::at(slot, level, now));
            cause.inspect(|cause| self.alarms.silence(slot, *cause))
        } else {
            for place in 0..ALARMS_MAX {
                if let Some(cause) = self.cause(self.alarms.unexplained(place)) {
                    self.alarms.explain(place, Some(cause));
                }
            }
            self.alarms.cause(slot)
        };
        cause.and_then(check_of).map_or("", |(cause, _)| cause.name)
    }

    fn cause(&self, effect: Option<Alarm>) -> Option<u16> {
        Some(root_cause(&effect?, self.standing())?.slot)
    }

    fn standing(&self) -> impl Iterator<Item = Alarm> {
        self.alarms.iter().filter_map(OpenAlarm::alarm)
    }

    fn outlives(&self, slot: u16, inputs: &Inputs<'_>) -> Option<Finding> {
        let (check, instance) = check_of(slot)?;
        let state =
            self.states.get(usize::from(slot)).filter(|state| state.lasts(inputs.now, Millis::ZERO))?;
        let level = state.level()?;
        let (value, limit) = if level == Level::Stale {
            (f32::NAN, f32::NAN)
        } else {
            let value = Some((check.read)(inputs, instance)?.value).filter(|value| value.is_finite())?;
            (value, check.limit(level, inputs.params))
        };
        let change = LevelChange { level, previous: level, value, limit };
        Some(self.finding(check, instance, inputs, change, ""))
    }

    fn has_lost_drive(&self) -> bool {
        self.levels().any(|(check, _, level)| level == Level::Critical && suppression::is_of_drive(check))
    }

    /// Every check instance that has had something to say, with its level.
    pub fn levels(&self) -> impl Iterator<Item = (&'static Check, u8, Level)> + Clone {
        self.numbered_levels().map(|(_, check, instance, level)| (check, instance, level))
    }

    pub(crate) fn numbered_levels(&self) -> impl Iterator<Item = (u16, &'static Check, u8, Level)> + Clone {
        let states = slots().zip(&self.states);
        states.filter_map(|((slot, check, instance), state)| {
            state.level().map(|level| (slot, check, instance, level))
        })
    }

    /// Whether an alarm's value is still bad, and was for as long as its text waits. True of what has no alarm.
    pub fn lasts(&self, check: &Check, instance: u8, now: BootMs) -> bool {
        let state = slot_of(check.name, instance).and_then(|slot| self.states.get(usize::from(slot)));
        state.is_none_or(|state| state.lasts(now, Millis::from_secs(check.told_after_s.into())))
    }

    /// The alarm of a check that stands, and whether another one explains it by now.
    pub fn alarm(&self, check: &str, instance: u8) -> Option<(Alarm, bool)> {
        let known = self.alarms.of(slot_of(check, instance)?)?;
        Some((known.alarm()?, known.cause.is_some()))
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

/// How checks are stepped, by [`CheckPhase`].
fn hows(inputs: &Inputs<'_>) -> [CheckStep; CheckPhase::ALL.len()] {
    let Inputs { now, vehicle, flight, .. } = *inputs;
    let armed = vehicle.armed();
    let is_silent = || vehicle.heartbeat.within(now, SILENT).is_none();
    // A vehicle that is down and disarmed, or silent, is not judged any further.
    let over = flight.in_mishap() && ((flight.is_down() && !armed) || is_silent());
    // A mishap goes on: all but those that always apply would only echo it.
    let quiet = flight.in_mishap() && !over;
    let latched = armed && inputs.params.get(Param::Latch) >= 0.5;
    CheckPhase::ALL.map(|when| {
        let applies = match when {
            CheckPhase::Always => return CheckStep { applies: true, quiet: false, latched },
            CheckPhase::Armed => armed,
            CheckPhase::InFlight => flight.airborne(),
        };
        CheckStep { applies: quiet || (!over && applies), quiet, latched }
    })
}

/// Critical before stale before warning: not knowing is worse than a known warning, and better than a known danger.
fn worst(levels: impl Iterator<Item = Level>) -> Level {
    const FROM_BEST: [Level; 5] = [Level::Ok, Level::Advisory, Level::Warning, Level::Stale, Level::Critical];
    levels.max_by_key(|level| FROM_BEST.iter().position(|one| one == level)).unwrap_or(Level::Stale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_stable_identifiers() {
        let mut seen = Vec::new();
        for check in checks() {
            let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
            assert!(check.name.len() <= 16 && check.name.bytes().all(plain), "{}", check.name);
            assert!(!seen.contains(&check.name), "{} twice", check.name);
            seen.push(check.name);
        }
    }

    #[test]
    fn every_subsystem_has_checks_under_its_own_name() {
        for (table, subsystem) in tables::TABLES.iter().zip(Subsystem::ALL) {
            assert!(!table.is_empty(), "{subsystem:?}");
            assert!(table.iter().all(|check| check.subsystem == subsystem), "{subsystem:?}");
        }
    }

    #[test]
    fn nothing_known_is_not_ok() {
        let health = Health::default();
        assert_eq!(health.overall(), Level::Stale);
        assert_eq!(worst([Level::Ok, Level::Stale].into_iter()), Level::Stale);
        assert_eq!(worst([Level::Critical, Level::Stale].into_iter()), Level::Critical);
    }
}
