//! The files of the output formats.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use hums_blackbox::Gap;

use super::collect::{Collected, Selection, Table};
use super::text::columns;
use super::{Formats, inside};
use crate::logs::Log;
use crate::logs::reader::Deliver;
use crate::output::{self, Stdout};

/// Room for a group's lines of a busy message; there may be some hundred of these.
const BUFFER_BYTES: usize = 16 * 1024;

/// Where a log's files go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Destination {
    /// The one file goes to standard output.
    Standard,
    /// The one file has this name.
    File(PathBuf),
    /// Single files have this name with an extension; tables lie in a directory of this name.
    Named(PathBuf),
}

impl Destination {
    /// By the rule that `hums decode --help` tells.
    pub fn new(output: &Path, log: &Log, logs: usize, formats: Formats) -> Self {
        let says_directory = output.is_dir() || output.as_os_str().to_string_lossy().ends_with(['/', '\\']);
        if logs == 1 && formats.is_single_file() && !says_directory {
            return Self::File(output.to_owned());
        }
        Self::Named(inside(output, &log.name))
    }

    fn open(&self, extension: &str) -> Result<(Box<dyn Write>, PathBuf)> {
        let path = match self {
            Self::Standard => return Ok((Box::new(BufWriter::new(Stdout::new())), PathBuf::from("-"))),
            Self::File(path) => path.clone(),
            Self::Named(name) => {
                // Appended, not replaced: a log's own name may have a dot in it.
                let mut name = name.clone().into_os_string();
                name.push(format!(".{extension}"));
                PathBuf::from(name)
            }
        };
        Ok((Box::new(create(&path)?), path))
    }
}

fn create(path: &Path) -> Result<BufWriter<File>> {
    if let Some(dir) = path.parent().filter(|dir| !dir.as_os_str().is_empty()) {
        fs::create_dir_all(dir).with_context(|| format!("{}: cannot be made", dir.display()))?;
    }
    let file = File::create(path).with_context(|| format!("{}: cannot be written", path.display()))?;
    Ok(BufWriter::with_capacity(BUFFER_BYTES, file))
}

/// What was written.
#[derive(Debug, Default)]
pub struct Written {
    /// For people: each file with what is in it.
    pub lines: Vec<String>,
    /// What the log says was lost while recording.
    pub losses: u64,
}

/// The open files of one log.
pub struct Writers {
    destination: Destination,
    formats: Formats,
    epoch_us: Option<u64>,
    selection: Selection,
    tlog: Option<(Box<dyn Write>, PathBuf)>,
    jsonl: Option<(Box<dyn Write>, PathBuf)>,
    tables: BTreeMap<Table, BufWriter<File>>,
    headers: BTreeMap<&'static str, Vec<&'static str>>,
    frames: u64,
    records: u64,
    losses: u64,
}

impl Writers {
    /// Opens what is sure to be written; tables are opened when they get their first row.
    pub fn new(destination: Destination, formats: Formats, epoch_us: Option<u64>) -> Result<Self> {
        let open = |wanted: bool, extension| wanted.then(|| destination.open(extension)).transpose();
        let (tlog, jsonl) = (open(formats.tlog, "tlog")?, open(formats.jsonl, "jsonl")?);
        if let (true, Destination::Named(dir)) = (formats.csv, &destination) {
            fs::create_dir_all(dir).with_context(|| format!("{}: cannot be made", dir.display()))?;
        }
        Ok(Self {
            destination,
            formats,
            epoch_us,
            selection: Selection::default(),
            tlog,
            jsonl,
            tables: BTreeMap::new(),
            headers: BTreeMap::new(),
            frames: 0,
            records: 0,
            losses: 0,
        })
    }

    fn put(&mut self, collected: &Collected<'_>) -> Result<()> {
        self.frames += collected.frames;
        self.records += collected.records;
        self.losses += collected.losses;
        for (file, bytes) in [(&mut self.tlog, &collected.tlog), (&mut self.jsonl, &collected.jsonl)] {
            if let Some((file, path)) = file {
                write(file, bytes, path)?;
            }
        }
        for (name, columns) in &collected.headers {
            self.headers.entry(name).or_insert_with(|| columns.clone());
        }
        for (table, lines) in &collected.tables {
            self.table(*table, lines)?;
        }
        Ok(())
    }

    fn table(&mut self, table: Table, lines: &[u8]) -> Result<()> {
        let Destination::Named(dir) = &self.destination else { return Ok(()) };
        let path = dir.join(format!("{}.csv", file_name(table)));
        if let Some(file) = self.tables.get_mut(&table) {
            return write(file, lines, &path);
        }
        let mut file = create(&path)?;
        let own = match table {
            Table::Hums(name) => self.headers.get(name).map(Vec::as_slice).unwrap_or_default(),
            _ => &[],
        };
        write(&mut file, header(table, own).as_bytes(), &path)?;
        write(&mut file, lines, &path)?;
        self.tables.insert(table, file);
        Ok(())
    }

    /// Writes what is still held, and says what was written.
    pub fn finish(mut self) -> Result<Written> {
        let mut lines = Vec::new();
        for (mut file, path) in [self.tlog.take(), self.jsonl.take()].into_iter().flatten() {
            settle(file.flush(), &path)?;
            lines.push(format!("{}: {} frames", path.display(), self.frames));
        }
        if let (true, Destination::Named(dir)) = (self.formats.csv, &self.destination) {
            for (table, file) in &mut self.tables {
                settle(file.flush(), &dir.join(file_name(*table)))?;
            }
            let tables = self.tables.len();
            let (frames, records) = (self.frames, self.records);
            lines.push(format!("{}: {tables} tables, {frames} frames, {records} records", dir.display()));
        }
        Ok(Written { lines, losses: self.losses })
    }
}

impl<'a> Deliver<Collected<'a>> for Writers {
    fn gap(&mut self, gap: &Gap) -> Result<()> {
        let selection = self.selection.clone();
        let mut collected = Collected::new(self.formats, self.epoch_us, &selection);
        collected.gap(gap);
        self.put(&collected)
    }

    fn group(&mut self, collected: Collected<'a>) -> Result<()> {
        self.put(&collected)
    }
}

/// A table's file, without `.csv`.
fn file_name(table: Table) -> String {
    let name = |id| {
        hums_dialect::message(id).map_or_else(|| format!("UNKNOWN_{id}"), |message| message.name.to_owned())
    };
    match table {
        Table::Message(id) => name(id),
        Table::Unverified(id) => format!("UNVERIFIED_{}", name(id)),
        Table::Unknown(id) => format!("UNKNOWN_{id}"),
        Table::Hums(name) => name.to_owned(),
    }
}

/// A table's first line.
fn header(table: Table, own: &[&str]) -> String {
    let mut names: Vec<String> = vec!["time_boot[s]".into(), "time_utc".into()];
    match table {
        Table::Hums(_) => names.extend(own.iter().map(|name| (*name).to_owned())),
        Table::Message(id) => {
            names.extend(["system".into(), "component".into()]);
            names.extend(hums_dialect::message(id).map(columns).unwrap_or_default());
        }
        Table::Unverified(_) | Table::Unknown(_) => {
            names.extend(["system", "component", "sequence", "payload"].map(String::from));
        }
    }
    names.join(",") + "\n"
}

fn write(file: &mut impl Write, bytes: &[u8], path: &Path) -> Result<()> {
    settle(file.write_all(bytes), path)
}

fn settle(result: std::io::Result<()>, path: &Path) -> Result<()> {
    match result {
        Err(error) if output::is_reader_gone(&error) => Err(crate::outcome::ReaderGone.into()),
        result => result.with_context(|| format!("{}: cannot be written", path.display())),
    }
}
