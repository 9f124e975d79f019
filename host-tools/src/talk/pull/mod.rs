//! `hums box pull`: logs over MAVLink FTP, burst by burst.
//!
//! An interrupted download resumes if its bytes match the log's beginning, by checksum. At the end the whole file is
//! compared, and verified as by `hums info --verify`. File names contain the session: two cards never collide.

mod around;
mod compare;
mod ftp;
mod judge;

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use serde::Serialize;

pub(super) use self::around::{WHOLE_GROUP, newest};
use self::compare::{Heading, heading_here, heading_of, is_same};
use self::ftp::Ftp;
use self::judge::{LogJson, judge};
use super::Client;
use crate::cli;
use crate::files::{Output, make_directory, settle};
use crate::logs::segment_name;
use crate::outcome::{Outcome, usage};
use crate::output::{self, Schema};
use crate::plural::count;
use crate::printable::word;

const TOLD_BYTES: u32 = 8 * 1024;

const SCHEMA: Schema = Schema::first("hums-pull");

#[derive(Debug, Serialize)]
struct PulledJson {
    /// MAVLink system id of the box's vehicle.
    system: u8,
    /// Logs on the PC.
    logs: Vec<LogJson>,
    /// Moment of `--around`.
    around: Option<MomentJson>,
}

#[derive(Debug, Serialize)]
struct MomentJson {
    time_s: f64,
    /// The requested finding, or `null`.
    check: Option<String>,
    instance: Option<u8>,
    level: Option<&'static str>,
}

/// Runs `hums box pull`.
pub fn run(args: &cli::Pull) -> Result<Outcome> {
    make_directory(&args.output)?;
    let client = Client::connect(&args.at)?;
    let system = client.system();
    bring(client, args).with_context(|| format!("system {system}"))
}

fn bring(client: Client, args: &cli::Pull) -> Result<Outcome> {
    let mut ftp = Ftp::new(client)?;
    let (mut logs, skipped) = ftp.list()?;
    logs.sort();
    if skipped > 0 {
        note!(
            "the box could not read {}, whose names are not known; call again, or read the card itself",
            count(skipped, "more log")
        );
    }
    if let Some(missing) = args.names.iter().find(|name| logs.iter().all(|(log, _)| log != *name)) {
        let names: Vec<&str> = logs.iter().map(|(log, _)| log.as_str()).collect();
        bail!("{missing}: the box lists no such log now; it has {}", names.join(", "));
    }
    // Others are not missing.
    let listed = Outcome::lossy(skipped > 0 && args.names.is_empty());
    let newest = logs.last().map(|(log, _)| log.clone());
    let oldest = args.last.map(|most| first_of_newest(&logs, most));
    let is_requested = |log: &str| {
        (args.names.is_empty() || args.names.iter().any(|name| name == log))
            && oldest.is_none_or(|oldest| number(log).is_none_or(|number| number >= oldest))
    };
    let (logs, left_out): (Vec<_>, Vec<_>) = logs.into_iter().partition(|(log, _)| is_requested(log));
    if let Some(moment) = &args.around {
        return Ok(around(&mut ftp, logs, args, moment)?.and(listed));
    }
    // A log begun just now may be empty.
    let begun = newest.filter(|_| args.names.is_empty());
    let left_out: Vec<String> =
        left_out.into_iter().filter(|(_, bytes)| *bytes > 0).map(|(log, _)| log).collect();
    let mut pulled = Vec::new();
    let came = each(&mut ftp, logs, begun.as_deref(), args, &mut pulled);
    // Also the logs before an error.
    let judged = judge(&left_out, &mut pulled);
    let outcome = came?.and(judged?).and(listed);
    if args.at.json {
        output::json(SCHEMA, &PulledJson { system: ftp.system(), logs: pulled, around: None })?;
    }
    Ok(outcome)
}

fn number(log: &str) -> Option<u32> {
    segment_name(Path::new(log)).map(|name| name.session)
}

/// The first of this many newest. An empty log begun just now is not counted.
fn first_of_newest(logs: &[(String, u32)], most: usize) -> u32 {
    let filled = logs.iter().filter(|(_, bytes)| *bytes > 0);
    let mut numbers: Vec<u32> = filled.filter_map(|(log, _)| number(log)).collect();
    numbers.dedup();
    match most.checked_sub(1) {
        Some(more) => numbers.iter().rev().nth(more).copied().unwrap_or(0),
        None => u32::MAX,
    }
}

/// A fault of one does not stop the others.
fn each(
    ftp: &mut Ftp,
    logs: Vec<(String, u32)>,
    begun: Option<&str>,
    args: &cli::Pull,
    pulled: &mut Vec<LogJson>,
) -> Result<Outcome> {
    let (mut outcome, mut failed) = (Outcome::Done, None);
    for (name, bytes) in logs {
        match pull(ftp, &name, &args.output).with_context(|| name.clone()) {
            Ok(Some((path, is_new))) => {
                if !is_new {
                    note!("{name}: is there already as {}: the same by its checksum", path.display());
                } else if !args.at.json {
                    output::line(&word(&path.display().to_string()))?;
                }
                pulled.push(LogJson::new(name, path, is_new));
            }
            Ok(None) if bytes == 0 && begun == Some(name.as_str()) => {}
            Ok(None) => {
                note!(
                    "{name}: has no data, or its first sector cannot be read: read the card itself, or an image of it"
                );
                outcome = Outcome::Losses;
            }
            // Of link or disk: the others would fail too.
            Err(error) if error.root_cause().is::<io::Error>() => return Err(error),
            // Made room for later logs.
            Err(error) if error.root_cause().is::<ftp::NoSuchLog>() => {
                note!("{error:#}");
                outcome = Outcome::Losses;
            }
            Err(error) => {
                if failed.is_some() {
                    note!("{error:#}");
                } else {
                    failed = Some(error);
                }
            }
        }
    }
    failed.map_or(Ok(outcome), Err)
}

fn around(
    ftp: &mut Ftp,
    mut logs: Vec<(String, u32)>,
    args: &cli::Pull,
    moment: &cli::LogMoment,
) -> Result<Outcome> {
    let newest = logs.iter().rev().find(|(_, bytes)| *bytes > 0).and_then(|(log, _)| number(log));
    if !args.names.is_empty() && logs.iter().any(|(log, _)| number(log) != newest) {
        return Err(usage("--around needs one log; name files of one number only"));
    }
    logs.retain(|(log, _)| number(log) == newest);
    let around::Brought { files, at, found, outcome } =
        around::pull(ftp, &logs, &args.output, (moment, args.span))?;
    if args.at.json {
        let around = MomentJson {
            time_s: at.as_secs_f64(),
            instance: found.as_ref().map(|found| found.instance),
            level: found.as_ref().map(|found| found.level.name()),
            check: found.map(|found| found.check),
        };
        let logs = files.into_iter().map(|(name, path)| LogJson::new(name, path, true)).collect();
        output::json(SCHEMA, &PulledJson { system: ftp.system(), logs, around: Some(around) })?;
    } else {
        files.iter().try_for_each(|(_, path)| output::line(&word(&path.display().to_string())))?;
    }
    Ok(outcome)
}

/// Path, and whether it is new; `None` if empty.
fn pull(ftp: &mut Ftp, name: &str, output: &Path) -> Result<Option<(PathBuf, bool)>> {
    let length = ftp.open(name)?;
    if length == 0 {
        return Ok(None);
    }
    let heading = heading_of(ftp, name, length)?;
    let path = output.join(&heading.name);
    let there = there(ftp, name, &path, length)?;
    if there == LocalCopy::Whole {
        return Ok(Some((path, false)));
    }
    let mut file = Output::resume(&path)?;
    let mut have = begun(ftp, name, &mut file, length)?;
    if let LocalCopy::Beginning(bytes) = there
        && have < bytes
    {
        file.begin_anew()?;
        let mut shorter = File::open(&path)?.take(u64::from(bytes));
        settle(io::copy(&mut shorter, &mut file).map(|_| ()), &path)?;
        have = bytes;
    }
    if have > 0 {
        note!("{name}: goes on after {have} bytes, which the box confirms by their checksum");
    }
    complete(ftp, name, &mut file, (have, length), &heading)?;
    file.finish()?;
    Ok(Some((path, true)))
}

/// Downloads until it equals the box's; counts are bytes here and in all.
fn complete(
    ftp: &mut Ftp,
    name: &str,
    file: &mut Output,
    (have, mut length): (u32, u32),
    heading: &Heading,
) -> Result<()> {
    fetch(ftp, name, file, have, length)?;
    if !is_whole(ftp, name, file, length)? {
        file.begin_anew()?;
        note!("{name}: the download differs from the box's log; it starts again");
        length = ftp.open(name)?.min(length);
        check_same(heading, &heading_of(ftp, name, length)?)?;
        fetch(ftp, name, file, 0, length)?;
        if !is_whole(ftp, name, file, length)? {
            bail!(
                "two downloads differ from the box's log, so its card may be failing; read the card itself ({} has the last download)",
                file.part().display()
            );
        }
    }
    let same = check_same(heading, &heading_here(file.part(), name, length)?);
    if same.is_err() {
        file.begin_anew()?;
    }
    same
}
fn check_same(first: &Heading, now: &Heading) -> Result<()> {
    match (first.session, now.session) {
        (first, now) if first == now => Ok(()),
        (_, Some(_)) => bail!(
            "another log, {}, replaced it during the download, of which nothing is kept; call again",
            now.name
        ),
        (_, None) => {
            bail!("the box can no longer read its beginning, so it may be another log; call again")
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LocalCopy {
    Nothing,
    /// The log has grown since.
    Beginning(u32),
    /// All of it.
    Whole,
}

fn there(ftp: &mut Ftp, name: &str, path: &Path, length: u32) -> Result<LocalCopy> {
    let Ok(about) = path.metadata() else { return Ok(LocalCopy::Nothing) };
    if !about.is_file() {
        bail!("{}: is not a file; move it away, or name another directory with -o", path.display());
    }
    let bytes = u32::try_from(about.len()).unwrap_or(u32::MAX);
    if bytes == 0 {
        return Ok(LocalCopy::Nothing);
    }
    if !is_same(ftp, name, path, bytes.min(length))? {
        bail!(
            "{} differs from the box's log of the same session, and stays. Check it with `hums info --verify`; then move it away, or name another directory with -o",
            path.display()
        );
    }
    if about.len() > u64::from(length) {
        bail!(
            "{} is the box's log with {} more, and stays; move it away, or name another directory with -o",
            path.display(),
            count(about.len() - u64::from(length), "byte")
        );
    }
    Ok(if bytes < length { LocalCopy::Beginning(bytes) } else { LocalCopy::Whole })
}

/// Resumable bytes; another log's are deleted.
fn begun(ftp: &mut Ftp, name: &str, file: &mut Output, length: u32) -> Result<u32> {
    let part = file.part().to_owned();
    let bytes = u32::try_from(part.metadata()?.len()).unwrap_or(u32::MAX);
    if bytes <= length && is_same(ftp, name, &part, bytes)? {
        return Ok(bytes);
    }
    file.begin_anew()?;
    note!("{name}: the unfinished download differs from the box's log; it starts again");
    Ok(0)
}

fn fetch(ftp: &mut Ftp, name: &str, file: &mut Output, have: u32, length: u32) -> Result<()> {
    let (mut done, mut told) = (have, have);
    let brought = ftp.bring(have, length, |bytes| {
        settle(file.write_all(bytes), file.path())?;
        done += bytes.len() as u32;
        if done >= length || done - told >= TOLD_BYTES {
            told = done;
            note!("{name}: {done} of {length} bytes");
        }
        Ok(())
    });
    brought.with_context(|| format!("after {done} of {length} bytes"))
}

/// Whether the download equals the box's log.
fn is_whole(ftp: &mut Ftp, name: &str, file: &mut Output, length: u32) -> Result<bool> {
    let flushed = file.flush();
    settle(flushed, file.path())?;
    is_same(ftp, name, file.part(), length)
}

#[cfg(test)]
mod tests;
