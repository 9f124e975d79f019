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

use core::num::NonZeroU32;

use super::finding::{Level, Subsystem};
use super::inputs::Inputs;
use crate::latest::Reading;
use crate::params::{Param, Params};
use crate::time::{Instant, Span};

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

/// One check.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Stable name, at most 16 characters of `a-z0-9_`.
    pub name: &'static str,
    /// What it means, in a few words that a pilot understands.
    pub words: &'static str,
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
    /// Reads the value; `None` while it has never been measured.
    pub read: fn(&Inputs<'_>, u8) -> Option<Reading>,
}

/// How long a value must be good before the level falls, so that a value at its limit does not flicker.
pub const CLEAR: Span = Span::from_secs(2);

/// Measurements that have to be bad, one after the other: one message of nonsense is no alarm.
pub const SAMPLES: u8 = 2;

/// A point in time in four bytes, because there are some 140 states: milliseconds modulo 2^32, and never zero. What is
/// measured from it is far shorter than the 49.7 days after which it would be mistaken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Stamp(Option<NonZeroU32>);

impl Stamp {
    const NONE: Self = Self(None);

    const fn at(at: Instant) -> Self {
        match NonZeroU32::new(at.as_millis() as u32) {
            Some(millis) => Self(Some(millis)),
            // A millisecond earlier.
            None => Self(Some(NonZeroU32::MAX)),
        }
    }

    const fn is_set(self) -> bool {
        self.0.is_some()
    }

    /// Whether it is set and more than `span` ago.
    fn older_than(self, now: Instant, span: Span) -> bool {
        self.age_ms(now).is_some_and(|age_ms| age_ms > span.as_millis())
    }

    fn age_ms(self, now: Instant) -> Option<u64> {
        Some(u64::from((now.as_millis() as u32).wrapping_sub(self.0?.get())))
    }

    /// Runs while `on`; whether it has run for `span`.
    fn run(&mut self, on: bool, now: Instant, span: Span) -> bool {
        if !on {
            *self = Self::NONE;
            return false;
        }
        if !self.is_set() {
            *self = Self::at(now);
        }
        self.age_ms(now).is_some_and(|age_ms| age_ms >= span.as_millis())
    }
}

/// The memory of one instance of a check.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    /// `None` until the value has been seen while the check applied.
    level: Option<Level>,
    /// What it does not fall below, while levels are held: a warning or a critical level.
    held: Option<Level>,
    /// Measurements in a row beyond the warning's limit, and beyond the critical one.
    bad_samples: u8,
    very_bad_samples: u8,
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

impl State {
    /// Nothing seen yet.
    pub const fn new() -> Self {
        Self {
            level: None,
            held: None,
            bad_samples: 0,
            very_bad_samples: 0,
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
        let seen = reading.map_or(self.seen, |reading| Stamp::at(reading.at.min(now)));
        let measured = core::mem::replace(&mut self.seen, seen) != seen;
        // A value that was measured once and no longer is grows old like one whose message stops.
        if check.stale_after.is_some_and(|limit| self.seen.older_than(now, limit)) {
            // Measurements that were bad still count: a stream may be slower than values stay fresh.
            let Self { level, bad_samples, very_bad_samples, seen, .. } = *self;
            *self = Self { level, bad_samples, very_bad_samples, seen, ..Self::new() };
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

    /// After a step, where levels may fall.
    pub(super) const fn release(&mut self, change: Option<Change>) -> Option<Change> {
        self.held = None;
        change
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
        let very_bad = count(&mut self.very_bad_samples, beyond(critical, 0.0), measured)
            & self.very_bad.run(beyond(critical, 0.0), now, check.debounce_critical);
        // Without a warning limit there is no warning on the way to critical.
        let warned = beyond(warn, 0.0) || (!warn.is_nan() && beyond(critical, 0.0));
        let bad =
            count(&mut self.bad_samples, warned, measured) & self.bad.run(warned, now, check.debounce_warn);
        let undecided = self.bad.is_set() || self.very_bad.is_set();

        let held = match level {
            Level::Critical => beyond(critical, check.hysteresis),
            Level::Warning => beyond(warn, check.hysteresis) || beyond(critical, check.hysteresis),
            _ => false,
        };
        let better = self.better.run(!held, now, CLEAR);
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
        let limit = if next == Level::Critical || warn.is_nan() { critical } else { warn };
        self.go(next, value, limit)
    }

    /// Changes the level; the first time, good news is no news.
    fn go(&mut self, level: Level, value: f32, limit: f32) -> Option<Change> {
        let before = self.level.replace(level);
        let previous = before.unwrap_or(Level::Ok);
        if previous == level {
            return None;
        }
        self.better = Stamp::NONE;
        Some(Change { level, previous, value, limit })
    }
}

/// Counts measurements that are bad one after the other; whether there were enough.
fn count(samples: &mut u8, bad: bool, measured: bool) -> bool {
    *samples = if bad { samples.saturating_add(u8::from(measured || *samples == 0)) } else { 0 };
    *samples >= SAMPLES
}

#[cfg(test)]
mod tests;
