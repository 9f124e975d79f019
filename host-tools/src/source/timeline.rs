//! Recorded times as times that never fall.
//!
//! A recording's clock may fall (another power-on in the same file, a clock that was set) and damage may make it say
//! anything. A small step back is a reordering: what comes late counts as coming now. A larger one is a restart, after
//! which time goes on from where it was. A step forward beyond a day is damage or a clock that was set: it counts for
//! nothing, and if the clock stays there, time goes on from there.

use hums_core::time::Instant;

use super::item::{Cause, Gap};
use crate::plural::count;

/// A step back beyond this is a clock that began again, not a reordering.
pub const STEP_BACK_US_MAX: u64 = 1_000_000;
/// A step forward beyond this is damage or a clock that was set; gaps of hours are real.
pub const STEP_FORWARD_US_MAX: u64 = 24 * 3600 * 1_000_000;

/// So many of the times after a jump are asked whether it is one: eight damaged ones in a row are outvoted.
pub const ASKED: usize = 16;
/// Times that stand in a file side by side are out of order by so much at most, as a rule.
const DISORDER_US: u64 = 200_000;

/// Whether a time that is far from the one before it is wrong: the times after it go on from the one before it, and not
/// from it. `None` where none of them tells. Of the first time of all (`before` is `None`): whether the next one and
/// most others are before it.
///
/// One damaged bit makes such a time. A pause and a restart are confirmed by what comes after them. After a jump
/// forward, times from before the jump's beginning tell nothing: a log begins with old values.
pub fn is_wrong(before: Option<u64>, recorded: u64, after: impl IntoIterator<Item = u64>) -> Option<bool> {
    let (mut wrong, mut right) = (0_usize, 0_usize);
    for time in after.into_iter().take(ASKED) {
        if before.is_none() && wrong == 0 && right > 0 {
            // The clock went on from the first time, and fell later.
            return Some(false);
        }
        let disagrees = match before {
            Some(before) if recorded > before && time.saturating_add(STEP_BACK_US_MAX) < before => continue,
            Some(before) if recorded > before => time.saturating_add(DISORDER_US) < recorded,
            Some(before) => time.saturating_add(DISORDER_US) >= before,
            None => time.saturating_add(STEP_BACK_US_MAX) < recorded,
        };
        *(if disagrees { &mut wrong } else { &mut right }) += 1;
    }
    (wrong + right > 0).then_some(wrong > right)
}

/// Messages with a wrong time: how many, and where the first one is.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wrong {
    count: u64,
    first: Option<(Instant, u64)>,
}

impl Wrong {
    /// One more, at this byte of the recording.
    pub fn add(&mut self, at: Instant, place: u64) {
        self.count += 1;
        self.first.get_or_insert((at, place));
    }

    /// Tells them as damage; nothing where there are none.
    pub fn gap(self) -> Option<Gap> {
        let (at, place) = self.first?;
        let words =
            format!("{} with a wrong time, far from the times around it", count(self.count, "message"));
        Some(Gap { from: Some(at), to: None, cause: Cause::Damaged, place: Some(place), bytes: 0, words })
    }
}

/// What a recorded time became.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// When it is.
    pub at: Instant,
    /// The clock fell, or jumped, right before it.
    pub restarted: bool,
}

/// Follows a recording's clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timeline {
    /// The latest recorded time of this power-on, and what it became.
    last: Option<(u64, u64)>,
    restarts: u64,
}

impl Timeline {
    /// A clock whose first time is that of the stream: microseconds since a power-on. (One that counts from 1970 is
    /// made by [`Timeline::from_first`].)
    pub fn new() -> Self {
        Self::default()
    }

    /// A clock whose first time, whatever it says, is the stream's time zero.
    pub fn from_first(first_us: u64) -> Self {
        Self { last: Some((first_us, 0)), restarts: 0 }
    }

    /// The next recorded time, in microseconds.
    pub fn at(&mut self, recorded_us: u64) -> Moment {
        let Some((before, reached)) = self.last else {
            // The first time of all may be damaged too: a day is enough.
            let first = if recorded_us > STEP_FORWARD_US_MAX { 0 } else { recorded_us };
            self.last = Some((recorded_us, first));
            return Moment { at: Instant::from_micros(first), restarted: false };
        };
        let (at, restarted) = match recorded_us.checked_sub(before) {
            Some(step) if step <= STEP_FORWARD_US_MAX => (reached.saturating_add(step), false),
            // The later time stays the base, so that a reordered pair does not stretch time.
            None if before - recorded_us <= STEP_BACK_US_MAX => {
                return Moment { at: Instant::from_micros(reached), restarted: false };
            }
            _ => (reached, true),
        };
        self.restarts += u64::from(restarted);
        self.last = Some((recorded_us, at));
        Moment { at: Instant::from_micros(at), restarted }
    }

    /// The latest time; zero before the first.
    pub fn now(&self) -> Instant {
        Instant::from_micros(self.last.map_or(0, |(_, reached)| reached))
    }

    /// Whether a recorded time is so far from the latest one, forward or back, that it may be wrong; the first one may.
    pub fn is_jump(&self, recorded_us: u64) -> bool {
        self.last.is_none_or(|(before, _)| recorded_us.abs_diff(before) > STEP_BACK_US_MAX)
    }

    /// The latest recorded time.
    pub fn recorded_us(&self) -> Option<u64> {
        self.last.map(|(recorded_us, _)| recorded_us)
    }

    /// How often the clock fell or jumped.
    pub fn restarts(&self) -> u64 {
        self.restarts
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000;

    fn times(recorded: &[u64]) -> Vec<(u64, bool)> {
        let mut timeline = Timeline::new();
        let moment = |&us: &u64| {
            let moment = timeline.at(us);
            (moment.at.as_micros(), moment.restarted)
        };
        recorded.iter().map(moment).collect()
    }

    #[test]
    fn a_reordered_pair_neither_falls_nor_stretches_time() {
        let got = times(&[10 * SECOND, 10 * SECOND + 100, 10 * SECOND + 60, 10 * SECOND + 200]);
        let times: Vec<u64> = got.iter().map(|(at, _)| at - 10 * SECOND).collect();
        assert_eq!(times, [0, 100, 100, 200]);
        assert!(got.iter().all(|(_, restarted)| !restarted));
    }

    #[test]
    fn another_power_on_goes_on_from_where_time_was() {
        let got = times(&[60 * SECOND, 61 * SECOND, 2 * SECOND, 3 * SECOND]);
        assert_eq!(
            got,
            [(60 * SECOND, false), (61 * SECOND, false), (61 * SECOND, true), (62 * SECOND, false)]
        );
    }

    #[test]
    fn a_time_is_wrong_where_the_times_after_it_go_on_from_the_one_before_it() {
        let after = |seconds: [u64; 5]| seconds.map(|second| second * SECOND);
        let wrong = |recorded: u64, seconds| is_wrong(Some(100 * SECOND), recorded * SECOND, after(seconds));
        assert_eq!(wrong(108, [100, 100, 101, 101, 101]), Some(true));
        assert_eq!(wrong(3, [100, 100, 101, 101, 101]), Some(true));
        assert_eq!(wrong(108, [100, 108, 108, 109, 109]), Some(false), "a pause");
        assert_eq!(wrong(3, [3, 3, 4, 4, 4]), Some(false), "a restart");
        assert_eq!(wrong(108, [5, 6, 7, 8, 9]), None, "old values");
        assert_eq!(is_wrong(None, 30 * SECOND, after([2, 2, 2, 3, 3])), Some(true), "the first of all");
        let set = |tenths: [u64; 5]| {
            is_wrong(Some(100 * SECOND), 98_900_000, tenths.map(|tenth| tenth * SECOND / 10))
        };
        assert_eq!(set([991, 993, 995, 997, 999]), Some(false), "a clock that was set back by a second");
        assert_eq!(set([1_001, 1_003, 1_005, 1_007, 1_009]), Some(true));
        let run = [800, 800, 801, 801, 100, 100, 100, 101, 101, 101].map(|second| second * SECOND);
        assert_eq!(is_wrong(Some(100 * SECOND), 800 * SECOND, run), Some(true), "the first of five");
        assert_eq!(is_wrong(None, SECOND, after([2, 2, 90, 91, 92])), Some(false));
        assert_eq!(is_wrong(Some(SECOND), 9 * SECOND, []), None, "the last of all");
    }

    #[test]
    fn a_damaged_time_costs_no_years() {
        let got = times(&[SECOND, u64::MAX, 2 * SECOND]);
        assert!(got.iter().all(|(at, _)| *at <= 2 * SECOND), "{got:?}");
    }
}
