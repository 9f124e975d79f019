//! The monitor's time over a recording: it follows the recording's time and stops over each gap.
//!
//! The vehicle's state is unknown in a gap. So values do not age, debounces do not run, and flight time does not count. After
//! [`SETTLE`] or more the checks pause that long, for first values.

use hums_core::clock::{Instant, Span};
use hums_onboard::monitoring::TICK;

/// Messages of once a second have come again.
pub const SETTLE: Span = Span::from_secs(1);

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// Time of the next step; `None` before the first.
    next: Option<Instant>,
    behind: Span,
    gap_end: Instant,
    /// Latest, monitor's time.
    reached: Instant,
}

impl Clock {
    /// The first step is at `at` or up to one step later.
    pub(super) fn begin(&mut self, at: Instant) -> Instant {
        *self.next.get_or_insert(whole(at))
    }

    /// `None`: no step up to this time.
    pub(super) fn step(&mut self, to: Instant) -> Option<Instant> {
        let now = self.next.filter(|next| *next <= to)?;
        self.next = Some(now + TICK);
        Some(now)
    }

    pub(super) fn skip_to(&mut self, at: Instant) {
        self.next = self.next.max(Some(whole(at)));
    }

    /// The monitor's time stops; the time before was stepped.
    pub(super) fn pause(&mut self, from: Instant, to: Instant) {
        let length = to.since(from.max(self.gap_end));
        let Some(next) = self.next.filter(|_| length > Span::ZERO) else { return };
        self.behind = self.behind + length;
        self.gap_end = to;
        self.next = Some(next.max(whole(to + if length >= SETTLE { SETTLE } else { TICK })));
    }

    pub(super) const fn now(&self) -> Instant {
        self.reached
    }

    pub(super) fn monitor(&mut self, at: Instant) -> Instant {
        let behind = Instant::from_micros(at.as_micros().saturating_sub(self.behind.as_micros()));
        self.reached = self.reached.max(behind);
        self.reached
    }

    pub(super) const fn gap_end(&self) -> Instant {
        self.gap_end
    }

    pub(super) const fn behind(&self) -> Span {
        self.behind
    }

    /// `now` of the recording is `steps` of the monitor; gaps since are not counted.
    pub(super) fn recording(now: Instant, steps: Instant, earlier: Instant) -> Instant {
        Instant::from_micros(now.as_micros().saturating_sub(steps.since(earlier).as_micros()))
    }
}

fn whole(at: Instant) -> Instant {
    Instant::from_micros(at.as_micros().div_ceil(TICK.as_micros()).saturating_mul(TICK.as_micros()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(milliseconds: u64) -> Instant {
        Instant::from_millis(milliseconds)
    }

    fn steps(clock: &mut Clock, to: Instant) -> Vec<(u64, u64)> {
        std::iter::from_fn(|| {
            let now = clock.step(to)?;
            Some((now.as_millis(), clock.monitor(now).as_millis()))
        })
        .collect()
    }

    #[test]
    fn the_monitors_time_stands_still_over_a_gap_and_no_step_is_made_for_a_second_after_it() {
        let mut clock = Clock::default();
        clock.begin(ms(1_000));
        assert_eq!(steps(&mut clock, ms(1_120)), [(1_000, 1_000), (1_050, 1_050), (1_100, 1_100)]);
        clock.pause(ms(1_120), ms(21_120));
        assert_eq!(clock.monitor(ms(21_130)), ms(1_130), "it goes on where the gap ends");
        assert_eq!(steps(&mut clock, ms(22_140)), []);
        assert_eq!(steps(&mut clock, ms(22_200)), [(22_150, 2_150), (22_200, 2_200)]);
        assert_eq!(Clock::recording(ms(22_200), ms(2_200), ms(2_150)), ms(22_150));
        clock.pause(ms(22_210), ms(22_310));
        assert_eq!(steps(&mut clock, ms(22_430)), [(22_400, 2_300)], "a short one has no second after it");
    }

    #[test]
    fn steps_are_at_the_same_times_whatever_message_is_the_first() {
        let first = |at| {
            let mut clock = Clock::default();
            clock.begin(ms(at));
            steps(&mut clock, ms(1_200)).last().map(|(at, _)| *at)
        };
        assert_eq!((first(1_000), first(1_007), first(1_049)), (Some(1_200), Some(1_200), Some(1_200)));
    }

    #[test]
    fn a_gap_within_a_gap_changes_nothing() {
        let mut clock = Clock::default();
        clock.begin(ms(0));
        clock.pause(ms(0), ms(10_000));
        clock.pause(ms(0), ms(5_000));
        assert_eq!(steps(&mut clock, ms(11_050)), [(11_000, 1_000), (11_050, 1_050)]);
    }
}
