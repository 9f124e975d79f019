//! `hums decode`: logs become files for other tools.
//!
//! | format | what | where |
//! |---|---|---|
//! | `tlog` | every frame bit for bit, UTC before it | one file a log |
//! | `csv` | a table for each message type, `HUMS_*` tables for the monitor's own records and for gaps | one file a table |
//! | `jsonl` | everything in order, an object a line | one file a log |
//!
//! A log is read once; its groups are turned to text in parallel and written in order.

pub mod collect;
pub mod record;
pub mod text;
pub mod usage;
mod wear;
pub mod write;

use std::path::{Path, PathBuf};

use anyhow::Result;
use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::{self, Format};
use crate::logs::{self, Log, reader};
use crate::outcome::{Outcome, usage as usage_error};
use crate::output;
use collect::{Collected, Selection};
use write::{Destination, Writers};

/// Runs `hums decode`.
pub fn run(args: &cli::Decode) -> Result<Outcome> {
    let selection = Selection::new(args)?;
    let formats = Formats::new(&args.format);
    let found = logs::find(&args.inputs)?;
    for remark in &found.remarks {
        eprintln!("hums: {remark}");
    }
    let mut outcome = Outcome::lossy(found.images.iter().any(|image| !image.damage.is_empty()));
    for image in found.images.iter().filter(|image| !image.damage.is_empty()) {
        eprintln!("hums: {}: {}", image.path.display(), image.damage.join("; "));
    }
    let standard_output = args.output == Path::new("-");
    if standard_output && (found.logs.len() != 1 || !formats.is_single_file()) {
        return Err(usage_error(format!(
            "-o -: standard output takes one log in one format of a single file (tlog or jsonl); there are {} logs",
            found.logs.len()
        )));
    }
    if found.logs.is_empty() {
        eprintln!("hums: no log is in there, so nothing was written");
    }
    for log in &found.logs {
        let destination = if standard_output {
            Destination::Standard
        } else {
            Destination::new(&args.output, log, found.logs.len(), formats)
        };
        outcome = outcome.and(decode(log, destination, formats, &selection)?);
    }
    Ok(outcome)
}

/// Which formats are asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Formats {
    /// A ground station's log.
    pub tlog: bool,
    /// Tables.
    pub csv: bool,
    /// Objects.
    pub jsonl: bool,
}

impl Formats {
    fn new(formats: &[Format]) -> Self {
        let has = |format| formats.contains(&format);
        Self { tlog: has(Format::Tlog), csv: has(Format::Csv), jsonl: has(Format::Jsonl) }
    }

    /// Whether a log becomes exactly one file.
    pub fn is_single_file(self) -> bool {
        !self.csv && self.tlog != self.jsonl
    }
}

fn decode(log: &Log, destination: Destination, formats: Formats, selection: &Selection) -> Result<Outcome> {
    let epoch_us = reader::epoch(log)?;
    if epoch_us.is_none() {
        selection.check_without_utc(&log.name)?;
        eprintln!(
            "hums: {}: no frame told the time of day: UTC columns are empty, and tlog times count from power-on as 1970",
            log.name
        );
    }
    let to_standard_output = matches!(destination, Destination::Standard);
    let mut writers = Writers::new(destination, formats, epoch_us)?;
    let bar = progress_bar(log);
    let new = || Collected::new(formats, epoch_us, selection);
    let summary = reader::read(log, new, &mut writers, |blocks| bar.set_position(blocks * 512))?;
    bar.finish_and_clear();
    let written = writers.finish()?;
    let lossy = summary.gaps > 0 || summary.blocks.damaged > 0 || written.losses > 0;
    if !to_standard_output {
        for line in written.lines {
            output::line(&line)?;
        }
    }
    if lossy {
        eprintln!(
            "hums: {}: {} gaps, {} frames missing, {} damaged sectors, {} frames or records lost while recording",
            log.name, summary.gaps, summary.frames_missing, summary.blocks.damaged, written.losses
        );
    }
    Ok(Outcome::lossy(lossy))
}

/// A bar over the log's bytes, on a terminal only.
pub fn progress_bar(log: &Log) -> ProgressBar {
    let bar = ProgressBar::new(log.bytes());
    if let Ok(style) = ProgressStyle::with_template("{msg} {bar:40} {bytes}/{total_bytes} {eta}") {
        bar.set_style(style);
    }
    bar.set_message(log.name.clone());
    bar
}

/// A path inside `dir` for a log's name, which may have directories of its own.
fn inside(dir: &Path, name: &str) -> PathBuf {
    name.split('/')
        .filter(|part| !matches!(*part, "" | "." | ".."))
        .fold(dir.to_owned(), |path, part| path.join(part))
}
