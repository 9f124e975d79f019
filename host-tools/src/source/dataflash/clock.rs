//! When a message was written, from what it says of it.
//!
//! Logs of today tell microseconds since power-on in every message, those of before 2015 milliseconds in most, and the
//! oldest (`ArduCopter` 2.9 and 3.0) only in GPS messages, as the receiver's time of the week. A message without a time
//! counts as written with the one before it.
//!
//! A single damaged bit makes a time of any size: a jump counts where the next messages of the file agree with it, and is
//! a wrong time where they go on from before it. Where none of them tells, the next message that is read decides. The
//! message of a jump that none follows is not trusted.

use hums_core::time::{Instant, Span};

use super::ahead::Ahead;
use super::format::Formats;
use super::message::Message;
use crate::source::timeline::{Moment, STEP_BACK_US_MAX, Timeline, is_wrong};

/// A step forward beyond this wants a second message that agrees. A log that is only written while armed does have
/// pauses of any length.
const STEP_DOUBTED_US: u64 = 30_000_000;
/// Messages that agree are no further apart than this.
const AGREE_US: u64 = 5_000_000;
/// Nothing is written for this long only where the logger pauses or fails: something of every log comes at 5 Hz.
const SILENCE: Span = Span::from_secs(1);
/// Microseconds in a week.
const WEEK_US: u64 = 7 * 86_400 * 1_000_000;

/// Follows the clock of a log.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    timeline: Timeline,
    /// The latest recorded time that is trusted.
    recorded_us: Option<u64>,
    /// A jump that no other message has agreed with.
    doubted_us: Option<u64>,
    /// The first time of the week, where that is the log's only clock.
    week_first_us: Option<u64>,
    /// When nothing had been written for a while before the message at hand: since when.
    silence: Option<Instant>,
}

/// When a message was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct When {
    /// In the recording's time.
    pub(super) at: Instant,
    /// Another power-on begins with it.
    pub(super) restarted: bool,
    /// Microseconds since power-on as the message says; `None` where it says nothing.
    pub(super) boot_us: Option<u64>,
    /// What its own time is worth.
    pub(super) own: Own,
}

/// What a message's own time is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Own {
    /// It has none.
    None,
    /// It counts.
    Sound,
    /// It is a jump that nothing confirms: the message is likely damaged.
    Doubted,
    /// The messages after it say that it is wrong.
    Wrong,
}

impl Own {
    /// Whether it does not count, though there is one.
    pub(super) fn is_doubted(self) -> bool {
        matches!(self, Self::Doubted | Self::Wrong)
    }
}

impl Clock {
    /// The first time of the log is this one.
    pub(super) fn begin(&mut self, first_us: u64) {
        self.timeline.at(first_us);
    }

    /// Whether a message has told a time.
    pub(super) fn has_begun(&self) -> bool {
        self.recorded_us.is_some()
    }

    /// Since when nothing had been written before the message at hand, where that was for long; asked for once.
    pub(super) fn silence(&mut self) -> Option<Instant> {
        self.silence.take()
    }

    /// The latest time.
    pub(super) fn now(&self) -> Instant {
        self.timeline.now()
    }

    /// When a message was written. `week` is a GPS message's time of the week where the log has no other clock; `ahead` is
    /// what follows the message in the file.
    pub(super) fn at(
        &mut self,
        message: &Message<'_>,
        week: Option<u64>,
        (ahead, formats): (Ahead<'_>, &Formats),
    ) -> When {
        let boot_us = message.time_us();
        let Some(recorded_us) = boot_us.or_else(|| week.map(|ms| self.since_first(ms.saturating_mul(1_000))))
        else {
            return self.as_before(boot_us, Own::None);
        };
        let is_jump = self.recorded_us.is_none_or(|before| recorded_us.abs_diff(before) > STEP_BACK_US_MAX);
        let wrong = if is_jump && boot_us.is_some() {
            is_wrong(self.recorded_us, recorded_us, ahead.times(formats))
        } else {
            None
        };
        if wrong == Some(true) {
            return self.as_before(boot_us, Own::Wrong);
        }
        if wrong.is_none() && self.is_doubtful(recorded_us) {
            let agrees = self.doubted_us.is_some_and(|doubted_us| {
                recorded_us.saturating_add(STEP_BACK_US_MAX) >= doubted_us
                    && recorded_us <= doubted_us.saturating_add(AGREE_US)
            });
            if !agrees {
                self.doubted_us = Some(recorded_us);
                return self.as_before(boot_us, Own::Doubted);
            }
        }
        self.doubted_us = None;
        self.recorded_us = Some(match self.recorded_us {
            Some(before) if recorded_us.saturating_add(STEP_BACK_US_MAX) >= before => before.max(recorded_us),
            _ => recorded_us,
        });
        let before = self.now();
        let Moment { at, restarted } = self.timeline.at(recorded_us);
        self.silence = Some(before).filter(|before| !restarted && at.since(*before) > SILENCE);
        When { at, restarted, boot_us, own: Own::Sound }
    }

    /// Written with the message before it.
    fn as_before(&self, boot_us: Option<u64>, own: Own) -> When {
        When { at: self.now(), restarted: false, boot_us, own }
    }

    /// The time of the week as time since the first one; it goes on over the week's end.
    fn since_first(&mut self, week_us: u64) -> u64 {
        let first = *self.week_first_us.get_or_insert(week_us);
        let since = (week_us % WEEK_US + WEEK_US - first % WEEK_US) % WEEK_US;
        let weeks = self.recorded_us.unwrap_or(0) / WEEK_US;
        let same = weeks.saturating_mul(WEEK_US).saturating_add(since);
        let before = self.recorded_us.unwrap_or(0);
        if same.saturating_add(WEEK_US / 2) < before { same.saturating_add(WEEK_US) } else { same }
    }

    fn is_doubtful(&self, recorded_us: u64) -> bool {
        let Some(before) = self.recorded_us else {
            // Nobody flies for longer than a month.
            return recorded_us > 30 * 86_400 * 1_000_000;
        };
        recorded_us.saturating_add(STEP_BACK_US_MAX) < before
            || recorded_us > before.saturating_add(STEP_DOUBTED_US)
    }
}
