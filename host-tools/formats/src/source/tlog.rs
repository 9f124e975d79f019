//! A ground station's log: eight big-endian bytes of microseconds since 1970, one frame, repeated.

pub mod records;
pub mod times;

use std::io::{self, Read};

use self::records::{Record, Records, TIME_BYTES};
use self::times::Times;
use super::stream::{Chunk, Source};
use crate::plural::count;

/// A tlog as a source: its frames at their recorded times.
pub struct Tlog<R> {
    records: Records<R>,
    times: Times,
    place: u64,
    noise_bytes: u64,
    jumps: u64,
    damages: u64,
    ended: bool,
}

impl<R: Read> Tlog<R> {
    /// Reads no further than needed: few times are compared.
    pub fn new(input: R) -> Self {
        Self::of(Records::new(input))
    }

    /// Reads ahead of a file.
    pub fn ahead(input: R) -> Self {
        Self::of(Records::ahead(input))
    }

    fn of(records: Records<R>) -> Self {
        Self {
            records,
            times: Times::default(),
            place: 0,
            noise_bytes: 0,
            jumps: 0,
            damages: 0,
            ended: false,
        }
    }
}

impl<R: Read + Send> Source for Tlog<R> {
    fn next(&mut self) -> io::Result<Option<Chunk>> {
        Ok(match self.records.next_record()? {
            None => {
                if !std::mem::replace(&mut self.ended, true) {
                    self.damages += self.times.gaps().count() as u64;
                }
                None
            }
            Some(Record::Frame { time_us, bytes }) => {
                let told = self.times.take(time_us, &bytes, self.place, &self.records);
                self.place += (TIME_BYTES + bytes.len()) as u64;
                self.jumps += u64::from(told.begins.is_some());
                Some(Chunk { at_us: self.times.now().as_micros(), bytes })
            }
            Some(Record::Noise(bytes)) => {
                self.damages += 1;
                self.noise_bytes += bytes.len() as u64;
                self.place += bytes.len() as u64;
                Some(Chunk { at_us: self.times.now().as_micros(), bytes })
            }
        })
    }

    fn has_records(&self) -> bool {
        true
    }

    fn damages(&self) -> u64 {
        self.damages
    }

    fn remark(&self) -> Option<String> {
        let mut said = Vec::new();
        if self.noise_bytes > 0 {
            let bytes = count(self.noise_bytes, "byte");
            said.push(format!("of no record of the tlog, and arriving as noise: {bytes}"));
        }
        if self.jumps > 0 {
            let times = count(self.jumps, "time");
            said.push(format!("its clock jumped {times}; time goes on from where it was"));
        }
        said.extend(self.times.gaps().map(|gap| gap.words));
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
