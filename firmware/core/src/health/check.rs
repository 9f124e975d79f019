//! The mechanism of a check: a value against its limits, with debounce, hysteresis, a condition and the stale state.
//!
//! A check is data ([`Check`]) plus one pure function that reads its value; its memory is a [`State`]. Adding a check
//! is one entry in its subsystem's table and one function.
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
    bad: Stamp,
    very_bad: Stamp,
    better: Stamp,
    /// When the value was measured last.
    seen: Stamp,
}

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
        Self { level: None, bad: Stamp::NONE, very_bad: Stamp::NONE, better: Stamp::NONE, seen: Stamp::NONE }
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
        self.seen = reading.map_or(self.seen, |reading| Stamp::at(reading.at.min(now)));
        // A value that was measured once and no longer is grows old like one whose message stops.
        if check.stale_after.is_some_and(|limit| self.seen.older_than(now, limit)) {
            *self = Self { level: self.level, seen: self.seen, ..Self::new() };
            return self.go(Level::Stale, f32::NAN, f32::NAN);
        }
        self.judge(check, now, reading?.value, params)
    }

    fn judge(&mut self, check: &Check, now: Instant, value: f32, params: &Params) -> Option<Change> {
        let level = self.level.unwrap_or(Level::Ok);
        let warn = check.warn.map_or(f32::NAN, |param| params.get(param));
        let critical = check.critical.map_or(f32::NAN, |param| params.get(param));
        // A limit that is NaN is off: no comparison with it is true.
        let beyond = |limit: f32, margin: f32| match check.side {
            Side::Above => value > limit - margin,
            Side::Below => value < limit + margin,
        };
        let very_bad = self.very_bad.run(beyond(critical, 0.0), now, check.debounce_critical);
        // Without a warning limit there is no warning on the way to critical.
        let warned = beyond(warn, 0.0) || (!warn.is_nan() && beyond(critical, 0.0));
        let bad = self.bad.run(warned, now, check.debounce_warn);
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

#[cfg(test)]
mod tests {
    use super::*;

    const _: () = assert!(size_of::<State>() <= 20);

    const CHECK: Check = Check {
        name: "tilt",
        words: "tilt",
        subsystem: Subsystem::Attitude,
        unit: "deg",
        side: Side::Above,
        warn: Some(Param::TiltWarn),
        critical: Some(Param::TiltCrit),
        hysteresis: 5.0,
        debounce_warn: Span::from_millis(500),
        debounce_critical: Span::from_millis(200),
        when: When::Always,
        stale_after: Some(Span::from_secs(1)),
        instances: 1,
        alarm_only: false,
        read: |_, _| None,
    };

    /// Steps every 50 ms through (milliseconds, value) and gives (milliseconds, level) of each change.
    fn run(check: &Check, values: &[(u64, f32)]) -> Vec<(u64, Level)> {
        let params = Params::defaults();
        let mut state = State::new();
        let mut changes = Vec::new();
        let mut now_ms = 0;
        for (until_ms, value) in values {
            while now_ms < *until_ms {
                let now = Instant::from_millis(now_ms);
                let reading = Some(Reading { at: now, value: *value });
                changes.extend(
                    state.step(check, now, reading, true, &params).map(|change| (now_ms, change.level)),
                );
                now_ms += 50;
            }
        }
        changes
    }

    #[test]
    fn a_level_rises_after_its_debounce_and_falls_after_the_clear_time() {
        let changes = run(&CHECK, &[(1_000, 10.0), (3_000, 50.0), (4_000, 70.0), (10_000, 10.0)]);
        let expected = [(1_500, Level::Warning), (3_200, Level::Critical), (6_000, Level::Ok)];
        assert_eq!(changes, expected);
    }

    #[test]
    fn a_short_excursion_is_no_finding() {
        assert_eq!(run(&CHECK, &[(1_000, 10.0), (1_450, 50.0), (5_000, 10.0)]), []);
    }

    #[test]
    fn within_the_hysteresis_the_level_stays() {
        let changes = run(&CHECK, &[(1_000, 50.0), (20_000, 42.0), (30_000, 39.0)]);
        assert_eq!(changes, [(500, Level::Warning), (22_000, Level::Ok)]);
    }

    #[test]
    fn a_side_below_mirrors_everything() {
        let below = Check {
            side: Side::Below,
            warn: Some(Param::CellVoltWarn),
            critical: Some(Param::CellVoltCrit),
            hysteresis: 0.05,
            ..CHECK
        };
        let changes = run(&below, &[(1_000, 3.8), (3_000, 3.55), (4_000, 3.4), (10_000, 3.9)]);
        assert_eq!(changes, [(1_500, Level::Warning), (3_200, Level::Critical), (6_000, Level::Ok)]);
    }

    #[test]
    fn silence_is_stale_and_not_healthy() {
        let params = Params::defaults();
        let mut state = State::new();
        let reading = Some(Reading { at: Instant::ZERO, value: 1.0 });
        assert_eq!(state.step(&CHECK, Instant::ZERO, reading, true, &params), None);
        assert_eq!(state.level(), Some(Level::Ok));
        let late = Instant::from_millis(1_050);
        let change = state.step(&CHECK, late, reading, true, &params).expect("it is stale");
        assert_eq!((change.level, change.previous), (Level::Stale, Level::Ok));
        assert_eq!(state.step(&CHECK, late, reading, true, &params), None, "said once");
        let fresh = Some(Reading { at: late, value: 1.0 });
        let change = state.step(&CHECK, late, fresh, true, &params).expect("it is back");
        assert_eq!((change.level, change.previous), (Level::Ok, Level::Stale));
    }

    #[test]
    fn what_was_never_seen_or_is_no_number_is_not_ok() {
        let params = Params::defaults();
        let mut state = State::new();
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let reading = Some(Reading { at: Instant::ZERO, value });
            assert_eq!(state.step(&CHECK, Instant::ZERO, reading, true, &params), None);
        }
        assert_eq!(state.step(&CHECK, Instant::ZERO, None, true, &params), None);
        assert_eq!(state.level(), None);
    }

    #[test]
    fn a_value_that_is_no_longer_given_grows_stale_and_bad_news_after_that_is_never_ok() {
        let params = Params::defaults();
        let mut state = State::new();
        let mut levels = Vec::new();
        for now_ms in (0..5_000).step_by(50) {
            let now = Instant::from_millis(now_ms);
            let value = if now_ms < 1_000 { Some(10.0) } else { (now_ms >= 3_000).then_some(70.0) };
            let reading = value.map(|value| Reading { at: now, value });
            let change = state.step(&CHECK, now, reading, true, &params);
            levels.extend(change.map(|change| (now_ms, change.level)));
        }
        assert_eq!(levels, [(2_000, Level::Stale), (3_200, Level::Critical)]);
    }

    #[test]
    fn a_first_value_that_is_bad_is_not_ok_while_it_is_debounced() {
        let params = Params::defaults();
        let mut state = State::new();
        let reading = Some(Reading { at: Instant::ZERO, value: 50.0 });
        assert_eq!(state.step(&CHECK, Instant::ZERO, reading, true, &params), None);
        assert_eq!(state.level(), None);
    }

    #[test]
    fn debounce_and_staleness_hold_across_the_end_of_the_counter_of_milliseconds() {
        let params = Params::defaults();
        let mut state = State::new();
        let mut levels = Vec::new();
        let start_ms = u64::from(u32::MAX) - 1_050;
        for after_ms in (0..5_000).step_by(50) {
            let now = Instant::from_millis(start_ms + after_ms);
            let value = if after_ms < 500 { 10.0 } else { 50.0 };
            let reading = (after_ms < 2_000).then_some(Reading { at: now, value });
            let change = state.step(&CHECK, now, reading, true, &params);
            levels.extend(change.map(|change| (after_ms, change.level)));
        }
        assert_eq!(levels, [(1_000, Level::Warning), (3_000, Level::Stale)]);
    }

    #[test]
    fn a_value_that_came_after_the_step_began_is_fresh() {
        let params = Params::defaults();
        let mut state = State::new();
        let reading = Some(Reading { at: Instant::from_millis(70), value: 10.0 });
        assert_eq!(state.step(&CHECK, Instant::from_millis(50), reading, true, &params), None);
        assert_eq!(state.level(), Some(Level::Ok));
    }

    #[test]
    fn a_check_without_a_warning_limit_never_warns() {
        let check = Check { warn: None, debounce_critical: Span::from_secs(60), ..CHECK };
        let changes = run(&check, &[(1_000, 10.0), (62_000, 70.0)]);
        assert_eq!(changes, [(61_000, Level::Critical)]);
    }

    #[test]
    fn what_does_not_apply_has_no_level() {
        let params = Params::defaults();
        let mut state = State::new();
        let reading = Some(Reading { at: Instant::ZERO, value: 10.0 });
        state.step(&CHECK, Instant::ZERO, reading, true, &params);
        assert_eq!(state.level(), Some(Level::Ok));
        assert_eq!(state.step(&CHECK, Instant::ZERO, reading, false, &params), None);
        assert_eq!(state.level(), None);
    }

    #[test]
    fn what_no_longer_applies_is_no_longer_bad() {
        let params = Params::defaults();
        let mut state = State::new();
        for now_ms in (0..1_000).step_by(50) {
            let now = Instant::from_millis(now_ms);
            state.step(&CHECK, now, Some(Reading { at: now, value: 50.0 }), true, &params);
        }
        assert_eq!(state.level(), Some(Level::Warning));
        let change =
            state.step(&CHECK, Instant::from_millis(1_000), None, false, &params).expect("it clears");
        assert_eq!(change.level, Level::Ok);
    }
}
