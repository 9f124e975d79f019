//! `cargo xtask bench logs`: `hums check` beside pymavlink's `DFReader` (`DataFlash`) and pyulog (`ULog`). The
//! program's processor time counts, the best of some rounds.
//!
//! Each log is repeated to 16 MB, as `cat` joins it: the start of two milliseconds does not count.
//!
//! Logs: below the folders of `HUMS_LOGS` (colons between), else of `tests`.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail};

use super::tools::{files_below, folders, on_one_core, repeat, work_folder};
use crate::hums;
use crate::oracle;

const ASKED_MB_S: f64 = 100.0;
/// Least bytes of a log.
const BYTES_MIN: f64 = 16e6;
const ROUNDS: usize = 5;

const DATAFLASH: &str = "import sys\n\
    from pymavlink import DFReader\n\
    log = DFReader.DFReader_binary(sys.argv[1])\n\
    while log.recv_msg() is not None: pass\n";
const ULOG: &str = "import sys\nfrom pyulog import ULog\nULog(sys.argv[1])\n";

/// Prints seconds of the processor, and the code.
const TIMED: &str = "import resource, subprocess, sys\n\
    run = subprocess.run(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)\n\
    used = resource.getrusage(resource.RUSAGE_CHILDREN)\n\
    print(used.ru_utime + used.ru_stime, run.returncode)\n";

pub(crate) fn run() -> Result<()> {
    println!("\nSpeed of hums check on one core, the best of {ROUNDS} rounds\n");
    let logs = logs()?;
    if logs.is_empty() {
        bail!("no .bin and no .ulg, plain or .gz, is below `tests`; HUMS_LOGS=FOLDER names others");
    }
    let program = hums::build_release()?;
    oracle::prepare()?;
    let python = oracle::python();
    println!("{:32} {:>8} {:>12} {:>12} {:>7}", "log", "MB", "hums check", "Python", "times");
    let mut slow = Vec::new();
    let path = work_folder()?.join("long.log");
    for (log, script) in &logs {
        repeat(&plain(log)?, BYTES_MIN, &path)?;
        let megabytes = fs::metadata(&path)?.len() as f64 / 1e6;
        let (mut ours, mut theirs) = (f64::INFINITY, f64::INFINITY);
        for _ in 0..ROUNDS {
            let check = ["check".as_ref(), "--json".as_ref(), path.as_os_str()];
            // Damage, or findings.
            ours = ours.min(seconds(&python, program.as_os_str(), check, &[0, 3, 4])?);
            let read = ["-c".as_ref(), script.as_ref(), path.as_os_str()];
            theirs = theirs.min(seconds(&python, python.as_os_str(), read, &[0])?);
        }
        let rate = |seconds: f64| format!("{:.1} MB/s", megabytes / seconds);
        let name = log.file_name().unwrap_or_default().to_string_lossy();
        println!("{name:32} {megabytes:8.1} {:>12} {:>12} {:7.0}", rate(ours), rate(theirs), theirs / ours);
        if megabytes / ours < ASKED_MB_S {
            slow.push(name.into_owned());
        }
    }
    println!("(asked: {ASKED_MB_S} MB/s of each)");
    if !slow.is_empty() {
        bail!("slower than {ASKED_MB_S} MB/s: {}", slow.join(", "));
    }
    Ok(())
}

fn logs() -> Result<Vec<(PathBuf, &'static str)>> {
    let with = |reader, kinds: &[&str]| -> Result<Vec<_>> {
        let logs = files_below(&folders("HUMS_LOGS", false), kinds)?;
        Ok(logs.into_iter().map(|log| (log, reader)).collect())
    };
    Ok([with(DATAFLASH, &[".bin", ".bin.gz"])?, with(ULOG, &[".ulg", ".ulg.gz"])?].concat())
}

/// Compression is not measured.
fn plain(log: &Path) -> Result<PathBuf> {
    if log.extension().is_none_or(|extension| extension != "gz") {
        return Ok(log.to_owned());
    }
    let path = work_folder()?.join(log.file_stem().unwrap_or_default());
    let status = Command::new("gzip").arg("-dc").arg(log).stdout(File::create(&path)?).status();
    if !status.context("gzip cannot be started; `cargo xtask setup` installs it")?.success() {
        bail!("{}: gzip cannot unpack it", log.display());
    }
    Ok(path)
}

/// Seconds on one core; ends with one of these codes.
fn seconds(python: &Path, program: &OsStr, words: [&OsStr; 3], codes: &[i32]) -> Result<f64> {
    let mut command = on_one_core(python.as_os_str(), true);
    command.args(["-c", TIMED]).arg(program).args(words).env("RAYON_NUM_THREADS", "1");
    let output = command.output()?;
    let said = String::from_utf8_lossy(&output.stdout);
    let told =
        said.trim().split_once(' ').and_then(|(used, code)| Some((used.parse().ok()?, code.parse().ok()?)));
    match told {
        Some((used, code)) if codes.contains(&code) => Ok(used),
        _ => bail!("{command:?}: {said}{}", String::from_utf8_lossy(&output.stderr)),
    }
}
