//! A recording's clock: never falls, and finds invalid times.
//!
//! Every format with recorded times uses it, message by message. A time within a second of the latest one
//! counts; an earlier one is a reordering. Any other is a jump, and goes to [`super::doubt`]: it is wrong, or
//! a pause, or the clock began again.
//!
//! **Old values.** A `ULog` begins with each topic's last value, perhaps minutes old. For a format with such
//! values ([`Rules::old_values`]), a time that is behind is *old*, not wrong. It is wrong only if also behind
//! its own series. An old time counts as now, and is no witness for others.

use hums_core::clock::Instant;

use super::doubt::{DISORDER_US, Ends, Question, RUN, Time};
use super::item::Gap;
use super::timeline::{Moment, STEP_BACK_US_MAX, STEP_FORWARD_US_MAX, Timeline};
use crate::plural::count;

/// Steady messages come at least this often ...
const STEADY_US: u64 = 500_000;
/// ... for this many in a row.
const STEADY_MIN: u8 = 32;
/// This many messages of a series without a later time: the clock stands still.
const STILL_MIN: u8 = 100;
/// Times needed, most of them before a log's beginning, to call that wrong.
pub const BEGINNING_ASKED: usize = 64;
/// Followed series; further ones count as rare.
const SERIES_MAX: usize = 65_537;

/// A time in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stamp {
    /// Microseconds, by the recording's clock.
    pub us: u64,
    /// A type of message or topic. Small.
    pub series: usize,
}

/// Times after a message in the file.
#[derive(Clone, Debug, Default)]
pub struct LaterTimes {
    /// Up to [`super::doubt::ASKED`] of the requested ones.
    pub stamps: Vec<Stamp>,
    /// No times follow.
    pub is_end: bool,
}

/// Differences between formats.
#[derive(Clone, Copy, Debug)]
pub struct Rules {
    /// The first time is zero; otherwise times count from a power-on.
    pub from_first: bool,
    /// A time behind may be an old value.
    pub old_values: bool,
    /// Rules for the ends.
    pub ends: Ends,
}

/// A log's recorded start, and whether it is wrong: most of its first times are before it, or a day behind
/// it. Then the time shared by many counts.
pub fn beginning(told: u64, first: &[u64], is_end: bool) -> (u64, bool) {
    let fits = |time: u64| {
        time.saturating_add(STEP_BACK_US_MAX) >= told && time <= told.saturating_add(STEP_FORWARD_US_MAX)
    };
    let first: Vec<u64> = first.iter().copied().filter(|time| *time > 0).collect();
    let enough = if is_end { RUN as usize + 1 } else { BEGINNING_ASKED };
    let fitting = first.iter().filter(|time| fits(**time)).count();
    if first.len() < enough || fitting * 4 > first.len() {
        return (told, false);
    }
    // Those of the log follow each other.
    let followed = |time: u64| {
        first.iter().filter(|other| (time..=time.saturating_add(STEP_BACK_US_MAX)).contains(*other)).count()
    };
    let most = first.iter().map(|time| followed(*time)).max().unwrap_or(0);
    let began = first.iter().copied().filter(|time| followed(*time) * 2 >= most).min();
    (began.unwrap_or(told), true)
}

/// Validity of a message's time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// It counts.
    Sound(Moment),
    /// Counts as now.
    Old,
    /// Contradicted by the times around it.
    Wrong {
        /// An earlier time of the series counted.
        known: bool,
    },
}

#[derive(Clone, Copy, Debug, Default)]
struct Series {
    /// Old or not.
    last_us: Option<u64>,
    steady: u8,
    /// Messages without a later time while the recording's time was this one.
    still: u8,
    still_at: Option<u64>,
    /// One has counted.
    known: bool,
}

/// Follows the times of a recording.
#[derive(Clone, Debug)]
pub struct Clock {
    rules: Rules,
    timeline: Timeline,
    begun: bool,
    series: Vec<Series>,
    steps: Steps,
}

#[derive(Clone, Copy, Debug, Default)]
struct Steps {
    last_us: [u64; RUN as usize],
    count: u64,
}

impl Steps {
    fn add(&mut self, step_us: u64) {
        let place = (self.count % RUN as u64) as usize;
        if let Some(last) = self.last_us.get_mut(place) {
            *last = step_us;
        }
        self.count += 1;
    }

    /// The largest of the last steps. With few, the median of those and the following ones.
    fn usual_us(&self, before: Option<u64>, times: &[Time]) -> u64 {
        let last = self.last_us.get(..self.count as usize).unwrap_or(&self.last_us);
        if self.count >= RUN as u64 {
            return last.iter().copied().max().unwrap_or(0);
        }
        let times = || before.into_iter().chain(times.iter().map(|time| time.us));
        let follow = times().zip(times().skip(1)).map(|(one, next)| next.saturating_sub(one));
        let mut all: Vec<u64> = last.iter().copied().chain(follow).collect();
        all.sort_unstable();
        all.get(all.len().saturating_sub(1) / 2).copied().unwrap_or(0)
    }
}

impl Clock {
    /// Before the first time.
    pub const fn new(rules: Rules) -> Self {
        let steps = Steps { last_us: [0; RUN as usize], count: 0 };
        Self { rules, timeline: Timeline::new(), begun: false, series: Vec::new(), steps }
    }

    /// The first time, by a search.
    pub fn begin(&mut self, us: u64) {
        self.timeline.at(us);
    }

    /// Beginning by the log itself; `true` if another log came before, from which time goes on.
    pub fn begin_log(&mut self, us: u64) -> bool {
        let again = self.timeline.recorded_us().is_some();
        if again {
            self.timeline.begin_again(us);
        } else {
            self.timeline.at(us);
        }
        self.series.clear();
        again
    }

    /// At a jump `ahead` gives the next stamps that its argument accepts.
    pub fn take(
        &mut self,
        stamp: Stamp,
        ahead: impl FnOnce(&dyn Fn(Stamp) -> bool) -> LaterTimes,
    ) -> Reading {
        self.take_beside(stamp, ahead, || None)
    }

    /// Beside a clock that knows the passed time better. At a valid jump, `passed` returns microseconds if
    /// this clock was set.
    pub fn take_beside(
        &mut self,
        stamp: Stamp,
        ahead: impl FnOnce(&dyn Fn(Stamp) -> bool) -> LaterTimes,
        passed: impl FnOnce() -> Option<u64>,
    ) -> Reading {
        if !self.timeline.is_jump(stamp.us) {
            return Reading::Sound(self.count(stamp, None));
        }
        if self.is_old(stamp) {
            self.note(stamp);
            return Reading::Old;
        }
        let ahead = ahead(&|stamp| !self.is_old(stamp));
        let time = |stamp: &Stamp| Time { us: stamp.us, steady: self.is_steady(stamp.series) };
        let times: Vec<Time> = std::iter::once(&stamp).chain(&ahead.stamps).map(time).collect();
        let before = self.timeline.recorded_us();
        let (ends, usual_us) = (self.rules.ends, self.steps.usual_us(before, &times));
        let question = Question { before, times: &times, is_end: ahead.is_end, ends, usual_us };
        if !question.is_wrong() {
            return Reading::Sound(self.count(stamp, passed()));
        }
        let known = self.series(stamp.series).known;
        if self.rules.old_values && before.is_some_and(|before| stamp.us < before) {
            // A topic that falls back to an old value stays there.
            self.note(stamp);
        }
        Reading::Wrong { known }
    }

    /// A valid time; after a set clock, this much time passed.
    fn count(&mut self, stamp: Stamp, passed_us: Option<u64>) -> Moment {
        if self.rules.from_first && !self.begun {
            self.timeline = Timeline::from_first(stamp.us);
        }
        let before = self.timeline.recorded_us();
        let moment = match passed_us {
            Some(passed_us) => self.timeline.set(stamp.us, passed_us),
            None => self.timeline.at(stamp.us),
        };
        if moment.restarted {
            self.series.clear();
            self.steps = Steps::default();
        } else if let Some(before) = before.filter(|_| self.begun) {
            self.steps.add(stamp.us.saturating_sub(before));
        }
        self.begun = true;
        if let Some(series) = self.note(stamp) {
            series.known = true;
        }
        moment
    }

    fn note(&mut self, stamp: Stamp) -> Option<&mut Series> {
        if stamp.series >= self.series.len() && stamp.series < SERIES_MAX {
            self.series.resize(stamp.series + 1, Series::default());
        }
        let now = self.timeline.recorded_us();
        let series = self.series.get_mut(stamp.series)?;
        let stands = series.still_at == now && series.last_us.is_some_and(|last| stamp.us <= last);
        series.still = if stands { series.still.saturating_add(1) } else { 1 };
        series.still_at = now;
        let goes_on = series.last_us.is_some_and(|last| stamp.us.saturating_sub(last) <= STEADY_US);
        series.steady = if goes_on { series.steady.saturating_add(1) } else { 0 };
        series.last_us = Some(stamp.us);
        Some(series)
    }

    fn series(&self, series: usize) -> Series {
        self.series.get(series).copied().unwrap_or_default()
    }

    fn is_old(&self, stamp: Stamp) -> bool {
        let Some(now) = self.timeline.recorded_us().filter(|_| self.rules.old_values) else { return false };
        let last_us = self.series(stamp.series).last_us;
        stamp.us.saturating_add(STEP_BACK_US_MAX) < now
            && last_us.is_none_or(|last| stamp.us.saturating_add(DISORDER_US) >= last)
    }

    /// A clock that stands or runs backwards, by this series.
    pub fn stands(&self, series: usize) -> bool {
        self.series(series).still >= STILL_MIN
    }

    fn is_steady(&self, series: usize) -> bool {
        let series = self.series(series);
        series.steady >= STEADY_MIN
            && series
                .last_us
                .zip(self.timeline.recorded_us())
                .is_some_and(|(last, now)| last.saturating_add(STEADY_US) >= now)
    }

    /// Whether a valid time has come.
    pub const fn has_begun(&self) -> bool {
        self.begun
    }

    /// Time that no recorded time shows.
    pub fn pass(&mut self, us: u64) {
        self.timeline.pass(us);
    }

    /// The latest time.
    pub fn now(&self) -> Instant {
        self.timeline.now()
    }

    /// The latest, as recorded.
    pub const fn recorded_us(&self) -> Option<u64> {
        self.timeline.recorded_us()
    }
}

/// Messages with a wrong time: their number, and the first one's place.
#[derive(Clone, Copy, Debug, Default)]
pub struct WrongTimes {
    count: u64,
    first: Option<(Instant, u64)>,
}

impl WrongTimes {
    /// Counts a message at this byte of the recording.
    pub fn add(&mut self, at: Instant, place: u64) {
        self.count += 1;
        self.first.get_or_insert((at, place));
    }

    /// Damage, if any.
    pub fn gap(&self) -> Option<Gap> {
        let (at, place) = self.first?;
        let words =
            format!("{} with a wrong time, far from the times around it", count(self.count, "message"));
        Some(Gap::damaged(at, place, words))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000;
    const RULES: Rules = Rules {
        from_first: false,
        old_values: true,
        ends: Ends { steady_us: SECOND, seldom_us: 3_600 * SECOND },
    };

    /// Latest time in seconds, and validity of each.
    fn read(clock: &mut Clock, stamps: &[(usize, f64)]) -> (f64, String) {
        let stamps: Vec<Stamp> = stamps
            .iter()
            .map(|&(series, seconds)| Stamp { us: (seconds * 1e6).round() as u64, series })
            .collect();
        let mut worth = String::new();
        for (index, &stamp) in stamps.iter().enumerate() {
            let rest = stamps.get(index + 1..).unwrap_or_default();
            let ahead = |asks: &dyn Fn(Stamp) -> bool| LaterTimes {
                stamps: rest.iter().copied().filter(|stamp| asks(*stamp)).take(24).collect(),
                is_end: rest.len() <= 24,
            };
            worth.push(match clock.take(stamp, ahead) {
                Reading::Sound(Moment { restarted: false, .. }) => '.',
                Reading::Sound(_) => 'R',
                Reading::Old => 'o',
                Reading::Wrong { .. } => 'W',
            });
        }
        (clock.now().as_secs_f64(), worth)
    }

    #[test]
    fn old_values_at_a_logs_beginning_count_as_now_and_a_wrong_time_between_them_is_seen() {
        let mut clock = Clock::new(RULES);
        clock.begin_log(60 * SECOND);
        let first = [(1, 3.0), (2, 60.1), (3, 8.5), (4, 65.1), (3, 9.0), (5, 60.1), (6, 60.2), (2, 60.2)];
        let more = (0..30).map(|index| (2, 60.3 + f64::from(index) / 100.0));
        let (end, worth) = read(&mut clock, &first.into_iter().chain(more).collect::<Vec<_>>());
        assert_eq!((end, &worth[..8]), (60.59, "o.oWo..."));
        assert!(worth[8..].chars().all(|worth| worth == '.'), "{worth}");
    }

    #[test]
    fn a_topic_that_falls_behind_its_own_time_is_wrong_once_and_old_from_then_on() {
        let mut clock = Clock::new(RULES);
        let stamps: Vec<(usize, f64)> = (0..100)
            .flat_map(|index| {
                let now = 60.0 + f64::from(index) / 50.0;
                [(1, now), (2, if index < 50 { now } else { 7.0 })]
            })
            .collect();
        let (end, worth) = read(&mut clock, &stamps);
        assert_eq!((end, worth.matches('W').count(), worth.matches('o').count()), (61.98, 1, 49), "{worth}");
        assert_eq!(worth.matches('R').count(), 0);
    }

    #[test]
    fn a_clock_that_falls_for_good_is_a_restart_though_some_topics_are_slow() {
        for fall in [1.05, 1.5, 5.0, 59.0] {
            let mut clock = Clock::new(RULES);
            let stamps: Vec<(usize, f64)> = (0..200)
                .flat_map(|index| {
                    let now = 60.0 + f64::from(index) / 50.0 - if index < 100 { 0.0 } else { fall };
                    let slow = (index % 60 == 0).then_some((2, now - 0.003));
                    [Some((1, now)), slow].into_iter().flatten().collect::<Vec<_>>()
                })
                .collect();
            let (end, worth) = read(&mut clock, &stamps);
            assert_eq!(worth.matches('R').count(), 1, "{fall} {worth}");
            assert!((end - 63.96).abs() < 0.03, "{fall} {end}");
        }
    }

    #[test]
    fn a_beginning_that_all_times_are_before_is_wrong_and_one_that_some_follow_is_not() {
        let first: Vec<u64> = (0..100).map(|index| 60 * SECOND + index * 1_000).collect();
        for (began, wrong) in [(60, false), (50, false), (68, true)] {
            let (at, is_wrong) = beginning(began * SECOND, &first, false);
            assert_eq!((at == began * SECOND, is_wrong), (!wrong, wrong), "{began}");
            assert!(!is_wrong || first.contains(&at));
        }
        assert!(beginning(SECOND, &first.iter().map(|time| time + (1 << 50)).collect::<Vec<_>>(), false).1);
        assert!(!beginning(68 * SECOND, &first[..20], false).1, "they may be old");
        assert!(beginning(68 * SECOND, &first[..20], true).1);
    }
}
