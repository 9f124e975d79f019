//! `hums decode`: logs become files for other tools.
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
//! Gaps are in every format: `HUMS_GAP` tables, objects and points; a table `gaps.csv` beside a tlog and with `thesis`.

pub mod collect;
pub mod columns;
pub mod context;
pub mod field_names;
pub mod identity;
pub mod influx;
pub mod parquet;
pub mod record;
pub mod reference;
pub mod row;
pub mod selection;
pub mod side_by_side;
pub mod table;
pub mod text;
pub mod thesis;
mod wear;
pub mod write;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use anyhow::Result;

use crate::cli;
use crate::files::Inputs;
use crate::logs::reader::{self, Summary};
use crate::logs::{self, Log};
use crate::outcome::{Outcome, usage as usage_error};
use crate::{output, progress};
use collect::Collected;
use context::{Context, Formats};
use identity::{Extent, Identity};
use influx::Tags;
use selection::Selection;
use side_by_side::side_by_side;
use write::{Destination, Writers, Written};

/// Runs `hums decode`.
pub fn run(args: &cli::Decode) -> Result<Outcome> {
    let selection = Selection::new(args)?;
    let formats = Formats::new(&args.format);
    let found = logs::find(&args.inputs, args.salvage)?;
    for remark in &found.remarks {
        eprintln!("hums: {remark}");
    }
    let mut outcome = Outcome::lossy(found.images.iter().any(|image| !image.damage.is_empty()));
    for image in found.images.iter().filter(|image| !image.damage.is_empty()) {
        eprintln!("hums: {}: {}", image.path.display(), image.damage.join("; "));
    }
    let standard_output = args.output == Path::new("-");
    if standard_output && (found.logs.len() != 1 || !formats.is_single_file()) {
        let why = match found.logs.len() {
            1 => "these formats are more than that".to_owned(),
            count => format!("there are {count} logs"),
        };
        return Err(usage_error(format!(
            "-o -: standard output takes one log in one format of a single file (tlog, jsonl or influx), and {why}; \
             name a file or a directory"
        )));
    }
    let one_file = found.logs.len() == 1 && formats.is_single_file();
    if args.output.is_file() && !one_file {
        return Err(usage_error(format!(
            "-o {}: is a file, but tables, several formats and several logs need a directory; name one, or a new name",
            args.output.display()
        )));
    }
    if found.logs.is_empty() {
        eprintln!("hums: no log is in there, so nothing was written");
    }
    let inputs = Inputs::of(args.inputs.iter().map(PathBuf::as_path).chain(found.paths()));
    let logs = found.logs.len();
    let task = Task { formats, selection, inputs, output: &args.output, standard_output, logs };
    let sessions = Mutex::new(Sessions::new());
    side_by_side(
        &found.logs,
        |log| task.decode(log, &sessions),
        |done| {
            let done = done?;
            done.remarks.iter().for_each(|remark| eprintln!("hums: {remark}"));
            outcome = outcome.and(done.outcome);
            done.lines.iter().try_for_each(|line| output::line(line))
        },
    )?;
    Ok(outcome)
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
    /// What was written.
    lines: Vec<String>,
    /// What there is to say of it.
    remarks: Vec<String>,
}

impl Task<'_> {
    /// `sessions` are the sessions whose Parquet tables are taken.
    fn decode(&self, log: &Log, sessions: &Mutex<Sessions>) -> Result<Done> {
        let mut remarks = Vec::new();
        let mut context = Context {
            formats: self.formats,
            selection: self.selection.clone(),
            inputs: self.inputs.clone(),
            ..Context::default()
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
        if context.epoch_us.is_none() {
            context.selection.check_without_utc(&log.name)?;
            remarks.push(format!(
                "{}: no frame told the time of day: UTC columns are empty, and tlog times count from power-on as 1970",
                log.name
            ));
        }
        let mut parquet = None;
        if self.formats.parquet {
            parquet = sessions.lock().ok().and_then(|mut sessions| {
                claim(&mut sessions, &partition(self.output, &context.identity), context.identity.extent)
            });
            if parquet.is_none() {
                context.formats.parquet = false;
                remarks.push(format!(
                    "{}: is the same session as another log here; its Parquet tables are written once",
                    log.name
                ));
            }
        }
        let (mut summary, mut written) = self.write(log, &context, parquet.as_deref())?;
        if summary.epoch_us != context.epoch_us && !self.standard_output {
            // Only its last group knew better: all of it again, with that.
            context.epoch_us = summary.epoch_us;
            (summary, written) = self.write(log, &context, parquet.as_deref())?;
        }
        let lossy = summary.gaps > 0 || summary.blocks.damaged > 0 || written.losses > 0;
        if lossy {
            remarks.push(format!(
                "{}: {} gaps, {} frames missing, {} damaged sectors, {} frames or records lost while recording",
                log.name, summary.gaps, summary.frames_missing, summary.blocks.damaged, written.losses
            ));
        }
        let lines = if self.standard_output { Vec::new() } else { written.lines };
        Ok(Done { outcome: Outcome::lossy(lossy), lines, remarks })
    }

    /// Reads a log and writes its files.
    fn write(&self, log: &Log, context: &Context, parquet: Option<&Path>) -> Result<(Summary, Written)> {
        let destination = if self.standard_output {
            Destination::Standard
        } else {
            Destination::new(self.output, log, self.logs, self.formats)
        };
        let mut writers = Writers::new(context, destination, parquet.map(Path::to_owned))?;
        let bar = progress::bar(log);
        let new = || Collected::new(context);
        let summary = reader::read(log, new, &mut writers, |blocks| bar.set_position(blocks * 512))?;
        bar.finish_and_clear();
        Ok((summary, writers.finish()?))
    }
}

/// Sessions by the directory of their Parquet tables.
type Sessions = BTreeMap<PathBuf, Extent>;

/// A directory for a session, unless it is there already: a card and a copy of it are one session. Another session of
/// the same name (of a board without a source of randomness) gets a number.
fn claim(sessions: &mut Sessions, dir: &Path, extent: Extent) -> Option<PathBuf> {
    let names = std::iter::once(dir.to_owned()).chain((2..).map(|number| {
        let mut name = dir.to_owned().into_os_string();
        name.push(format!("-{number}"));
        PathBuf::from(name)
    }));
    for name in names {
        match sessions.get(&name) {
            Some(known) if *known == extent => return None,
            Some(_) => {}
            None => {
                sessions.insert(name.clone(), extent);
                return Some(name);
            }
        }
    }
    None
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
    fn a_copy_of_a_session_is_told_from_another_session_of_its_name() {
        let mut sessions = Sessions::new();
        let mut claim = |frames| claim(&mut sessions, Path::new("session=s1"), (frames, None, None));
        assert_eq!(claim(5), Some(PathBuf::from("session=s1")));
        assert_eq!(claim(5), None, "a copy");
        assert_eq!(claim(6), Some(PathBuf::from("session=s1-2")), "another");
        assert_eq!(claim(6), None, "its copy");
    }
}
