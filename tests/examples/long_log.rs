//! Memory and time for a long log: `long_log HUMS MIB RECORDING.tlog [WHAT...]`.
//!
//! The log repeats one recording. Output files take up to 30 times the log's size meanwhile.

use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{Header, Preamble, SECTOR_BYTES, Sector};
use hums_tests::child;

/// Time limit of a run; only a long log on a busy machine comes near.
const LIMIT: Duration = Duration::from_hours(2);
/// Offsets in a group's sector: its start in ms, and the number of earlier frames.
const START_AT: usize = 15 + 4;
const FRAMES_AT: usize = 15 + 10;
const NUMBER_AT: usize = 11;
/// The codec's prediction depends on the lower 32 bits of the time.
const ROUND_MS: u64 = 1 << 32;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let [hums, mib, recording, ref what @ ..] = *words.as_slice() else {
        eprintln!("usage: long_log HUMS MIB RECORDING.tlog [WHAT...]");
        return ExitCode::from(2);
    };
    match long(Path::new(hums), mib, Path::new(recording), what) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Outputs of a long log: name and words of the command. Standard output is not stored: all of a long log is hundreds
/// of gigabytes of text.
const MADE: [(&str, &[&str]); 9] = [
    ("info", &["info"]),
    ("verify", &["info", "--verify"]),
    ("report", &["report", "-o", "OUT"]),
    ("tlog", &["decode", "-o", "-", "--format", "tlog"]),
    ("jsonl", &["decode", "-o", "-", "--format", "jsonl"]),
    ("influx", &["decode", "-o", "-", "--format", "influx"]),
    ("csv", &["decode", "-o", "OUT", "--format", "csv"]),
    ("parquet", &["decode", "-o", "OUT", "--format", "parquet"]),
    ("thesis", &["decode", "-o", "OUT", "--format", "thesis"]),
];

fn long(hums: &Path, mib: &str, recording: &Path, what: &[&str]) -> Result<()> {
    let bytes = mib.parse::<u64>().context("MIB is a number")? << 20;
    if let Some(unknown) = what.iter().find(|word| MADE.iter().all(|(name, _)| name != *word)) {
        bail!("{unknown}: one of {}", MADE.map(|(name, _)| name).join(", "));
    }
    let dir = tempfile::tempdir()?;
    let (log, short) = (dir.path().join("long.hum"), dir.path().join("short.hum"));
    Command::new(hums).args(["decode", "--format", "hum"]).arg(recording).arg("-o").arg(&short).output()?;
    let (written, frames) = lengthen(&short, &log, bytes)?;
    println!("a log of {} MiB with {frames} frames", written >> 20);
    for (name, arguments) in MADE.iter().filter(|(name, _)| what.is_empty() || what.contains(name)) {
        let out = dir.path().join("out");
        let mut command = Command::new("sh");
        let words = arguments.iter().map(|word| if *word == "OUT" { out.as_os_str() } else { word.as_ref() });
        command.args(["-c", "exec \"$@\" > /dev/null", "sh"]).arg(hums).args(words).arg(&log);
        let start = Instant::now();
        let outcome = child::run(&mut command, LIMIT).expect_code(&[0]);
        println!(
            "{name}: {:.1} MiB of memory at most, {:.0} s",
            outcome.memory_kib_max as f64 / 1024.0,
            start.elapsed().as_secs_f64()
        );
        if out.is_dir() {
            fs::remove_dir_all(&out)?;
        } else if out.exists() {
            fs::remove_file(&out)?;
        }
    }
    Ok(())
}

fn lengthen(short: &Path, long: &Path, bytes: u64) -> Result<(u64, u64)> {
    let data = fs::read(short)?;
    let sectors: Vec<[u8; SECTOR_BYTES]> =
        data.chunks_exact(SECTOR_BYTES).filter_map(|chunk| chunk.try_into().ok()).collect();
    let last = sectors.iter().rposition(|sector| Header::read(sector).is_ok_and(|h| h.since_first == 0));
    let whole = sectors.get(..last.unwrap_or(0)).filter(|whole| !whole.is_empty()).context("too short")?;
    let session = Header::read(&whole[0]).map_or(0, |header| header.session);
    let frames: u64 = whole.iter().filter_map(|s| Header::read(s).ok()).map(|h| u64::from(h.frames)).sum();
    let mut out = BufWriter::new(File::create(long)?);
    let (mut number, mut round, mut written) = (0_u32, 0_u64, 0_u64);
    while written < bytes {
        for block in whole {
            let mut block = *block;
            let starts = Header::read(&block).is_ok_and(|header| header.since_first == 0);
            block[NUMBER_AT..NUMBER_AT + 4].copy_from_slice(&number.to_le_bytes());
            if starts {
                let preamble = Preamble::read(&block[15..]).context("a group's start")?;
                let start_ms = preamble.start_ms + round * ROUND_MS;
                block[START_AT..START_AT + 6].copy_from_slice(&start_ms.to_le_bytes()[..6]);
                let before = preamble.frames_before.wrapping_add((round * frames) as u32);
                block[FRAMES_AT..FRAMES_AT + 4].copy_from_slice(&before.to_le_bytes());
            }
            let mut sector = Sector::from_bytes(block);
            sector.seal(session);
            out.write_all(sector.bytes())?;
            number = number.wrapping_add(1);
            written += SECTOR_BYTES as u64;
        }
        round += 1;
    }
    out.flush()?;
    Ok((written, round * frames))
}
