//! A tlog's times: validity, meaning, and whether the clock works, for every command.

use std::io::Read;

use hums_core::clock::Instant;

use super::records::{Records, UTC_US_MIN};
use crate::mavlink::frame::{Peek, is_good, peek};
use crate::plural::count;
use crate::source::boot::{JOINT_US, Joints, boot_ms};
use crate::source::clock::{Clock, LaterTimes, Reading, Rules, Stamp, WrongTimes};
use crate::source::doubt::Ends;
use crate::source::item::{Cause, Gap};
use crate::source::pace::{Pace, SLOWER};

/// Microseconds since 1970, by the clock of a ground station, which may be set. A link may be silent for seconds before its
/// last frames, longer after its first.
const RULES: Rules = Rules {
    from_first: true,
    old_values: false,
    ends: Ends { steady_us: 10_000_000, seldom_us: 60_000_000 },
};

/// Standing times are invalid from this many records on.
const STILL_RECORDS: u64 = 100;
/// A lead of the autopilot's clock: the recorder's stopped. Held-back frames are late, never early.
const EARLY_US: i64 = 2_000_000;
/// Microseconds: a starting ground station writes held-back frames at once, and its clock stands.
const START_US: u64 = 30_000_000;
/// Microseconds: two power-ons or recordings.
const APART_US: i64 = 60_000_000;
/// Microseconds.
const DISORDER_US: i64 = 1_000_000;

/// The recorder's clock beside the autopilot's: no frame is received before it is sent. A clock that stands still, or is a
/// hundred times slower (milliseconds as microseconds), gives way to the autopilot's.
#[derive(Clone, Copy, Debug, Default)]
struct Beside {
    /// The first system that reports its time, that time, the recording's.
    last: Option<(u8, i64, i64)>,
    ahead_us: i64,
    stands: bool,
    passed_us: u64,
    began: Option<(Instant, u64)>,
}

impl Beside {
    /// Progress beyond a recorder's clock that does not run.
    fn told(&mut self, system: u8, boot_ms: u32, now: Instant, place: u64) -> u64 {
        let (boot_us, now_us) =
            (i64::from(boot_ms) * 1_000, i64::try_from(now.as_micros()).unwrap_or(i64::MAX));
        let ahead_us = now_us.saturating_sub(boot_us);
        let Some((of, boot_before, now_before)) = self.last else {
            (self.last, self.ahead_us) = (Some((system, boot_us, now_us)), ahead_us);
            return 0;
        };
        let passed_us = boot_us - boot_before;
        if of != system || (-DISORDER_US..=0).contains(&passed_us) {
            return 0;
        }
        self.last = Some((system, boot_us, now_us));
        if !(0..=APART_US).contains(&passed_us) {
            (self.ahead_us, self.stands) = (ahead_us, false);
            return 0;
        }
        if now_us.saturating_sub(now_before).saturating_mul(SLOWER as i64) >= passed_us {
            self.ahead_us = if self.stands { ahead_us } else { self.ahead_us.min(ahead_us) };
            self.stands = false;
            return 0;
        }
        let early_us = self.ahead_us.saturating_sub(ahead_us);
        self.stands |= early_us >= EARLY_US;
        if !self.stands || early_us <= 0 {
            return 0;
        }
        self.began.get_or_insert((now, place));
        self.last = Some((system, boot_us, now_us.saturating_add(early_us)));
        let early_us = early_us.unsigned_abs();
        self.passed_us = self.passed_us.saturating_add(early_us);
        early_us
    }

    fn gap(&self) -> Option<Gap> {
        let is_start = |at: Instant| at.as_micros() <= START_US && self.passed_us <= START_US && !self.stands;
        let (at, place) = self.began.filter(|(at, _)| !is_start(*at))?;
        let words = format!(
            "the recorded times stand still, or go on {SLOWER} times slower than the autopilot's, from here on for {} s: there its \
             clock counts",
            self.passed_us.div_ceil(1_000_000)
        );
        Some(Gap::damaged(at, place, words))
    }
}

/// A beginning with a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begins {
    /// It was set.
    Clock,
    /// Another recording.
    Recording,
}

/// A record's time, judged.
#[derive(Clone, Copy, Debug, Default)]
pub struct JudgedTime {
    /// Something begins with it.
    pub begins: Option<Begins>,
    /// New UTC at time zero, microseconds since 1970.
    pub epoch_us: Option<u64>,
}

/// Follows a tlog's times.
#[derive(Debug)]
pub struct Times {
    clock: Clock,
    joints: Joints,
    wrong: WrongTimes,
    now: Instant,
    records: u64,
    beside: Beside,
    pace: Pace,
}

impl Default for Times {
    fn default() -> Self {
        Self {
            clock: Clock::new(RULES),
            joints: Joints::default(),
            wrong: WrongTimes::default(),
            now: Instant::ZERO,
            records: 0,
            beside: Beside::default(),
            pace: Pace::default(),
        }
    }
}

impl Times {
    /// The latest valid time.
    pub const fn now(&self) -> Instant {
        self.now
    }

    /// The time of a record at this byte.
    pub fn take<R: Read>(
        &mut self,
        time_us: u64,
        bytes: &[u8],
        place: u64,
        after: &Records<R>,
    ) -> JudgedTime {
        let told = self.time(time_us, place, after);
        if let Peek::Frame(frame) = peek(bytes)
            && let Some(boot_ms) = boot_ms(&frame)
            && is_good(&frame)
        {
            self.joints.told(frame.system(), boot_ms);
            let early_us = self.beside.told(frame.system(), boot_ms, self.now, place);
            if early_us > 0 {
                self.clock.pass(early_us);
                self.now = self.clock.now();
            }
        }
        self.pace.at(self.now, place, bytes.len() as u64);
        told
    }

    fn time<R: Read>(&mut self, time_us: u64, place: u64, after: &Records<R>) -> JudgedTime {
        self.records += 1;
        let before = self.clock.recorded_us();
        let stamp = |us| Stamp { us, series: 0 };
        let ahead = |_: &dyn Fn(Stamp) -> bool| {
            let (times, is_end) = after.times_after();
            LaterTimes { stamps: times.into_iter().map(stamp).collect(), is_end }
        };
        let (joints, stands) = (self.joints, self.beside.stands);
        // Counted while the clock stood still.
        let passed = || if stands { Some(1) } else { joints.elapsed_us(before?, time_us, after) };
        let Reading::Sound(moment) = self.clock.take_beside(stamp(time_us), ahead, passed) else {
            self.wrong.add(self.now, place);
            return JudgedTime::default();
        };
        self.now = moment.at;
        let is_joint = before.is_some_and(|before| {
            let is_far = moment.restarted || time_us > before.saturating_add(JOINT_US);
            is_far && self.joints.is_joint(before, time_us, after)
        });
        if is_joint {
            self.joints = Joints::default();
            self.pace.begin_another();
            self.beside = Beside { last: None, stands: false, ..self.beside };
        }
        if moment.restarted && !is_joint {
            self.pace.fell(moment.at);
        }
        let begins = match (is_joint, moment.restarted) {
            (true, _) => Some(Begins::Recording),
            (false, true) => Some(Begins::Clock),
            (false, false) => None,
        };
        let is_new = begins.is_some() || before.is_none();
        let epoch_us = time_us.checked_sub(self.now.as_micros());
        let epoch_us = epoch_us.filter(|_| is_new && time_us >= UTC_US_MIN);
        JudgedTime { begins, epoch_us }
    }

    /// Damage, once all were taken.
    pub fn gaps(&self) -> impl Iterator<Item = Gap> {
        self.wrong
            .gap()
            .into_iter()
            .chain(self.beside.gap())
            .chain(self.no_times().or_else(|| self.pace.gap()))
    }

    /// The gap of a recording without a possible time.
    pub fn none_of(&self, frames: u64) -> Option<Gap> {
        let words = format!(
            "{} without a time that can be one: nothing in the log can be judged",
            count(frames, "frame")
        );
        (self.records == 0 && frames > 0).then(|| Gap::new(None, Cause::NoTimes, words))
    }

    fn no_times(&self) -> Option<Gap> {
        if self.now != Instant::ZERO || self.records < STILL_RECORDS {
            return None;
        }
        let words =
            format!("{} have the same time: nothing in the log can be judged", count(self.records, "record"));
        Some(Gap::new(None, Cause::NoTimes, words))
    }
}
