//! How small the log of a recording is, and how fast it is made and read: one row a recording, then the means.
//!
//! ```text
//! cargo run --release -p hums-blackbox --example sizes -- tests/flights/*.tlog
//! ```
//! `--quick` leaves gzip and xz out. Each log begins with the records that a session has (boot, clock, vehicle) and has statistics every 10 s. It is read
//! back and compared with the recording frame by frame; a difference ends the program. `gzip` and `xz` must be there.

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant as Stopwatch;

use hums_blackbox::record::{Boot, Clock, Stats, Vehicle};
use hums_blackbox::{Item, LogReader, Record, SECTOR_BYTES, Sector, SectorSink, Writer};
use hums_core::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// A recording's frame: microseconds since 1970, and the frame.
type Frame<'a> = (u64, &'a [u8]);

#[derive(Default)]
struct Card(Vec<u8>);

impl SectorSink for Card {
    fn room(&self) -> usize {
        usize::MAX
    }

    fn put(&mut self, sector: &Sector) {
        let mut sector = *sector;
        sector.seal(0x1234_5678);
        self.0.extend_from_slice(sector.bytes());
    }
}

fn main() -> Result<()> {
    println!(
        "{:24} {:>8} {:>8} {:>8} {:>8} {:>6} {:>6} {:>7} {:>9} {:>9} {:>9}",
        "recording",
        "tlog",
        "gzip -9",
        "xz -9e",
        "log",
        "ratio",
        "vs xz",
        "B/frame",
        "write",
        "read",
        "gzip -d"
    );
    let (mut ratios, mut against_xz, mut count) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (options, paths): (Vec<_>, Vec<_>) =
        std::env::args().skip(1).partition(|word| word.starts_with("--"));
    let quick = options.iter().any(|option| option == "--quick");
    for path in paths {
        let tlog = std::fs::read(&path)?;
        let frames = frames(&tlog);
        let stopwatch = Stopwatch::now();
        let log = pack(&frames)?;
        let write_s = stopwatch.elapsed().as_secs_f64();
        let stopwatch = Stopwatch::now();
        let mut tlog_again = Vec::with_capacity(tlog.len());
        unpack(&log, &mut tlog_again)?;
        let read_s = stopwatch.elapsed().as_secs_f64();
        compare(&frames, &tlog_again)?;
        if quick {
            let (write, read) = (tlog.len() as f64 / write_s / 1e6, tlog.len() as f64 / read_s / 1e6);
            let ratio = tlog.len() as f64 / log.len() as f64;
            ratios += ratio.ln();
            count += 1.0;
            println!("{path} {} {ratio:.3} write {write:.0} read {read:.0} MB/s", log.len());
            continue;
        }
        let gzipped = filter("gzip", &["-9c"], &tlog)?;
        let xz = filter("xz", &["-9ec"], &tlog)?.len() as f64;
        let stopwatch = Stopwatch::now();
        for _ in 0..5 {
            filter("gzip", &["-dc"], &gzipped)?;
        }
        let gunzip_s = stopwatch.elapsed().as_secs_f64() / 5.0;
        let (bytes, ours) = (tlog.len() as f64, log.len() as f64);
        ratios += (bytes / ours).ln();
        against_xz += (xz / ours).ln();
        count += 1.0;
        println!(
            "{:24} {:8} {:8} {:8} {:8} {:6.2} {:6.2} {:7.2} {:4.0} MB/s {:4.0} MB/s {:4.0} MB/s",
            Path::new(&path).file_name().unwrap_or_default().to_string_lossy(),
            tlog.len(),
            gzipped.len(),
            xz,
            log.len(),
            bytes / ours,
            xz / ours,
            ours / frames.len() as f64,
            bytes / write_s / 1e6,
            bytes / read_s / 1e6,
            bytes / gunzip_s / 1e6,
        );
    }
    println!(
        "geometric mean: {:.3} times smaller than the tlog, {:.3} times smaller than xz -9e; writer {} bytes",
        (ratios / count).exp(),
        (against_xz / count).exp(),
        size_of::<Writer>(),
    );
    Ok(())
}

fn frames(tlog: &[u8]) -> Vec<Frame<'_>> {
    let (mut frames, mut rest) = (Vec::new(), tlog);
    while let Some((time, tail)) = rest.split_first_chunk::<8>() {
        let len = match *tail {
            [0xfe, len, ..] => usize::from(len) + 8,
            [0xfd, len, incompat, ..] => usize::from(len) + 12 + if incompat & 1 == 1 { 13 } else { 0 },
            _ => break,
        };
        let Some((frame, tail)) = tail.split_at_checked(len) else { break };
        frames.push((u64::from_be_bytes(*time), frame));
        rest = tail;
    }
    frames
}

fn pack(frames: &[Frame<'_>]) -> Result<Vec<u8>> {
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    let Some(&(start, _)) = frames.first() else { return Ok(card.0) };
    let boot = Boot { version: "0.1.0", git: "0123456789", board: "sizes", ..Boot::default() };
    let clock = Clock { boot: Instant::ZERO, utc_micros: start, source: 2 };
    writer.record(Instant::ZERO, &Record::Boot(boot), &mut card)?;
    writer.record(Instant::ZERO, &Record::Clock(clock), &mut card)?;
    writer.record(Instant::ZERO, &Record::Vehicle(Vehicle::default()), &mut card)?;
    let mut stats_due = 10_000_000;
    for &(time, bytes) in frames {
        let at = Instant::from_micros(time.saturating_sub(start));
        writer.frame(at, bytes, checks(bytes), &mut card)?;
        if at.as_micros() >= stats_due {
            let counters = writer.counters();
            let stats =
                Stats { frames_in: counters.frames, frames_logged: counters.frames, ..Stats::default() };
            writer.record(at, &Record::Stats(stats), &mut card)?;
            stats_due = at.as_micros() + 10_000_000;
        }
    }
    writer.finish(&mut card);
    Ok(card.0)
}

/// Whether the checksum is that of our definition.
fn checks(frame: &[u8]) -> bool {
    let (id, payload_at) = match *frame {
        [0xfe, _, _, _, _, id, ..] => (u32::from(id), 6),
        [0xfd, _, _, _, _, _, _, a, b, c, ..] => (u32::from_le_bytes([a, b, c, 0]), 10),
        _ => return false,
    };
    let Some(message) = hums_dialect::message(id) else { return false };
    let end = payload_at + usize::from(frame[1]);
    let crc = frame[1..end].iter().chain([&message.crc_extra]).fold(0xffff_u16, |crc, &byte| {
        let mut x = byte ^ crc as u8;
        x ^= x << 4;
        let x = u16::from(x);
        (crc >> 8) ^ (x << 8) ^ (x << 3) ^ (x >> 4)
    });
    frame.get(end..end + 2) == Some(&crc.to_le_bytes()[..])
}

fn unpack(log: &[u8], tlog: &mut Vec<u8>) -> Result<()> {
    let mut reader = Box::new(LogReader::new());
    let (blocks, _) = log.as_chunks::<SECTOR_BYTES>();
    let mut blocks = blocks.iter();
    loop {
        match blocks.next() {
            Some(block) => reader.feed(block),
            None => reader.end(),
        }
        while let Some(item) = reader.next() {
            match item {
                Item::Frame { utc_micros, bytes, .. } => {
                    tlog.extend_from_slice(&utc_micros.ok_or("no clock")?.to_be_bytes());
                    tlog.extend_from_slice(bytes);
                }
                Item::Gap(gap) => return Err(format!("{gap:?}").into()),
                Item::Record { .. } => {}
                Item::End(_) => return Ok(()),
            }
        }
    }
}

fn compare(expected: &[Frame<'_>], tlog: &[u8]) -> Result<()> {
    let found = frames(tlog);
    if found.len() != expected.len() {
        return Err(format!("{} frames instead of {}", found.len(), expected.len()).into());
    }
    let mut latest = 0;
    for (index, (expected, found)) in expected.iter().zip(&found).enumerate() {
        latest = latest.max(expected.0);
        if expected.1 != found.1 || latest.abs_diff(found.0) > 1_000 {
            return Err(format!("frame {index} differs").into());
        }
    }
    Ok(())
}

fn filter(program: &str, arguments: &[&str], input: &[u8]) -> Result<Vec<u8>> {
    let mut child =
        Command::new(program).args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
    let mut stdin = child.stdin.take().ok_or("no pipe")?;
    let output = std::thread::scope(|scope| {
        scope.spawn(move || stdin.write_all(input));
        child.wait_with_output()
    })?;
    Ok(output.stdout)
}
