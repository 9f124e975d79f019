//! The autopilot's own time in a ground station's recording: it distinguishes a joint of two recordings from a clock
//! that was set.
//!
//! If a ground station's clock falls, or jumps by more than an hour, either happened. If the autopilot's time since power-on
//! goes on, so does the recording. If it changes too, this is another recording.

use std::io::Read;

use super::item::AUTOPILOT;
use super::tlog::records::Records;
use crate::mavlink::frame::{Peek, peek};

/// Microseconds: beyond this another recording is possible.
pub(super) const JOINT_US: u64 = 3_600_000_000;
/// ms, at least this often.
const TOLD_MS: i64 = 60_000;
/// ms.
const DISORDER_MS: i64 = 1_000;
/// Microseconds.
const HELD_BACK_US: u64 = 10_000_000;

/// `SYSTEM_TIME`, `ATTITUDE`, `GLOBAL_POSITION_INT`; a payload's trailing zeros are not sent.
pub(super) fn boot_ms(frame: &hums_link::Frame<'_>) -> Option<u32> {
    let offset = match frame.id() {
        2 => 8,
        30 | 33 => 0,
        _ => return None,
    };
    let byte = |at: usize| frame.payload().get(offset + at).copied().unwrap_or(0);
    (frame.component() == AUTOPILOT).then(|| u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]))
}

/// Last report: system, and ms since power-on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Joints(Option<(u8, u32)>);

impl Joints {
    /// An autopilot's report.
    pub(super) const fn told(&mut self, system: u8, boot_ms: u32) {
        self.0 = Some((system, boot_ms));
    }

    /// ms from the last report before a jump to the jump, by the first report after it.
    fn passed_ms<R: Read>(self, time_us: u64, after: &Records<R>) -> Option<i64> {
        let (system, before_ms) = self.0?;
        let (after_us, after_ms) = after.frames_after(|recorded_us, bytes| match peek(bytes) {
            Peek::Frame(frame) if frame.system() == system => Some((recorded_us, boot_ms(&frame)?)),
            _ => None,
        })?;
        let since_jump_ms = i64::try_from(after_us.saturating_sub(time_us) / 1_000).ok()?;
        Some(i64::from(after_ms) - i64::from(before_ms) - since_jump_ms)
    }

    /// Microseconds passed, if the recorder's clock was set and the autopilot's went on. A link that holds frames back lets a
    /// clock jump by some seconds.
    pub(super) fn elapsed_us<R: Read>(self, before_us: u64, time_us: u64, after: &Records<R>) -> Option<u64> {
        if (before_us..before_us.saturating_add(HELD_BACK_US)).contains(&time_us) {
            return None;
        }
        let passed_ms = self.passed_ms(time_us, after).filter(|ms| (-DISORDER_MS..=TOLD_MS).contains(ms))?;
        let passed_us = u64::try_from(passed_ms * 1_000).unwrap_or(0);
        let is_set = time_us < before_us || time_us - before_us > passed_us.saturating_add(HELD_BACK_US);
        is_set.then_some(passed_us)
    }

    /// Another recording: the autopilot's clock does not go on. Without its time, a jump by more than an hour.
    pub(super) fn is_joint<R: Read>(self, before_us: u64, time_us: u64, after: &Records<R>) -> bool {
        let Some(boot) = self.passed_ms(time_us, after) else {
            return before_us.abs_diff(time_us) > JOINT_US;
        };
        let recorder = (i128::from(time_us) - i128::from(before_us)) / 1_000;
        let with_it = i128::from(boot).abs_diff(recorder) <= TOLD_MS as u128;
        boot < -DISORDER_MS || (boot > TOLD_MS && !with_it)
    }
}
