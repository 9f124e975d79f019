//! `cargo xtask bench`: the record's size and speed, beside targets.
//!
//! Recordings: `tests/flights`, and below the folders of `HUMS_FLIGHTS` (colons between). Sizes repeat and are checked; speeds
//! are only shown.

mod logs;
mod tools;

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use clap::ValueEnum as _;
use serde_json::Value;

use tools::{files_below, folders, median, on_one_core, repeat, work_folder};

use crate::hums;
use crate::setup::{self, Need};
use crate::shell::Shell;

/// Than the tlog, geometric mean of whole sessions.
const SMALLER_MIN: f64 = 6.5;
/// Tlog by `xz -9e`, and log.
const SMALLER_THAN_XZ_MIN: f64 = 2.3;
/// Bytes of MAVLink a second at 921,600 baud.
pub(crate) const BYTES_PER_S: f64 = 92_160.0;
/// Part of the speed of `gzip -d`.
const AGAINST_GZIP_MIN: f64 = 0.4;
/// The line: on slower ones work by the clock is a larger part of each byte.
const BAUD: &str = "921600";
/// Seconds of that line: a short recording shows only its start.
const SECONDS_MIN: f64 = 10.0;
/// Bytes of tlog: starts hardly count.
const DECODED_MIN: f64 = 8e6;
/// Compared pairs.
const ROUNDS: usize = 9;

/// The measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Bench {
    /// Bytes of the record beside the tlog's and those of xz
    Sizes,
    /// Speed of decoding beside gzip's
    Speed,
    /// Speed of `hums check` on logs of autopilots, beside pymavlink and pyulog
    Logs,
}

/// An error for a missed target.
pub(crate) fn run(what: &[Bench]) -> Result<()> {
    setup::require(&[Need::Linker])?;
    let what = if what.is_empty() { Bench::value_variants() } else { what };
    let flights = flights()?;
    let mut missed = Vec::new();
    for bench in what {
        let done = match bench {
            Bench::Sizes => sizes(&flights),
            Bench::Speed => speed(&flights),
            Bench::Logs => logs::run(),
        };
        if let Err(error) = done {
            missed.push(format!("{bench:?}: {error:#}").to_lowercase());
        }
    }
    if missed.is_empty() { Ok(()) } else { bail!("{}", missed.join("; ")) }
}

/// Recordings by name; two folders may have the same one.
fn flights() -> Result<Vec<PathBuf>> {
    let mut flights = files_below(&folders("HUMS_FLIGHTS", true), &[".tlog", ".raw"])?;
    flights.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    flights.dedup_by(|a, b| a.file_name() == b.file_name());
    Ok(flights)
}

/// Unsigned tlogs.
fn unsigned(flights: &[PathBuf]) -> impl Iterator<Item = &PathBuf> {
    flights.iter().filter(|path| path.extension().is_some_and(|extension| extension == "tlog"))
}

fn name(flight: &Path) -> String {
    flight.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn sizes(flights: &[PathBuf]) -> Result<()> {
    println!("\nSizes\n");
    let logs = Shell::cargo()
        .args(["run", "--quiet", "--release", "-p", "hums-blackbox", "--example", "sizes", "--"])
        .args(flights)
        .run()
        .context("a size misses its target, or xz is missing; the lines above say which");
    sizes_of_sessions(flights).and(logs)
}

/// Sizes with every record that the monitor makes.
fn sizes_of_sessions(flights: &[PathBuf]) -> Result<()> {
    println!("\nSizes of whole sessions, with all that the monitor records of them\n");
    let program = hums::build_release()?;
    let (card, packed) = (work_folder()?.join("card.img"), work_folder()?.join("flight.tlog.xz"));
    let (mut logs, mut xz_logs, mut count) = (0.0, 0.0, 0.0);
    println!("{:22} {:>9} {:>9} {:>9} {:>7} {:>7}", "recording", "tlog", "xz -9e", "session", "tlog/", "xz/");
    for flight in unsigned(flights) {
        let _ = fs::remove_file(&card);
        let sim = ["sim", "--json", "--speed", "max"];
        let (json, _) =
            Shell::new(&program).args(sim).arg(flight).arg("--sd").arg(&card).output_and_code()?;
        let report: Value = serde_json::from_str(&json)
            .context("the report of hums sim is not JSON; run it by hand with --json")?;
        let bytes = report["bytes_logged"]
            .as_f64()
            .filter(|&bytes| bytes > 0.0)
            .context("the run logged nothing; run hums sim by hand")?;
        let xz = Command::new("xz").arg("-9ec").arg(flight).stdout(File::create(&packed)?).status();
        xz.context("xz cannot be started; install xz-utils")?;
        let (tlog, xz) = (fs::metadata(flight)?.len() as f64, fs::metadata(&packed)?.len() as f64);
        let (ratio, against_xz) = (tlog / bytes, xz / bytes);
        println!("{:22} {tlog:9} {xz:9} {bytes:9} {ratio:7.3} {against_xz:7.3}", name(flight));
        logs += ratio.ln();
        xz_logs += against_xz.ln();
        count += 1.0;
    }
    let (ratio, against_xz) = ((logs / count).exp(), (xz_logs / count).exp());
    println!("geometric mean: {ratio:.3} times smaller than the tlog (asked: {SMALLER_MIN})");
    println!("                {against_xz:.3} times smaller than xz -9e (asked: {SMALLER_THAN_XZ_MIN})");
    if ratio < SMALLER_MIN || against_xz < SMALLER_THAN_XZ_MIN {
        bail!("the mean of whole sessions misses its target; the table above has the sizes");
    }
    Ok(())
}

/// One after the other on one core, several times.
fn speed(flights: &[PathBuf]) -> Result<()> {
    println!("\nSpeed of decoding to tlog, median of {ROUNDS} rounds\n");
    let program = hums::build_release()?;
    let folder = work_folder()?;
    println!(
        "{:22} {:>10} {:>10} {:>7}  {:>12} {:>6}  {:>10}",
        "recording", "gzip -d", "one core", "ratio", "all cores", "times", "mcap, one"
    );
    let (mut all_ratios, mut all_gains) = (Vec::new(), Vec::new());
    for flight in unsigned(flights) {
        let (log, zipped) = (folder.join("flight.hum"), folder.join("flight.tlog.gz"));
        let tlog = folder.join("long.tlog");
        repeat(flight, DECODED_MIN, &tlog)?;
        // `decode` replaces nothing.
        let _ = fs::remove_file(&log);
        Shell::new(&program).args(["decode", "--format", "hum", "-o"]).arg(&log).arg(&tlog).output()?;
        let gzip = Command::new("gzip").arg("-c").arg(&tlog).stdout(File::create(&zipped)?).status();
        gzip.context("gzip cannot be started")?;
        let bytes = fs::metadata(&tlog)?.len() as f64;
        let decode = |format: &str, threads: Option<&str>| {
            let mut command = on_one_core(program.as_os_str(), threads.is_some());
            command.arg("decode").arg(&log).args(["--format", format, "-o", "-"]);
            if let Some(threads) = threads {
                command.env("RAYON_NUM_THREADS", threads);
            }
            seconds(command)
        };
        let unzip = || {
            let mut command = on_one_core("gzip".as_ref(), true);
            command.arg("-dc").arg(&zipped);
            seconds(command)
        };
        let (mut rounds, mut gains, mut mcap) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let (gzip_s, one_s, all_s) = (unzip()?, decode("tlog", Some("1"))?, decode("tlog", None)?);
            mcap.push(decode("mcap", Some("1"))?);
            rounds.push((gzip_s / one_s, gzip_s, one_s));
            gains.push((one_s / all_s, all_s));
        }
        rounds.sort_by(|a, b| a.0.total_cmp(&b.0));
        gains.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ((ratio, gzip_s, one_s), (gain, all_s)) = (rounds[ROUNDS / 2], gains[ROUNDS / 2]);
        let rate = |seconds: f64| format!("{:.0} MB/s", bytes / seconds / 1e6);
        println!(
            "{:22} {:>10} {:>10} {ratio:7.2}  {:>12} {gain:6.2}  {:>10}",
            name(flight),
            rate(gzip_s),
            rate(one_s),
            rate(all_s),
            rate(median(&mut mcap))
        );
        all_ratios.push(ratio);
        all_gains.push(gain);
    }
    let (ratio, gain) = (median(&mut all_ratios), median(&mut all_gains));
    println!("median ratio to gzip -d on one core: {ratio:.2} (asked: {AGAINST_GZIP_MIN})");
    println!("median gain by all cores: {gain:.2}");
    Ok(())
}

fn seconds(mut command: Command) -> Result<f64> {
    let start = Instant::now();
    let output = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).output()?;
    if !output.status.success() {
        bail!("{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(start.elapsed().as_secs_f64())
}

/// Back to back at the fastest line; returns the report.
pub(crate) fn record_at_full_rate(program: &Path, image: &Path, flight: &Path) -> Result<Value> {
    let (card, input) = (work_folder()?.join("card.img"), work_folder()?.join("long.tlog"));
    let _ = fs::remove_file(&card);
    repeat(flight, SECONDS_MIN * BYTES_PER_S, &input)?;
    let (json, _) = Shell::new(program)
        .args(["sim", "--json", "--costs", "--firmware"])
        .arg(image)
        .arg(&input)
        // On a small card the first segment takes 0.7 s.
        .args(["--line-rate", BAUD, "--card-size", "4096", "--sd"])
        .arg(&card)
        .output_and_code()?;
    serde_json::from_str(&json)
        .context("the report of hums sim --firmware is not JSON; run it by hand with --json")
}
