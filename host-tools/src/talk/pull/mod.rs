//! `hums pull`: the board's logs over MAVLink FTP, burst by burst; what a burst lost is read piece by piece.
//!
//! A download that was interrupted is gone on with, once what is there was compared with the beginning of the board's
//! log (by its checksum, or where the board's firmware computes none by its ends); at the end the whole is compared, and read through as
//! `hums verify` does, also where it is there already. A file's name says whose session it is, so that those of two cards never meet.

mod around;
mod compare;
mod ftp;
mod judge;
mod moment;
mod part;

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use hums_blackbox::SECTOR_BYTES;
use hums_core::time::Instant;
use serde::Serialize;

use self::compare::{Heading, Likeness, compare, heading_here, heading_of};
use self::ftp::Ftp;
use self::judge::{LogJson, judge};
use self::part::Part;
use super::Client;
use crate::cli;
use crate::files::{Output, make_directory, settle};
use crate::logs::{self, segment_name};
use crate::outcome::Outcome;
use crate::output::{self, Schema};
use crate::plural::count;
use crate::printable::word;
use crate::summary::Overview;

/// What `hums pull --json` prints.
const SCHEMA: Schema = Schema::first("hums-pull");

#[derive(Debug, Serialize)]
struct PulledJson {
    /// Whose board it is.
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
    fn of(at: Instant, found: Option<around::Found>) -> Self {
        let (check, instance, level) = found
            .map(|found| (found.check, found.instance, found.level))
            .map_or((None, None, None), |(check, instance, level)| {
                (Some(check), Some(instance), Some(level))
            });
        Self { time_s: at.as_secs_f64(), check, instance, level }
    }
}

/// Runs `hums pull`.
pub fn run(args: &cli::Pull) -> Result<Outcome> {
    make_directory(&args.output)?;
    let client = Client::connect(&args.at)?;
    let system = client.system();
    bring(client, args).with_context(|| format!("system {system}"))
}

/// Brings the logs that are asked for.
fn bring(client: Client, args: &cli::Pull) -> Result<Outcome> {
    let mut ftp = Ftp::new(client)?;
    let mut logs = ftp.list()?;
    logs.sort();
    if let Some(missing) = args.names.iter().find(|name| logs.iter().all(|(log, _)| log != *name)) {
        let names: Vec<&str> = logs.iter().map(|(log, _)| log.as_str()).collect();
        bail!("{missing}: the board has no such log; it has {}", names.join(", "));
    }
    let all: Vec<String> = logs.iter().filter(|(_, bytes)| *bytes > 0).map(|(log, _)| log.clone()).collect();
    logs.retain(|(log, _)| args.names.is_empty() || args.names.contains(log));
    if let Some(moment) = &args.around {
        return around(&mut ftp, logs.into_iter().map(|(log, _)| log).collect(), args, moment);
    }
    let newest = args.last.unwrap_or(logs.len()).min(logs.len());
    let mut pulled = Vec::new();
    let came = bring_each(&mut ftp, logs.split_off(logs.len() - newest), args, &mut pulled);
    // Also what came before an error.
    let judged = judge(&all, &mut pulled);
    came?;
    let outcome = judged?;
    if args.json {
        output::json(SCHEMA, &PulledJson { system: ftp.system(), logs: pulled, around: None })?;
    }
    Ok(outcome)
}

/// Brings these logs whole, one after the other.
fn bring_each(
    ftp: &mut Ftp,
    logs: Vec<(String, u32)>,
    args: &cli::Pull,
    pulled: &mut Vec<LogJson>,
) -> Result<()> {
    for (name, _) in logs {
        let Some((path, is_new)) = pull(ftp, &name, &args.output).with_context(|| name.clone())? else {
            continue;
        };
        if !is_new {
            note!("{name}: is there already as {}: the same by its checksum", path.display());
        } else if !args.json {
            output::line(&word(&path.display().to_string()))?;
        }
        pulled.push(LogJson { name, path, is_new, whole: true });
    }
    Ok(())
}

/// Brings a moment of the newest session of these logs.
fn around(ftp: &mut Ftp, mut logs: Vec<String>, args: &cli::Pull, moment: &cli::Around) -> Result<Outcome> {
    let session = |log: &String| segment_name(Path::new(log)).map(|name| name.session);
    let newest = logs.iter().filter_map(session).max();
    logs.retain(|log| session(log) == newest);
    if newest.is_none() {
        bail!("the board has no log");
    }
    let brought = around::pull(ftp, &logs, &args.output, moment, args.span)?;
    let mut outcome = Outcome::Done;
    let mut pulled = Vec::new();
    if brought.strange > 0 {
        note!(
            "{} of another session came and are not in the part: another log has come in its place while it was read, or the \
             card has lost some of it",
            count(brought.strange, "sector")
        );
        outcome = Outcome::Losses;
    }
    for (name, path) in brought.parts {
        let sound = is_sound(&name, &path)?;
        outcome = outcome.and(Outcome::lossy(!sound));
        if !args.json {
            output::line(&word(&path.display().to_string()))?;
        }
        pulled.push(LogJson { name, path, is_new: true, whole: false });
    }
    if args.json {
        output::json(
            SCHEMA,
            &PulledJson {
                system: ftp.system(),
                logs: pulled,
                around: Some(MomentJson::of(brought.at, brought.found)),
            },
        )?;
    }
    Ok(outcome)
}

/// Whether the sectors of a part, and the frames in them, are as they were recorded.
fn is_sound(name: &str, path: &Path) -> Result<bool> {
    let mut sound = true;
    for log in &logs::find(&[path.to_owned()], false)?.logs {
        let overview = Overview::verified(log)?;
        let (blocks, frames) = (overview.ending.summary.blocks, overview.contents.bad_frames);
        for (number, what) in [
            (blocks.damaged + blocks.unsound, "damaged sectors"),
            (frames, "frames that fail their checksum"),
        ] {
            if number > 0 {
                note!("{name}: {what}: {number}; `hums verify` says more");
                sound = false;
            }
        }
    }
    Ok(sound)
}

/// Brings a log: where it is, and whether it was not there already; none where nothing is in it.
fn pull(ftp: &mut Ftp, name: &str, output: &Path) -> Result<Option<(PathBuf, bool)>> {
    let mut length = ftp.open(name)?;
    if length == 0 {
        note!("{name}: nothing is recorded in it yet");
        return Ok(None);
    }
    let heading = heading_of(ftp, name, length)?;
    let path = output.join(&heading.name);
    let there = there(ftp, name, &path, length)?;
    let mut part = Part::there(&path, length / SECTOR_BYTES as u32, &heading.sectors)?;
    if there == There::Whole {
        part.map_or(Ok(()), |part| part.finish(&path))?;
        return Ok(Some((path, false)));
    }
    let (mut file, _) = Output::resume(&path)?;
    let (mut have, mut likeness) = begun(ftp, name, &mut file, length)?;
    if let There::Beginning(bytes) = there
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
    fetch(ftp, name, &mut file, have, length, part.as_mut())?;
    if !is_whole(ftp, name, &mut file, length)? {
        let aside = file.set_aside()?;
        note!(
            "{name}: what came differs from the board's log; once more from its beginning, and what came stays as {}",
            aside.display()
        );
        length = ftp.open(name)?.min(length);
        check_same(&heading, &heading_of(ftp, name, length)?)?;
        fetch(ftp, name, &mut file, 0, length, None)?;
        if !is_whole(ftp, name, &mut file, length)? {
            bail!(
                "what came differs from the board's log twice; does its card give the same bytes each time? {} has what came",
                file.part().display()
            );
        }
    }
    if let Err(other) = check_same(&heading, &heading_here(file.part(), name, length)?) {
        file.set_aside()?;
        return Err(other);
    }
    file.finish()?;
    part.map_or(Ok(()), |part| part.finish(&path))?;
    Ok(Some((path, true)))
}

/// Nothing of one session gets the name of another one.
fn check_same(first: &Heading, now: &Heading) -> Result<()> {
    match (first.session, now.session) {
        (first, now) if first == now => Ok(()),
        (_, Some(_)) => bail!(
            "another log has come in its place while it was read, {}: nothing of it has the first one's name; what came is kept in \
             hums-kept: call again",
            now.name
        ),
        (_, None) => bail!(
            "its beginning can no longer be read on the board, so nothing tells whether it is the same log still; what came is \
             kept in hums-kept: call again"
        ),
    }
}

/// What is on this PC already under the log's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum There {
    Nothing,
    /// So many bytes of it: the log has grown since.
    Beginning(u32),
    /// All of it.
    Whole,
}

fn there(ftp: &mut Ftp, name: &str, path: &Path, length: u32) -> Result<There> {
    let Ok(about) = path.metadata() else { return Ok(There::Nothing) };
    if !about.is_file() {
        bail!(
            "{}: is no file, and stands where the log is to be: move it away, or name another directory with -o",
            path.display()
        );
    }
    let bytes = u32::try_from(about.len()).unwrap_or(u32::MAX);
    if bytes == 0 {
        return Ok(There::Nothing);
    }
    match compare(ftp, name, path, bytes.min(length))? {
        Likeness::Same | Likeness::SameEnds if about.len() > u64::from(length) => bail!(
            "{} begins as the board's log, and has {} more than that has; it is left as it is: move it away, or name \
             another directory with -o",
            path.display(),
            count(about.len() - u64::from(length), "byte")
        ),
        Likeness::Same if bytes < length => Ok(There::Beginning(bytes)),
        Likeness::Same => Ok(There::Whole),
        // Not proved: it comes once more, and takes the place of what is there when it is whole.
        Likeness::SameEnds => Ok(There::Nothing),
        Likeness::Other => bail!(
            "{} differs from the board's log of the same session: one of both is damaged or was changed, and `hums verify` \
             says whether this one is; it is left as it is: move it away, or name another directory with -o",
            path.display()
        ),
    }
}

/// How much of the log an earlier run has left that can be gone on with, and what says so; what is of another log is set
/// aside.
fn begun(ftp: &mut Ftp, name: &str, file: &mut Output, length: u32) -> Result<(u32, Likeness)> {
    let part = file.part().to_owned();
    let bytes = u32::try_from(part.metadata()?.len()).unwrap_or(u32::MAX);
    let likeness = if bytes <= length { compare(ftp, name, &part, bytes)? } else { Likeness::Other };
    if likeness != Likeness::Other {
        return Ok((bytes, likeness));
    }
    let aside = file.set_aside()?;
    note!("{name}: what was begun was changed; it begins anew, and that stays as {}", aside.display());
    Ok((0, likeness))
}

/// Brings what is missing, but for what is in a part of it that is here already.
fn fetch(
    ftp: &mut Ftp,
    name: &str,
    file: &mut Output,
    from: u32,
    length: u32,
    mut part: Option<&mut Part>,
) -> Result<()> {
    const SECTOR: u32 = SECTOR_BYTES as u32;
    let mut have = from;
    while have < length {
        // What is begun of a sector is brought to its end.
        let place = have.div_ceil(SECTOR);
        if let Some(part) = part.as_mut().filter(|part| have.is_multiple_of(SECTOR) && part.has(place)) {
            let written = file.write_all(part.read(place)?.bytes());
            settle(written, file.path())?;
            have += SECTOR;
            continue;
        }
        let next = part.as_ref().and_then(|part| part.next(place, true));
        let end = next.map_or(length, |next| (next * SECTOR).min(length));
        let context = || format!("after {have} of {length} bytes");
        let mut done = have;
        ftp.bring(have, end, |bytes| {
            settle(file.write_all(bytes), file.path())?;
            done += bytes.len() as u32;
            note!("{name}: {done} of {length} bytes");
            Ok(())
        })
        .with_context(context)?;
        have = end;
    }
    Ok(())
}

/// Whether what came is the board's log.
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
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use hums_blackbox::Header;
    use hums_link::messages;
    use hums_link::packet::Fields;

    use super::*;
    use crate::endpoint::Endpoint;
    use crate::talk::fake;

    /// The sectors of a recording of the repository, as `hums pack` makes them.
    pub(super) fn packed(dir: &Path, name: &str) -> Vec<u8> {
        let input = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/flights").join(name);
        let output = dir.join(name);
        let pack =
            cli::Pack { input: Endpoint::File(input), output: output.clone(), replace: false, json: false };
        crate::pack::run(&pack).expect("packed");
        fs::read(output).expect("there")
    }

    const NAME: &str = "00001_00.HUM";

    /// The names in a folder.
    fn names_in(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("there");
        let mut names: Vec<String> =
            entries.map(|entry| entry.expect("there").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// A board with this log, in whose place the other one comes with the so-many-th question for bytes.
    fn board(mut log: Vec<u8>, other: Vec<u8>, mut reads: u32) -> Ftp {
        let client = fake::found(&[1], move |frame| {
            let asked = Fields(frame.payload().get(3..).unwrap_or_default());
            let (opcode, size, at) = (asked.u8(3), usize::from(asked.u8(4)), asked.u32(8) as usize);
            let sequence = asked.u16(0);
            if matches!(opcode, 5 | 15) {
                reads = reads.saturating_sub(1);
                if reads == 0 {
                    log.clone_from(&other);
                }
            }
            let answer = |more: u16, at: usize, is_last: bool, data: &[u8]| {
                let [s0, s1] = sequence.wrapping_add(more).to_le_bytes();
                let head = [s0, s1, 0, 128, data.len() as u8, opcode, u8::from(is_last), 0];
                let payload = [&head[..], &(at as u32).to_le_bytes(), data].concat();
                (1, messages::file_transfer(255, 190, &payload))
            };
            match opcode {
                4 => vec![answer(1, 0, false, &(log.len() as u32).to_le_bytes())],
                5 => vec![answer(1, at, false, &log[at.min(log.len())..(at + size).min(log.len())])],
                14 => {
                    let sum = hums_link::ftp::checksum(0, &log[..at.min(log.len())]);
                    vec![answer(1, at, false, &sum.to_le_bytes())]
                }
                15 => {
                    let pieces = log[at..].chunks(size).take(20).enumerate();
                    let is_last = |piece: usize| piece == 19 || at + (piece + 1) * size >= log.len();
                    pieces.map(|(n, data)| answer(n as u16 + 1, at + n * size, is_last(n), data)).collect()
                }
                _ => vec![answer(1, 0, false, &[])],
            }
        });
        Ftp::new(client).expect("it answers")
    }

    /// The first sectors of two sessions, and what `pull` calls the first one.
    fn two_logs(dir: &Path) -> (Vec<u8>, Vec<u8>, String) {
        let [one, other] = ["px4_hil_quad_low.tlog", "ap_quad_guided.tlog"]
            .map(|name| packed(dir, name).get(..80 * SECTOR_BYTES).expect("a longer log").to_vec());
        let path = dir.join("one.HUM");
        fs::write(&path, &one).expect("written");
        let name = heading_here(&path, NAME, one.len() as u32).expect("it reads").name;
        (one, other, name)
    }

    #[test]
    fn what_was_begun_is_kept_when_the_card_loses_it_or_another_log_comes_in_its_place() {
        let dir = tempfile::tempdir().expect("a folder");
        let (log, other, name) = two_logs(dir.path());
        let mut lost = log.clone();
        lost[4096..8192].fill(0);
        for (next, case) in [(&lost, "lost"), (&other, "exchanged")] {
            let output = dir.path().join(case);
            fs::create_dir(&output).expect("made");
            let part = output.join(format!(".{name}.pull.hums-part"));
            fs::write(&part, &log[..20_000]).expect("written");
            // The heading is read before.
            let mut ftp = board(log.clone(), next.clone(), 8 * 3 + 1);
            let pulled = pull(&mut ftp, NAME, &output);
            let kept = fs::read(output.join("hums-kept/1").join(&name)).expect("kept");
            assert_eq!(kept[..20_000], log[..20_000], "{case}");
            if case == "lost" {
                let (path, is_new) = pulled.expect("it came").expect("a log");
                assert!(is_new && fs::read(path).expect("there") == lost);
            } else {
                let told = pulled.expect_err("it is another one").to_string();
                assert!(told.contains("another log has come in its place"), "{told}");
                // Nothing is left of what was begun.
                assert_eq!(names_in(&output), ["hums-kept"]);
            }
        }
        // The other one from its first byte on.
        let output = dir.path().join("early");
        fs::create_dir(&output).expect("made");
        let mut ftp = board(log.clone(), other.clone(), 8 * 3 + 1);
        let told = pull(&mut ftp, NAME, &output).expect_err("it is another one").to_string();
        assert!(told.contains("another log has come in its place"), "{told}");
        assert_eq!(fs::read(output.join("hums-kept/1").join(&name)).expect("kept"), other);
        assert_eq!(names_in(&output), ["hums-kept"]);
    }

    #[test]
    fn a_card_that_loses_the_beginning_of_a_log_is_not_called_another_log() {
        let dir = tempfile::tempdir().expect("a folder");
        let (log, _, name) = two_logs(dir.path());
        // The first sector alone, of which the others tell the session; the whole first page.
        let without = |bytes: usize| [&vec![0; bytes][..], &log[bytes..]].concat();
        for (next, words) in [
            (without(SECTOR_BYTES), None),
            (without(8 * SECTOR_BYTES), Some("its beginning can no longer be read on the board")),
        ] {
            let output = tempfile::tempdir().expect("a folder");
            let mut ftp = board(log.clone(), next.clone(), 8 * 3 + 5);
            let pulled = pull(&mut ftp, NAME, output.path());
            let Some(words) = words else {
                let (path, _) = pulled.expect("it came").expect("a log");
                assert_eq!(
                    (path.file_name().expect("a name"), fs::read(&path).expect("there")),
                    (name.as_ref(), next)
                );
                continue;
            };
            let told = pulled.expect_err("nothing tells what it is").to_string();
            assert!(told.contains(words), "{told}");
            assert_eq!(names_in(output.path()), ["hums-kept"]);
        }
    }

    #[test]
    fn what_is_no_file_in_the_place_of_a_log_is_told_and_left() {
        let dir = tempfile::tempdir().expect("a folder");
        let (log, other, name) = two_logs(dir.path());
        let output = dir.path().join("logs");
        fs::create_dir_all(output.join(&name)).expect("made");
        let mut ftp = board(log, other, u32::MAX);
        let told = pull(&mut ftp, NAME, &output).expect_err("a folder").to_string();
        assert!(told.contains("is no file, and stands where the log is to be: move it away"), "{told}");
        assert_eq!(names_in(&output), [name]);
    }

    #[test]
    fn a_part_that_has_what_the_card_has_lost_since_is_not_written_over() {
        let dir = tempfile::tempdir().expect("a folder");
        let (log, _, name) = two_logs(dir.path());
        let part = crate::logs::naming::part_name(&dir.path().join(&name));
        fs::write(&part, &log).expect("written");
        let mut lost = log.clone();
        lost[..SECTOR_BYTES].fill(0);
        let mut ftp = board(lost.clone(), lost, u32::MAX);
        let what: cli::Around = "0".parse().expect("a time");
        around::pull(&mut ftp, &[NAME.to_owned()], dir.path(), &what, hums_core::time::Span::from_secs(1))
            .expect("a part");
        assert_eq!(fs::read(&part).expect("there"), log);
    }

    #[test]
    fn a_part_has_sectors_of_one_session_also_where_the_log_is_exchanged_while_it_is_read() {
        let dir = tempfile::tempdir().expect("a folder");
        let (log, other, name) = two_logs(dir.path());
        let what: cli::Around = "0".parse().expect("a time");
        // The log's beginning is read before.
        let mut ftp = board(log.clone(), other, 8 * 3 + 5);
        let span = hums_core::time::Span::from_secs(9_999);
        let names = [NAME.to_owned()];
        let brought = around::pull(&mut ftp, &names, dir.path(), &what, span).expect("a part");
        let [(_, path)] = &brought.parts[..] else { panic!("{brought:?}") };
        assert_eq!(path, &crate::logs::naming::part_name(&dir.path().join(name)));
        let part = fs::read(path).expect("there");
        assert_eq!(part.len(), log.len());
        let mut others = 0;
        for (ours, theirs) in part.chunks(SECTOR_BYTES).zip(log.chunks(SECTOR_BYTES)) {
            // One is half of each, and fails its check.
            let is_sector = Header::read(ours.first_chunk().expect("a sector")).is_ok();
            assert!(ours == theirs || !is_sector);
            others += u32::from(!is_sector && ours.iter().any(|byte| *byte != 0));
        }
        assert!(others <= 1, "{others}");
        assert!(brought.strange > 10, "{brought:?}");
    }
}
