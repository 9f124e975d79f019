//! The log's clock: microseconds since the autopilot's boot, as times that never fall.
//!
//! Messages of different topics overtake each other, and at the beginning of a log stands what was published last of each topic,
//! which may be minutes old: both count as now. A single time that is far ahead of those before and after it is wrong, and
//! counts as now too. Where
//! the times stay far off, the clock was set or another log was joined on: then time goes on from where it was.

use hums_core::time::Instant;

use crate::source::timeline::{STEP_BACK_US_MAX, is_wrong};

/// A step beyond this, forward or back, wants to be confirmed. Topics are logged every ten seconds at least or once only.
const STEP_US_MAX: u64 = 10_000_000;
/// So many times in a row confirm a step forward.
const AHEAD: u32 = 3;
/// So many times in a row confirm a step back: more than there are topics with old values at the beginning.
const BEHIND: u32 = 400;
/// A vehicle that has been up for longer than this gets times that count from the log's beginning, and a step
/// forward beyond it counts for nothing: as [`super::super::timeline`] has it.
const DAY_US: u64 = 24 * 3_600 * 1_000_000;

/// Follows the times.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// The latest recorded time, and what it became.
    recorded: u64,
    reached: u64,
    begun: bool,
    /// A time that was too far ahead, and how many agree with it.
    ahead: Option<(u64, u32)>,
    behind: u32,
    /// How many were taken since the log's beginning, up to [`BEHIND`].
    taken: u32,
}

impl Clock {
    /// The header of a log: the time at which it began. `true` where another log came before it.
    pub(super) fn begin(&mut self, recorded: u64) -> bool {
        let again = self.begun;
        if !again {
            self.reached = if recorded > DAY_US { 0 } else { recorded };
        }
        *self = Self { recorded, reached: self.reached, begun: true, ahead: None, behind: 0, taken: 0 };
        again
    }

    /// Whether a time is so far ahead that it may be wrong. At a log's beginning are old values, and any step is right.
    pub(super) fn is_doubtful(&self, recorded: u64) -> bool {
        self.taken >= BEHIND && recorded.saturating_sub(self.recorded) > STEP_BACK_US_MAX
    }

    /// Whether a doubtful time is wrong: those after it go on from before it.
    pub(super) fn is_wrong(&self, recorded: u64, after: impl IntoIterator<Item = u64>) -> bool {
        is_wrong(Some(self.recorded), recorded, after) == Some(true)
    }

    /// The next recorded time; `true` where the clock fell for good.
    pub(super) fn take(&mut self, recorded: u64) -> bool {
        self.taken = self.taken.saturating_add(1).min(BEHIND);
        let step = recorded.saturating_sub(self.recorded);
        if step > STEP_US_MAX {
            let agrees = |&(time, _): &(u64, u32)| recorded.abs_diff(time) <= STEP_US_MAX;
            let count = self.ahead.filter(agrees).map_or(1, |(_, count)| count + 1);
            self.ahead = Some((recorded, count));
            if count < AHEAD {
                return false;
            }
            self.reached = self.reached.saturating_add(if step > DAY_US { 0 } else { step });
        } else if self.recorded.saturating_sub(recorded) > STEP_US_MAX {
            self.behind += 1;
            if self.behind < BEHIND {
                return false;
            }
            (self.recorded, self.behind, self.ahead) = (recorded, 0, None);
            return true;
        } else {
            self.reached = self.reached.saturating_add(step);
        }
        (self.recorded, self.behind, self.ahead) = (self.recorded.max(recorded), 0, None);
        false
    }

    /// The latest time.
    pub(super) fn now(&self) -> Instant {
        Instant::from_micros(self.reached)
    }

    /// The latest time as the log has it.
    pub(super) fn recorded(&self) -> u64 {
        self.recorded
    }

    /// What a time of the log's own is in the stream.
    pub(super) fn zero(&self) -> i128 {
        i128::from(self.recorded) - i128::from(self.reached)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1_000_000;

    fn clock() -> Clock {
        let mut clock = Clock::default();
        assert!(!clock.begin(60 * SECOND));
        clock
    }

    fn after(clock: &mut Clock, times: impl IntoIterator<Item = u64>) -> u64 {
        times.into_iter().for_each(|time| assert!(!clock.take(time)));
        clock.now().as_micros()
    }

    #[test]
    fn old_values_at_the_beginning_count_as_now() {
        let mut clock = clock();
        assert_eq!(after(&mut clock, [3 * SECOND, 61 * SECOND, 2 * SECOND, 60 * SECOND]), 61 * SECOND);
    }

    #[test]
    fn a_single_damaged_time_costs_nothing_and_a_gap_is_a_gap() {
        let mut clock = clock();
        assert_eq!(after(&mut clock, [u64::MAX, 61 * SECOND, 3_600 * SECOND, 62 * SECOND]), 62 * SECOND);
        assert_eq!(after(&mut clock, [3_600, 3_601, 3_602].map(|time| time * SECOND)), 3_602 * SECOND);
    }

    #[test]
    fn a_clock_that_was_set_to_another_century_goes_on_from_where_it_was() {
        let mut clock = clock();
        let century = 100 * 365 * DAY_US;
        assert_eq!(after(&mut clock, [0, 1, 2, 3].map(|time| century + time * SECOND)), 61 * SECOND);
    }

    #[test]
    fn a_clock_that_falls_for_good_goes_on_from_where_it_was() {
        let mut clock = clock();
        let fell: Vec<bool> = (0..BEHIND + 10).map(|_| clock.take(SECOND)).collect();
        assert_eq!(fell.iter().filter(|&&fell| fell).count(), 1);
        assert_eq!(after(&mut clock, [3 * SECOND]), 62 * SECOND);
    }

    #[test]
    fn another_log_goes_on_from_where_the_first_one_ended() {
        let mut clock = clock();
        after(&mut clock, [65 * SECOND]);
        assert!(clock.begin(5 * SECOND));
        assert_eq!(after(&mut clock, [6 * SECOND]), 66 * SECOND);
    }
}
