//! The mechanism of a check: a value against its limits, with debounce, hysteresis, a condition and the stale state.
//!
//! A check is data ([`Check`]) plus one pure function that reads its value; its memory is a [`State`].
//!
//! "Bad for `debounce`" takes time and samples: the value is beyond its limit for so long, and in [`SAMPLES`]
//! measurements of it. A slow stream holds its last value: that is one sample, however long it is held.
//!
//! ```text
//!            bad for `debounce`             silent for `stale_after`
//!      Ok ------------------------> Warning, Critical ----------> Stale
//!       ^ <------------------------                                 |
//!            good for `clear`                 heard again           |
//!       \-----------------------------------------------------------/
//! ```
//!
//! A value that goes up and down is one event, not many. [`CLEAR`] grows eightfold with each level that it rises to
//! again, up to [`CLEAR_MAX`], until the check no longer applies (landing, disarming). So does the time after which a
//! bad value is stale: a slow stream gives no new alarm with each message.

use core::num::NonZeroU8;

use super::finding::{Level, Subsystem};
use super::inputs::Inputs;
use super::suppression::Role;
use crate::bytes::fnv1a;
use crate::latest::Reading;
use crate::parameters::{Param, Params};
use crate::time::{BootMs, Millis, Stamp};

/// The bad side of a check's limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Values above the limit are bad.
    Above,
    /// Values below the limit are bad.
    Below,
}

/// The phase of a flight in which a check applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CheckPhase {
    /// Whenever its value is known.
    Always,
    /// While the motors may turn.
    Armed,
    /// From take-off to landing.
    InFlight,
}

impl CheckPhase {
    pub(super) const ALL: [Self; 3] = [Self::Always, Self::Armed, Self::InFlight];
}

/// Kind of part that the instance numbers count. Two checks with equal kind and instance concern one part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstanceKind {
    /// A single one, or parts whose numbers say nothing.
    Vehicle,
    /// Motors.
    Motor,
    /// Batteries.
    Battery,
    /// GNSS receivers.
    Receiver,
}

/// The unit of a check's value and limits, in a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unit(u8);

impl Unit {
    const NAMES: [&str; 19] = [
        "", "", "%", "1/min", "V", "deg", "deg/s", "degC", "frames", "g", "hPa", "m", "m/s", "m/s2", "ms",
        "rad/s", "rpm", "s", "times",
    ];

    /// A unit as it is written; empty for a plain number. A new one goes into `NAMES`.
    pub const fn of(name: &str) -> Self {
        let mut place = Self::FLAG.0 as usize + 1;
        while fnv1a(Self::NAMES[place]) != fnv1a(name) {
            place += 1;
        }
        Self(place as u8)
    }

    /// A flag, or the number of a state: the value tells a pilot nothing, and the alarm alone is sent. It is written like a plain number.
    pub const FLAG: Self = Self(0);

    /// Whether the value is a flag.
    pub const fn is_flag(self) -> bool {
        self.0 == Self::FLAG.0
    }

    /// As it is written.
    pub const fn name(self) -> &'static str {
        Self::NAMES[self.0 as usize]
    }
}

/// The limits of a check.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Which side of them is bad.
    pub side: Side,
    /// The limit of [`Level::Warning`].
    pub warn: Option<Param>,
    /// The limit of [`Level::Critical`].
    pub critical: Option<Param>,
    /// How far back on the good side of a limit the value must be to count as good again.
    pub hysteresis: f32,
}

impl Limits {
    pub(super) const fn above(warn: Option<Param>, critical: Option<Param>, hysteresis: f32) -> Self {
        Self { side: Side::Above, warn, critical, hysteresis }
    }

    pub(super) const fn below(warn: Option<Param>, critical: Option<Param>, hysteresis: f32) -> Self {
        Self { side: Side::Below, warn, critical, hysteresis }
    }

    /// A limit that is missing or off is NaN: no comparison with it is true.
    fn values(&self, params: &Params) -> [f32; 2] {
        [self.warn, self.critical].map(|limit| limit.map_or(f32::NAN, |param| params.get(param)))
    }

    fn is_beyond(&self, value: f32, limit: f32, margin: f32) -> bool {
        match self.side {
            Side::Above => value > limit - margin,
            Side::Below => value < limit + margin,
        }
    }
}

/// Reads the value of one of several.
pub type ValueReader = fn(&Inputs<'_>, u8) -> Option<Reading>;

/// One check.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Stable name, at most 16 characters of `a-z0-9_`.
    pub name: &'static str,
    /// The part of the vehicle.
    pub subsystem: Subsystem,
    /// The unit of value and limits.
    pub unit: Unit,
    /// Its limits.
    pub limits: Limits,
    /// How long it must be bad before it is a warning, and before it is critical, milliseconds: a minute at most.
    pub debounce_ms: [u16; 2],
    /// How long it must be bad before its warning is told, if that is longer, seconds; or [`Check::RECORDED`].
    pub told_after_s: u8,
    /// When the check applies.
    pub when: CheckPhase,
    /// How old the value may be, seconds; `None` for values that are ages themselves.
    pub stale_s: Option<NonZeroU8>,
    /// How many there may be.
    pub instances: u8,
    /// Its silence says nothing: a flag that is not set, a restart that did not happen. Such a check can make its part
    /// of the vehicle worse, and never by itself make it healthy.
    pub alarm_only: bool,
    /// Its place among causes.
    pub role: Role,
    /// What its instances are numbers of.
    pub of: InstanceKind,
    /// Reads the value; `None` while it has never been measured.
    pub read: ValueReader,
}

/// How long a value must be good before the level falls, so that a value at its limit does not flicker.
pub const CLEAR: Millis = Millis::from_secs(2);

/// The longest that it must be good, once it was bad again twice.
pub const CLEAR_MAX: Millis = Millis::from_secs(128);

/// The same for checks that apply on the ground too: they have no end of a flight to begin anew at.
pub const CLEAR_MAX_ALWAYS: Millis = Millis::from_secs(16);

const _: () = assert!(CLEAR.as_millis() << (3 * Repeats::MOST) == CLEAR_MAX.as_millis());

/// An alarm whose value is never stale is stale itself this long after its last value.
const UNSEEN: Millis = Millis::from_secs(15);

/// Bad measurements in a row that make an alarm: one wrong message is none.
pub const SAMPLES: u8 = 2;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Samples(u8);

impl Samples {
    const BAD: u8 = 0;
    const VERY_BAD: u8 = 4;

    fn count(&mut self, which: u8, bad: bool, measured: bool) -> bool {
        let before = self.0 >> which & 0xF;
        let count = if bad { (before + u8::from(measured || before == 0)).min(0xF) } else { 0 };
        self.0 = self.0 & !(0xF << which) | count << which;
        count >= SAMPLES
    }
}

/// How often a level was reached again, and the worst one that was reached, since the check began to apply. In a byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Repeats(u8);

impl Repeats {
    const MOST: u32 = 2;

    const fn count(self) -> u32 {
        self.0 as u32 & 3
    }

    /// Eightfold for each.
    fn grown(self, span: Millis) -> Millis {
        Millis::from_millis(span.as_millis() << (3 * self.count()))
    }

    fn note(&mut self, previous: Level, level: Level) {
        let rank = if level.alarm() > previous.alarm() { level.alarm() } else { 0 };
        let worst = self.0 >> 2 & 3;
        let again = u32::from(rank > 0 && rank <= worst);
        self.0 = (self.count() + again).min(Self::MOST) as u8 | worst.max(rank) << 2;
    }
}

#[derive(Clone, Copy)]
pub(super) struct CheckStep {
    pub(super) applies: bool,
    /// It would only echo a mishap: its level stays as it is.
    pub(super) quiet: bool,
    /// Levels do not fall.
    pub(super) latched: bool,
}

state! {
    /// The memory of one instance of a check.
    pub struct State {
        /// `None` until the value has been seen while the check applied.
        level: Option<Level>,
        /// The lowest level while levels are held: a warning or critical.
        pub(super) held: Option<Level>,
        samples: Samples = Samples(0),
        repeats: Repeats = Repeats(0),
        bad: Stamp,
        very_bad: Stamp,
        better: Stamp,
        seen: Stamp,
    }
}

const _: () = assert!(size_of::<State>() <= 20);
/// There are more than a hundred rows in flash.
const _: () = assert!(size_of::<Check>() <= if cfg!(target_pointer_width = "32") { 40 } else { 56 });

/// A change of level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LevelChange {
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
    /// The pilot gets no text of its warnings; record and report have them.
    pub const RECORDED: u8 = u8::MAX;

    /// How old the value may be; `None` for values that are ages themselves.
    pub fn stale_after(&self) -> Option<Millis> {
        self.stale_s.map(|seconds| Millis::from_secs(seconds.get().into()))
    }

    pub(super) fn limit(&self, level: Level, params: &Params) -> f32 {
        let [warn, critical] = self.limits.values(params);
        if level == Level::Critical || warn.is_nan() { critical } else { warn }
    }
}

impl State {
    /// The level, or `None` while the check has had nothing to say.
    pub const fn level(&self) -> Option<Level> {
        self.level
    }

    pub(super) fn has_alarm(&self) -> bool {
        self.level.is_some_and(|level| level.alarm() > 0)
    }

    /// Whether it has no alarm, or its value was bad for so long and is not good just now.
    pub(super) fn lasts(&self, now: BootMs, span: Millis) -> bool {
        !self.has_alarm() || (!self.better.is_set() && self.bad.age(now).unwrap_or(Millis::ZERO) >= span)
    }

    /// Whether it never had a value since it began to apply, nor a level: then a step without a value changes nothing.
    pub(super) fn is_new(&self) -> bool {
        self.level.is_none() && self.held.is_none() && !self.seen.is_set()
    }

    fn is_calm(&self) -> bool {
        let counts = self.bad.is_set() || self.very_bad.is_set() || self.samples != Samples(0);
        self.level == Some(Level::Ok) && self.better.is_set() && !counts
    }

    /// One step of a good value that was good before, as nearly every step is: notes when it was measured. `false` if
    /// [`Self::step`] has more to do.
    #[inline]
    pub(super) fn stays_good(
        &mut self,
        check: &Check,
        now: BootMs,
        reading: Reading,
        params: &Params,
    ) -> bool {
        let Reading { at, value } = reading;
        let is_beyond = |limit| check.limits.is_beyond(value, limit, 0.0);
        if !self.is_calm() || !value.is_finite() || check.limits.values(params).into_iter().any(is_beyond) {
            return false;
        }
        let at = at.earlier(now);
        if check.stale_after().is_some_and(|limit| now.since(at) > limit) {
            return false;
        }
        self.seen = Stamp::at(at);
        true
    }

    pub(super) fn see(&mut self, now: BootMs, reading: Option<Reading>) {
        if let Some(reading) = reading.filter(|reading| reading.value.is_finite()) {
            self.seen = Stamp::at(reading.at.earlier(now));
        }
    }

    /// One step: at least every 50 ms.
    pub fn step(
        &mut self,
        check: &Check,
        now: BootMs,
        reading: Option<Reading>,
        applies: bool,
        params: &Params,
    ) -> Option<LevelChange> {
        if !applies {
            // A check that no longer applies is neither bad nor known to be good: it has no level.
            let previous = self.level.filter(|level| *level != Level::Ok);
            *self = Self::default();
            return previous.map(|previous| LevelChange {
                level: Level::Ok,
                previous,
                value: f32::NAN,
                limit: f32::NAN,
            });
        }
        let reading = reading.filter(|reading| reading.value.is_finite());
        let seen = reading.map_or(self.seen, |reading| Stamp::at(reading.at.earlier(now)));
        let measured = core::mem::replace(&mut self.seen, seen) != seen;
        // A value that was measured once and no longer is grows old like one whose message stops.
        if self.stale_after(check).is_some_and(|limit| self.seen.older_than(now, limit)) {
            // Measurements that were bad still count: a stream may be slower than values stay fresh.
            let Self { level, samples, repeats, seen, .. } = *self;
            *self = Self { level, samples, repeats, seen, ..Self::default() };
            return self.go(Level::Stale, f32::NAN, f32::NAN);
        }
        self.judge(check, now, reading?.value, measured, params)
    }

    /// After a step, where levels are not to fall: a warning stays one, and what grew old comes back as what it was.
    pub(super) fn hold(&mut self, before: &Self, change: Option<LevelChange>) -> Option<LevelChange> {
        self.held = before.held;
        let change = change?;
        let known = [before.held, Some(change.previous), Some(change.level)].into_iter().flatten();
        self.held = known.filter(|level| level.alarm() > 0).max_by_key(|level| level.alarm());
        match self.held {
            Some(held) if change.level != Level::Stale && change.level != held => {
                *self = Self { level: Some(held), held: Some(held), ..*before };
                (change.previous != held).then_some(LevelChange { level: held, ..change })
            }
            _ => Some(change),
        }
    }

    fn clear(&self, check: &Check) -> Millis {
        // The detector ends a mishap. The next sign is a new mishap, and reported.
        if check.subsystem == Subsystem::Mishap {
            return CLEAR;
        }
        let most = if check.when == CheckPhase::Always { CLEAR_MAX_ALWAYS } else { CLEAR_MAX };
        self.repeats.grown(CLEAR).min(most)
    }

    /// How old the value may be. An alarm that came back after a pause of its stream has more time.
    fn stale_after(&self, check: &Check) -> Option<Millis> {
        // Also of a value that is never stale: without its input it has none.
        let grown = || self.repeats.grown(check.stale_after().unwrap_or(UNSEEN));
        if self.has_alarm() { Some(grown()) } else { check.stale_after() }
    }

    /// `measured`: the value was measured since the last step, and not only held.
    fn judge(
        &mut self,
        check: &Check,
        now: BootMs,
        value: f32,
        measured: bool,
        params: &Params,
    ) -> Option<LevelChange> {
        let level = self.level.unwrap_or(Level::Ok);
        let [warn, critical] = check.limits.values(params);
        let beyond = |limit: f32, margin: f32| check.limits.is_beyond(value, limit, margin);
        let [debounce_warn, debounce_critical] = check.debounce_ms.map(|ms| Millis::from_millis(ms.into()));
        let very_bad = self.samples.count(Samples::VERY_BAD, beyond(critical, 0.0), measured)
            & self.very_bad.run(beyond(critical, 0.0), now, debounce_critical);
        // Without a warning limit no warning precedes critical.
        let warned = beyond(warn, 0.0) || (!warn.is_nan() && beyond(critical, 0.0));
        let bad =
            self.samples.count(Samples::BAD, warned, measured) & self.bad.run(warned, now, debounce_warn);
        let undecided = self.bad.is_set() || self.very_bad.is_set();

        let held = match level {
            Level::Critical => beyond(critical, check.limits.hysteresis),
            Level::Warning => {
                beyond(warn, check.limits.hysteresis) || beyond(critical, check.limits.hysteresis)
            }
            _ => false,
        };
        let better = self.better.run(!held, now, self.clear(check));
        let next = if very_bad || (level == Level::Critical && !better) {
            Level::Critical
        } else if bad || (level == Level::Warning && !better) {
            Level::Warning
        } else if undecided && matches!(self.level, None | Some(Level::Stale)) {
            // Bad for too short a time, and never good before.
            return None;
        } else {
            Level::Ok
        };
        self.go(next, value, check.limit(next, params))
    }

    fn go(&mut self, level: Level, value: f32, limit: f32) -> Option<LevelChange> {
        let before = self.level.replace(level);
        let previous = before.unwrap_or(Level::Ok);
        if previous == level {
            return None;
        }
        self.repeats.note(previous, level);
        self.better = Stamp::NONE;
        Some(LevelChange { level, previous, value, limit })
    }
}

#[cfg(test)]
mod tests;
