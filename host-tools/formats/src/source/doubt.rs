//! Finds the wrong times of a recording: one rule for all formats.
//!
//! One damaged bit may change a time to any value; later times show the wrong one. A clock goes on; it may
//! pause for any time; it seldom falls. Of the present and the next few times, the right ones make the
//! longest row that goes on. A fall costs as much as [`RUN`] wrong times and a half. So eight wrong ones in a
//! row are outvoted, and a new clock is confirmed. A row leaves out whole runs only: if an omitted time goes
//! right on into a kept one, both are right (a clock set back by a second).
//!
//! At a recording's end a steady message never comes alone after a pause; a rare one may (saved parameters, a
//! change of mode). At its beginning a pause counts unless it is long.

use super::timeline::{STEP_BACK_US_MAX, STEP_FORWARD_US_MAX};

/// Compared after a jump: a run of wrong ones and twice as many others.
pub const ASKED: usize = 24;
/// Outvoted wrong times in a row.
pub const RUN: i32 = 8;
/// Usual disorder of neighbours.
pub const DISORDER_US: u64 = 200_000;
const GOES_ON_US: u64 = 500_000;
/// Out of order up to here: slow topics come late.
const FAR_US: u64 = 800_000;

const TIME: i32 = 10;
const FALL: i32 = RUN * TIME + TIME / 2;
/// Cost of disorder: a little more than a time's value.
const LATE: i32 = TIME + 2;
/// Cost of a pause: of two rows, the one with fewer pauses wins.
const PAUSE: i32 = 1;

/// A compared time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Time {
    /// As it was recorded, microseconds.
    pub us: u64,
    /// Steady until just now.
    pub steady: bool,
}

/// Longest pauses at a recording's ends.
#[derive(Clone, Copy, Debug)]
pub struct Ends {
    /// Time before the last steady messages.
    pub steady_us: u64,
    /// Time after the first, and before the last rare messages.
    pub seldom_us: u64,
}

/// Whether a time is wrong.
#[derive(Clone, Copy, Debug)]
pub struct Question<'a> {
    /// `None` for the first of all.
    pub before: Option<u64>,
    /// It, and up to [`ASKED`] after it.
    pub times: &'a [Time],
    /// No times follow.
    pub is_end: bool,
    /// Rules for the ends.
    pub ends: Ends,
    /// Microseconds, as far as known.
    pub usual_us: u64,
}

impl Question<'_> {
    /// The longest row goes on without the first time.
    pub fn is_wrong(&self) -> bool {
        let Some(&asked) = self.times.first() else { return false };
        // Two rows for each time: the best with the first one, and without.
        let mut rows: Vec<(Option<i32>, Option<i32>)> = Vec::with_capacity(self.times.len());
        let mut climbs = true;
        for (index, time) in self.times.iter().enumerate() {
            let begins = TIME - self.before.map_or(0, |before| self.cost(before, time));
            if index == 0 {
                rows.push((Some(begins), None));
                continue;
            }
            let goes_on = self.goes_on_into(index);
            climbs &= goes_on;
            let is_far = time.us.abs_diff(asked.us) > FAR_US;
            let (mut with, mut without) = (None, Some(begins).filter(|_| is_far && !climbs));
            for (last, (row, from)) in rows.iter().zip(self.times).enumerate() {
                if goes_on && last + 1 < index && self.is_jump_after(last) {
                    continue;
                }
                let worth = TIME - self.cost(from.us, time);
                with = with.max(row.0.map(|row| row + worth));
                without = without.max(row.1.map(|row| row + worth));
            }
            rows.push((with, without));
        }
        let with = rows.iter().filter_map(|row| row.0).max();
        let without = rows.iter().filter_map(|row| row.1).max().unwrap_or(0).max(0);
        with.is_some_and(|with| without > with)
    }

    fn goes_on_into(&self, index: usize) -> bool {
        self.pair(index.wrapping_sub(1)).is_some_and(|[last, time]| {
            time.us.saturating_add(DISORDER_US) >= last.us && time.us <= last.us.saturating_add(GOES_ON_US)
        })
    }

    fn is_jump_after(&self, index: usize) -> bool {
        self.pair(index).is_some_and(|[last, time]| time.us.abs_diff(last.us) > STEP_BACK_US_MAX)
    }

    fn pair(&self, index: usize) -> Option<[Time; 2]> {
        Some([*self.times.get(index)?, *self.times.get(index.checked_add(1)?)?])
    }

    fn cost(&self, last: u64, time: &Time) -> i32 {
        let step = time.us.saturating_sub(last);
        if time.us.saturating_add(STEP_BACK_US_MAX) < last || step > STEP_FORWARD_US_MAX {
            return self.fall();
        }
        if time.us.saturating_add(DISORDER_US) < last {
            return LATE;
        }
        if step <= STEP_BACK_US_MAX {
            return 0;
        }
        let Ends { steady_us, seldom_us } = self.ends;
        let longest = match (self.is_end, self.before) {
            (true, Some(_)) if time.steady => steady_us,
            (true, _) | (_, None) => seldom_us,
            (false, Some(_)) => u64::MAX,
        };
        if step > longest.max(self.usual_us.saturating_mul(2)) { self.fall() } else { PAUSE }
    }

    fn fall(&self) -> i32 {
        let most = self.times.len() as i32 * TIME / 2;
        if self.is_end { FALL } else { FALL.min(most) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: f64 = 1e6;
    const ENDS: Ends = Ends { steady_us: 1_000_000, seldom_us: 3_600_000_000 };

    fn is_wrong(before: Option<f64>, seconds: &[f64], steady: bool, is_end: bool) -> bool {
        let us = |seconds: f64| (seconds * SECOND).round() as u64;
        let times: Vec<Time> =
            seconds.iter().take(1 + ASKED).map(|&seconds| Time { us: us(seconds), steady }).collect();
        Question { before: before.map(us), times: &times, is_end, ends: ENDS, usual_us: 0 }.is_wrong()
    }

    fn going_on(from: f64, times: usize, every: f64) -> Vec<f64> {
        (0..times).map(|index| from + index as f64 * every).collect()
    }

    #[test]
    fn up_to_eight_wrong_times_in_a_row_are_seen_and_more_are_a_pause_or_a_restart() {
        for (shift, count) in [(1.05, 1), (8.4, 1), (700.0, 3), (8.4, 8), (-9.0, 8), (-90.0, 1), (9e9, 8)] {
            for every in [0.0, 0.004, 0.02, 0.1] {
                let wrong = going_on(100.0 + shift, count, every);
                let sound = going_on(100.0 + count as f64 * every, 24, every);
                let all = [wrong, sound].concat();
                for first in 0..count {
                    assert!(is_wrong(Some(100.0), &all[first..], true, false), "{shift} {count} {every}");
                }
                assert!(!is_wrong(Some(100.0), &all[count..], true, false), "the one after them");
            }
        }
        for shift in [8.4, -9.0, 700.0] {
            let all = [going_on(100.0 + shift, 9, 0.02), going_on(100.2, 20, 0.02)].concat();
            assert!(!is_wrong(Some(100.0), &all, true, false));
        }
    }

    #[test]
    fn wrong_times_of_different_sizes_are_seen_together() {
        let all = [vec![108.4, 3.0, 100.0 + 7e8, 104.2, 97.0], going_on(100.1, 20, 0.01)].concat();
        for first in 0..5 {
            assert!(is_wrong(Some(100.0), &all[first..], true, false), "{first}");
        }
    }

    #[test]
    fn pauses_of_messages_that_come_seldom_are_believed_one_by_one() {
        let all = [vec![105.3, 110.3], going_on(110.3, 23, 0.01)].concat();
        assert!(!is_wrong(Some(100.0), &all, false, false));
        assert!(!is_wrong(Some(100.0), &going_on(101.01, 24, 1.01), false, false), "one a second");
        assert!(!is_wrong(Some(100.0), &[130.0, 160.9, 191.8], false, true), "at the end");
        assert!(is_wrong(Some(100.0), &[4_000.0], false, true), "an hour");
    }

    #[test]
    fn a_clock_that_was_set_back_by_a_second_is_right_as_soon_as_it_goes_on() {
        for every in [0.01, 0.05, 0.1, 0.2] {
            assert!(!is_wrong(Some(100.0), &going_on(98.912, 25, every), true, false), "{every}");
        }
        let slow = [
            -1.088, -0.592, -0.59, -0.112, -0.09, 0.178, 0.196, 0.37, 0.405, 0.411, 0.889, 0.911, 1.406,
            1.412,
        ];
        let slow: Vec<f64> = slow.iter().map(|late| 100.0 + late).chain(going_on(101.9, 11, 0.05)).collect();
        assert!(!is_wrong(Some(100.0), &slow, true, false));
        assert!(is_wrong(Some(100.0), &[98.912, 100.1, 100.2, 100.3], true, false));
    }

    #[test]
    fn slow_topics_that_come_late_make_no_time_wrong() {
        let late = [0.0, -0.01, -0.213, -0.05, -0.6, 0.0, -0.4, -0.41, -0.5, 0.06];
        for first in 0..late.len() {
            let all: Vec<f64> = late.iter().cycle().skip(first).take(25).map(|late| 104.4 + late).collect();
            assert!(!is_wrong(Some(100.0), &all, false, false), "{first}");
            let wrong = [vec![804.4, 804.41, 804.39], all].concat();
            assert!(is_wrong(Some(104.4), &wrong[..25], false, false), "{first}");
        }
    }

    #[test]
    fn at_the_end_what_came_again_and_again_does_not_come_alone_after_a_pause() {
        for count in 1..=8 {
            let last = going_on(108.4, count, 0.01);
            assert!(is_wrong(Some(100.0), &last, true, true), "{count}");
            let more = [last, going_on(100.1, 3, 0.01)].concat();
            assert!(is_wrong(Some(100.0), &more, true, true), "{count}");
        }
        assert!(!is_wrong(Some(100.0), &going_on(108.4, 9, 0.01), true, true));
        assert!(is_wrong(Some(100.0), &going_on(8.4, 8, 0.01), true, true), "a fall");
        assert!(!is_wrong(Some(100.0), &going_on(8.4, 9, 0.01), true, true), "a restart");
    }

    #[test]
    fn the_first_times_are_wrong_where_the_others_are_before_them() {
        for count in 1..=8 {
            let all = [going_on(720.0, count, 0.01), going_on(12.0, 20, 0.01)].concat();
            assert!(is_wrong(None, &all, false, false), "{count}");
        }
        assert!(!is_wrong(None, &[39.0, 42.0, 42.0, 42.01, 42.02], false, false), "a pause");
        assert!(is_wrong(None, &[39.0, 9_000.0, 9_000.0, 9_000.1], false, false));
        assert!(!is_wrong(None, &[39.0], false, true), "the only one");
    }

    #[test]
    fn where_few_follow_most_of_them_decide() {
        assert!(!is_wrong(Some(100.0), &[], true, false));
        assert!(!is_wrong(Some(100.0), &[8.0], true, false));
        assert!(!is_wrong(Some(100.0), &[8.0, 8.1, 8.2], true, false));
        assert!(is_wrong(Some(100.0), &[8.0, 100.1, 100.2], true, false));
    }
}
