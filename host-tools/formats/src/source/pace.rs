//! Checks whether a recording's clock runs.
//!
//! A bad clock stops, is zero from some place on, or has milliseconds as microseconds. Four signs:
//!
//! | measure | reason |
//! |---|---|
//! | bytes recorded within the time | loggers and links cannot write 4 MiB a second for long |
//! | another clock in the messages (UTC of a receiver) | a recording's clock a hundred times slower is wrong
//! |
//! | messages of one kind without a later time, a hundred in a row | a kind comes again after some time |
//! | falls of the clock in a row | eight falls with less than five seconds between mean that it runs
//! backwards |

use hums_core::clock::{Instant, Span};

use super::clock::WrongTimes;
use super::item::{Cause, Gap};

/// Bytes a second: the fastest logs, of all inertial samples, have a quarter of it.
const BYTES_PER_S: u64 = 4 * 1024 * 1024;
/// Bytes that a logger writes when it begins (parameters, a mission), or had to hold back. The most in 80
/// public logs of `ArduPilot` is 84 KB, definitions included.
const BURST_BYTES: u64 = 192 * 1024;
/// A clock this many times slower than another is wrong: simulators run at some tens of times.
pub const SLOWER: u64 = 100;
/// Time of the other clock, until the slow one is reported.
const WITNESSED: Span = Span::from_secs(10);
/// The other clock was set.
const APART: Span = Span::from_secs(60);
const FALLS: u32 = 8;
/// ... with less than this between: backwards.
const BETWEEN: Span = Span::from_secs(5);

/// Falls in a row: first time and place, last time, number.
#[derive(Clone, Copy, Debug)]
struct Falls {
    first: (Instant, u64),
    last: Instant,
    count: u32,
}

/// Follows a recording's clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pace {
    first: Option<Instant>,
    last: Option<Instant>,
    place: u64,
    /// Bytes still without time, and their beginning.
    level: u64,
    since: Option<(Instant, u64)>,
    /// Both times, before the first became too slow.
    witness: Option<(Instant, u64)>,
    falls: Option<Falls>,
    /// First time and place at which the clock did not run.
    stands: Option<(Instant, u64)>,
}

impl Pace {
    /// `bytes`: of messages since the last call.
    pub fn at(&mut self, now: Instant, place: u64, bytes: u64) {
        self.place = place;
        self.first.get_or_insert(now);
        let Some(before) = self.last.replace(now) else { return };
        let passed = now.since(before).as_micros();
        let room = passed.saturating_mul(BYTES_PER_S) / 1_000_000;
        self.level = self.level.saturating_add(bytes).saturating_sub(room);
        if self.level == 0 {
            self.since = None;
            return;
        }
        let since = *self.since.get_or_insert((now, place));
        if self.level > BURST_BYTES {
            self.stands.get_or_insert(since);
        }
    }

    /// Microseconds from any beginning.
    pub fn witness(&mut self, now: Instant, us: u64) {
        let Some((then, told)) = self.witness else {
            self.witness = Some((now, us));
            return;
        };
        // Two receivers differ by a little.
        if us < told && told - us < 1_000_000 {
            return;
        }
        let passed = Span::from_micros(us.saturating_sub(told));
        let is_slow = now.since(then).as_micros().saturating_mul(SLOWER) < passed.as_micros();
        if us < told || !is_slow {
            self.witness = Some((now, us));
        } else if passed > APART {
            // It was set.
            self.witness = Some((now, us));
        } else if passed >= WITNESSED {
            self.stands.get_or_insert((then, self.place));
        }
    }

    /// The clock fell or was set, to this time.
    pub fn fell(&mut self, now: Instant) {
        let in_a_row = self.falls.filter(|falls| now.since(falls.last) < BETWEEN);
        let before = in_a_row.unwrap_or(Falls { first: (now, self.place), last: now, count: 0 });
        let falls = Falls { last: now, count: before.count.saturating_add(1), ..before };
        self.falls = Some(falls);
        if falls.count >= FALLS {
            self.stands.get_or_insert(falls.first);
        }
    }

    /// The clock stands still ([`super::clock::Clock::stands`]).
    pub fn stood(&mut self, now: Instant, place: u64) {
        self.stands.get_or_insert((now, place));
    }

    /// Another recording begins.
    pub fn begin_another(&mut self) {
        *self = Self { first: self.first, stands: self.stands, ..Self::default() };
    }

    /// Once all has been read: single wrong times, and the clock. If the clock never ran, the single wrong
    /// times are unknown.
    pub fn gaps(&self, wrong: &WrongTimes) -> impl Iterator<Item = Gap> + use<> {
        let never_ran = self.stands.is_some() && self.first == self.last;
        wrong.gap().filter(|_| !never_ran).into_iter().chain(self.gap())
    }

    /// Faults of the clock, once all has been read.
    pub fn gap(&self) -> Option<Gap> {
        let (at, place) = self.stands?;
        let words = "the recorded times stand still, fall again and again, or go on far too slowly, from here on: what is \
                     recorded there cannot be judged";
        Some(Gap::new(Some(at), Cause::NoTimes, words.to_owned()).at(place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(us: u64) -> Instant {
        Instant::from_micros(us)
    }

    /// Microseconds with every 100 bytes, from some time on.
    fn is_told(step_us: u64, bytes: u64) -> bool {
        let mut pace = Pace::default();
        (0..bytes / 100).for_each(|message| pace.at(at(message * step_us), message * 100, 100));
        pace.gap().is_some()
    }

    #[test]
    fn a_clock_that_stands_or_creeps_is_told_and_a_burst_or_a_fast_log_is_not() {
        assert!(is_told(0, 300_000), "stands");
        assert!(is_told(1, 300_000), "creeps");
        assert!(!is_told(0, 100_000), "a burst");
        assert!(!is_told(50, 10_000_000), "2 MB/s");
        let mut pace = Pace::default();
        for second in 0..100 {
            (0..1_000).for_each(|_| pace.at(at(second * 1_000_000), 0, 100));
        }
        assert!(pace.gap().is_none());
    }

    #[test]
    fn another_clock_tells_one_that_is_too_slow_and_one_that_falls_again_and_again_runs_backwards() {
        let slow = |times: u64| {
            let mut pace = Pace::default();
            (0..200_u64)
                .for_each(|tick| pace.witness(at(tick * 200_000 / times), 7_000_000 + tick * 200_000));
            pace.gap().is_some()
        };
        assert_eq!((slow(1), slow(50), slow(1_000)), (false, false, true));
        let falls = |every_s: u64| {
            let mut pace = Pace::default();
            (1..20_u64).for_each(|fall| pace.fell(at(fall * every_s * 1_000_000)));
            pace.gap().is_some()
        };
        assert_eq!((falls(1), falls(10)), (true, false));
    }
}
