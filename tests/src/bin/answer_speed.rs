//! Speed from a card to an answer, as ratios in one run, and memory for a long log.
//!
//! ```text
//! answer_speed HUMS PYTHON RECORDING.tlog...      the ratios: pymavlink's mavlogdump and gzip beside it
//! answer_speed HUMS --long MIB RECORDING.tlog [WHAT...]
//!                                                 memory: a log of so many MiB, made of one recording over and over, and
//!                                                 all that can be made of it, or only what is named (`info`, `csv`, …)
//! ```
//! Output files take up to 30 times the log's size while it is measured.
//!
//! For instance: `cargo run --release -p hums-tests --bin answer_speed -- target/release/hums target/venv/bin/python
//! tests/flights/ap_quad_guided.tlog`.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::{Header, Preamble, SECTOR_BYTES, Sector};
use hums_tests::child;

/// Runs of a program. The fastest counts: other load only adds time.
const RUNS: u32 = 5;
/// Time limit of a run; only a long log on a busy machine comes near.
const LIMIT: Duration = Duration::from_hours(2);
/// Offsets in a group's sector: its start in ms, and the number of earlier frames.
const START_AT: usize = 15 + 4;
const FRAMES_AT: usize = 15 + 10;
const NUMBER_AT: usize = 11;
/// Delay of each round, ms. The codec's prediction depends on the lower 32 bits of the time.
const ROUND_MS: u64 = 1 << 32;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let result = match *words.as_slice() {
        [hums, "--long", mib, recording, ref what @ ..] => {
            long(Path::new(hums), mib, Path::new(recording), what)
        }
        [hums, python, ref recordings @ ..] if !recordings.is_empty() => {
            recordings.iter().try_for_each(|one| ratios(Path::new(hums), Path::new(python), Path::new(one)))
        }
        _ => {
            eprintln!(
                "usage: answer_speed HUMS PYTHON RECORDING.tlog... | answer_speed HUMS --long MIB RECORDING.tlog [WHAT...]"
            );
            return ExitCode::from(2);
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// The fastest of some runs.
fn fastest(runs: u32, mut command: impl FnMut() -> Command) -> Result<Duration> {
    let mut best = Duration::MAX;
    for _ in 0..runs {
        let start = Instant::now();
        let status = command().stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status()?;
        if !matches!(status.code(), Some(0 | 3)) {
            bail!("{:?} ended with {status}", command());
        }
        best = best.min(start.elapsed());
    }
    Ok(best)
}

fn ratios(hums: &Path, python: &Path, recording: &Path) -> Result<()> {
    let dir = tempfile::tempdir()?;
    let log = dir.path().join("log.hum");
    let pack =
        Command::new(hums).args(["decode", "--format", "hum"]).arg(recording).arg("-o").arg(&log).output()?;
    if !matches!(pack.status.code(), Some(0 | 3)) {
        bail!("hums decode --format hum: {}", String::from_utf8_lossy(&pack.stderr));
    }
    let types = types(python, recording)?;
    let list = types.iter().cloned().collect::<Vec<_>>().join(",");
    let dump = fastest(1, || {
        let mut command = Command::new(python);
        command
            .args(["-m", "pymavlink.tools.mavlogdump", "--format", "csv", "--types", &list])
            .arg(recording);
        command
    })?;
    let out = dir.path().join("out");
    let decode = fastest(RUNS, || {
        let mut command = Command::new(hums);
        command.arg("decode").arg(&log).arg("-o").arg(&out).args(["--force", "--format", "csv"]);
        for name in &types {
            command.args(["--message", name]);
        }
        command
    })?;
    let gz = dir.path().join("flight.tlog.gz");
    let packed = Command::new("gzip").arg("-c").arg(recording).output().context("gzip")?;
    fs::write(&gz, packed.stdout)?;
    let gunzip = fastest(RUNS, || {
        let mut command = Command::new("gzip");
        command.arg("-dc").arg(&gz);
        command
    })?;
    let info = fastest(RUNS, || {
        let mut command = Command::new(hums);
        command.arg("info").arg(&log);
        command
    })?;
    let name = recording.file_name().unwrap_or_default().to_string_lossy();
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    println!(
        "{name}: {} types; csv: mavlogdump {:.0} ms, hums {:.1} ms: {:.0} times faster; info {:.1} ms, gzip -d {:.1} ms: {:.2} of its time",
        types.len(),
        ms(dump),
        ms(decode),
        dump.as_secs_f64() / decode.as_secs_f64(),
        ms(info),
        ms(gunzip),
        info.as_secs_f64() / gunzip.as_secs_f64(),
    );
    Ok(())
}

/// The types that pymavlink's own dialect knows in a recording.
fn types(python: &Path, recording: &Path) -> Result<BTreeSet<String>> {
    const SCRIPT: &str = "import sys
from pymavlink import mavutil
log = mavutil.mavlink_connection(sys.argv[1], dialect='ardupilotmega')
types = set()
while (message := log.recv_msg()) is not None:
    types.add(message.get_type())
print('\\n'.join(sorted(t for t in types if t != 'BAD_DATA' and not t.startswith('UNKNOWN'))))";
    let output = Command::new(python).args(["-c", SCRIPT]).arg(recording).output()?;
    let types: BTreeSet<String> =
        String::from_utf8_lossy(&output.stdout).lines().map(str::to_owned).collect();
    if types.is_empty() {
        bail!(
            "pymavlink finds nothing in {}: {}",
            recording.display(),
            String::from_utf8_lossy(&output.stderr)
        );
    }
    Ok(types)
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

/// A long log as a recorder would have made it: groups of one recording over and over, later each time.
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

/// Writes the whole groups of `short` again and again, with their numbers, times and frame counts going on.
fn lengthen(short: &Path, long: &Path, bytes: u64) -> Result<(u64, u64)> {
    let data = fs::read(short)?;
    let sectors: Vec<[u8; SECTOR_BYTES]> =
        data.chunks_exact(SECTOR_BYTES).filter_map(|chunk| chunk.try_into().ok()).collect();
    // The last group ends early: in the middle of a log no group would follow it.
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
