//! The autopilot's own time in a ground station's recording: it distinguishes a joint of two recordings from a clock
//! that was set.
//!
//! If a ground station's clock falls, or jumps by more than an hour, it was set, or another recording was joined on.
//! The autopilot's messages have its time since power-on. If that time goes on, so does the recording. If it changes
//! too, this is another recording: a restart in the air just when a clock is set is too unlikely.

use std::collections::VecDeque;
use std::io::Read;

use super::item::AUTOPILOT;
use super::pace::SLOWER;
use super::timeline::STEP_BACK_US_MAX;
use super::tlog::records::Records;
use crate::mavlink::frame;

/// A clock that jumps by more than this may belong to another recording: microseconds.
pub(super) const JOINT_US: u64 = 3_600_000_000;
/// Messages with the time since power-on come at least this often, ms.
const TOLD_MS: i64 = 60_000;
/// Messages are out of order by this at most.
const DISORDER_MS: i64 = 1_000;

/// `time_boot_ms` of an autopilot's `SYSTEM_TIME`, `ATTITUDE` and `GLOBAL_POSITION_INT`; zeros at the end of a payload are not sent.
pub(super) fn boot_ms(frame: &hums_link::Frame<'_>) -> Option<u32> {
    boot_ms_of(frame.id(), frame.component(), frame.payload())
}

/// The same of a frame by its parts.
pub(super) fn boot_ms_of(id: u32, component: u8, payload: &[u8]) -> Option<u32> {
    let offset = match id {
        2 => 8,
        30 | 33 => 0,
        _ => return None,
    };
    let byte = |at: usize| payload.get(offset + at).copied().unwrap_or(0);
    (component == AUTOPILOT).then(|| u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]))
}

/// Follows the autopilots' time.
#[derive(Clone, Debug, Default)]
pub(super) struct Joints {
    /// The last report of an autopilot: its system, and its time since power-on.
    last: Option<(u8, u32)>,
    /// Lead of the recorder's clock over the autopilots' at their last few reports, microseconds.
    ahead: VecDeque<(u8, i64)>,
    /// By how much the recorder's clock was set back last, microseconds, until it is set again.
    fell_us: Option<i64>,
}

/// Number of an autopilot's times kept, ...
const KEPT: usize = 24;
/// ... and beyond this number the third lowest counts.
const MANY: usize = 6;
/// Time after a jump in which the autopilot's times are compared.
const ASKED_MS: u32 = 5_000;
/// No link holds back more.
const HELD_BACK_US: i64 = 10_000_000;

impl Joints {
    /// An autopilot of the recording reported its time, at this time of the recorder's clock.
    pub(super) fn told(&mut self, time_us: Option<u64>, system: u8, boot_ms: u32) {
        if self.last.is_some_and(|(last, before)| last == system && falls(before, boot_ms)) {
            self.ahead.clear();
        }
        self.last = Some((system, boot_ms));
        if let Some(time_us) = time_us {
            if self.ahead.len() >= KEPT {
                self.ahead.pop_front();
            }
            self.ahead.push_back((system, ahead_us(time_us, boot_ms)));
        }
    }

    /// Another recording begins.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// The recorder's clock was set from one time to another, while this time passed.
    pub(super) fn set(&mut self, before_us: u64, time_us: u64, passed_us: u64) {
        let set_us = i128::from(time_us) - i128::from(before_us) - i128::from(passed_us);
        let set_us = i64::try_from(set_us).unwrap_or(0);
        self.fell_us = set_us.checked_neg().filter(|fell_us| *fell_us > 0);
        self.ahead.iter_mut().for_each(|(_, ahead)| *ahead = ahead.saturating_add(set_us));
    }

    /// The real time passed, microseconds, if the recorder's clock was set while the autopilot's went on. A
    /// frame may be late, by as much as a link holds back, but never early. So a clock that falls was set.
    /// One that jumps forward was set if it jumps by more, or by as much as it fell before.
    pub(super) fn elapsed_us<R: Read>(
        &self,
        before_us: u64,
        time_us: u64,
        after: &Records<R>,
    ) -> Option<u64> {
        let (system, before_ms) = self.last?;
        let jump_us = i64::try_from(i128::from(time_us) - i128::from(before_us)).ok()?;
        let is_regained = |us: i64| self.fell_us.is_some_and(|fell| us.abs_diff(fell) < STEP_BACK_US_MAX / 2);
        if jump_us > 0 && jump_us < HELD_BACK_US && !is_regained(jump_us) {
            return None;
        }
        let (mut ahead, mut first_ms, mut seen_ms, mut last_us) = (Vec::new(), None, 0, time_us);
        let mut returns = None;
        after.each_after(&mut |recorded_us, bytes| {
            // It is set again.
            if recorded_us.saturating_add(STEP_BACK_US_MAX) < std::mem::replace(&mut last_us, recorded_us) {
                returns = Some(recorded_us);
                return false;
            }
            if let frame::Peek::Frame(frame) = frame::peek(bytes)
                && frame.system == system
                && let Some(boot_ms) = boot_ms_of(frame.id, frame.component, frame.payload)
            {
                let first_ms = *first_ms.get_or_insert(boot_ms);
                seen_ms = boot_ms.saturating_sub(first_ms);
                ahead.push(ahead_us(recorded_us, boot_ms));
            }
            seen_ms < ASKED_MS
        });
        // The clock is soon back at its old time, before the next report of the autopilot: only its lead by
        // then has passed.
        let returned_us = returns.and_then(|us| i64::try_from(i128::from(us) - i128::from(before_us)).ok());
        if first_ms.is_none()
            && jump_us >= HELD_BACK_US
            && let Some(returned_us) = returned_us
            && (-(STEP_BACK_US_MAX as i64)..HELD_BACK_US).contains(&returned_us)
        {
            return Some(0);
        }
        let passed_ms = i64::from(first_ms?) - i64::from(before_ms);
        let goes_on = (-DISORDER_MS..=TOLD_MS).contains(&passed_ms);
        let ran_us = last_us.saturating_sub(time_us);
        if goes_on && seen_ms >= ASKED_MS && ran_us.saturating_mul(SLOWER) < u64::from(seen_ms) * 1_000 {
            // The clock does not run after the jump: its lead has no meaning.
            return Some(u64::try_from(passed_ms * 1_000).unwrap_or(0));
        }
        let known = self.ahead.iter().filter(|(of, _)| *of == system).map(|(_, ahead)| *ahead);
        let set_us = least(ahead)?.checked_sub(least(known.collect())?)?;
        let is_set = set_us < -(STEP_BACK_US_MAX as i64) || set_us > HELD_BACK_US || is_regained(set_us);
        let passed_us = jump_us.saturating_sub(set_us);
        let fits = (-DISORDER_MS * 1_000..=TOLD_MS * 1_000).contains(&passed_us);
        (is_set && goes_on && fits).then(|| u64::try_from(passed_us).unwrap_or(0))
    }

    /// Whether another recording begins at this jump of the recorder's clock: the autopilot's clock does not
    /// go on. Without an autopilot's time, a jump by more than an hour counts.
    pub(super) fn is_joint<R: Read>(&self, before_us: u64, time_us: u64, after: &Records<R>) -> bool {
        let Some((system, before_ms)) = self.last else { return before_us.abs_diff(time_us) > JOINT_US };
        let told = after.frames_after(|bytes| match frame::peek(bytes) {
            frame::Peek::Frame(frame) if frame.system == system => {
                boot_ms_of(frame.id, frame.component, frame.payload)
            }
            _ => None,
        });
        let Some(after_ms) = told else { return before_us.abs_diff(time_us) > JOINT_US };
        let boot = i64::from(after_ms) - i64::from(before_ms);
        let recorder = (i128::from(time_us) - i128::from(before_us)) / 1_000;
        let with_it = i128::from(boot).abs_diff(recorder) <= TOLD_MS as u128;
        boot < -DISORDER_MS || (boot > TOLD_MS && !with_it)
    }
}

/// Whether the time since power-on falls: another power-on.
fn falls(before_ms: u32, boot_ms: u32) -> bool {
    i64::from(boot_ms) < i64::from(before_ms) - DISORDER_MS
}

/// By how much the recorder's clock is ahead of the autopilot's. (Recorded times are below 9e15.)
fn ahead_us(time_us: u64, boot_ms: u32) -> i64 {
    i64::try_from(time_us).unwrap_or(i64::MAX).saturating_sub(i64::from(boot_ms) * 1_000)
}

/// The least but two, which may be wrong.
fn least(mut ahead: Vec<i64>) -> Option<i64> {
    ahead.sort_unstable();
    ahead.get(if ahead.len() > MANY { 2 } else { 0 }).copied()
}
