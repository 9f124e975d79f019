//! Size of a recording's log: one row a recording, then the means against their targets.
//!
//! ```text
//! cargo run --release -p hums-blackbox --example sizes -- tests/flights/*
//! ```
//! Each log begins with the records that a session has (boot, clock, vehicle) and has statistics every 10 s. It is
//! read back and compared frame by frame; a difference ends the program. A file that is not a tlog is read as the raw
//! bytes of a line of 57,600 baud. `--quick` leaves xz out. Exit codes: 0, or 1 where a mean is below its target.

#[path = "../tests/common/card.rs"]
mod card;
#[path = "../tests/common/log.rs"]
mod log;

use std::error::Error;
use std::io::Write;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use card::Card;
use hums_blackbox::record::{Boot, Clock, Stats, Vehicle};
use hums_blackbox::{Entry, Record, SECTOR_BYTES, Writer};
use hums_core::clock::Instant;
use log::Item;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Tlog's size by the log's, geometric mean.
const RATIO_MIN: f64 = 6.5;
/// `xz -9e` of the tlog by the log.
const AGAINST_XZ_MIN: f64 = 2.3;

/// Microseconds since 1970, and the frame.
type Frame<'a> = (u64, &'a [u8]);

fn main() -> Result<ExitCode> {
    let (options, paths): (Vec<_>, Vec<_>) =
        std::env::args().skip(1).partition(|word| word.starts_with("--"));
    let quick = options.iter().any(|option| option == "--quick");
    println!(
        "{:26} {:>8} {:>9} {:>9} {:>9} {:>7} {:>7} {:>8}",
        "recording", "frames", "tlog", "xz -9e", "log", "tlog/", "xz/", "B/frame"
    );
    let (mut ratios, mut against_xz, mut count) = (0.0_f64, 0.0_f64, 0.0_f64);
    for path in paths {
        let file = std::fs::read(&path)?;
        let is_tlog = Path::new(&path).extension().is_some_and(|extension| extension == "tlog");
        let tlog = if is_tlog { file } else { tlog_of_line(&file) };
        let frames = frames(&tlog);
        let log = pack(&frames)?;
        let mut tlog_again = Vec::with_capacity(tlog.len());
        let epoch = frames.first().map_or(0, |(at, _)| *at);
        unpack(&log, epoch, &mut tlog_again)?;
        compare(&frames, &tlog_again)?;
        let xz = if quick { f64::NAN } else { filter("xz", &["-9ec"], &tlog)?.len() as f64 };
        let signed = frames.iter().filter(|frame| matches!(frame.1, [0xfd, _, 1, ..])).count();
        let counts = signed * 2 < frames.len();
        let (bytes, ours) = (tlog.len() as f64, log.len() as f64);
        if counts {
            ratios += (bytes / ours).ln();
            against_xz += (xz / ours).ln();
            count += 1.0;
        }
        println!(
            "{:26} {:8} {:9} {:9} {:9} {:7.3} {:7.3} {:8.2}{}",
            Path::new(&path).file_name().unwrap_or_default().to_string_lossy(),
            frames.len(),
            tlog.len(),
            xz,
            log.len(),
            bytes / ours,
            xz / ours,
            ours / frames.len() as f64,
            if counts { "" } else { "  signed: not counted" },
        );
    }
    let (ratio, against_xz) = ((ratios / count).exp(), (against_xz / count).exp());
    println!("geometric mean of {count} unsigned recordings:");
    println!("  {ratio:.3} times smaller than the tlog (asked: {RATIO_MIN})");
    println!("  {against_xz:.3} times smaller than xz -9e (asked: {AGAINST_XZ_MIN})");
    println!("writer: {} bytes of {}", size_of::<Writer>(), hums_blackbox::WRITER_BYTES_MAX);
    let missed = ratio < RATIO_MIN || against_xz < AGAINST_XZ_MIN;
    Ok(if missed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn tlog_of_line(line: &[u8]) -> Vec<u8> {
    const MICROS_PER_BYTE: usize = 10_000_000 / 57_600;
    let (mut tlog, mut rest) = (Vec::new(), line);
    while !rest.is_empty() {
        let len = match frame_len(rest).filter(|&len| rest.get(..len).is_some_and(checks)) {
            Some(len) => {
                let at_us = (line.len() - rest.len() + len) * MICROS_PER_BYTE;
                tlog.extend_from_slice(&(1_700_000_000_000_000 + at_us as u64).to_be_bytes());
                tlog.extend_from_slice(&rest[..len]);
                len
            }
            None => 1,
        };
        rest = &rest[len..];
    }
    tlog
}

fn frame_len(bytes: &[u8]) -> Option<usize> {
    match *bytes {
        [0xfe, len, ..] => Some(usize::from(len) + 8),
        [0xfd, len, incompat, ..] => Some(usize::from(len) + 12 + if incompat & 1 == 1 { 13 } else { 0 }),
        _ => None,
    }
}

fn frames(tlog: &[u8]) -> Vec<Frame<'_>> {
    let (mut frames, mut rest) = (Vec::new(), tlog);
    while let Some((time, tail)) = rest.split_first_chunk::<8>() {
        let Some(len) = frame_len(tail) else { break };
        let Some((frame, tail)) = tail.split_at_checked(len) else { break };
        frames.push((u64::from_be_bytes(*time), frame));
        rest = tail;
    }
    frames
}

fn pack(frames: &[Frame<'_>]) -> Result<Vec<u8>> {
    let (mut writer, mut card) = (Box::new(Writer::new()), Card::default());
    let Some(&(start, _)) = frames.first() else { return Ok(Vec::new()) };
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
    Ok(card.0.iter().flat_map(|sector| *sector.bytes()).collect())
}

fn checks(frame: &[u8]) -> bool {
    let (id, payload_at) = match *frame {
        [0xfe, _, _, _, _, id, ..] => (u32::from(id), 6),
        [0xfd, _, _, _, _, _, _, a, b, c, ..] => (u32::from_le_bytes([a, b, c, 0]), 10),
        _ => return false,
    };
    let Some(message) = hums_dialect::message(id) else { return false };
    let end = payload_at + usize::from(frame[1]);
    if end > frame.len() {
        return false;
    }
    let crc = frame[1..end].iter().chain([&message.crc_extra]).fold(0xffff_u16, |crc, &byte| {
        let mut x = byte ^ crc as u8;
        x ^= x << 4;
        let x = u16::from(x);
        (crc >> 8) ^ (x << 8) ^ (x << 3) ^ (x >> 4)
    });
    frame.get(end..end + 2) == Some(&crc.to_le_bytes()[..])
}

/// `epoch`: UTC at power-on.
fn unpack(log: &[u8], epoch: u64, tlog: &mut Vec<u8>) -> Result<()> {
    let mut gaps = Vec::new();
    let end = log::read(log.as_chunks::<SECTOR_BYTES>().0, |item| match item {
        Item::Entry(Entry::Frame { at, bytes, .. }) => {
            tlog.extend_from_slice(&(epoch + at.as_micros()).to_be_bytes());
            tlog.extend_from_slice(bytes);
        }
        Item::Entry(Entry::Record { .. }) => {}
        Item::Gap(gap) => gaps.push(gap),
    });
    if end.epoch_micros != Some(epoch) {
        return Err(format!("the clock is {:?}", end.epoch_micros).into());
    }
    if gaps.is_empty() { Ok(()) } else { Err(format!("{gaps:?}").into()) }
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
