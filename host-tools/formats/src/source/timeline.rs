//! Makes times that never fall from recorded times.
//!
//! A clock may fall (another power-on, a set clock), and damage may give it any value.
//! - A small step back is a reordering: the late item counts as coming now.
//! - A larger step back is a restart. Time goes on a microsecond after its last value.
//! - A step forward beyond a day does not count; if the clock stays there, time goes on from there.

use hums_core::clock::Instant;

/// Step back: beyond this it is a restart, not a reordering.
pub const STEP_BACK_US_MAX: u64 = 1_000_000;
/// Step forward: beyond this it is damage or a set clock; gaps of hours are real.
pub const STEP_FORWARD_US_MAX: u64 = 24 * 3600 * 1_000_000;

/// A time's result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// When it is.
    pub at: Instant,
    /// Right before it the clock fell or jumped.
    pub restarted: bool,
}

/// Follows a recording's clock.
#[derive(Clone, Copy, Debug, Default)]
pub struct Timeline {
    /// Latest recorded time of this power-on, and its result.
    last: Option<(u64, u64)>,
    restarts: u64,
}

impl Timeline {
    /// Starts at the first time: microseconds since a power-on. [`Timeline::from_first`] makes one for times
    /// since 1970.
    pub const fn new() -> Self {
        Self { last: None, restarts: 0 }
    }

    /// A timeline with its first time as zero.
    pub const fn from_first(first_us: u64) -> Self {
        Self { last: Some((first_us, 0)), restarts: 0 }
    }

    /// Another recording: time goes on from its last value.
    pub fn begin_again(&mut self, recorded_us: u64) {
        self.restarts += 1;
        self.last = Some((recorded_us, self.now().as_micros().saturating_add(1)));
    }

    /// The clock was set; this much passed meanwhile.
    pub fn set(&mut self, recorded_us: u64, passed_us: u64) -> Moment {
        self.restarts += 1;
        let at = self.now().as_micros().saturating_add(passed_us.max(1));
        self.last = Some((recorded_us, at));
        Moment { at: Instant::from_micros(at), restarted: true }
    }

    /// Time that no recorded time shows.
    pub fn pass(&mut self, us: u64) {
        if let Some((_, reached)) = &mut self.last {
            *reached = reached.saturating_add(us);
        }
    }

    /// Takes microseconds.
    pub fn at(&mut self, recorded_us: u64) -> Moment {
        let Some((before, reached)) = self.last else {
            // The first may be damaged too.
            let first = if recorded_us > STEP_FORWARD_US_MAX { 0 } else { recorded_us };
            self.last = Some((recorded_us, first));
            return Moment { at: Instant::from_micros(first), restarted: false };
        };
        let (at, restarted) = match recorded_us.checked_sub(before) {
            Some(step) if step <= STEP_FORWARD_US_MAX => (reached.saturating_add(step), false),
            // A reordered pair does not stretch time.
            None if before - recorded_us <= STEP_BACK_US_MAX => {
                return Moment { at: Instant::from_micros(reached), restarted: false };
            }
            _ => (reached.saturating_add(1), true),
        };
        self.restarts += u64::from(restarted);
        self.last = Some((recorded_us, at));
        Moment { at: Instant::from_micros(at), restarted }
    }

    /// Latest; zero before the first.
    pub fn now(&self) -> Instant {
        Instant::from_micros(self.last.map_or(0, |(_, reached)| reached))
    }

    /// So far from the latest time that it may be wrong; the first may.
    pub fn is_jump(&self, recorded_us: u64) -> bool {
        self.last.is_none_or(|(before, _)| recorded_us.abs_diff(before) > STEP_BACK_US_MAX)
    }

    /// The latest recorded time.
    pub const fn recorded_us(&self) -> Option<u64> {
        match self.last {
            Some((recorded_us, _)) => Some(recorded_us),
            None => None,
        }
    }

    /// Number of falls and jumps of the clock.
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
            [(60 * SECOND, false), (61 * SECOND, false), (61 * SECOND + 1, true), (62 * SECOND + 1, false)]
        );
    }

    #[test]
    fn a_damaged_time_costs_no_years() {
        let got = times(&[SECOND, u64::MAX, 2 * SECOND]);
        assert!(got.iter().all(|(at, _)| *at <= 2 * SECOND), "{got:?}");
    }
}
