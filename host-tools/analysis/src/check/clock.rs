//! The monitor's time over a recording: it follows the recording's time and stops over each gap.
//!
//! The vehicle's state is unknown in a gap. So values do not age over it, debounces do not run, and the gap
//! does not count as time in the air. After a gap of [`SETTLE`] or longer the checks pause for that time,
//! until the first values have come.

use hums_core::clock::{Instant, Span};
use hums_onboard::monitoring::TICK;

/// Pause of the checks after a long gap: messages sent once a second have come again by then.
pub const SETTLE: Span = Span::from_secs(1);

/// The recording's time and the monitor's.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// The recording's time of the next step; `None` before the first.
    next: Option<Instant>,
    /// By how much the monitor's time is behind the recording's: the sum of the gaps.
    behind: Span,
    /// The recording's time at the end of the latest gap.
    gap_end: Instant,
    /// The monitor's latest time.
    reached: Instant,
}

impl Clock {
    /// The recording's time of the next step. The first step is at `at` or up to one step later.
    pub(super) fn begin(&mut self, at: Instant) -> Instant {
        *self.next.get_or_insert(whole(at))
    }

    /// The next step up to a time of the recording, if there is one more.
    pub(super) fn step(&mut self, to: Instant) -> Option<Instant> {
        let now = self.next.filter(|next| *next <= to)?;
        self.next = Some(now + TICK);
        Some(now)
    }

    /// The next step is at this time, if that is later: both times go on.
    pub(super) fn skip_to(&mut self, at: Instant) {
        self.next = self.next.max(Some(whole(at)));
    }

    /// The recording has a gap between these two times, so the monitor's time stops. The time before it was
    /// already stepped.
    pub(super) fn pause(&mut self, from: Instant, to: Instant) {
        let length = to.since(from.max(self.gap_end));
        let Some(next) = self.next.filter(|_| length > Span::ZERO) else { return };
        self.behind = self.behind + length;
        self.gap_end = to;
        self.next = Some(next.max(whole(to + if length >= SETTLE { SETTLE } else { TICK })));
    }

    /// The monitor's time now.
    pub(super) const fn now(&self) -> Instant {
        self.reached
    }

    /// The monitor's time at a time of the recording; it never falls.
    pub(super) fn monitor(&mut self, at: Instant) -> Instant {
        let behind = Instant::from_micros(at.as_micros().saturating_sub(self.behind.as_micros()));
        self.reached = self.reached.max(behind);
        self.reached
    }

    /// The recording's time at the end of the latest gap.
    pub(super) const fn gap_end(&self) -> Instant {
        self.gap_end
    }

    /// By how much the monitor's time is behind the recording's: the sum of the gaps until now.
    pub(super) const fn behind(&self) -> Span {
        self.behind
    }

    /// The recording's time of an earlier time of the monitor, seen from `now` of the recording, which is `steps` of the
    /// monitor. Gaps between the two are not counted.
    pub(super) fn recording(now: Instant, steps: Instant, earlier: Instant) -> Instant {
        Instant::from_micros(now.as_micros().saturating_sub(steps.since(earlier).as_micros()))
    }
}

/// The first whole step at a time or after it. Steps are at the same times whatever message a recording begins with, and
/// whatever is damaged in it.
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
