//! `hums decode`: logs and recordings become files for other tools.
//!
//! | format | what | where |
//! |---|---|---|
//! | `tlog` | every frame bit for bit, UTC before it | one file a log |
//! | `csv` | a table for each message type, `HUMS_*` tables for the monitor's own records and for gaps | one file a table |
//! | `jsonl` | everything in order, an object a line | one file a log |
//! | `influx` | line protocol: the reference system's measurement, every frame, every record | one file a log |
//! | `parquet` | typed columns, the tables of `csv` | one file a table, by vehicle, date and session |
//! | `thesis` | the reference system's four tables | four files a log |
//!
//! A log is read once (twice where its vehicle must be known first); its groups are turned to text and columns in
//! parallel and written in order. Several logs go side by side, few enough that memory stays bounded.
//!
//! A log's files are named after its session ([`naming`]), and no other session's files are ever written over. Folders of
//! tables are replaced whole or not at all ([`crate::files::Folder`]).
//!
//! Recordings that are no logs of ours ([`recorded`]) become the same formats, an autopilot's log with its own tables.
//!
//! Gaps are in every format: `HUMS_GAP` tables, objects and points; a table `gaps.csv` beside a tlog and with `thesis`.

pub mod collect;
pub mod columns;
pub mod context;
pub mod destination;
pub mod field_names;
pub mod identity;
pub mod influx;
pub mod naming;
pub mod parquet;
pub mod record;
pub mod recorded;
pub mod reference;
pub mod row;
pub mod selection;
pub mod side_by_side;
pub mod table;
pub mod tables;
pub mod text;
pub mod thesis;
pub mod unknown;
mod wear;
pub mod write;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::{Result, bail};
use hums_core::time::Instant;

use crate::cli;
use crate::files::{Folder, Held, Inputs, says_directory};
use crate::logs::reader::{self, Summary};
use crate::outcome::{Outcome, usage as usage_error};
use crate::plural::count;
use crate::source::recording::{Place, find};
use crate::{output, progress};
use collect::Collected;
use context::{Context, Formats};
use destination::Destination;
use identity::Identity;
use influx::Tags;
use naming::{Named, Traits};
use selection::Selection;
use side_by_side::side_by_side;
use write::{Writers, Written};

/// Runs `hums decode`.
pub fn run(args: &cli::Decode) -> Result<Outcome> {
    let formats = Formats::new(&args.format);
    let found = find(&args.inputs, args.salvage)?;
    for remark in &found.remarks {
        eprintln!("hums: {remark}");
    }
    let mut outcome = Outcome::lossy(found.is_lossy());
    for image in found.images.iter().filter(|image| !image.damage.is_empty()) {
        eprintln!("hums: {}: {}", image.path.display(), image.damage.join("; "));
    }
    let standard_output = args.output == Path::new("-");
    if standard_output && (found.places.len() != 1 || !formats.is_single_file()) {
        let why = match found.places.len() {
            1 => "these formats are more than that".to_owned(),
            count => format!("there are {count} logs"),
        };
        return Err(usage_error(format!(
            "-o -: standard output takes one log in one format of a single file (tlog, jsonl or influx), and {why}; \
             name a file or a directory"
        )));
    }
    let one_file = found.places.len() == 1 && formats.is_single_file();
    if args.output.is_file() && !one_file {
        return Err(usage_error(format!(
            "-o {}: is a file, but tables, several formats and several logs need a directory; name one, or a new name",
            args.output.display()
        )));
    }
    if found.places.is_empty() {
        eprintln!("hums: no log is in there, so nothing was written");
    }
    let mut inputs = Inputs::of(args.inputs.iter().map(PathBuf::as_path).chain(found.paths()));
    if !one_file || says_directory(&args.output) {
        inputs = inputs.without_folders();
    }
    let logs = found.places.len();
    let native = check_forms(&found.places, formats)?;
    let selection = Selection::new(args, native)?;
    let task = Task { formats, selection, inputs, output: &args.output, standard_output, logs };
    let works = works(&found.places)?;
    let taken = Mutex::new(BTreeSet::new());
    let mut written = works.is_empty();
    side_by_side(
        &works,
        |work| task.decode(work, &works, &taken),
        |done| {
            let done = done?;
            done.remarks.iter().for_each(|remark| eprintln!("hums: {remark}"));
            outcome = outcome.and(done.outcome);
            written |= done.written;
            done.lines.iter().try_for_each(|line| output::line(line))
        },
    )?;
    if !written {
        bail!("nothing is within --from and --to, so nothing was written");
    }
    Ok(outcome)
}

/// Whether any of these has messages of its own instead of MAVLink's; an error where one cannot become what is asked for.
fn check_forms(places: &[Place], formats: Formats) -> Result<bool> {
    let mut native = false;
    for place in places.iter().filter(|place| place.own().is_none()) {
        if place.is_standard() {
            return Err(usage_error("-: a recording is read twice here; give a file"));
        }
        let format = place.open()?.format;
        if !format.is_of_link() {
            native = true;
            if formats.tlog {
                return Err(usage_error(format!(
                    "{}: is an {}, which has no MAVLink frames for a tlog; --format csv, jsonl or parquet has all of it",
                    place.title,
                    format.words()
                )));
            }
        }
    }
    Ok(native)
}

/// A log, and what its files are called.
struct Work<'a> {
    log: &'a Place,
    traits: Traits,
    named: Named,
}

/// The logs with their names.
fn works(logs: &[Place]) -> Result<Vec<Work<'_>>> {
    let mut traits = Vec::new();
    // A log that cannot be read is named all the same: reading it says why.
    side_by_side(
        logs,
        |log| Traits::of(log).unwrap_or_default(),
        |found| {
            traits.push(found);
            Ok(())
        },
    )?;
    let logs: Vec<(&Place, Traits)> = logs.iter().zip(traits).collect();
    let names = naming::names(&logs);
    Ok(logs.into_iter().zip(names).map(|((log, traits), named)| Work { log, traits, named }).collect())
}

/// What to do with each log.
struct Task<'a> {
    formats: Formats,
    selection: Selection,
    inputs: Inputs,
    output: &'a Path,
    standard_output: bool,
    logs: usize,
}

/// A log's outcome, to be told in the logs' order.
struct Done {
    outcome: Outcome,
    /// Whether there was anything to write.
    written: bool,
    /// What was written.
    lines: Vec<String>,
    /// What there is to say of it.
    remarks: Vec<String>,
}

impl Task<'_> {
    /// `taken` are the directories of Parquet tables that other logs of this command have.
    fn decode(&self, work: &Work<'_>, all: &[Work<'_>], taken: &Mutex<BTreeSet<PathBuf>>) -> Result<Done> {
        let log = work.log;
        let (name, nth) = match &work.named {
            Named::As(name, nth) => (name, *nth),
            Named::Copy(of) => {
                let of = all.get(*of).map_or("another log", |work| work.log.name.as_str());
                let remark = format!("{}: is a copy of {of}, which is written once", log.name);
                return Ok(Done {
                    outcome: Outcome::Done,
                    written: true,
                    lines: Vec::new(),
                    remarks: vec![remark],
                });
            }
        };
        let mut remarks = Vec::new();
        let mut context = self.context(work)?;
        if context.epoch_us.is_none() {
            context.selection.check_without_utc(&log.name)?;
            remarks.push(format!(
                "{}: no frame told the time of day: UTC columns are empty, and tlog times count from power-on as 1970",
                log.name
            ));
        }
        let mut parquet = None;
        if self.formats.parquet
            && let Ok(mut taken) = taken.lock()
        {
            let first = partition(self.output, &context.identity);
            let dir = claim(&mut taken, &first, nth, &context.stamp);
            if dir != first {
                remarks.push(format!(
                    "{}: {} has other tables of a session of this number; these go to {}",
                    log.name,
                    first.display(),
                    dir.display()
                ));
            }
            parquet = Some(dir);
        }
        let (mut summary, mut written) = self.write(log, name, &context, parquet.as_deref())?;
        if summary.epoch_us != context.epoch_us && !self.standard_output {
            // Only its last group knew better: all of it again, with that.
            context.epoch_us = summary.epoch_us;
            (summary, written) = self.write(log, name, &context, parquet.as_deref())?;
        }
        let Some(written) = written else {
            remarks.push(nothing_of(log, &summary));
            return Ok(Done { outcome: Outcome::Done, written: false, lines: Vec::new(), remarks });
        };
        let lossy = summary.gaps > 0 || summary.blocks.damaged > 0 || written.losses > 0;
        if lossy {
            remarks.push(format!(
                "{}: {}, {} missing, {}, {} lost while recording",
                log.name,
                count(summary.gaps, "gap"),
                count(summary.frames_missing, "frame"),
                count(summary.blocks.damaged, "damaged sector"),
                if written.losses == 1 {
                    "1 frame or record".to_owned()
                } else {
                    format!("{} frames or records", written.losses)
                }
            ));
        }
        let lines = if self.standard_output { Vec::new() } else { written.lines };
        Ok(Done { outcome: Outcome::lossy(lossy), written: true, lines, remarks })
    }

    /// What must be known of a log before its first byte is written.
    fn context(&self, work: &Work<'_>) -> Result<Context> {
        let mut context = Context {
            formats: self.formats,
            selection: self.selection.clone(),
            inputs: self.inputs.clone(),
            stamp: work.traits.stamp(),
            ..Context::default()
        };
        let Some(log) = work.log.own() else {
            context.identity = recorded::identity(work.log)?;
            context.tags = Tags::new(&context.identity.session, &context.identity.vehicle);
            context.epoch_us = context.identity.epoch_us;
            return Ok(context);
        };
        context.epoch_us = if self.formats.influx || self.formats.parquet {
            context.identity = Identity::of(log)?;
            context.tags = Tags::new(&context.identity.session, &context.identity.vehicle);
            context.identity.epoch_us
        } else if self.standard_output {
            reader::epoch(log)?
        } else {
            reader::likely_epoch(log)?
        };
        Ok(context)
    }

    /// Reads a log and writes its files; none where nothing of it is in the time that was asked for.
    fn write(
        &self,
        place: &Place,
        name: &str,
        context: &Context,
        parquet: Option<&Path>,
    ) -> Result<(Summary, Option<Written>)> {
        let destination = if self.standard_output {
            Destination::Standard
        } else {
            Destination::new(self.output, name, self.logs, self.formats)
        };
        let mut writers = Writers::new(context, destination, parquet.map(Path::to_owned))?;
        let summary = match place.own() {
            Some(log) => {
                let bar = progress::bar(log);
                let new = || Collected::new(context);
                let summary = reader::read(log, new, &mut writers, |blocks| bar.set_position(blocks * 512))?;
                bar.finish_and_clear();
                summary
            }
            None => recorded::read(place, context, &mut writers)?,
        };
        if writers.is_empty() && context.selection.has_limits() {
            return Ok((summary, None));
        }
        Ok((summary, Some(writers.finish()?)))
    }
}

/// Says that nothing of a log is in the time that was asked for, and what time it has.
fn nothing_of(log: &Place, summary: &Summary) -> String {
    let seconds = |at: Option<Instant>| at.map_or(0.0, Instant::as_secs_f64);
    format!(
        "{}: nothing of it is within --from and --to: it goes from {:.3} s to {:.3} s",
        log.name,
        seconds(summary.first),
        seconds(summary.last)
    )
}

/// A directory for a session's tables: that of its own earlier tables, otherwise a free one. Another session of the
/// same name (of a board without a source of randomness) gets a number; so does another part of the same session.
fn claim(taken: &mut BTreeSet<PathBuf>, dir: &Path, nth: u32, stamp: &str) -> PathBuf {
    let numbered = |number: u32| {
        let mut name = dir.to_owned().into_os_string();
        if number > 1 {
            name.push(format!("-{number}"));
        }
        PathBuf::from(name)
    };
    let held = |path: &PathBuf| Folder::held(path, stamp);
    let own = (1..).map(numbered).take_while(|path| held(path) != Held::Nothing);
    let mut own = own.filter(|path| held(path) == Held::TheSame);
    let is_free = |path: &PathBuf| held(path) == Held::Nothing && !taken.contains(path);
    let free = || (nth..u32::MAX).map(numbered).find(is_free);
    let claimed = own.next().or_else(free).unwrap_or_else(|| dir.to_owned());
    taken.insert(claimed.clone());
    claimed
}

/// The directory of a session's Parquet tables, named as the tools that read them expect.
fn partition(output: &Path, identity: &Identity) -> PathBuf {
    // Hive's word for "null", which every reader of this layout knows.
    let date = identity.date.as_deref().unwrap_or("__HIVE_DEFAULT_PARTITION__");
    output
        .join(format!("vehicle={}", identity.vehicle))
        .join(format!("date={date}"))
        .join(format!("session={}", identity.session))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_a_session_replace_their_own_and_no_others() {
        let root = tempfile::tempdir().expect("a directory");
        let dir = root.path().join("session=s1");
        let mut taken = BTreeSet::new();
        let mut claim = |nth, stamp| claim(&mut taken, &dir, nth, stamp);
        assert_eq!(claim(1, "one"), dir);
        let second = root.path().join("session=s1-2");
        assert_eq!(claim(2, "two"), second, "another of the same command");
        for (path, stamp) in [(&dir, "one"), (&second, "two")] {
            let folder = Folder::create(path, &Inputs::none(), stamp).expect("made");
            folder.finish().expect("whole");
        }
        assert_eq!(claim(2, "one"), dir, "a later run, in another order");
        assert_eq!(claim(1, "two"), second);
        assert_eq!(claim(1, "three"), root.path().join("session=s1-3"));
        assert_eq!(
            claim(1, "four"),
            root.path().join("session=s1-4"),
            "also while the third is being written"
        );
    }
}
