//! A ground station's log: eight big-endian bytes of microseconds since 1970, one frame, repeated.
//!
//! Damage is walked over: where no record stands, bytes are skipped up to the next place where one does, and what was
//! skipped arrives as noise on the line, because nothing that was in the file may vanish unseen.
//!
//! Recorded clocks jump (a PC's clock is set, two recordings are joined). Arrival times never fall: after a step back
//! of more than a second, or forward of more than a day, time goes on from where it was; a smaller step back is a
//! frame that arrives together with the one before it.

use std::io::{self, Read};

use super::doubt::ASKED;
use super::stream::{Chunk, Source, read_some};
use crate::mavlink::frame::{Check, FRAME_BYTES_MAX, Peek, peek};
use crate::plural::count;

pub(super) const TIME_BYTES: usize = 8;
const BUFFER_BYTES: usize = 64 * 1024;
/// Enough to see a record and the header of the next one.
const RECORD_BYTES: usize = 2 * (TIME_BYTES + FRAME_BYTES_MAX);
/// Enough to see those after it too that are asked whether its time is right, behind damage as well.
const AHEAD_BYTES: usize = 256 * 1024;
/// No record for so long: what follows is no part of the log.
const NOTHING_BYTES: usize = 64 * 1024;

/// A step back beyond this is a clock that was set, not a reordering.
const STEP_BACK_US_MAX: u64 = 1_000_000;
/// A step forward beyond this is damage or a clock that was set; gaps of hours are real.
const STEP_FORWARD_US_MAX: u64 = 24 * 3600 * 1_000_000;
/// No recording is from after the year 2255: a time beyond is damage. It may be small: time since boot.
const TIME_US_MAX: u64 = 9_000_000_000_000_000;

/// One record.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Record {
    /// A frame with the time before it, in microseconds (since 1970, if the recorder knew it).
    Frame {
        /// The recorded time.
        time_us: u64,
        /// The frame.
        bytes: Vec<u8>,
    },
    /// Bytes that belong to no record.
    Noise(Vec<u8>),
}

/// The records of a tlog, in order.
pub struct Records<R> {
    input: R,
    buffer: Vec<u8>,
    at: usize,
    ended: bool,
    /// How much is kept of what follows.
    ahead_bytes: usize,
}

impl<R: Read> Records<R> {
    /// Reads from `input`, no further than needs be: somebody may be writing it.
    pub fn new(input: R) -> Self {
        Self { input, buffer: Vec::new(), at: 0, ended: false, ahead_bytes: RECORD_BYTES }
    }

    /// Reads from `input`, and further on, so that those that follow can be asked.
    pub(super) fn ahead(input: R) -> Self {
        Self { ahead_bytes: AHEAD_BYTES, ..Self::new(input) }
    }

    fn rest(&self) -> &[u8] {
        self.buffer.get(self.at..).unwrap_or_default()
    }

    /// The times of the next few records, and whether no more follow.
    pub(super) fn times_after(&self) -> (Vec<u64>, bool) {
        let mut times = Vec::with_capacity(ASKED);
        let is_end = self.each_after(&mut |time_us, _| {
            times.push(time_us);
            times.len() < ASKED
        });
        (times, is_end)
    }

    /// What the first of the next frames tells that tells it, as far as they are here.
    pub(super) fn frames_after<T>(&self, mut told: impl FnMut(&[u8]) -> Option<T>) -> Option<T> {
        let mut found = None;
        self.each_after(&mut |_, bytes| {
            found = told(bytes);
            found.is_none()
        });
        found
    }

    /// Hands on the next records until one says no; whether the recording ends with them.
    pub(super) fn each_after(&self, each: &mut dyn FnMut(u64, &[u8]) -> bool) -> bool {
        let (mut rest, mut nothing) = (self.rest(), 0);
        while !rest.is_empty() {
            let Some((time_us, length)) = record_at(rest, self.ended) else {
                rest = rest.get(1..).unwrap_or_default();
                nothing += 1;
                continue;
            };
            if !each(time_us, rest.get(TIME_BYTES..TIME_BYTES + length).unwrap_or_default()) {
                return false;
            }
            rest = rest.get(TIME_BYTES + length..).unwrap_or_default();
            nothing = 0;
        }
        self.ended || nothing >= NOTHING_BYTES
    }

    /// Whether the input ended with these bytes, which were the last that came, in the middle of a record.
    pub(super) fn is_cut(&self, noise: &[u8]) -> bool {
        let frame = noise.get(TIME_BYTES..).filter(|frame| !frame.is_empty());
        self.ended
            && self.rest().is_empty()
            && noise.first() == Some(&0)
            && frame.is_none_or(|frame| matches!(peek(frame), Peek::Short))
    }

    fn fill(&mut self) -> io::Result<()> {
        if self.ended || self.rest().len() >= self.ahead_bytes {
            return Ok(());
        }
        self.buffer.drain(..self.at);
        self.at = 0;
        // Twice as much: what is left is not moved for each chunk.
        while self.buffer.len() < 2 * self.ahead_bytes && !self.ended {
            let old = self.buffer.len();
            self.buffer.resize(old + BUFFER_BYTES, 0);
            let got = read_some(&mut self.input, self.buffer.get_mut(old..).unwrap_or_default())?;
            self.buffer.truncate(old + got);
            self.ended = got == 0;
        }
        Ok(())
    }

    /// The next record; `None` at the end.
    pub fn next_record(&mut self) -> io::Result<Option<Record>> {
        let mut noise = Vec::new();
        loop {
            self.fill()?;
            if self.rest().is_empty() {
                return Ok((!noise.is_empty()).then_some(Record::Noise(noise)));
            }
            if let Some((time_us, length)) = record_at(self.rest(), self.ended) {
                if !noise.is_empty() {
                    return Ok(Some(Record::Noise(noise)));
                }
                let bytes = self.rest().get(TIME_BYTES..TIME_BYTES + length).unwrap_or_default().to_vec();
                self.at += TIME_BYTES + length;
                return Ok(Some(Record::Frame { time_us, bytes }));
            }
            noise.push(self.rest().first().copied().unwrap_or_default());
            self.at += 1;
            if noise.len() >= BUFFER_BYTES {
                return Ok(Some(Record::Noise(noise)));
            }
        }
    }
}

/// The time and the frame length of the record that begins here. A frame that does not check counts where the record
/// after it, or the end of the file, stands where it should: that is another definition of the message, not damage.
fn record_at(bytes: &[u8], ended: bool) -> Option<(u64, usize)> {
    let time_us = u64::from_be_bytes(bytes.get(..TIME_BYTES)?.try_into().ok()?);
    if time_us > TIME_US_MAX {
        return None;
    }
    let Peek::Frame(frame) = peek(bytes.get(TIME_BYTES..)?) else { return None };
    let length = frame.bytes.len();
    let after = bytes.get(TIME_BYTES + length..).unwrap_or_default();
    let followed = match after.get(TIME_BYTES..) {
        None => ended && after.is_empty(),
        Some(next) => after.first() == Some(&0) && matches!(peek(next), Peek::Frame(_) | Peek::Short),
    };
    (frame.check() == Check::Good || followed).then_some((time_us, length))
}

/// Recorded times as arrival times.
#[derive(Debug, Default)]
struct Arrival {
    /// The recorded time of the last record, and what it became.
    last: Option<(u64, u64)>,
    jumps: u64,
}

impl Arrival {
    fn at(&mut self, recorded: u64) -> u64 {
        let Some((before, arrived)) = self.last else {
            self.last = Some((recorded, 0));
            return 0;
        };
        let at = match (recorded.checked_sub(before), before.saturating_sub(recorded)) {
            (Some(step), _) if step <= STEP_FORWARD_US_MAX => arrived + step,
            // The later recorded time stays the base, so that a reordered pair does not stretch time.
            (None, back) if back <= STEP_BACK_US_MAX => return arrived,
            _ => {
                self.jumps += 1;
                arrived
            }
        };
        self.last = Some((recorded, at));
        at
    }

    fn now(&self) -> u64 {
        self.last.map_or(0, |(_, arrived)| arrived)
    }
}

/// A tlog as a source: its frames at their recorded times.
pub struct Tlog<R> {
    records: Records<R>,
    arrival: Arrival,
    noise_bytes: u64,
    utc_start_us: Option<u64>,
}

/// Recorded times before 2000 count from some power-on: they tell no UTC.
pub(super) const UTC_US_MIN: u64 = 946_684_800_000_000;

impl<R: Read> Tlog<R> {
    /// Reads from `input`.
    pub fn new(input: R) -> Self {
        Self { records: Records::new(input), arrival: Arrival::default(), noise_bytes: 0, utc_start_us: None }
    }
}

impl<R: Read + Send> Source for Tlog<R> {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        Ok(match self.records.next_record()? {
            None => None,
            Some(Record::Frame { time_us, bytes }) => {
                if self.arrival.last.is_none() {
                    self.utc_start_us = Some(time_us).filter(|&time| time >= UTC_US_MIN);
                }
                Some(Chunk { at_us: self.arrival.at(time_us), bytes })
            }
            Some(Record::Noise(bytes)) => {
                self.noise_bytes += bytes.len() as u64;
                Some(Chunk { at_us: self.arrival.now(), bytes })
            }
        })
    }

    fn utc_start_us(&self) -> Option<u64> {
        self.utc_start_us
    }

    fn has_records(&self) -> bool {
        true
    }

    fn remark(&self) -> Option<String> {
        let mut said = Vec::new();
        if self.noise_bytes > 0 {
            let bytes = count(self.noise_bytes, "byte");
            said.push(format!("of no record of the tlog, and arriving as noise: {bytes}"));
        }
        if self.arrival.jumps > 0 {
            said.push(format!(
                "its clock jumped {} times; time goes on from where it was",
                self.arrival.jumps
            ));
        }
        (!said.is_empty()).then(|| said.join("; "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::frame::tests::HEARTBEAT;

    const START: u64 = 1_700_000_000_000_000;

    fn record(time: u64) -> Vec<u8> {
        [&time.to_be_bytes()[..], &HEARTBEAT].concat()
    }

    fn chunks(bytes: &[u8]) -> Vec<(u64, usize)> {
        let mut source = Tlog::new(bytes);
        std::iter::from_fn(|| source.next().expect("memory"))
            .map(|chunk| (chunk.at_us, chunk.bytes.len()))
            .collect()
    }

    #[test]
    fn recorded_times_count_from_the_first() {
        let tlog = [record(START), record(START + 5), record(START + 2_000_000)].concat();
        assert_eq!(chunks(&tlog), [(0, 21), (5, 21), (2_000_000, 21)]);
    }

    #[test]
    fn a_clock_that_was_set_neither_falls_nor_waits_for_years() {
        let hour = 3_600_000_000;
        let tlog = [
            record(START + hour),
            record(START),
            record(START + 10),
            record(START + 400 * 24 * hour),
            record(START),
        ]
        .concat();
        assert_eq!(chunks(&tlog).iter().map(|chunk| chunk.0).collect::<Vec<_>>(), [0, 0, 10, 10, 10]);
    }

    #[test]
    fn a_reordered_pair_does_not_stretch_time() {
        let tlog = [record(START), record(START + 100), record(START + 60), record(START + 200)].concat();
        assert_eq!(chunks(&tlog).iter().map(|chunk| chunk.0).collect::<Vec<_>>(), [0, 100, 100, 200]);
    }

    #[test]
    fn damage_costs_the_record_it_hit_and_every_byte_still_arrives() {
        let clean: Vec<u8> = (0..50).flat_map(|at| record(START + at)).collect();
        for hit in 0..clean.len() {
            let mut tlog = clean.clone();
            tlog[hit] = !tlog[hit];
            let got = chunks(&tlog);
            let whole = got.iter().filter(|chunk| chunk.1 == HEARTBEAT.len()).count();
            assert!(whole >= 48, "byte {hit}: {whole} frames");
        }
    }

    #[test]
    fn a_cut_tlog_gives_what_it_has() {
        let clean: Vec<u8> = (0..5).flat_map(|at| record(START + at)).collect();
        for end in 0..clean.len() {
            let got = chunks(&clean[..end]);
            let whole = got.iter().filter(|chunk| chunk.1 == HEARTBEAT.len()).count();
            assert!(whole >= end / (TIME_BYTES + HEARTBEAT.len()), "{end} bytes: {got:?}");
        }
    }

    #[test]
    fn a_frame_of_another_definition_is_kept_in_one_piece() {
        let mut odd = record(START + 1);
        odd[20] ^= 1;
        let tlog = [record(START), odd, record(START + 2)].concat();
        assert_eq!(chunks(&tlog), [(0, 21), (1, 21), (2, 21)]);
    }
}
