//! `hums box pull`: the board's logs over MAVLink FTP, burst by burst; lost pieces are read one by one.
//!
//! An interrupted download is resumed if its bytes match the beginning of the board's log. They are compared
//! by checksum, or by both ends if the firmware computes none. At the end the whole file is compared and
//! verified as by `hums info --verify`, also if it was there already. A file's name contains its session, so
//! files of two cards never collide.

mod around;
mod compare;
mod ftp;
mod judge;
mod moment;
mod part;
mod remote;
mod session;
mod stretch;

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::SECTOR_BYTES;
use hums_core::clock::Instant;
use serde::Serialize;

use self::compare::{Heading, Likeness, beginning_of, compare, heading_here, heading_of};
use self::ftp::Ftp;
use self::judge::{Asked, LogJson, judge};
use self::session::{Place, place};
use self::stretch::{Reading, Stretch};
use super::Client;
use crate::cli;
use crate::files::{Output, make_directory, settle};
use crate::outcome::Outcome;
use crate::output::{self, Schema};
use crate::plural::{are, count};
use crate::printable::word;
use crate::summary::FindingLine;

/// Bytes between two progress messages.
const TOLD_BYTES: u32 = 8 * 1024;

/// Message for an empty log. A board does not list a log whose first sector is lost.
const NOTHING: &str = "nothing is recorded in it yet, or its first sector cannot be read";

/// Output of `hums box pull --json`.
const SCHEMA: Schema = Schema::first("hums-pull");

#[derive(Debug, Serialize)]
struct PulledJson {
    /// The board's identity.
    system: u8,
    logs: Vec<LogJson>,
    /// With `--around`.
    around: Option<MomentJson>,
}

#[derive(Debug, Serialize)]
struct MomentJson {
    time_s: f64,
    check: Option<String>,
    instance: Option<u8>,
    level: Option<&'static str>,
}

impl MomentJson {
    fn of(at: Instant, found: Option<FindingLine>) -> Self {
        let (check, instance, level) = found
            .map(|found| (found.check, found.instance, found.level))
            .map_or((None, None, None), |(check, instance, level)| {
                (Some(check), Some(instance), Some(level))
            });
        Self { time_s: at.as_secs_f64(), check, instance, level }
    }
}

/// Runs `hums box pull`.
pub fn run(args: &cli::Pull) -> Result<Outcome> {
    make_directory(&args.output)?;
    let client = Client::connect(&args.at)?;
    let system = client.system();
    bring(client, args).with_context(|| format!("system {system}"))
}

/// Downloads the requested logs.
fn bring(client: Client, args: &cli::Pull) -> Result<Outcome> {
    let mut ftp = Ftp::new(client)?;
    let (mut logs, skipped) = ftp.list()?;
    logs.sort();
    if skipped > 0 {
        note!(
            "the board's card does not give {} now, with names that are not known: call again, or read the card itself",
            count(skipped, "more log")
        );
    }
    if let Some(missing) = args.names.iter().find(|name| logs.iter().all(|(log, _)| log != *name)) {
        let names: Vec<&str> = logs.iter().map(|(log, _)| log.as_str()).collect();
        let such = if skipped > 0 { "lists no such log now" } else { "has no such log" };
        bail!("{missing}: the board {such}; it has {}", names.join(", "));
    }
    // With named logs, others are not missing.
    let listed = Outcome::lossy(skipped > 0 && args.names.is_empty());
    let mut all: Vec<String> =
        logs.iter().filter(|(_, bytes)| *bytes > 0).map(|(log, _)| log.clone()).collect();
    let begun = logs.last().map(|(log, _)| log.clone());
    logs.retain(|(log, _)| args.names.is_empty() || args.names.contains(log));
    if let Some(moment) = &args.around {
        let left_out: Vec<String> =
            all.into_iter().filter(|log| !args.names.is_empty() && !args.names.contains(log)).collect();
        return Ok(around(&mut ftp, logs, &left_out, args, moment)?.and(listed));
    }
    // A log begun just now may be empty.
    let begun = begun.filter(|_| args.names.is_empty());
    let asked = if args.names.is_empty() { newest(&mut logs, args.last) } else { Asked::named(&args.names) };
    let mut bringing = Bringing { begun, args, pulled: Vec::new(), gone: Vec::new() };
    let came = bringing.all(&mut ftp, logs, &mut all, &asked);
    let Bringing { mut pulled, gone, .. } = bringing;
    // Also the logs before an error.
    let judged = judge(&all, &asked, &mut pulled);
    let outcome = came?
        .and(judged?)
        .and(tell_gone(&gone))
        .and(hold_against_next(&mut ftp, &all, &asked, &mut pulled)?)
        .and(listed);
    if args.json {
        output::json(SCHEMA, &PulledJson { system: ftp.system(), logs: pulled, around: None })?;
    }
    Ok(outcome)
}

/// Keeps this many of the newest logs, or all, each with all of its files.
fn newest(logs: &mut Vec<(String, u32)>, most: Option<usize>) -> Asked {
    let Some(most) = most else { return Asked::between(Place::default(), Place::MAX) };
    // A log begun just now that is still empty is not counted, and comes with the others.
    let mut numbers: Vec<u32> =
        logs.iter().filter(|(_, bytes)| *bytes > 0).filter_map(|(log, _)| session::number(log)).collect();
    numbers.dedup();
    if most == 0 {
        logs.clear();
        return Asked::named(&[]);
    }
    let first = numbers.len().checked_sub(most).and_then(|at| numbers.get(at));
    let first = Place { session: first.copied().unwrap_or(0), segment: 0 };
    logs.retain(|(log, _)| place(log).is_none_or(|place| place >= first));
    Asked::between(first, Place::MAX)
}

/// Reports files in the board's list that it deleted before their download as lost.
fn tell_gone(gone: &[String]) -> Outcome {
    let Some(first) = gone.first() else { return Outcome::Done };
    note!(
        "the board no longer has {} that it had in its list, from {first} on: its card made room for later ones",
        count(gone.len() as u64, "file")
    );
    Outcome::Losses
}

/// How often the board's list is requested again if files disappeared during the download.
const LISTS_MAX: usize = 8;

/// A download.
struct Bringing<'a> {
    /// This log may be empty without a loss.
    begun: Option<String>,
    args: &'a cli::Pull,
    pulled: Vec<LogJson>,
    /// Files in the board's list that it deleted before their download.
    gone: Vec<String>,
}

impl Bringing<'_> {
    /// Downloads these logs. If the board deleted some meanwhile, its list is requested again, and the new
    /// logs come too; `board` are its logs that are not empty.
    fn all(
        &mut self,
        ftp: &mut Ftp,
        mut logs: Vec<(String, u32)>,
        board: &mut Vec<String>,
        asked: &Asked,
    ) -> Result<Outcome> {
        let mut outcome = Outcome::Done;
        for nth in 1.. {
            let (brought, mut failed) = self.each(ftp, logs)?;
            outcome = outcome.and(brought);
            let is_again = !failed.is_empty() && self.args.names.is_empty() && nth < LISTS_MAX;
            let now = if is_again { ftp.list()?.0 } else { Vec::new() };
            let is_gone = |name: &String| is_again && now.iter().all(|(log, _)| log != name);
            self.gone.extend(failed.iter().map(|(name, _)| name.clone()).filter(is_gone));
            failed.retain(|(name, _)| !is_gone(name));
            let mut failed = failed.into_iter().map(|(_, error)| error);
            if let Some(first) = failed.next() {
                failed.for_each(|error| note!("{error:#}"));
                return Err(first);
            }
            if !is_again {
                break;
            }
            *board = now.iter().filter(|(_, bytes)| *bytes > 0).map(|(log, _)| log.clone()).collect();
            board.sort();
            self.begun = now.iter().map(|(log, _)| log).max().cloned();
            let wanted = |(name, bytes): &(String, u32)| {
                let came = self.pulled.iter().find(|log| log.name == *name);
                let has = came.and_then(|log| log.path.metadata().ok()).map_or(0, |about| about.len());
                place(name).is_some_and(|place| asked.has(place))
                    && (came.is_none() || has != u64::from(*bytes))
            };
            logs = now.into_iter().filter(wanted).collect();
            logs.sort();
        }
        Ok(outcome)
    }

    /// Downloads these logs one after the other. A fault of one does not stop the others. Returns the names
    /// that failed.
    fn each(
        &mut self,
        ftp: &mut Ftp,
        logs: Vec<(String, u32)>,
    ) -> Result<(Outcome, Vec<(String, anyhow::Error)>)> {
        let (mut outcome, mut failed) = (Outcome::Done, Vec::new());
        let filled: Vec<_> =
            logs.iter().filter(|(_, bytes)| *bytes > 0).map(|(log, _)| log.clone()).collect();
        for (name, bytes) in logs {
            let brought = match pull(ftp, &name, &self.args.output).with_context(|| name.clone()) {
                Ok(brought) => brought,
                // An error of the link or of the disk would also stop the others.
                Err(error) if error.root_cause().is::<io::Error>() => return Err(error),
                Err(error) => {
                    failed.push((name, error));
                    continue;
                }
            };
            // Later files of the same log show whether it had data.
            let is_followed = || {
                filled.iter().any(|other| *other > name && session::number(other) == session::number(&name))
            };
            match brought {
                Some((path, is_new)) => {
                    if !is_new {
                        note!("{name}: is there already as {}: the same by its checksum", path.display());
                    } else if !self.args.json {
                        output::line(&word(&path.display().to_string()))?;
                    }
                    self.pulled.retain(|log| log.name != name);
                    self.pulled.push(LogJson::new(name, path, is_new));
                }
                None if bytes > 0 => {
                    note!(
                        "{name}: has {} by the board's directory, and none when it is opened; call again",
                        count(bytes, "byte")
                    );
                    outcome = Outcome::Losses;
                }
                None if self.begun.as_deref() == Some(name.as_str()) => {}
                None if self.args.names.is_empty() && is_followed() => {}
                None => {
                    note!(
                        "{name}: nothing of it came, and it may have a flight in it: read the card itself, or an image of it"
                    );
                    outcome = Outcome::Losses;
                }
            }
        }
        Ok((outcome, failed))
    }
}

/// Whether each log is complete up to the next file of its session, if that was not requested. The first
/// number of the next file shows it.
fn hold_against_next(
    ftp: &mut Ftp,
    board: &[String],
    asked: &Asked,
    pulled: &mut [LogJson],
) -> Result<Outcome> {
    let mut outcome = Outcome::Done;
    for log in pulled {
        let Some(own) = place(&log.name) else { continue };
        let next = board.iter().find_map(|name| Some((name, place(name).filter(|next| *next > own)?)));
        let Some((next, _)) = next.filter(|(_, next)| next.session == own.session && !asked.has(*next))
        else {
            continue;
        };
        let bytes = log.path.metadata().map_or(0, |about| about.len());
        let sectors = u32::try_from(bytes / SECTOR_BYTES as u64).unwrap_or(u32::MAX);
        let length = ftp.open(next)?;
        let here = heading_here(&log.path, &log.name, sectors.saturating_mul(SECTOR_BYTES as u32))?;
        let begins = [here, heading_of(ftp, next, length)?].map(|heading| beginning_of(&heading.sectors).1);
        if let [Some(first), Some(next_first)] = begins
            && let missing @ 1.. = next_first.saturating_sub(first.saturating_add(sectors))
        {
            note!(
                "{}: {} missing at its end: {next} begins after them",
                log.name,
                are(missing.into(), "sector")
            );
            log.whole = false;
            outcome = Outcome::Losses;
        }
    }
    Ok(outcome)
}

/// Downloads a moment of the newest session of these logs.
fn around(
    ftp: &mut Ftp,
    logs: Vec<(String, u32)>,
    left_out: &[String],
    args: &cli::Pull,
    moment: &cli::Around,
) -> Result<Outcome> {
    let (mut names, mut empty) = (Vec::new(), Vec::new());
    for (name, bytes) in logs {
        if bytes < SECTOR_BYTES as u32 && ftp.open(&name)? < SECTOR_BYTES as u32 {
            note!("{name}: {NOTHING}");
            empty.push(name);
        } else {
            names.push(name);
        }
    }
    let session = session::newest(ftp, &names, !args.names.is_empty())?;
    // The sectors' numbers show a gap between two logs. A search must report unread further files of the last
    // one.
    let last = session.logs.last().and_then(|log| place(log));
    let is_further =
        |log: &&String| place(log) > last && place(log).map(|log| log.session) == last.map(|log| log.session);
    let further = empty.iter().find(is_further).filter(|_| !matches!(moment, cli::Around::Time(_)));
    let mut outcome = Outcome::lossy(further.is_some() || !args.names.is_empty() && !empty.is_empty());
    if let Some(name) = further {
        note!("{name}: is a further file of this session, and may have what is looked for, and later");
    }
    for name in &session.unknown {
        note!(
            "{name}: its beginning cannot be read, so that nothing tells whether it is of this session; it is not looked at: \
             `hums box pull {name}` brings it"
        );
        outcome = Outcome::Losses;
    }
    let brought = around::pull(ftp, &session.logs, left_out, &args.output, (moment, args.span))?;
    if brought.strange > 0 {
        note!(
            "{} of another session came and are not in the part: another log has come in its place while it was read, or the \
             card has lost some of it",
            count(brought.strange, "sector")
        );
        outcome = Outcome::Losses;
    }
    outcome = outcome.and(brought.outcome);
    if brought.at.is_none() && outcome == Outcome::Done {
        bail!("no such finding is in what the board gives of this session");
    }
    let mut pulled = Vec::new();
    for (name, path) in brought.parts {
        if !args.json {
            output::line(&word(&path.display().to_string()))?;
        }
        pulled.push(LogJson::new(name, path, true));
    }
    if args.json {
        let around = brought.at.map(|at| MomentJson::of(at, brought.found));
        output::json(SCHEMA, &PulledJson { system: ftp.system(), logs: pulled, around })?;
    }
    Ok(outcome)
}

/// Downloads a log. Returns its path and whether it is new; `None` for an empty log.
fn pull(ftp: &mut Ftp, name: &str, output: &Path) -> Result<Option<(PathBuf, bool)>> {
    let length = ftp.open(name)?;
    if length == 0 {
        note!("{name}: {NOTHING}");
        return Ok(None);
    }
    let heading = heading_of(ftp, name, length)?;
    let path = output.join(&heading.name);
    let there = there(ftp, name, &path, length)?;
    if there == LocalCopy::Whole {
        return Ok(Some((path, false)));
    }
    let mut file = Output::resume(&path)?;
    let (mut have, mut likeness) = begun(ftp, name, &mut file, length)?;
    if let LocalCopy::Beginning(bytes) = there
        && have < bytes
    {
        file.begin_anew()?;
        let mut shorter = File::open(&path)?.take(u64::from(bytes));
        settle(io::copy(&mut shorter, &mut file).map(|_| ()), &path)?;
        (have, likeness) = (bytes, Likeness::Same);
    }
    if have > 0 {
        let who = match likeness {
            Likeness::SameEnds => "of which the first and the last 512 agree with the board's log",
            Likeness::Same | Likeness::Other => "which the board confirms by their checksum",
        };
        note!("{name}: goes on after {have} bytes, {who}");
    }
    let brought = complete(ftp, name, &mut file, (have, length), &heading);
    if let Err(why) = brought {
        // Before any message about it.
        tell_begun(name, file.part())?;
        return Err(why);
    }
    file.finish()?;
    Ok(Some((path, true)))
}

/// Downloads the missing rest of a log until it equals the board's; the counts are bytes here and in all.
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
        note!("{name}: what came differs from the board's log; once more from its beginning");
        length = ftp.open(name)?.min(length);
        check_same(heading, &heading_of(ftp, name, length)?)?;
        fetch(ftp, name, file, 0, length)?;
        if !is_whole(ftp, name, file, length)? {
            bail!(
                "what came differs from the board's log twice; does its card give the same bytes each time? {} has what came",
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

/// Prints the quality of an incomplete log.
fn tell_begun(name: &str, begun: &Path) -> Result<()> {
    let bytes = begun.metadata().map_or(0, |about| about.len());
    if bytes < SECTOR_BYTES as u64 {
        return Ok(());
    }
    let kept =
        format!("{name}: what came of it so far, {}, is kept as {}", count(bytes, "byte"), begun.display());
    match faults_of(name, begun)?.join("; ").as_str() {
        "" => note!("{kept}; its sectors are sound and follow each other"),
        faults => note!("{kept}, and is damaged: {faults}"),
    }
    Ok(())
}

/// Faults of the beginning of a log.
fn faults_of(name: &str, begun: &Path) -> Result<Vec<String>> {
    let bytes = begun.metadata().map_or(0, |about| about.len());
    let sectors = u32::try_from(bytes / SECTOR_BYTES as u64).unwrap_or(u32::MAX);
    let stretch = Stretch { name: name.to_owned(), path: begun.to_owned(), places: 0..sectors, sectors };
    Ok(Reading::of(&[stretch])?.faults(false))
}

/// Data of one session never get the name of another.
fn check_same(first: &Heading, now: &Heading) -> Result<()> {
    match (first.session, now.session) {
        (first, now) if first == now => Ok(()),
        (_, Some(_)) => bail!(
            "another log has come in its place while it was read, {}: nothing of it has the first one's name: call again",
            now.name
        ),
        (_, None) => bail!(
            "its beginning can no longer be read on the board, so nothing tells whether it is the same log still: call again"
        ),
    }
}

/// The file already on this PC under the log's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LocalCopy {
    Nothing,
    /// This many bytes of it: the log has grown since.
    Beginning(u32),
    /// All of it.
    Whole,
}

fn there(ftp: &mut Ftp, name: &str, path: &Path, length: u32) -> Result<LocalCopy> {
    let Ok(about) = path.metadata() else { return Ok(LocalCopy::Nothing) };
    if !about.is_file() {
        bail!(
            "{}: is no file, and stands where the log is to be: move it away, or name another directory with -o",
            path.display()
        );
    }
    let bytes = u32::try_from(about.len()).unwrap_or(u32::MAX);
    if bytes == 0 {
        return Ok(LocalCopy::Nothing);
    }
    match compare(ftp, name, path, bytes.min(length))? {
        Likeness::Same | Likeness::SameEnds if about.len() > u64::from(length) => bail!(
            "{} begins as the board's log, and has {} more than that has; it is left as it is: move it away, or name \
             another directory with -o",
            path.display(),
            count(about.len() - u64::from(length), "byte")
        ),
        Likeness::Same if bytes < length => Ok(LocalCopy::Beginning(bytes)),
        Likeness::Same => Ok(LocalCopy::Whole),
        // Equality is not proved: the log is downloaded again and replaces the file once complete.
        Likeness::SameEnds => Ok(LocalCopy::Nothing),
        Likeness::Other => bail!(
            "{} differs from the board's log of the same session: one of both is damaged or was changed, and `hums info --verify` \
             says whether this one is; it is left as it is: move it away, or name another directory with -o",
            path.display()
        ),
    }
}

/// The bytes left by an earlier run that can be resumed, and the kind of proof. Bytes of another log are
/// deleted.
fn begun(ftp: &mut Ftp, name: &str, file: &mut Output, length: u32) -> Result<(u32, Likeness)> {
    let part = file.part().to_owned();
    let bytes = u32::try_from(part.metadata()?.len()).unwrap_or(u32::MAX);
    let likeness = if bytes <= length { compare(ftp, name, &part, bytes)? } else { Likeness::Other };
    if likeness != Likeness::Other {
        return Ok((bytes, likeness));
    }
    file.begin_anew()?;
    note!("{name}: what was begun is not the beginning of the board's log; it begins anew");
    Ok((0, likeness))
}

/// Downloads the missing sectors.
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

/// Whether the download equals the board's log.
fn is_whole(ftp: &mut Ftp, name: &str, file: &mut Output, length: u32) -> Result<bool> {
    let flushed = file.flush();
    settle(flushed, file.path())?;
    let likeness = compare(ftp, name, file.part(), length)?;
    if likeness == Likeness::SameEnds {
        note!(
            "{name}: the board's firmware computes no checksum: only its sectors' own checks say that it is whole"
        );
    }
    Ok(likeness != Likeness::Other)
}

#[cfg(test)]
mod tests;
