//! MAVLink recordings, a ground station's tlog and the raw bytes of a port, as the one stream.

use anyhow::Result;
use hums_core::time::Instant;
use hums_link::framer::Framer;

use super::boot::{JOINT_US, Joints, boot_ms};
use super::checksums::Checksums;
use super::clock::{Ahead, Clock, Reading, Rules, Stamp, Wrong};
use super::doubt::Ends;
use super::input::Input;
use super::item::{About, Cause, Fact, Gap, Item, MessageCount, Reader, Summary, Take, Want};
use super::paced::Paced;
use super::raw::Raw;
use super::said::Said;
use super::stream::Source as _;
use super::timeline::Timeline;
use super::tlog::{Record, Records, TIME_BYTES, UTC_US_MIN};
use crate::names::message_name;
use crate::plural::count;

/// Ids below this are counted in a table; above it lie few messages, and hostile ones are bounded by [`IDS_MAX`].
const NEAR: usize = 1024;
/// Further ids that are counted one by one.
const IDS_MAX: usize = 4096;

/// Frames by their id.
struct Counts {
    near: Vec<(u64, u64)>,
    far: std::collections::BTreeMap<u32, (u64, u64)>,
}

impl Counts {
    fn new() -> Self {
        Self { near: vec![(0, 0); NEAR], far: std::collections::BTreeMap::new() }
    }

    fn add(&mut self, id: u32, bytes: usize) {
        let room = self.far.len() < IDS_MAX;
        let count = match self.near.get_mut(id as usize) {
            Some(count) => count,
            None if room => self.far.entry(id).or_default(),
            None => return,
        };
        (count.0, count.1) = (count.0 + 1, count.1 + bytes as u64);
    }

    fn summary(&self) -> Summary {
        let near = (0..).zip(&self.near).filter(|(_, count)| count.0 > 0);
        let all = near.chain(self.far.iter().map(|(id, count)| (*id, count)));
        let message =
            |(id, &(count, bytes))| MessageCount { name: message_name(id).into_owned(), count, bytes };
        let mut messages: Vec<_> = all.map(message).collect();
        messages.sort_by(|a, b| a.name.cmp(&b.name));
        Summary { messages, ending: None }
    }
}

/// A ground station's log.
pub struct TlogReader {
    records: Records<Input>,
}

impl TlogReader {
    /// Reads from `input`.
    pub fn new(input: Input) -> Self {
        Self { records: Records::ahead(input) }
    }
}

/// Microseconds since 1970, by the clock of a ground station, which may be set; a link may be silent for seconds until its last
/// frames come, and for longer after its first.
const RULES: Rules = Rules {
    from_first: true,
    old_values: false,
    ends: Ends { steady_us: 10_000_000, seldom_us: 60_000_000 },
};

/// The reading of a tlog.
struct TlogReading {
    clock: Clock,
    joints: Joints,
    wrong: Wrong,
    now: Instant,
    /// The time of the record at hand, where it is not wrong.
    time_us: Option<u64>,
}

impl TlogReading {
    /// Takes the time of a record, and hands on what it says of the clock; whether another recording begins.
    fn time(
        &mut self,
        time_us: u64,
        place: u64,
        after: &Records<Input>,
        take: &mut Take<'_>,
    ) -> Result<bool> {
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
            self.time_us = None;
            return Ok(false);
        };
        (self.now, self.time_us) = (moment.at, Some(time_us));
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
        match (is_joint, moment.restarted) {
            (true, _) => take(self.now, Item::Joint)?,
            (false, true) => take(self.now, Item::Restart)?,
            (false, false) if before.is_some() => return Ok(false),
            (false, false) => {}
        }
        if let Some(epoch_us) = time_us.checked_sub(self.now.as_micros()).filter(|_| time_us >= UTC_US_MIN) {
            take(self.now, Item::Epoch(epoch_us))?;
        }
        Ok(is_joint)
    }
}

impl Reader for TlogReader {
    fn read(&mut self, want: Want<'_>, take: &mut Take<'_>) -> Result<Summary> {
        let (mut framer, mut said, mut counts) = (Framer::new(), Said::default(), Counts::new());
        let mut reading = TlogReading {
            clock: Clock::new(RULES),
            joints: Joints::default(),
            wrong: Wrong::default(),
            now: Instant::ZERO,
            time_us: None,
        };
        let mut checksums = Checksums::default();
        let mut place = 0_u64;
        while let Some(record) = self.records.next_record()? {
            let bytes = match record {
                Record::Frame { time_us, bytes } => {
                    if reading.time(time_us, place, &self.records, take)? {
                        // Nothing that was said before holds.
                        said.end(take)?;
                        (framer, said) = (Framer::new(), Said::default());
                    }
                    place += TIME_BYTES as u64;
                    checksums.begin(reading.now, place, &bytes);
                    bytes
                }
                Record::Noise(bytes) => {
                    let (cause, what) = if self.records.is_cut(&bytes) {
                        (Cause::Cut, "a record that the end cuts off")
                    } else {
                        (Cause::Damaged, "of no record of the tlog")
                    };
                    let words = format!("{what}: {}", count(bytes.len(), "byte"));
                    take(reading.now, Item::Gap(&gap(reading.now, cause, place, bytes.len(), words)))?;
                    bytes
                }
            };
            place += bytes.len() as u64;
            let TlogReading { joints, now, time_us, .. } = &mut reading;
            push(&mut framer, &bytes, true, &mut |frame| {
                checksums.frame(&frame);
                joints.frame(*time_us, &frame);
                counts.add(frame.id(), frame.bytes().len());
                said.frame(*now, &frame, want, take)
            })?;
            checksums.end();
        }
        if let Some(gap) = checksums.gap() {
            take(reading.now, Item::Gap(&gap))?;
        }
        if let Some(words) = checksums.words() {
            take(reading.now, Item::Fact(Fact { about: About::Unchecked, words: &words }))?;
        }
        if let Some(gap) = reading.wrong.gap() {
            take(reading.now, Item::Gap(&gap))?;
        }
        said.end(take)?;
        Ok(counts.summary())
    }
}

/// The time of frames without recorded times: what the autopilot's own messages tell of the time since its boot, and until it
/// tells any, what a line takes for the bytes.
#[derive(Default)]
struct BootTimes {
    /// Whose times count: the first system whose autopilot tells one.
    system: Option<u8>,
    timeline: Option<Timeline>,
    /// The line's time at the first of them.
    base: Instant,
}

impl BootTimes {
    /// The time of a frame, and whether the autopilot's clock began again before it.
    fn at(&mut self, line: Instant, frame: &hums_link::Frame<'_>) -> (Instant, bool) {
        let told = boot_ms(frame).filter(|_| self.system.is_none_or(|system| system == frame.system()));
        if let Some(boot_ms) = told {
            let boot_us = u64::from(boot_ms) * 1_000;
            if self.timeline.is_none() {
                (self.system, self.base) = (Some(frame.system()), line);
            }
            let timeline = self.timeline.get_or_insert_with(|| Timeline::from_first(boot_us));
            let moment = timeline.at(boot_us);
            return (self.after_base(moment.at), moment.restarted);
        }
        (self.timeline.map_or(line, |timeline| self.after_base(timeline.now())), false)
    }

    fn after_base(&self, at: Instant) -> Instant {
        Instant::from_micros(self.base.as_micros().saturating_add(at.as_micros()))
    }
}

/// The raw bytes of a port, in the time that the autopilot's messages tell, or that a line at this rate takes for them.
pub struct RawReader {
    bytes: Paced<Raw<Input>>,
}

impl RawReader {
    /// Reads from `input`, at `baud`.
    pub fn new(input: Input, baud: u32) -> Self {
        Self { bytes: Paced::new(Raw::new(input), baud) }
    }
}

impl Reader for RawReader {
    fn read(&mut self, want: Want<'_>, take: &mut Take<'_>) -> Result<Summary> {
        let (mut framer, mut said, mut counts) = (Framer::new(), Said::default(), Counts::new());
        let mut now = Instant::ZERO;
        let mut line = Instant::ZERO;
        let mut times = BootTimes::default();
        let mut each = |line, frame: hums_link::Frame<'_>, take: &mut Take<'_>| {
            counts.add(frame.id(), frame.bytes().len());
            let (at, restarted) = times.at(line, &frame);
            now = at;
            if restarted {
                take(at, Item::Restart)?;
            }
            said.frame(at, &frame, want, take)
        };
        while let Some(chunk) = self.bytes.next()? {
            line = Instant::from_micros(chunk.at_us);
            push(&mut framer, &chunk.bytes, false, &mut |frame| each(line, frame, take))?;
        }
        push(&mut framer, &[], true, &mut |frame| each(line, frame, take))?;
        said.end(take)?;
        let noise = framer.counts().bytes_not_frames;
        if noise > 0 {
            // Noise on the line and damage of the file look alike here.
            let words = format!("of no frame, noise on the line: {}", count(noise, "byte"));
            let lost = Gap {
                from: Some(Instant::ZERO),
                to: Some(now),
                place: None,
                bytes: noise,
                ..gap(now, Cause::Lost, 0, 0, words)
            };
            take(now, Item::Gap(&lost))?;
        }
        Ok(counts.summary())
    }
}

fn gap(at: Instant, cause: Cause, place: u64, bytes: usize, words: String) -> Gap {
    Gap { from: Some(at), to: None, cause, place: Some(place), bytes: bytes as u64, words }
}

/// Pushes bytes into a framer whose frames go to one that may fail. `idle` says that silence follows.
fn push(
    framer: &mut Framer,
    bytes: &[u8],
    idle: bool,
    each: &mut dyn FnMut(hums_link::Frame<'_>) -> Result<()>,
) -> Result<()> {
    let mut result = Ok(());
    let mut sink = |frame: hums_link::Frame<'_>| {
        if result.is_ok() {
            result = each(frame);
        }
    };
    framer.push(bytes, &mut sink);
    if idle {
        framer.idle(&mut sink);
    }
    result
}

#[cfg(test)]
mod tests;
