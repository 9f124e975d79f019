//! `cargo xtask bench`: size and speed of the record, each figure beside its target.
//!
//! Recordings are those of `tests/flights` and below the folders that `HUMS_FLIGHTS` names (separated by colons). Sizes and
//! costs repeat to the digit, so they are checked; speeds depend on the machine, so they are only shown.

mod logs;
mod tools;

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use serde_json::Value;

use tools::{median, on_one_core, repeat, work_folder};

use crate::firmware::{self, Board};
use crate::hums;
use crate::repo;
use crate::setup::{self, Need};
use crate::shell::Shell;

/// How much smaller than the tlog a whole session is to be, as a geometric mean.
const SMALLER_MIN: f64 = 6.5;
/// Ratio of the size to that of `xz -9e` of the tlog.
const SMALLER_THAN_XZ_MIN: f64 = 2.3;
/// The processor's clock, Hz.
const CLOCK_HZ: f64 = 168e6;
/// Bytes of MAVLink a second at 921,600 baud.
pub(crate) const BYTES_PER_S: f64 = 92_160.0;
/// Limit of the encoder's load.
const LOAD_MAX: f64 = 0.16;
/// How fast decoding is to be, as a part of the speed of `gzip -d`.
const AGAINST_GZIP_MIN: f64 = 0.4;
/// Steps of all checks, usage and trends, a second.
const TICKS_PER_S: f64 = 20.0;
/// The line on which costs are counted: at a slower one, work by the clock is a larger part of each byte.
const BAUD: &str = "921600";
/// Least length of a count, in seconds of that line, so that a short recording shows more than its start.
const SECONDS_MIN: f64 = 10.0;
/// Least input of a decoding, in bytes of tlog, so that the programs' starts hardly count.
const DECODED_MIN: f64 = 8e6;
/// Pairs of runs that are compared.
const ROUNDS: usize = 9;

/// The measurements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Bench {
    Sizes,
    Speed,
    Cost,
    Logs,
}

impl Bench {
    pub(crate) const ALL: [Self; 4] = [Self::Sizes, Self::Speed, Self::Cost, Self::Logs];

    pub(crate) fn parse(words: &[&str]) -> Result<Vec<Self>> {
        if words.is_empty() {
            return Ok(Self::ALL.to_vec());
        }
        let parse = |word: &&str| match *word {
            "sizes" => Ok(Self::Sizes),
            "speed" => Ok(Self::Speed),
            "cost" => Ok(Self::Cost),
            "logs" => Ok(Self::Logs),
            other => bail!("bench measures sizes, speed, cost or logs, not {other}"),
        };
        words.iter().map(parse).collect()
    }
}

/// Measures; an error if a checked figure misses its target.
pub(crate) fn run(what: &[Bench]) -> Result<()> {
    setup::ensure(&[Need::Linker], false).require_all()?;
    let flights = flights()?;
    let mut missed = Vec::new();
    for bench in what {
        let done = match bench {
            Bench::Sizes => sizes(&flights),
            Bench::Speed => speed(&flights),
            Bench::Cost => cost(&flights),
            Bench::Logs => logs::run(),
        };
        if let Err(error) = done {
            missed.push(format!("{bench:?}: {error:#}").to_lowercase());
        }
    }
    if missed.is_empty() { Ok(()) } else { bail!("{}", missed.join("; ")) }
}

/// All recordings, in order of their names.
fn flights() -> Result<Vec<PathBuf>> {
    let more = std::env::var_os("HUMS_FLIGHTS").unwrap_or_default();
    let more = std::env::split_paths(&more).filter(|folder| !folder.as_os_str().is_empty());
    let mut flights: Vec<PathBuf> = Vec::new();
    for folder in std::iter::once(repo::root().join("tests/flights")).chain(more) {
        collect(&folder, &mut flights)?;
    }
    flights.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    Ok(flights)
}

/// The recordings in this folder and in those below it.
fn collect(folder: &Path, flights: &mut Vec<PathBuf>) -> Result<()> {
    let entries = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        let is_recording =
            path.extension().is_some_and(|extension| extension == "tlog" || extension == "raw");
        if path.is_dir() {
            collect(&path, flights)?;
        } else if is_recording && !flights.iter().any(|known| known.file_name() == path.file_name()) {
            // The same recording may lie in two of the folders.
            flights.push(path);
        }
    }
    Ok(())
}

/// Those that the means and the model of the chip take: tlogs that are not signed.
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
        .context("a size misses its target, or xz is missing");
    sizes_of_sessions(flights).and(logs)
}

/// Size of whole sessions: with every finding, snapshot, counter and statistic that the monitor makes of a recording.
fn sizes_of_sessions(flights: &[PathBuf]) -> Result<()> {
    println!("\nSizes of whole sessions, with all that the monitor records of them\n");
    let program = hums::build_release()?;
    let (card, packed) = (work_folder()?.join("card.img"), work_folder()?.join("flight.tlog.xz"));
    let (mut logs, mut xz_logs, mut count) = (0.0, 0.0, 0.0);
    println!("{:22} {:>9} {:>9} {:>9} {:>7} {:>7}", "recording", "tlog", "xz -9e", "session", "tlog/", "xz/");
    for flight in unsigned(flights) {
        let _ = fs::remove_file(&card);
        let sim = ["sim", "--json", "--speed", "max", "--input"];
        let (json, _) =
            Shell::new(&program).args(sim).arg(flight).arg("--sd").arg(&card).output_and_code()?;
        let report: Value = serde_json::from_str(&json).context("the report of hums sim")?;
        let bytes =
            report["bytes_logged"].as_f64().filter(|&bytes| bytes > 0.0).context("nothing was logged")?;
        let xz = Command::new("xz").arg("-9ec").arg(flight).stdout(File::create(&packed)?).status();
        xz.context("xz cannot be started")?;
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
        bail!("whole sessions are {ratio:.3} times smaller than tlogs, {against_xz:.3} times than xz -9e");
    }
    Ok(())
}

/// Decodes logs and unpacks the same tlogs, one after the other on one core, several times.
fn speed(flights: &[PathBuf]) -> Result<()> {
    println!("\nSpeed of decoding to tlog, median of {ROUNDS} rounds\n");
    let program = hums::build_release()?;
    let folder = work_folder()?;
    println!(
        "{:22} {:>10} {:>10} {:>7}  {:>12} {:>6}",
        "recording", "gzip -d", "one core", "ratio", "all cores", "times"
    );
    let (mut all_ratios, mut all_gains) = (Vec::new(), Vec::new());
    for flight in unsigned(flights) {
        let (log, zipped) = (folder.join("flight.hum"), folder.join("flight.tlog.gz"));
        let tlog = folder.join("long.tlog");
        repeat(flight, DECODED_MIN, &tlog)?;
        // `pack` replaces nothing that is there.
        let _ = fs::remove_file(&log);
        let done = Command::new(&program)
            .args(["decode", "--format", "hum"])
            .arg(&tlog)
            .arg("-o")
            .arg(&log)
            .output()?;
        if !log.is_file() || !done.status.success() {
            bail!("hums decode --format hum {}: {}", flight.display(), String::from_utf8_lossy(&done.stderr));
        }
        let gzip = Command::new("gzip").arg("-c").arg(&tlog).stdout(File::create(&zipped)?).status();
        gzip.context("gzip cannot be started")?;
        let bytes = fs::metadata(&tlog)?.len() as f64;
        let decode = |threads: Option<&str>| {
            let mut command = on_one_core(program.as_os_str(), threads.is_some());
            command.arg("decode").arg(&log).args(["--format", "tlog", "-o", "-"]);
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
        let (mut rounds, mut gains) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let (gzip_s, one_s, all_s) = (unzip()?, decode(Some("1"))?, decode(None)?);
            rounds.push((gzip_s / one_s, gzip_s, one_s));
            gains.push((one_s / all_s, all_s));
        }
        rounds.sort_by(|a, b| a.0.total_cmp(&b.0));
        gains.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ((ratio, gzip_s, one_s), (gain, all_s)) = (rounds[ROUNDS / 2], gains[ROUNDS / 2]);
        let rate = |seconds: f64| format!("{:.0} MB/s", bytes / seconds / 1e6);
        println!(
            "{:22} {:>10} {:>10} {ratio:7.2}  {:>12} {gain:6.2}",
            name(flight),
            rate(gzip_s),
            rate(one_s),
            rate(all_s)
        );
        all_ratios.push(ratio);
        all_gains.push(gain);
    }
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    println!(
        "median ratio to gzip -d on one core: {:.2} (asked: {AGAINST_GZIP_MIN})",
        median(&mut all_ratios)
    );
    println!("median gain by {cores} cores: {:.2}", median(&mut all_gains));
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

/// Runs recordings through the image that is flashed on the model of its chip, back to back at the fastest line rate; it counts
/// the cycles of each stage.
fn cost(flights: &[PathBuf]) -> Result<()> {
    println!("\nModelled cycles of the STM32F405 at {BAUD} baud, by stage\n");
    setup::ensure(&[Need::FirmwareTarget], false).require_all()?;
    let (image, program) = (firmware::build(Board::F405)?, hums::build()?);
    let (mut dearest, mut all) = (("none".to_owned(), 0.0), (0.0, 0.0));
    for flight in unsigned(flights) {
        let report = record_at_full_rate(&program, &image, flight)?;
        let (encoding, bytes) = print_costs(&name(flight), &report)?;
        all = (all.0 + encoding, all.1 + bytes);
        if encoding / bytes > dearest.1 {
            dearest = (name(flight), encoding / bytes);
        }
    }
    let say = |what: &str, per_byte: f64| {
        println!(
            "encoding {what}: {per_byte:.1} cycles a byte, {:.2} % of {} MHz at {} kB/s",
            load(per_byte) * 100.0,
            CLOCK_HZ / 1e6,
            BYTES_PER_S / 1e3,
        );
    };
    say("all of them", all.0 / all.1);
    say(&format!("the dearest, {}", dearest.0), dearest.1);
    println!("(asked: at most {} %)", LOAD_MAX * 100.0);
    let load = load(dearest.1);
    if load > LOAD_MAX {
        bail!("encoding {} takes {:.2} % of the processor", dearest.0, load * 100.0);
    }
    Ok(())
}

/// Runs a recording through the firmware on the model of its chip, back to back at the fastest line: its report. `program` is
/// `hums`, `image` the firmware.
pub(crate) fn record_at_full_rate(program: &Path, image: &Path, flight: &Path) -> Result<Value> {
    let (card, input) = (work_folder()?.join("card.img"), work_folder()?.join("long.tlog"));
    let _ = fs::remove_file(&card);
    repeat(flight, SECONDS_MIN * BYTES_PER_S, &input)?;
    let (json, _) = Shell::new(program)
        .args(["sim", "--json", "--costs", "--firmware"])
        .arg(image)
        .arg("--input")
        .arg(&input)
        // On a small card the first segment alone takes 0.7 s.
        .args(["--line-rate", BAUD, "--card-size", "4096", "--sd"])
        .arg(&card)
        .output_and_code()?;
    serde_json::from_str(&json).context("the report of hums sim --firmware")
}

/// One recording's stages; gives the cycles that encoding took, and the bytes.
fn print_costs(flight: &str, report: &Value) -> Result<(f64, f64)> {
    let number = |key: &str| report[key].as_f64().filter(|&number| number > 0.0);
    let (Some(bytes), Some(frames)) = (number("bytes_in"), number("frames_in")) else {
        bail!("nothing of {flight} was received")
    };
    let stages = report["cycles"].as_object().context("the firmware does not count cycles")?;
    println!("{flight}: {frames} frames, {bytes} bytes");
    for (stage, count) in stages {
        let count = count.as_f64().unwrap_or(f64::NAN);
        println!(
            "  {stage:10} {:8.1} a byte {:9.0} a frame {:7.2} % of the processor",
            count / bytes,
            count / frames,
            load(count / bytes) * 100.0
        );
    }
    let all: f64 = stages.values().filter_map(Value::as_f64).sum();
    println!(
        "  {:10} {:8.1} a byte {:9.0} a frame {:7.2} % of the processor",
        "all",
        all / bytes,
        all / frames,
        load(all / bytes) * 100.0
    );
    if let (Some(powered_s), Some(steps)) =
        (report["usage"]["powered_time_s"].as_f64(), stages.get("tick").and_then(Value::as_f64))
    {
        let step = steps / (powered_s * TICKS_PER_S);
        let load = step * TICKS_PER_S / CLOCK_HZ;
        println!("  {:10} {step:8.0} cycles every 50 ms {:11.2} % of the processor", "a step", load * 100.0);
    }
    Ok((report["cycles"]["encode"].as_f64().context("no stage encode")?, bytes))
}

/// The load of that many cycles a byte on the fastest line.
fn load(cycles_per_byte: f64) -> f64 {
    cycles_per_byte * BYTES_PER_S / CLOCK_HZ
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_or_some_are_measured_and_a_mistyped_one_is_not_ignored() {
        assert_eq!(Bench::parse(&[]).unwrap(), Bench::ALL);
        assert_eq!(Bench::parse(&["cost", "sizes"]).unwrap(), [Bench::Cost, Bench::Sizes]);
        assert!(Bench::parse(&["size"]).is_err());
    }

    #[test]
    fn the_load_that_is_asked_for_is_some_291_cycles_a_byte() {
        assert!(load(291.0) <= LOAD_MAX && load(292.0) > LOAD_MAX);
    }

    #[test]
    fn costs_are_those_of_the_stage() {
        let report = r#"{"bytes_in": 100, "frames_in": 4, "cycles": {"encode": 9000, "tick": 1}}"#;
        let report: Value = serde_json::from_str(report).unwrap();
        let (encoding, bytes) = print_costs("flight", &report).unwrap();
        assert!((encoding / bytes - 90.0).abs() < 1e-9);
        assert!(print_costs("flight", &Value::Null).is_err());
    }
}
