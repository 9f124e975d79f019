//! MAVLink recordings, a ground station's tlog and the raw bytes of a port, as the one stream.

use anyhow::Result;
use hums_core::time::Instant;
use hums_link::framer::Framer;

use super::boot::{JOINT_US, Joints, boot_ms};
use super::clock::{Ahead, Clock, Reading, Rules, Stamp, Wrong};
use super::doubt::Ends;
use super::input::Input;
use super::item::{Cause, Gap, Item, MessageCount, Reader, Summary, Take, Want};
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
        Self { records: Records::new(input) }
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
}

impl TlogReading {
    /// Takes the time of a record, and hands on what it says of the clock.
    fn time(&mut self, time_us: u64, place: u64, after: &Records<Input>, take: &mut Take<'_>) -> Result<()> {
        let before = self.clock.recorded_us();
        let stamp = |us| Stamp { us, series: 0 };
        let ahead = |_: &dyn Fn(Stamp) -> bool| {
            let (times, is_end) = after.times_after();
            Ahead { stamps: times.into_iter().map(stamp).collect(), is_end }
        };
        let Reading::Sound(moment) = self.clock.take(stamp(time_us), ahead) else {
            self.wrong.add(self.now, place);
            return Ok(());
        };
        self.now = moment.at;
        let is_joint = before.is_some_and(|before| {
            let is_far = moment.restarted || time_us > before.saturating_add(JOINT_US);
            is_far && self.joints.is_joint(before, time_us, after)
        });
        match (is_joint, moment.restarted) {
            (true, _) => take(self.now, Item::Joint)?,
            (false, true) => take(self.now, Item::Restart)?,
            (false, false) if before.is_some() => return Ok(()),
            (false, false) => {}
        }
        match time_us.checked_sub(self.now.as_micros()).filter(|_| time_us >= UTC_US_MIN) {
            Some(epoch_us) => take(self.now, Item::Epoch(epoch_us)),
            None => Ok(()),
        }
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
        };
        let mut place = 0_u64;
        while let Some(record) = self.records.next_record()? {
            let bytes = match record {
                Record::Frame { time_us, bytes } => {
                    reading.time(time_us, place, &self.records, take)?;
                    place += TIME_BYTES as u64;
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
            let TlogReading { joints, now, .. } = &mut reading;
            push(&mut framer, &bytes, true, &mut |frame| {
                joints.frame(&frame);
                counts.add(frame.id(), frame.bytes().len());
                said.frame(*now, &frame, want, take)
            })?;
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
mod tests {
    use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
    use hums_link::packet::Packet;

    use super::*;
    use crate::mavlink::frame::tests::HEARTBEAT;

    const SECOND: u64 = 1_000_000;

    /// Of a tlog with these times, in tenths of seconds: gaps, restarts, and the last time in tenths.
    fn told(tenths: &[u64]) -> (Vec<(Cause, Option<u64>)>, usize, u64) {
        let record = |tenth: &u64| {
            [&(1_700_000_000 * SECOND + tenth * SECOND / 10).to_be_bytes()[..], &HEARTBEAT].concat()
        };
        let bytes: Vec<u8> = tenths.iter().flat_map(record).collect();
        let mut reader = TlogReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"));
        let (mut gaps, mut restarts, mut last) = (Vec::new(), 0, Instant::ZERO);
        let summary = reader.read(Want { frames: true, ..Want::default() }, &mut |at, item| {
            match item {
                Item::Gap(gap) => gaps.push((gap.cause, gap.place)),
                Item::Restart => restarts += 1,
                _ => {}
            }
            last = at;
            Ok(())
        });
        assert!(summary.is_ok());
        (gaps, restarts, last.as_millis() / 100)
    }

    #[test]
    fn one_wrong_time_is_damage_and_changes_no_other_time() {
        let usual: Vec<u64> = (1_000..1_200).collect();
        assert_eq!(told(&usual), (vec![], 0, 199));
        for (at, wrong) in [(100, 1_130), (100, 1_400), (100, 9_000), (100, 100), (0, 1_500)] {
            let mut times = usual.clone();
            times[at] = wrong;
            // The first record's time begins the recording, unless it is the wrong one.
            let end = if at == 0 { 198 } else { 199 };
            assert_eq!(told(&times), (vec![(Cause::Damaged, Some(at as u64 * 29))], 0, end), "{wrong}");
        }
    }

    #[test]
    fn a_wrong_time_at_either_end_moves_no_other_time() {
        for count in [1, 2, 8] {
            for (at, wrong) in [(200 - count, 170_000), (200 - count, 100), (0, 10_000), (0, 80_900)] {
                let mut times: Vec<u64> = (80_000..80_200).collect();
                times[at..at + count].fill(wrong);
                let end = 199 - count as u64;
                let told = told(&times);
                assert_eq!(
                    told,
                    (vec![(Cause::Damaged, Some(at as u64 * 29))], 0, end),
                    "{at} {wrong} {count}"
                );
            }
        }
        // A link that was silent for some seconds before its last frames.
        let late: Vec<u64> = (80_000..80_200).chain([80_250, 80_251]).collect();
        assert_eq!(told(&late), (vec![], 0, 251));
    }

    #[test]
    fn a_clock_that_is_set_back_by_a_second_again_and_again_is_no_damage() {
        // Twenty records a second; every ten seconds the clock falls by 1.1 to 1.4 s.
        let mut times = Vec::new();
        let mut from = 80_000;
        for fall in [11, 14, 12, 13, 0] {
            times.extend((0..200).map(|record| from + record / 2));
            from += 99 - fall;
        }
        let (gaps, restarts, _) = told(&times);
        assert_eq!((gaps, restarts), (vec![], 4));
    }

    /// What a tlog says of its clock: of attitudes at these seconds of the ground station's clock and of the autopilot's.
    fn clock_of(times: &[(u64, u64)]) -> String {
        let (mut encoder, mut buffer) = (Encoder::of(1, 1), [0; FRAME_BYTES_MAX]);
        let record = |(recorded, boot): &(u64, u64)| {
            let time = (1_700_000_000 * SECOND + recorded * SECOND).to_be_bytes();
            let packet = Packet::new(30).u32(0, *boot as u32 * 1_000);
            [&time[..], encoder.frame(&mut buffer, &packet)].concat()
        };
        let bytes: Vec<u8> = times.iter().flat_map(record).collect();
        let mut reader = TlogReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"));
        let mut told = String::new();
        let read = reader.read(Want::default(), &mut |_, item| {
            match item {
                Item::Gap(_) => told += "gap ",
                Item::Restart => told += "restart ",
                Item::Joint => told += "joint ",
                _ => {}
            }
            Ok(())
        });
        assert!(read.is_ok());
        told
    }

    #[test]
    fn two_recordings_that_were_joined_are_told_from_a_clock_that_was_set_and_from_a_long_silence() {
        let part = |recorded: u64, boot: u64| (0..50).map(move |second| (recorded + second, boot + second));
        let joined =
            |recorded, boot| clock_of(&part(90_000, 100).chain(part(recorded, boot)).collect::<Vec<_>>());
        assert_eq!(joined(90_000, 100), "joint ", "the same twice");
        assert_eq!(joined(93_700, 100), "joint ", "an hour later, after another power-on");
        assert_eq!(joined(50_000, 700), "joint ", "an earlier one, longer after its power-on");
        assert_eq!(joined(50_000, 150), "restart ", "the clock was set");
        assert_eq!(joined(93_700, 100 + 3_700), "", "an hour without a word");
        assert_eq!(joined(90_200, 5), "", "a restart of the autopilot");
    }

    #[test]
    fn a_clock_that_was_set_and_a_silence_are_none() {
        let set: Vec<u64> = (1_000..1_100).chain(500..600).collect();
        assert_eq!(told(&set), (vec![], 1, 99 + 99));
        let silent: Vec<u64> = (1_000..1_100).chain(1_500..1_600).collect();
        assert_eq!(told(&silent), (vec![], 0, 599));
    }

    /// The times, in milliseconds, of attitudes that tell these times since the autopilot's boot, and how often it restarted.
    fn read(component: u8, boot_ms: &[u32]) -> (Vec<u64>, usize) {
        let (mut encoder, mut buffer) = (Encoder::of(1, component), [0; FRAME_BYTES_MAX]);
        let frame = |boot_ms: &u32| encoder.frame(&mut buffer, &Packet::new(30).u32(0, *boot_ms)).to_vec();
        let bytes: Vec<u8> = boot_ms.iter().flat_map(frame).collect();
        let mut reader = RawReader::new(Input::new(std::io::Cursor::new(bytes)).expect("memory"), 115_200);
        let (mut times, mut restarts) = (Vec::new(), 0);
        let want = Want { frames: true, ..Want::default() };
        let mut take = |at: Instant, item: Item<'_>| {
            times.extend(matches!(item, Item::Frame(_)).then(|| at.as_millis()));
            restarts += usize::from(matches!(item, Item::Restart));
            Ok(())
        };
        reader.read(want, &mut take).expect("memory");
        (times, restarts)
    }

    #[test]
    fn raw_frames_come_when_the_autopilots_messages_say_and_where_none_does_when_a_line_brings_them() {
        let (times, restarts) = read(1, &[60_000, 61_000, 75_500, 75_400, 900, 1_900]);
        let since_first: Vec<u64> = times.iter().map(|at| at - times[0]).collect();
        assert_eq!((since_first, restarts), (vec![0, 1_000, 15_500, 15_500, 15_500, 16_500], 1));
        let (times, restarts) = read(100, &[60_000, 61_000, 75_500]);
        assert!(times.len() == 3 && times[2] < 20 && restarts == 0, "no autopilot says so: {times:?}");
    }
}
