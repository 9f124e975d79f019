//! MAVLink recordings, a ground station's tlog and the raw bytes of a port, as the one stream.

use anyhow::Result;
use hums_core::time::Instant;
use hums_link::framer::Framer;

use super::input::Input;
use super::item::{Cause, Gap, Item, MessageCount, Reader, Summary, Take, Want};
use super::paced::Paced;
use super::raw::Raw;
use super::said::Said;
use super::stream::Source as _;
use super::timeline::{STEP_BACK_US_MAX, Timeline, Wrong, is_wrong};
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

/// Whether a record's time is wrong: the times after it say so, or it stands alone at one end of the recording, ten
/// minutes from all others or before them. A ground station's clock gives no single record such a time.
fn is_wrong_time(before: Option<u64>, time_us: u64, after: &[u64]) -> bool {
    const ALONE_US: u64 = 600_000_000;
    match (before, after.first()) {
        (Some(before), None) => {
            time_us > before.saturating_add(ALONE_US) || time_us.saturating_add(STEP_BACK_US_MAX) < before
        }
        (None, Some(next)) if *next > time_us.saturating_add(ALONE_US) => after.len() > 1,
        _ => is_wrong(before, time_us, after.iter().copied()) == Some(true),
    }
}

impl Reader for TlogReader {
    fn read(&mut self, want: Want<'_>, take: &mut Take<'_>) -> Result<Summary> {
        let (mut framer, mut said, mut counts) = (Framer::new(), Said::default(), Counts::new());
        let mut timeline: Option<Timeline> = None;
        let mut wrong = Wrong::default();
        let (mut place, mut now) = (0_u64, Instant::ZERO);
        while let Some(record) = self.records.next_record()? {
            let bytes = match record {
                Record::Frame { time_us, bytes } => {
                    let (before, after) =
                        (timeline.and_then(|timeline| timeline.recorded_us()), || self.records.times_after());
                    let is_jump = timeline.is_none_or(|timeline| timeline.is_jump(time_us));
                    // Where a wrong one is the first of all, the next one tells when the recording began.
                    let time_us = if is_jump && is_wrong_time(before, time_us, &after()) {
                        wrong.add(now, place);
                        before.or_else(|| after().first().copied()).unwrap_or(time_us)
                    } else {
                        time_us
                    };
                    let timeline = match &mut timeline {
                        Some(timeline) => timeline,
                        none => {
                            if time_us >= UTC_US_MIN {
                                take(now, Item::Epoch(time_us))?;
                            }
                            none.insert(Timeline::from_first(time_us))
                        }
                    };
                    let moment = timeline.at(time_us);
                    now = moment.at;
                    if moment.restarted {
                        take(now, Item::Restart)?;
                        if let Some(epoch_us) =
                            time_us.checked_sub(now.as_micros()).filter(|_| time_us >= UTC_US_MIN)
                        {
                            take(now, Item::Epoch(epoch_us))?;
                        }
                    }
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
                    take(now, Item::Gap(&gap(now, cause, place, bytes.len(), words)))?;
                    bytes
                }
            };
            place += bytes.len() as u64;
            push(&mut framer, &bytes, true, &mut |frame| {
                counts.add(frame.id(), frame.bytes().len());
                said.frame(now, &frame, want, take)
            })?;
        }
        if let Some(gap) = wrong.gap() {
            take(now, Item::Gap(&gap))?;
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
        let told = Self::boot_ms(frame).filter(|_| self.system.is_none_or(|system| system == frame.system()));
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

    /// `time_boot_ms` of an autopilot's `SYSTEM_TIME`, `ATTITUDE` and `GLOBAL_POSITION_INT`; zeros at the end of a payload are not sent.
    fn boot_ms(frame: &hums_link::Frame<'_>) -> Option<u32> {
        /// `MAV_COMP_ID_AUTOPILOT1`
        const AUTOPILOT: u8 = 1;
        let offset = match frame.id() {
            2 => 8,
            30 | 33 => 0,
            _ => return None,
        };
        let byte = |at: usize| frame.payload().get(offset + at).copied().unwrap_or(0);
        (frame.component() == AUTOPILOT).then(|| u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)]))
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
        for (at, wrong) in [(199, 170_000), (199, 100), (0, 10_000)] {
            let mut times: Vec<u64> = (80_000..80_200).collect();
            times[at] = wrong;
            let end = 198;
            assert_eq!(told(&times), (vec![(Cause::Damaged, Some(at as u64 * 29))], 0, end), "{at} {wrong}");
        }
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
