//! The autopilot's own time in a ground station's recording: what tells two recordings that were joined from a clock that was set.
//!
//! A ground station's clock that falls, or jumps by more than an hour, was set, or another recording was joined on. The
//! autopilot's messages tell its time since its power-on: where that goes on, the recording does; where it changes too, a
//! vehicle did not restart in the air just when a clock was set: it is another recording.

use super::input::Input;
use super::tlog::Records;
use crate::mavlink::frame;

/// A clock that jumps by more than this may be that of another recording: microseconds.
pub(super) const JOINT_US: u64 = 3_600_000_000;
/// Messages that tell the time since power-on come every few seconds at least, s.
const TOLD_MS: i64 = 60_000;
/// Messages are out of order by so much at most.
const DISORDER_MS: i64 = 1_000;
/// `MAV_COMP_ID_AUTOPILOT1`
const AUTOPILOT: u8 = 1;

/// `time_boot_ms` of an autopilot's `SYSTEM_TIME`, `ATTITUDE` and `GLOBAL_POSITION_INT`; zeros at the end of a payload are not sent.
pub(super) fn boot_ms(frame: &hums_link::Frame<'_>) -> Option<u32> {
    boot_ms_of(frame.id(), frame.component(), frame.payload())
}

fn boot_ms_of(id: u32, component: u8, payload: &[u8]) -> Option<u32> {
    let offset = match id {
        2 => 8,
        30 | 33 => 0,
        _ => return None,
    };
    let byte = |at: usize| payload.get(offset + at).copied().unwrap_or(0);
    (component == AUTOPILOT).then(|| u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]))
}

/// Follows the autopilots' time.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Joints {
    /// Of whichever autopilot told it last: its system, and its time since power-on.
    last: Option<(u8, u32)>,
}

impl Joints {
    /// A frame of the recording.
    pub(super) fn frame(&mut self, frame: &hums_link::Frame<'_>) {
        if let Some(boot_ms) = boot_ms(frame) {
            self.last = Some((frame.system(), boot_ms));
        }
    }

    /// Whether another recording begins where the recorder's clock goes from one time to another: the autopilot's does not
    /// go on. Where none tells its time, a jump by more than an hour says so.
    pub(super) fn is_joint(&self, before_us: u64, time_us: u64, after: &Records<Input>) -> bool {
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
