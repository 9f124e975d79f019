//! A fleet of 10,000 vehicles with 20,000 sessions: their ingest, the size and speed of their tables, and the sum for a year.

mod sessions;

use std::env;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::slice;
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use serde_json::Value;

use crate::child;
use crate::flights::{OWN, own, root};
use crate::oracle;
use crate::program::command;
use sessions::{Stretch, VEHICLES};

/// Its name for `prove`.
pub const FLEET: &str = "fleet";
/// Its description for a list.
pub const ABOUT: &str = "20,000 sessions of 10,000 vehicles: ingest, size, queries, and the sum for a year";

/// A call takes its share of a day's sessions.
const LIMIT: Duration = Duration::from_hours(1);
/// An earlier `hums`, whose ingest is compared.
const BEFORE: &str = "HUMS_BEFORE";
/// Calls of each program: the fastest one has the least of the machine's other work.
const CALLS: usize = 3;
/// Of the issue: sessions of a year, ingest against that of an earlier `hums`, size against the log, seconds of a query, disk.
const YEAR: f64 = 18e6;
const SPEED_MIN: f64 = 1.3;
const SIZE_MAX: f64 = 1.5;
const QUERY_S_MAX: f64 = 1.0;
const DISK_MAX: u64 = 3 << 30;

/// Extent of the fleet.
#[derive(Clone, Copy, Debug)]
pub struct Fleet {
    sessions: u64,
    days: u64,
    seconds: u64,
    /// Sessions for the comparison of speeds.
    compared: u64,
    /// Only the tables of the documented queries, and no limits of size and speed.
    is_short: bool,
}

impl Fleet {
    /// All of it.
    pub const LONG: Self = Self { sessions: 20_000, days: 20, seconds: 20, compared: 200, is_short: false };
    /// The short form, for `cargo xtask test`.
    pub const SHORT: Self = Self { sessions: 60, days: 1, seconds: 1, compared: 3, is_short: true };

    /// From `--short` and `--runs N`.
    pub fn parse(words: &[String]) -> Result<Self> {
        match words.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
            [] => Ok(Self::LONG),
            ["--short"] => Ok(Self::SHORT),
            ["--runs", count] => {
                let sessions = count.parse().with_context(|| format!("{count} is no number"))?;
                Ok(Self { sessions, days: sessions.div_ceil(1_000), ..Self::LONG })
            }
            _ => bail!("prove {FLEET} takes --short or --runs N"),
        }
    }
}

/// Makes, ingests and asks the fleet, in a temporary folder. Returns the figures as text.
///
/// # Errors
/// A promise is broken.
pub fn run(fleet: &Fleet) -> Result<String> {
    let dir = tempfile::tempdir()?;
    let dir = dir.path();
    let mut text = String::new();
    let stretches = Stretch::all(fleet.seconds)?;
    let ratio = compare(fleet, &stretches, dir, &mut text)?;
    let bytes = if fleet.is_short { None } else { Some(size(dir, &mut text)?) };
    let cost = ingest(fleet, &stretches, dir, &mut text)?;
    // An engine may fail, and the figures were an hour's work.
    eprint!("{text}");
    let query_s = ask(fleet, dir, &mut text)?;
    year(fleet, &cost, bytes, query_s, &mut text);
    // The speed of a short run is of the machine's other work.
    ensure!(
        fleet.is_short || ratio.is_none_or(|ratio| ratio >= SPEED_MIN) && query_s <= QUERY_S_MAX,
        "{text}ingest must be {SPEED_MIN} times as fast as before; the slowest query took {query_s:.2} s, {QUERY_S_MAX} s are \
         allowed: does this machine have other work?"
    );
    Ok(text)
}

fn decode(inputs: &[PathBuf], output: &Path, format: &str, more: &[&str]) -> f64 {
    timed(command::<&str>([]), inputs, output, format, more)
}

fn timed(mut program: Command, inputs: &[PathBuf], output: &Path, format: &str, more: &[&str]) -> f64 {
    let begun = Instant::now();
    program.args(["decode", "--format", format, "-o"]).arg(output).args(inputs).args(more);
    child::run(&mut program, LIMIT).expect_code(&[0]);
    begun.elapsed().as_secs_f64()
}

fn compact(folder: &Path) -> f64 {
    let begun = Instant::now();
    child::run(&mut command([OsStr::new("compact"), folder.as_os_str()]), LIMIT).expect_code(&[0]);
    begun.elapsed().as_secs_f64()
}

fn taken(folder: &Path) -> Result<(u64, u64)> {
    let mut sum = (0, 0);
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        let (bytes, files) = if path.is_dir() { taken(&path)? } else { (fs::metadata(&path)?.len(), 1) };
        sum = (sum.0 + bytes, sum.1 + files);
    }
    Ok(sum)
}

/// Sessions `from..to` as files of a new folder. Returns the number of their frames.
fn make(stretches: &[Stretch], sessions: std::ops::Range<u64>, day: u64, folder: &Path) -> Result<u64> {
    fs::create_dir_all(folder)?;
    let mut frames = 0;
    for index in sessions {
        // Both sessions of a vehicle are of one recording.
        let stretch = stretches.get((index % VEHICLES) as usize % stretches.len()).context("no stretch")?;
        frames += stretch.write(index, day, &folder.join(format!("{index:05}.tlog")))?;
    }
    Ok(frames)
}

/// The same files one by one, in one call, and by an earlier program, if there is one: then the ratio of their speeds.
fn compare(fleet: &Fleet, stretches: &[Stretch], dir: &Path, text: &mut String) -> Result<Option<f64>> {
    let (files, one, all) = (dir.join("compared"), dir.join("one"), dir.join("all"));
    make(stretches, 0..fleet.compared, 0, &files)?;
    let mut paths = fs::read_dir(&files)?.map(|entry| Ok(entry?.path())).collect::<Result<Vec<PathBuf>>>()?;
    paths.sort();
    for path in &paths {
        decode(slice::from_ref(path), &one, "parquet", &[]);
    }
    decode(slice::from_ref(&files), &all, "parquet", &[]);
    let (a, b) = (taken(&one)?, taken(&all)?);
    ensure!(a.1 == b.1, "one by one gave {} files, in one call {}", a.1, b.1);
    let Some(earlier) = env::var_os(BEFORE) else {
        let _ =
            writeln!(text, "NOT TESTED: speed of ingest against an earlier hums: {BEFORE} names its program");
        return [files, one, all].iter().try_for_each(fs::remove_dir_all).map(|()| None).map_err(Into::into);
    };
    let (mut now_s, mut before_s) = (f64::MAX, f64::MAX);
    // File systems without a journal make files slowly after many were removed.
    let new = tempfile::tempdir_in(dir)?;
    for call in 0..CALLS {
        for (name, program, seconds) in
            [("before", Command::new(&earlier), &mut before_s), ("now", command::<&str>([]), &mut now_s)]
        {
            let output = new.path().join(format!("{name}-{call}"));
            *seconds = seconds.min(timed(program, slice::from_ref(&files), &output, "parquet", &[]));
        }
    }
    new.close()?;
    let ratio = before_s / now_s;
    let _ = writeln!(
        text,
        "ingest of {} sessions in one call: {now_s:.2} s, {before_s:.2} s before: {ratio:.2} times as fast",
        fleet.compared
    );
    [files, one, all].iter().try_for_each(fs::remove_dir_all).map(|()| Some(ratio)).map_err(Into::into)
}

/// Different recordings of one vehicle: logs of the box, and their compacted tables. Returns bytes of these for each recording.
fn size(dir: &Path, text: &mut String) -> Result<f64> {
    let mut recordings = fs::read_dir(root().join("tests/labelled"))?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<Vec<_>>>()?;
    recordings.retain(|path| path.extension().is_some_and(|extension| extension == "gz"));
    recordings.extend(OWN.map(own));
    recordings.sort();
    let (logs, tables) = (dir.join("logs"), dir.join("tables"));
    fs::create_dir(&logs)?;
    for (number, recording) in recordings.iter().enumerate() {
        decode(slice::from_ref(recording), &logs.join(format!("{number:02}.hum")), "hum", &[]);
    }
    let log_bytes = taken(&logs)?.0;
    decode(slice::from_ref(&logs), &tables, "parquet", &["--vehicle", "one"]);
    let (bytes, files) = taken(&tables)?;
    compact(&tables);
    let (compact_bytes, compact_files) = taken(&tables)?;
    let ratio = compact_bytes as f64 / log_bytes as f64;
    let _ = writeln!(
        text,
        "size of {} different recordings of one vehicle: logs {log_bytes} bytes; tables {bytes} bytes in {files} files, compacted \
         {compact_bytes} in {compact_files}: {ratio:.2} times the logs",
        recordings.len()
    );
    ensure!(ratio <= SIZE_MAX, "compacted tables are {ratio:.2} times the logs, {SIZE_MAX} are allowed");
    [logs, tables].iter().try_for_each(fs::remove_dir_all)?;
    Ok(compact_bytes as f64 / recordings.len() as f64)
}

/// Seconds of ingest and of compaction, and files, for each session.
struct Cost {
    ingest_s: f64,
    compact_s: f64,
    files: f64,
    compact_files: f64,
}

/// Day by day: a day's sessions are made, decoded and compacted.
fn ingest(fleet: &Fleet, stretches: &[Stretch], dir: &Path, text: &mut String) -> Result<Cost> {
    let (day_folder, tables) = (dir.join("day"), dir.join("fleet"));
    let few: &[&str] = &[
        "--message",
        "ATTITUDE",
        "--message",
        "VIBRATION",
        "--message",
        "BATTERY_STATUS",
        "--message",
        "HEARTBEAT",
    ];
    let few = if fleet.is_short { few } else { &[] };
    let (mut frames, mut ingest_s, mut compact_s, mut most, mut files) = (0, 0.0, 0.0, 0, 0);
    for day in 0..fleet.days {
        let sessions = fleet.sessions * day / fleet.days..fleet.sessions * (day + 1) / fleet.days;
        frames += make(stretches, sessions, day, &day_folder)?;
        let before = if day == 0 { 0 } else { taken(&tables)?.1 };
        ingest_s += decode(slice::from_ref(&day_folder), &tables, "parquet", few);
        fs::remove_dir_all(&day_folder)?;
        let (bytes, now) = taken(&tables)?;
        (most, files) = (most.max(bytes), files + now - before);
        compact_s += compact(&tables);
    }
    let (bytes, compact_files) = taken(&tables)?;
    ensure!(most <= DISK_MAX, "the fleet took {most} bytes, {DISK_MAX} are allowed");
    let count = fleet.sessions as f64;
    let _ = writeln!(
        text,
        "fleet: {} sessions of {} s, {} vehicles, {} days, {frames} frames; ingest {ingest_s:.1} s ({:.1} sessions/s), compact \
         {compact_s:.1} s; {files} files became {compact_files}, {bytes} bytes; at most {most} bytes at a time",
        fleet.sessions,
        fleet.seconds,
        VEHICLES.min(fleet.sessions),
        fleet.days,
        count / ingest_s
    );
    // Tables of a box need a box.
    let image = dir.join("box.img");
    let sim = [
        OsStr::new("sim"),
        "--speed".as_ref(),
        "max".as_ref(),
        "--seed".as_ref(),
        "1".as_ref(),
        "--sd".as_ref(),
    ];
    child::run(command(sim).arg(&image).arg(own("ap_quad_faults.tlog")), LIMIT).expect_code(&[0]);
    decode(&[image], &tables, "parquet", &[]);
    fs::write(
        dir.join("expected.json"),
        serde_json::json!({ "sessions": fleet.sessions, "frames": frames }).to_string(),
    )?;
    Ok(Cost {
        ingest_s: ingest_s / count,
        compact_s: compact_s / count,
        files: files as f64 / count,
        compact_files: compact_files as f64 / count,
    })
}

/// The documented queries, in DuckDB and, if it is there, Spark. Returns seconds of the slowest one on the summary.
fn ask(fleet: &Fleet, dir: &Path, text: &mut String) -> Result<f64> {
    let answers = oracle::fleet_proof(&root().join("docs/fleet.md"), dir, !fleet.is_short);
    let (mut slowest, mut count) = (0.0_f64, 0);
    for query in answers["queries"].as_array().context("no queries")? {
        let (heading, seconds) =
            (query["heading"].as_str().unwrap_or_default(), query["seconds"].as_f64().unwrap_or(f64::MAX));
        let rows = query["rows"].as_u64().unwrap_or_default();
        if let (Some(read), Some(all)) = (query["files_read"].as_u64(), query["files"].as_u64()) {
            let _ = writeln!(
                text,
                "raw: {heading}: {read} of {all} files for one vehicle and day, {seconds:.3} s, {rows} rows"
            );
            ensure!(read <= 1, "{heading} reads {read} files for one vehicle and day");
        } else {
            let _ = writeln!(text, "summary: {heading}: {seconds:.3} s, {rows} rows");
            slowest = slowest.max(seconds);
        }
        count += 1;
    }
    ensure!(count > 10, "{count} queries are few");
    match &answers["spark"] {
        Value::String(why) => writeln!(text, "NOT TESTED: Spark: {why}")?,
        spark => writeln!(
            text,
            "Spark {}: {} of {} queries of the summary run as they are, with DuckDB's rows; one vehicle and day: {} of {} files",
            spark["version"].as_str().unwrap_or_default(),
            spark["same"],
            spark["queries"],
            spark["files_read"],
            spark["files"]
        )?,
    }
    Ok(slowest)
}

fn year(fleet: &Fleet, cost: &Cost, bytes: Option<f64>, query_s: f64, text: &mut String) {
    let times = YEAR / fleet.sessions as f64;
    let hours = |seconds: f64| YEAR * seconds / 3600.0;
    let _ = writeln!(
        text,
        "a year, {YEAR:.0} sessions, on this machine:\n\
         ingest {:.4} s x {YEAR:.0} / 3600 = {:.0} h; compact {:.4} s x {YEAR:.0} / 3600 = {:.0} h; {:.1} machines the whole year\n\
         files {:.2} a session before compact, {:.3} after it, x {YEAR:.0} = {:.0}\n\
         slowest query of the summary {query_s:.3} s x {times:.0} times the rows = {:.0} s; a condition on the date makes it less",
        cost.ingest_s,
        hours(cost.ingest_s),
        cost.compact_s,
        hours(cost.compact_s),
        hours(cost.ingest_s + cost.compact_s) / 8766.0,
        cost.files,
        cost.compact_files,
        YEAR * cost.compact_files,
        query_s * times
    );
    if let Some(bytes) = bytes {
        let _ = writeln!(
            text,
            "bytes of a session like the different recordings, compacted: {bytes:.0} x {YEAR:.0} = {:.2} TB",
            YEAR * bytes / 1e12
        );
    }
}
