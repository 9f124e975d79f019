//! `cargo xtask bench logs`: how fast `hums check` reads the logs of autopilots, beside what everybody reads them with:
//! pymavlink's `DFReader` for `DataFlash`, pyulog for `ULog`. Each reads every message of a log, on one core, one after the
//! other in the same run; speeds depend on the machine, ratios hardly.
//!
//! A log of less than a megabyte takes hardly longer than the program's start, two milliseconds: the speed of such logs is shown
//! together, and none is asked for.
//!
//! Logs are those below the folders that `HUMS_LOGS` names (separated by colons), else those of `tests`.

use std::env;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};

use super::tools::{median, on_one_core, work_folder};
use crate::hums;
use crate::oracle;
use crate::repo;

/// What `hums check` is to read, in MB a second, on one core.
const ASKED_MB_S: f64 = 100.0;
/// Of smaller logs, in MB, no speed is asked.
const SMALL_MB: f64 = 1.0;
/// Runs that are compared.
const ROUNDS: usize = 3;

/// What reads a log besides, as a program for Python whose first argument is the log.
const DATAFLASH: &str = "import sys\n\
    from pymavlink import DFReader\n\
    log = DFReader.DFReader_binary(sys.argv[1])\n\
    while log.recv_msg() is not None: pass\n";
const ULOG: &str = "import sys\nfrom pyulog import ULog\nULog(sys.argv[1])\n";

/// Measures; the speeds are shown, the one that is asked for is checked.
pub(crate) fn run() -> Result<()> {
    println!("\nSpeed of hums check on one core, median of {ROUNDS} rounds\n");
    let logs = logs()?;
    if logs.is_empty() {
        bail!("no .bin and no .ulg, plain or .gz, is below `tests`; HUMS_LOGS=FOLDER names others");
    }
    let program = hums::build_release()?;
    oracle::prepare()?;
    let python = oracle::python();
    println!("{:32} {:>8} {:>12} {:>12} {:>7}", "log", "MB", "hums check", "Python", "times");
    let (mut slow, mut small) = (Vec::new(), (0.0, 0.0));
    for (log, script) in &logs {
        let path = plain(log)?;
        let megabytes = fs::metadata(&path)?.len() as f64 / 1e6;
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        for _ in 0..ROUNDS {
            let mut command = on_one_core(program.as_os_str(), true);
            command.args(["check", "--json"]).arg(&path).env("RAYON_NUM_THREADS", "1");
            // 3 and 4: the log is damaged, or something was found.
            ours.push(seconds(command, &[0, 3, 4])?);
            let mut command = on_one_core(python.as_os_str(), true);
            command.args(["-c", script]).arg(&path);
            theirs.push(seconds(command, &[0])?);
        }
        let (ours, theirs) = (median(&mut ours), median(&mut theirs));
        let rate = |seconds: f64| format!("{:.1} MB/s", megabytes / seconds);
        let name = log.file_name().unwrap_or_default().to_string_lossy();
        println!("{name:32} {megabytes:8.1} {:>12} {:>12} {:7.0}", rate(ours), rate(theirs), theirs / ours);
        if megabytes < SMALL_MB {
            small = (small.0 + megabytes, small.1 + ours);
        } else if megabytes / ours < ASKED_MB_S {
            slow.push(name.into_owned());
        }
    }
    let (megabytes, seconds) = small;
    if seconds > 0.0 {
        println!("those below {SMALL_MB} MB together: {megabytes:.1} MB, {:.1} MB/s", megabytes / seconds);
    }
    println!("(asked: {ASKED_MB_S} MB/s of each that is larger)");
    if !slow.is_empty() {
        bail!("slower than {ASKED_MB_S} MB/s: {}", slow.join(", "));
    }
    Ok(())
}

/// The logs, with what else reads them.
fn logs() -> Result<Vec<(PathBuf, &'static str)>> {
    let named = env::var_os("HUMS_LOGS").map(|folders| env::split_paths(&folders).collect::<Vec<_>>());
    let mut waiting = named.unwrap_or_else(|| vec![repo::root().join("tests")]);
    let mut logs = Vec::new();
    while let Some(folder) = waiting.pop() {
        for entry in fs::read_dir(&folder).with_context(|| folder.display().to_string())? {
            let (path, kind) = {
                let entry = entry?;
                (entry.path(), entry.file_type()?)
            };
            let is = |path: &Path, wanted: &str| {
                path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted))
            };
            let unpacked = if is(&path, "gz") { path.with_extension("") } else { path.clone() };
            if kind.is_dir() {
                waiting.push(path);
            } else if is(&unpacked, "bin") {
                logs.push((path, DATAFLASH));
            } else if is(&unpacked, "ulg") {
                logs.push((path, ULOG));
            }
        }
    }
    logs.sort();
    Ok(logs)
}

/// The log without its compression, which is not what is measured.
fn plain(log: &Path) -> Result<PathBuf> {
    if log.extension().is_none_or(|extension| extension != "gz") {
        return Ok(log.to_owned());
    }
    let path = work_folder()?.join(log.file_stem().unwrap_or_default());
    let status = Command::new("gzip").arg("-dc").arg(log).stdout(File::create(&path)?).status();
    if !status.context("gzip cannot be started")?.success() {
        bail!("{}: gzip cannot unpack it", log.display());
    }
    Ok(path)
}

/// How long a program takes, which must end with one of these codes.
fn seconds(mut command: Command, codes: &[i32]) -> Result<f64> {
    let start = Instant::now();
    let output = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).output()?;
    let ended = output.status.code().is_some_and(|code| codes.contains(&code));
    if !ended {
        bail!("{command:?}: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(start.elapsed().as_secs_f64())
}
