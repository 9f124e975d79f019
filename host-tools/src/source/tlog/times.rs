//! The times of a tlog's records: which of them count, what they say of the recording, and whether they are times at all.
//!
//! Every command that reads a tlog asks here, so that all of them have the same times.

use std::io::Read;

use hums_core::time::Instant;

use super::records::{Records, UTC_US_MIN};
use crate::mavlink::frame::{Check, Peek, peek};
use crate::plural::count;
use crate::source::boot::{JOINT_US, Joints, boot_ms_of};
use crate::source::clock::{Ahead, Clock, Reading, Rules, Stamp, Wrong};
use crate::source::doubt::Ends;
use crate::source::item::{Cause, Gap};

/// Microseconds since 1970, by the clock of a ground station, which may be set; a link may be silent for seconds until its last
/// frames come, and for longer after its first.
const RULES: Rules = Rules {
    from_first: true,
    old_values: false,
    ends: Ends { steady_us: 10_000_000, seldom_us: 60_000_000 },
};

/// Times that stand still are none after so many records, ...
const STILL_RECORDS: u64 = 100;
/// ... and those that go on this many times slower than the autopilot's own, after so long: milliseconds as microseconds.
const SLOWER: u64 = 100;
const TOLD_MS: u64 = 10_000;
/// An autopilot's times further apart than this are of two power-ons, or of two recordings.
const APART_MS: u32 = 60_000;

/// What begins with a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begins {
    /// The clock: it was set.
    Clock,
    /// Another recording.
    Recording,
}

/// What a record's time says.
#[derive(Clone, Copy, Debug, Default)]
pub struct Told {
    /// What begins with it.
    pub begins: Option<Begins>,
    /// UTC at time zero, where that is new: microseconds since 1970.
    pub epoch_us: Option<u64>,
}

/// Follows the times of a tlog.
#[derive(Debug)]
pub struct Times {
    clock: Clock,
    joints: Joints,
    wrong: Wrong,
    now: Instant,
    records: u64,
    /// The time of an autopilot since its power-on, and how much of it went by.
    boot: Option<(u8, u32)>,
    told_ms: u64,
}

impl Default for Times {
    fn default() -> Self {
        let (joints, wrong) = (Joints::default(), Wrong::default());
        Self {
            clock: Clock::new(RULES),
            joints,
            wrong,
            now: Instant::ZERO,
            records: 0,
            boot: None,
            told_ms: 0,
        }
    }
}

impl Times {
    /// The latest time that counts.
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// Takes the time of a record with this frame, which stands at this byte.
    pub fn take<R: Read>(&mut self, time_us: u64, bytes: &[u8], place: u64, after: &Records<R>) -> Told {
        let (told, is_wrong) = self.time(time_us, place, after);
        if let Peek::Frame(frame) = peek(bytes)
            && let Some(boot_ms) = boot_ms_of(frame.id, frame.component, frame.payload)
            && frame.check() == Check::Good
        {
            self.joints.told(Some(time_us).filter(|_| !is_wrong), frame.system, boot_ms);
            let passed_ms = self.boot.filter(|(system, _)| *system == frame.system);
            let passed_ms = passed_ms.and_then(|(_, before_ms)| boot_ms.checked_sub(before_ms));
            self.told_ms += u64::from(passed_ms.filter(|passed_ms| *passed_ms < APART_MS).unwrap_or(0));
            self.boot = Some((frame.system, boot_ms));
        }
        told
    }

    /// What a time says, and whether it is wrong.
    fn time<R: Read>(&mut self, time_us: u64, place: u64, after: &Records<R>) -> (Told, bool) {
        self.records += 1;
        let (before, reached) = (self.clock.recorded_us(), self.now);
        let stamp = |us| Stamp { us, series: 0 };
        let ahead = |_: &dyn Fn(Stamp) -> bool| {
            let (times, is_end) = after.times_after();
            Ahead { stamps: times.into_iter().map(stamp).collect(), is_end }
        };
        let joints = &self.joints;
        let passed = || joints.elapsed_us(before?, time_us, after);
        let Reading::Sound(moment) = self.clock.take_beside(stamp(time_us), ahead, passed) else {
            self.wrong.add(self.now, place);
            return (Told::default(), true);
        };
        self.now = moment.at;
        let is_joint = before.is_some_and(|before| {
            let is_far = moment.restarted || time_us > before.saturating_add(JOINT_US);
            is_far && self.joints.is_joint(before, time_us, after)
        });
        let passed_us = moment.at.since(reached).as_micros();
        match before.filter(|_| moment.restarted) {
            _ if is_joint => self.joints.forget(),
            Some(before) => self.joints.set(before, time_us, passed_us),
            None => {}
        }
        let begins = match (is_joint, moment.restarted) {
            (true, _) => Some(Begins::Recording),
            (false, true) => Some(Begins::Clock),
            (false, false) => None,
        };
        let is_new = begins.is_some() || before.is_none();
        let epoch_us = time_us.checked_sub(self.now.as_micros());
        let epoch_us = epoch_us.filter(|_| is_new && time_us >= UTC_US_MIN);
        (Told { begins, epoch_us }, false)
    }

    /// What is wrong with the times, once all were taken: damage.
    pub fn gaps(&self) -> impl Iterator<Item = Gap> {
        self.wrong.gap().into_iter().chain(self.no_times())
    }

    /// The recorded times are none.
    fn no_times(&self) -> Option<Gap> {
        let passed_ms = self.now.as_millis();
        let words = if self.now == Instant::ZERO && self.records >= STILL_RECORDS {
            format!("{} have the same time: nothing in the log can be judged", count(self.records, "record"))
        } else if self.told_ms >= TOLD_MS && passed_ms < self.told_ms / SLOWER {
            format!(
                "the recorded times are no microseconds: {passed_ms} ms went by on them, and {} s on the autopilot's clock; \
                 nothing in the log can be judged",
                self.told_ms / 1_000
            )
        } else {
            return None;
        };
        Some(Gap { from: None, to: None, cause: Cause::NoTimes, place: None, bytes: 0, words })
    }
}
