//! Raw MAVLink in its autopilot's time: frames ([`BootTimes`]) and bytes ([`BootTimedSource`]).

use std::io;

use hums_core::clock::Instant;
use hums_link::Framer;

use super::blocks::BlockFinder;
use super::boot::boot_ms;
use super::stream::{Chunk, Source};
use super::timeline::Timeline;
use super::tlog::times::Begins;

/// ms: a restart reports less. A time that falls after more belongs to another recording.
const STARTS_MS: u32 = 10_000;

/// Time since boot for frames without recorded times. Before the first report, the line's time.
#[derive(Debug, Default)]
pub struct BootTimes {
    /// The first system with an autopilot: only its times count.
    system: Option<u8>,
    timeline: Option<Timeline>,
    /// Extended beyond 32 bits of milliseconds (49.7 days).
    boot_ms: u64,
    /// The line's time at the first report.
    base: Instant,
}

impl BootTimes {
    /// A frame's time, and the power-on or recording that begins with it.
    pub fn at(&mut self, line: Instant, frame: &hums_link::Frame<'_>) -> (Instant, Option<Begins>) {
        let told = boot_ms(frame).filter(|_| self.system.is_none_or(|system| system == frame.system()));
        if let Some(boot_ms) = told {
            self.boot_ms = extend(self.boot_ms, boot_ms);
            let boot_us = self.boot_ms.saturating_mul(1_000);
            if self.timeline.is_none() {
                (self.system, self.base) = (Some(frame.system()), line);
            }
            let timeline = self.timeline.get_or_insert_with(|| Timeline::from_first(boot_us));
            let moment = timeline.at(boot_us);
            let begins = if boot_ms > STARTS_MS { Begins::Recording } else { Begins::Clock };
            return (self.after_base(moment.at), moment.restarted.then_some(begins));
        }
        (self.timeline.map_or(line, |timeline| self.after_base(timeline.now())), None)
    }

    /// Whether its system is the timed one.
    pub fn is_of(&self, frame: &hums_link::Frame<'_>) -> bool {
        self.system == Some(frame.system())
    }

    const fn is_known(&self) -> bool {
        self.timeline.is_some()
    }

    fn after_base(&self, at: Instant) -> Instant {
        Instant::from_micros(self.base.as_micros().saturating_add(at.as_micros()))
    }
}

/// The time near the last one; otherwise a later one of the same 49.7 days, or another boot's.
fn extend(last_ms: u64, boot_ms: u32) -> u64 {
    const NEAR_MS: u32 = 60_000;
    let step = boot_ms.wrapping_sub(last_ms as u32).cast_signed();
    let same = last_ms & !u64::from(u32::MAX) | u64::from(boot_ms);
    match last_ms.checked_add_signed(step.into()) {
        Some(near) if step.unsigned_abs() < NEAR_MS => near,
        _ if same >= last_ms => same,
        _ => boot_ms.into(),
    }
}

/// Baud of the fastest port: between two reports bytes come no faster.
const PORT_BAUD: u64 = 921_600;

/// Whole frames at [`BootTimes`], and between two as on the fastest port.
pub struct BootTimedSource<S> {
    line: S,
    framer: Framer,
    times: BootTimes,
    /// An incomplete frame's.
    waiting: Vec<u8>,
    at_us: u64,
    /// Another recording began with the latest chunk.
    begins: bool,
    blocks: BlockFinder,
    is_cut: bool,
}

impl<S: Source> BootTimedSource<S> {
    /// Wraps `line`, which has a line's times.
    pub fn new(line: S) -> Self {
        Self {
            line,
            framer: Framer::new(),
            times: BootTimes::default(),
            waiting: Vec::new(),
            at_us: 0,
            begins: false,
            blocks: BlockFinder::default(),
            is_cut: false,
        }
    }

    /// Bytes at the autopilot's time, or the line's.
    fn chunk(&mut self, told_us: u64, bytes: Vec<u8>) -> Chunk {
        let baud = if self.times.is_known() { PORT_BAUD } else { u64::MAX };
        let line_us = (bytes.len() as u64).saturating_mul(10_000_000) / baud;
        self.at_us = told_us.max(self.at_us.saturating_add(line_us));
        Chunk { at_us: self.at_us, bytes }
    }
}

impl<S: Source> Source for BootTimedSource<S> {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        self.begins = false;
        while let Some(Chunk { at_us, bytes }) = self.line.next()? {
            let Self { framer, times, begins, waiting, .. } = self;
            let line = Instant::from_micros(at_us);
            let mut told_us = if times.is_known() { 0 } else { at_us };
            framer.push(&bytes, &mut |frame: hums_link::Frame<'_>| {
                let (at, began) = times.at(line, &frame);
                told_us = at.as_micros();
                *begins |= began == Some(Begins::Recording);
            });
            self.blocks.take(&bytes, framer.counts().frames);
            waiting.extend(bytes);
            let whole = waiting.len().saturating_sub(framer.held());
            if whole > 0 {
                let whole = waiting.drain(..whole).collect();
                return Ok(Some(self.chunk(told_us, whole)));
            }
        }
        let (held, frames) = (self.framer.held(), self.framer.counts().frames);
        self.framer.idle(&mut |_: hums_link::Frame<'_>| {});
        self.is_cut |= held > 0 && self.framer.counts().frames == frames;
        self.blocks.end();
        let rest = std::mem::take(&mut self.waiting);
        Ok((!rest.is_empty()).then(|| self.chunk(0, rest)))
    }

    fn begins_another(&self) -> bool {
        self.begins
    }

    fn damages(&self) -> u64 {
        self.line.damages() + u64::from(self.blocks.bytes() > 0) + u64::from(self.is_cut)
    }

    fn remark(&self) -> Option<String> {
        self.line.remark()
    }
}

#[cfg(test)]
mod tests {
    use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
    use hums_link::packet::Packet;

    use super::super::paced::PacedSource;
    use super::super::raw::Raw;
    use super::*;

    #[test]
    fn the_time_since_boot_goes_on_when_its_32_bits_begin_again() {
        const WRAP: u64 = 1 << 32;
        for (name, last_ms, boot_ms, expected) in [
            ("first", 0, 5_000, 5_000),
            ("goes on", 5_000, 65_000, 65_000),
            ("out of order", 5_000, 4_000, 4_000),
            ("begins again", WRAP - 500, 500, WRAP + 500),
            ("from before that", WRAP + 500, u32::MAX, WRAP - 1),
            ("long after that", WRAP + 500, 3_600_000, WRAP + 3_600_000),
            ("another boot", 3_600_000, 900, 900),
            ("another boot, after that", WRAP + 3_600_000, 900, 900),
        ] {
            assert_eq!(extend(last_ms, boot_ms), expected, "{name}");
        }
    }

    #[test]
    fn no_frame_is_cut_in_two_and_each_comes_when_the_autopilot_says() {
        let (mut encoder, mut buffer) = (Encoder::of(1, 1), [0; FRAME_BYTES_MAX]);
        let packet = |second: u32| Packet::new(30).u32(0, 60_000 + second * 1_000).f32(24, 1.5);
        let frames: Vec<Vec<u8>> =
            (0..50).map(|second| encoder.frame(&mut buffer, &packet(second)).to_vec()).collect();
        let raw = [frames.concat(), vec![0xfd, 20, 0]].concat();
        let mut source = BootTimedSource::new(PacedSource::new(Raw::new(&raw[..]), 115_200));
        let mut chunks = Vec::new();
        while let Some(chunk) = source.next().expect("memory") {
            chunks.push(chunk);
        }
        assert_eq!(chunks.pop().map(|rest| rest.bytes), Some(vec![0xfd, 20, 0]));
        assert_eq!(chunks.iter().map(|chunk| chunk.bytes.clone()).collect::<Vec<_>>(), frames);
        let first_us = chunks[0].at_us;
        let seconds: Vec<u64> = chunks.iter().map(|chunk| (chunk.at_us - first_us) / 1_000_000).collect();
        assert_eq!(seconds, (0..50).collect::<Vec<u64>>());
        assert_eq!(source.damages(), 1);
    }
}
