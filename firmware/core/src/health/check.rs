//! The mechanism of a check: a value against its limits, with debounce, hysteresis, a condition and the stale state.
//!
//! A check is data ([`Check`]) plus one pure function that reads its value; its memory is a [`State`]. Adding a check
//! is one entry in its subsystem's table and one function.
//!
//! "Bad for `debounce`" takes time and samples: the value is beyond its limit for so long, and in [`SAMPLES`] measurements
//! of it. A slow stream holds its last value: that is one sample, however long it is held.
//!
//! ```text
//!            bad for `debounce`             silent for `stale_after`
//!      Ok ------------------------> Warning, Critical ----------> Stale
//!       ^ <------------------------                                 |
//!            good for `clear`                 heard again           |
//!       \-----------------------------------------------------------/
//! ```
//!
//! A value that goes up and down is one thing and not one each time: [`CLEAR`] grows eightfold with each level that it rises to
//! again, up to [`CLEAR_MAX`], until the check no longer applies (the vehicle landed, or was disarmed). So does the time after
//! which a bad value is stale: a stream that is slower than values stay fresh is no new alarm with each message.

use super::finding::{Finding, Level, Orders, Subsystem};
use super::inputs::Inputs;
use crate::latest::Reading;
use crate::observation::{Feeds, Observation};
use crate::params::{Param, Params};
use crate::time::{Instant, Span, Stamp};

/// Which side of its limits is the bad one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Values above the limit are bad.
    Above,
    /// Values below the limit are bad.
    Below,
}

/// When a check applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum When {
    /// Whenever its value is known.
    Always,
    /// While the motors may turn.
    Armed,
    /// From take-off to landing.
    InFlight,
}

impl When {
    /// All of them, by their number.
    pub(super) const ALL: [Self; 3] = [Self::Always, Self::Armed, Self::InFlight];
}

/// What a check, or an instance of it, has its value from. What never said anything has none, and is not asked for one: most of a step
/// went into asking.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The vehicle, or parts of it that nobody counts: each is asked.
    Vehicle,
    /// Motors, whose ESCs tell of them.
    Motor,
    /// Motors by what they are given.
    Output,
    /// Batteries, the first one also by the autopilot's own figures, which name none.
    Supply,
    /// Batteries that report themselves.
    Battery,
    /// The autopilot's board: its rails, its processor's load and temperature.
    Board,
    /// Vibration, and what it clips.
    Vibration,
    /// The remote control's receiver and the telemetry radio.
    Radio,
    /// GNSS receivers.
    Receiver,
    /// Accelerometers, gyros, compasses and barometers by instance.
    Sensor,
    /// Two sensors of a kind that were compared.
    Pair,
    /// The estimator.
    Estimator,
    /// The combustion engine.
    Engine,
    /// The autopilot's own word on what is wrong.
    Alert,
    /// Components that wear.
    Wear,
    /// The airframe's earlier flights.
    Past,
}

impl Part {
    pub(super) const COUNT: usize = Self::Past as usize + 1;

    /// The parts of which an observation says something, among those that are [`Self::TOLD`], a bit each; all of these where it may change
    /// more.
    pub(super) const fn told_by(observation: &Observation) -> u16 {
        match observation {
            Observation::Battery(_) => Self::bits(&[Self::Supply, Self::Battery]),
            Observation::SystemStatus(_) => Self::bits(&[Self::Supply, Self::Battery, Self::Board]),
            Observation::Rails(_) | Observation::Processor(_) => Self::bits(&[Self::Board]),
            Observation::Vibration(_) => Self::bits(&[Self::Vibration]),
            Observation::RadioControl(_) | Observation::TelemetryRadio(_) => Self::bits(&[Self::Radio]),
            Observation::Gnss(_) | Observation::GnssIntegrity(_) => Self::bits(&[Self::Receiver]),
            Observation::Estimator(_) => Self::bits(&[Self::Estimator]),
            Observation::Engine(_) => Self::bits(&[Self::Engine]),
            Observation::Imu(_)
            | Observation::Air(_)
            | Observation::ImuAndAir(..)
            | Observation::Shock(_)
            | Observation::Attitude(_)
            | Observation::SecondEstimate(_)
            | Observation::Wanted(_)
            | Observation::ClimbWanted(_)
            | Observation::LocalPosition(_)
            | Observation::GlobalPosition(_)
            | Observation::Hud(_)
            | Observation::Outputs(_)
            | Observation::Escs(_)
            | Observation::SystemTime(_) => 0,
            _ => Self::TOLD,
        }
    }

    /// The parts whose values change with an observation of them, an event of the flight or a setting only: not with time, and not with
    /// what others say. A bit each.
    pub(super) const TOLD: u16 = Self::bits(&[
        Self::Supply,
        Self::Battery,
        Self::Board,
        Self::Vibration,
        Self::Radio,
        Self::Receiver,
        Self::Estimator,
        Self::Engine,
    ]);

    const fn bits(parts: &[Self]) -> u16 {
        let (mut bits, mut place) = (0, 0);
        while place < parts.len() {
            bits |= 1 << parts[place] as u8;
            place += 1;
        }
        bits
    }
}

/// How many of each [`Part`] have ever spoken.
pub struct Parts([u8; Part::COUNT]);

impl Parts {
    /// As they are now.
    pub fn of(inputs: &Inputs<'_>) -> Self {
        let Inputs { vehicle, derived, .. } = inputs;
        let all = |known: bool| if known { u8::MAX } else { 0 };
        let is_known = |at: Option<Instant>| all(at.is_some());
        let batteries = vehicle.batteries_known();
        let sensors = derived.crosschecks().sensors_known();
        let mut counts = [u8::MAX; _];
        for (part, count) in [
            (Part::Motor, vehicle.motors_known()),
            (Part::Output, all(derived.outputs().are_told())),
            (Part::Supply, batteries.max(1)),
            (Part::Battery, batteries),
            (Part::Board, is_known(vehicle.rails.at().or(vehicle.processor.at()).or(vehicle.system.at()))),
            (Part::Vibration, is_known(vehicle.vibration.at())),
            (Part::Radio, is_known(vehicle.rc.at().or(vehicle.radio.at()))),
            (Part::Receiver, vehicle.receivers_known()),
            (Part::Sensor, sensors),
            (Part::Pair, if derived.crosschecks().are_compared() { sensors } else { 0 }),
            (Part::Estimator, is_known(vehicle.estimator.at())),
            (Part::Engine, is_known(vehicle.engine.at())),
            (Part::Alert, all(vehicle.alerts.are_known())),
            (Part::Wear, all(inputs.wear.iter().any(Option::is_some))),
            (Part::Past, all(inputs.baselines.are_known())),
        ] {
            counts[part as usize] = count;
        }
        Self(counts)
    }

    /// The parts of which any has spoken: a bit each.
    pub(super) fn spoken(&self) -> u16 {
        self.0.iter().rev().fold(0, |spoken, count| spoken << 1 | u16::from(*count > 0))
    }

    /// How many instances of a check may have a value.
    pub const fn count(&self, check: &Check) -> u8 {
        let spoken = self.0[check.part as usize];
        if spoken < check.instances { spoken } else { check.instances }
    }

    /// How many of its states are stepped: what is not new is stepped, though nothing of it is known any more.
    pub(super) const fn stepped(&self, check: &Check) -> u8 {
        let spoken = self.0[check.part as usize];
        if spoken == 0 || spoken > check.instances { check.instances } else { spoken }
    }
}

/// One check.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Stable name, at most 16 characters of `a-z0-9_`.
    pub name: &'static str,
    /// The part of the vehicle.
    pub subsystem: Subsystem,
    /// The unit of value and limits.
    pub unit: &'static str,
    /// Which side of the limits is bad.
    pub side: Side,
    /// The limit of [`Level::Warning`].
    pub warn: Option<Param>,
    /// The limit of [`Level::Critical`].
    pub critical: Option<Param>,
    /// How far back on the good side of a limit the value must be to count as good again.
    pub hysteresis: f32,
    /// How long it must be bad before it is a warning.
    pub debounce_warn: Span,
    /// How long it must be bad before it is critical.
    pub debounce_critical: Span,
    /// When the check applies.
    pub when: When,
    /// How old the value may be; `None` for values that are ages themselves.
    pub stale_after: Option<Span>,
    /// How many there may be.
    pub instances: u8,
    /// Its silence says nothing: a flag that is not set, a restart that did not happen. Such a check can make its part
    /// of the vehicle worse, and never by itself make it healthy.
    pub alarm_only: bool,
    /// Its value is a flag or the number of a state, which tells a pilot nothing: the alarm alone is told.
    pub is_flag: bool,
    /// What its value is from.
    pub part: Part,
    /// Reads the value; `None` while it has never been measured.
    pub read: fn(&Inputs<'_>, u8) -> Option<Reading>,
}

/// How long a value must be good before the level falls, so that a value at its limit does not flicker.
pub const CLEAR: Span = Span::from_secs(2);

/// The longest that it must be good, once it was bad again twice.
pub const CLEAR_MAX: Span = Span::from_secs(128);

/// The same for checks that apply on the ground too: they have no end of a flight to begin anew at.
pub const CLEAR_MAX_ALWAYS: Span = Span::from_secs(16);

/// A state that rests is looked at again after this long.
pub(super) const REST_MAX: Span = Span::from_secs(600);

const _: () = assert!(CLEAR.as_millis() << (3 * Repeats::MOST) == CLEAR_MAX.as_millis());

/// Measurements that have to be bad, one after the other: one message of nonsense is no alarm.
pub const SAMPLES: u8 = 2;

/// Two counts up to 15 in a byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Samples(u8);

impl Samples {
    const NONE: Self = Self(0);
    const BAD: u8 = 0;
    const VERY_BAD: u8 = 4;

    /// Counts measurements that are bad one after the other; whether there were enough.
    fn count(&mut self, which: u8, bad: bool, measured: bool) -> bool {
        let before = self.0 >> which & 0xF;
        let count = if bad { (before + u8::from(measured || before == 0)).min(0xF) } else { 0 };
        self.0 = self.0 & !(0xF << which) | count << which;
        count >= SAMPLES
    }
}

/// How often a level was reached again, and the worst one that was reached, since the check began to apply; and how often the level was
/// looked at since another check explained it. In a byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Repeats(u8);

impl Repeats {
    const NONE: Self = Self(0);
    const MOST: u32 = 2;

    const fn count(self) -> u32 {
        self.0 as u32 & 3
    }

    /// Eightfold for each.
    fn grown(self, span: Span) -> Span {
        Span::from_millis(span.as_millis() << (3 * self.count()))
    }

    fn note(&mut self, previous: Level, level: Level) {
        let rank = |level| match level {
            Level::Warning => 1,
            Level::Critical => 2,
            _ => 0,
        };
        let (rank, worst) = (if rank(level) > rank(previous) { rank(level) } else { 0 }, self.0 >> 2 & 3);
        let again = u32::from(rank > 0 && rank <= worst);
        self.0 = (self.count() + again).min(Self::MOST) as u8 | worst.max(rank) << 2;
    }

    /// 0 where no other check explained the level, 1 where one does, 2 where none did at the last look.
    const fn looks(self) -> u8 {
        self.0 >> 4
    }

    const fn set_looks(&mut self, looks: u8) {
        self.0 = self.0 & 0xF | looks << 4;
    }
}

/// How a check is stepped.
#[derive(Clone, Copy)]
pub(super) struct How {
    /// It applies.
    pub(super) applies: bool,
    /// It would only echo a mishap: its level stays as it is.
    pub(super) quiet: bool,
    /// Levels do not fall.
    pub(super) latched: bool,
}

/// The memory of one instance of a check.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    /// `None` until the value has been seen while the check applied.
    level: Option<Level>,
    /// What it does not fall below, while levels are held: a warning or a critical level.
    held: Option<Level>,
    /// Measurements in a row beyond the warning's limit, and beyond the critical one.
    samples: Samples,
    repeats: Repeats,
    bad: Stamp,
    very_bad: Stamp,
    better: Stamp,
    /// When the value was measured last.
    seen: Stamp,
}

const _: () = assert!(size_of::<State>() <= 20);

/// A change of level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// The new level.
    pub level: Level,
    /// The level before; [`Level::Ok`] where it was not known.
    pub previous: Level,
    /// The value that decided; NaN where the input stopped.
    pub value: f32,
    /// The limit that it crossed; NaN where there is none.
    pub limit: f32,
}

impl Check {
    /// The limit of a level; NaN where there is none.
    pub(super) fn limit(&self, level: Level, params: &Params) -> f32 {
        let of = |param: Option<Param>| param.map_or(f32::NAN, |param| params.get(param));
        let (warn, critical) = (of(self.warn), of(self.critical));
        if level == Level::Critical || warn.is_nan() { critical } else { warn }
    }

    /// What a change of its level is told as.
    pub(super) const fn finding(&self, instance: u8, at: Instant, change: Change, feeds: Feeds) -> Finding {
        Finding {
            at,
            subsystem: self.subsystem,
            check: self.name,
            instance,
            level: change.level,
            previous: change.previous,
            // What is no longer said is not known to be good, nor is what a mishap left.
            value: if (matches!(self.part, Part::Alert) && change.value < 0.0)
                || (matches!(self.subsystem, Subsystem::Mishap) && matches!(change.level, Level::Ok))
            {
                f32::NAN
            } else {
                change.value
            },
            limit: change.limit,
            unit: self.unit,
            feeds,
            because: "",
            orders: Orders::Own,
        }
    }
}

impl State {
    /// Nothing seen yet.
    pub const fn new() -> Self {
        Self {
            level: None,
            held: None,
            samples: Samples::NONE,
            repeats: Repeats::NONE,
            bad: Stamp::NONE,
            very_bad: Stamp::NONE,
            better: Stamp::NONE,
            seen: Stamp::NONE,
        }
    }

    /// The level, or `None` while the check has had nothing to say.
    pub const fn level(&self) -> Option<Level> {
        self.level
    }

    /// Whether it is a warning or critical, and its value is good just now.
    pub(super) const fn gets_better(&self) -> bool {
        matches!(self.level, Some(Level::Warning | Level::Critical)) && self.better.is_set()
    }

    /// Another check's alarm explains its level, or does not, at the change to it.
    pub(super) const fn explain(&mut self, explained: bool) {
        self.repeats.set_looks(explained as u8);
    }

    /// Whether another check's alarm explained its level at the change to it.
    pub(super) const fn was_explained(&self) -> bool {
        self.repeats.looks() > 0
    }

    /// The same some time later, of what was explained. `true` where it is not for the second time: then it is a finding of its own.
    pub(super) const fn outlives(&mut self, explained: bool) -> bool {
        let looks = match (explained, self.repeats.looks()) {
            (true, _) => 1,
            (false, 1) => 2,
            (false, _) => 0,
        };
        self.repeats.set_looks(looks);
        looks == 0
    }

    /// Whether it never had a value since it began to apply, nor a level: then a step without a value changes nothing.
    pub(super) fn is_new(&self) -> bool {
        self.level.is_none() && self.held.is_none() && !self.seen.is_set()
    }

    /// Whether it is good, and nothing says otherwise.
    fn is_calm(&self) -> bool {
        let counts = self.bad.is_set() || self.very_bad.is_set() || self.samples != Samples::NONE;
        self.level == Some(Level::Ok) && self.better.is_set() && !counts
    }

    /// One step of what is good as it was for long and stays so, as nearly every step is: the time of its measurement is noted, and
    /// nothing else changes. Until when that goes on with the same value, which is a number; `None` where [`Self::step`] has more to do,
    /// and nothing was changed then.
    fn stays_calm(
        &mut self,
        check: &Check,
        now: Instant,
        Reading { at, value }: Reading,
        params: &Params,
    ) -> Option<Instant> {
        if !self.is_calm() {
            return None;
        }
        // A limit that is NaN is off: no comparison with it is true.
        let is_beyond = |limit: Option<Param>| {
            limit.map(|limit| params.get(limit)).is_some_and(|limit| match check.side {
                Side::Above => value > limit,
                Side::Below => value < limit,
            })
        };
        if is_beyond(check.warn) || is_beyond(check.critical) {
            return None;
        }
        // When what is never stale was measured counts once it is bad: then it is noted.
        let Some(limit) = check.stale_after else { return Some(now + REST_MAX) };
        let at = at.earlier(now);
        let seen = Stamp::at(at);
        if now.since(at) > limit {
            return None;
        }
        self.seen = seen;
        Some(at + limit)
    }

    /// Whether a step changes nothing but when it was measured, which is noted: it is good as it was for long, or it has no value, and
    /// never had one or is never stale. Until when that goes on with the same value; `None` where [`Self::step`] has more to do.
    #[inline]
    pub(super) fn rests(
        &mut self,
        check: &Check,
        instance: u8,
        inputs: &Inputs<'_>,
        how: How,
    ) -> Option<Instant> {
        let How { applies, quiet, latched } = how;
        if !quiet && !latched {
            self.held = None;
        }
        let reading = if applies { (check.read)(inputs, instance) } else { None };
        match reading.filter(|reading| reading.value.is_finite()) {
            Some(_) if quiet => None,
            Some(reading) => self.stays_calm(check, inputs.now, reading, inputs.params),
            None => {
                (self.is_new() || (applies && check.stale_after.is_none())).then(|| inputs.now + REST_MAX)
            }
        }
    }

    /// One step: at least every 50 ms.
    pub fn step(
        &mut self,
        check: &Check,
        now: Instant,
        reading: Option<Reading>,
        applies: bool,
        params: &Params,
    ) -> Option<Change> {
        if !applies {
            // What no longer applies is no longer bad, but it is not known to be good either: it has no level.
            let previous = self.level.filter(|level| *level != Level::Ok);
            *self = Self::new();
            return previous.map(|previous| Change {
                level: Level::Ok,
                previous,
                value: f32::NAN,
                limit: f32::NAN,
            });
        }
        let reading = reading.filter(|reading| reading.value.is_finite());
        if reading.is_some_and(|reading| self.stays_calm(check, now, reading, params).is_some()) {
            return None;
        }
        let seen = reading.map_or(self.seen, |reading| Stamp::at(reading.at.earlier(now)));
        let measured = core::mem::replace(&mut self.seen, seen) != seen;
        // A value that was measured once and no longer is grows old like one whose message stops.
        if self.stale_after(check).is_some_and(|limit| self.seen.older_than(now, limit)) {
            // Measurements that were bad still count: a stream may be slower than values stay fresh.
            let Self { level, samples, repeats, seen, .. } = *self;
            *self = Self { level, samples, repeats, seen, ..Self::new() };
            return self.go(Level::Stale, f32::NAN, f32::NAN);
        }
        self.judge(check, now, reading?.value, measured, params)
    }

    /// After a step, where levels are not to fall: a warning stays one, and what grew old comes back as what it was.
    pub(super) fn hold(&mut self, before: &Self, change: Option<Change>) -> Option<Change> {
        self.held = before.held;
        let change = change?;
        let known = [before.held, Some(change.previous), Some(change.level)];
        self.held = if known.contains(&Some(Level::Critical)) {
            Some(Level::Critical)
        } else {
            known.contains(&Some(Level::Warning)).then_some(Level::Warning)
        };
        match self.held {
            Some(held) if change.level != Level::Stale && change.level != held => {
                *self = Self { level: Some(held), held: Some(held), ..*before };
                (change.previous != held).then_some(Change { level: held, ..change })
            }
            _ => Some(change),
        }
    }

    /// The same as it was before a step, but for when its value was measured.
    pub(super) const fn seen_as(self, later: &Self) -> Self {
        Self { seen: later.seen, ..self }
    }

    /// How long it must be good before the level falls.
    fn clear(&self, check: &Check) -> Span {
        // What its detector ended is over: what it sees next is another mishap, and told.
        if check.subsystem == Subsystem::Mishap {
            return CLEAR;
        }
        let most = if check.when == When::Always { CLEAR_MAX_ALWAYS } else { CLEAR_MAX };
        self.repeats.grown(CLEAR).min(most)
    }

    /// How old the value may be. What is bad, and came back as bad after a pause of its stream, is given longer.
    fn stale_after(&self, check: &Check) -> Option<Span> {
        match self.level {
            Some(Level::Warning | Level::Critical) => {
                check.stale_after.map(|limit| self.repeats.grown(limit))
            }
            _ => check.stale_after,
        }
    }

    /// `measured`: the value was measured since the last step, and not only held.
    fn judge(
        &mut self,
        check: &Check,
        now: Instant,
        value: f32,
        measured: bool,
        params: &Params,
    ) -> Option<Change> {
        let level = self.level.unwrap_or(Level::Ok);
        let warn = check.warn.map_or(f32::NAN, |param| params.get(param));
        let critical = check.critical.map_or(f32::NAN, |param| params.get(param));
        // A limit that is NaN is off: no comparison with it is true.
        let beyond = |limit: f32, margin: f32| match check.side {
            Side::Above => value > limit - margin,
            Side::Below => value < limit + margin,
        };
        let very_bad = self.samples.count(Samples::VERY_BAD, beyond(critical, 0.0), measured)
            & self.very_bad.run(beyond(critical, 0.0), now, check.debounce_critical);
        // Without a warning limit there is no warning on the way to critical.
        let warned = beyond(warn, 0.0) || (!warn.is_nan() && beyond(critical, 0.0));
        let bad = self.samples.count(Samples::BAD, warned, measured)
            & self.bad.run(warned, now, check.debounce_warn);
        let undecided = self.bad.is_set() || self.very_bad.is_set();

        let held = match level {
            Level::Critical => beyond(critical, check.hysteresis),
            Level::Warning => beyond(warn, check.hysteresis) || beyond(critical, check.hysteresis),
            _ => false,
        };
        let better = self.better.run(!held, now, self.clear(check));
        let next = if very_bad || (level == Level::Critical && !better) {
            Level::Critical
        } else if bad || (level == Level::Warning && !better) {
            Level::Warning
        } else if undecided && matches!(self.level, None | Some(Level::Stale)) {
            // Bad, not yet for long enough, and nothing good is known from before.
            return None;
        } else {
            Level::Ok
        };
        self.go(next, value, check.limit(next, params))
    }

    /// Changes the level; the first time, good news is no news.
    fn go(&mut self, level: Level, value: f32, limit: f32) -> Option<Change> {
        let before = self.level.replace(level);
        let previous = before.unwrap_or(Level::Ok);
        if previous == level {
            return None;
        }
        self.repeats.note(previous, level);
        self.better = Stamp::NONE;
        Some(Change { level, previous, value, limit })
    }
}

#[cfg(test)]
mod tests;
