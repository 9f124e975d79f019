//! The files of the output formats.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use hums_blackbox::Gap;

use super::collect::Collected;
use super::context::{Context, Formats};
use super::influx::{Clock, Lines};
use super::parquet::ParquetTables;
use super::record::gap_row;
use super::reference::Reference;
use super::table::Table;
use super::text::columns;
use super::thesis::Thesis;
use crate::files::{
    Inputs, Output, appended, cannot_write, inside, make_directory, make_parent, says_directory, settle,
};
use crate::logs::Log;
use crate::logs::reader::Deliver;
use crate::output::Stdout;

/// Tables that are open at once at most: there are 16 million ids, and some hundred files for a process.
const OPEN_MAX: usize = 256;

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
        if logs == 1 && formats.is_single_file() && !says_directory(output) {
            return Self::File(output.to_owned());
        }
        Self::Named(inside(output, &log.name))
    }

    /// The path of the single file with this extension; `None` is standard output.
    fn path(&self, extension: &str) -> Option<PathBuf> {
        match self {
            Self::Standard => None,
            Self::File(path) => Some(path.clone()),
            Self::Named(name) => Some(appended(name, extension)),
        }
    }

    /// The directory of the tables. A single file has none.
    fn dir(&self) -> Option<&Path> {
        match self {
            Self::Standard | Self::File(_) => None,
            Self::Named(dir) => Some(dir),
        }
    }
}

/// A single file, open.
enum Single {
    Standard(BufWriter<Stdout>),
    File(Output),
}

impl Single {
    fn open(destination: &Destination, extension: &str, inputs: &Inputs) -> Result<Self> {
        match destination.path(extension) {
            None => {
                inputs.refuse_standard_output()?;
                Ok(Self::Standard(BufWriter::new(Stdout::new())))
            }
            Some(path) => Self::file(&path, inputs),
        }
    }

    fn file(path: &Path, inputs: &Inputs) -> Result<Self> {
        make_parent(path)?;
        Ok(Self::File(Output::create(path, inputs)?))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        match self {
            Self::Standard(out) => settle(out.write_all(bytes), Path::new("standard output")),
            Self::File(file) => settle(file.write_all(bytes), file.path()),
        }
    }

    /// All of it is there; gives its name.
    fn finish(self) -> Result<PathBuf> {
        match self {
            Self::Standard(mut out) => {
                settle(out.flush(), Path::new("standard output"))?;
                Ok(PathBuf::from("standard output"))
            }
            Self::File(mut file) => {
                file.finish()?;
                Ok(file.path().to_owned())
            }
        }
    }
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
pub struct Writers<'a> {
    context: &'a Context,
    destination: Destination,
    tlog: Option<Single>,
    jsonl: Option<Single>,
    influx: Option<Influx>,
    thesis: Option<Thesis>,
    parquet: Option<ParquetTables>,
    tables: BTreeMap<Table, BufWriter<File>>,
    /// Tables that have their header; not all of them are open.
    begun: BTreeSet<Table>,
    headers: BTreeMap<&'static str, Vec<&'static str>>,
    /// A tlog has no place for gaps: they lie beside it.
    gaps: Option<Single>,
    frames: u64,
    records: u64,
    losses: u64,
}

/// The line protocol's file, and what only can be told in order.
struct Influx {
    file: Single,
    messages: Clock,
    quantities: Clock,
    reference: Reference,
    points: Vec<u8>,
}

impl Influx {
    /// The frames of a group as they are, and what they told of the reference system's quantities.
    fn put(&mut self, context: &Context, collected: &Collected<'_>) -> Result<()> {
        self.points.clear();
        self.messages.write(&collected.influx, context.epoch_us, &mut self.points);
        let mut lines = Lines::default();
        for observed in &collected.observed {
            let own = self.reference.observe(observed.at, observed.source, &observed.observation);
            if own && context.selection.has_time(observed.at, context.epoch_us) {
                lines.observed(&context.tags, observed.at, &self.reference, &observed.observation);
            }
        }
        self.quantities.write(&lines, context.epoch_us, &mut self.points);
        self.file.write(&self.points)
    }
}

impl<'a> Writers<'a> {
    /// Opens what is sure to be written; tables are opened when they get their first row.
    pub fn new(context: &'a Context, destination: Destination, parquet: Option<PathBuf>) -> Result<Self> {
        let (formats, inputs) = (context.formats, &context.inputs);
        let open = |wanted: bool, extension| {
            wanted.then(|| Single::open(&destination, extension, inputs)).transpose()
        };
        let (tlog, jsonl) = (open(formats.tlog, "tlog")?, open(formats.jsonl, "jsonl")?);
        let influx = open(formats.influx, "lp")?.map(|file| Influx {
            file,
            messages: Clock::default(),
            quantities: Clock::default(),
            reference: Reference::new(),
            points: Vec::new(),
        });
        let mut thesis = None;
        if let Some(dir) = destination.dir() {
            if formats.csv {
                make_directory(dir)?;
            }
            if formats.thesis {
                let dir = dir.join("thesis");
                make_directory(&dir)?;
                thesis = Some(Thesis::new(&dir, inputs, context.selection.clone(), context.epoch_us)?);
            }
        }
        let about = [
            ("hums.vehicle", context.identity.vehicle.clone()),
            ("hums.session", context.identity.session.clone()),
        ];
        let parquet = parquet.map(|dir| ParquetTables::new(dir, &about)).transpose()?;
        Ok(Self {
            context,
            destination,
            tlog,
            jsonl,
            influx,
            thesis,
            parquet,
            tables: BTreeMap::new(),
            begun: BTreeSet::new(),
            headers: BTreeMap::new(),
            gaps: None,
            frames: 0,
            records: 0,
            losses: 0,
        })
    }

    fn put(&mut self, collected: Collected<'_>) -> Result<()> {
        self.frames += collected.frames;
        self.records += collected.records;
        self.losses += collected.losses;
        for (file, bytes) in [(&mut self.tlog, &collected.tlog), (&mut self.jsonl, &collected.jsonl)] {
            if let Some(file) = file {
                file.write(bytes)?;
            }
        }
        if let Some(influx) = &mut self.influx {
            influx.put(self.context, &collected)?;
        }
        if let Some(thesis) = &mut self.thesis {
            for observed in &collected.observed {
                thesis.observe(observed.at, observed.source, &observed.observation)?;
            }
        }
        for (name, columns) in &collected.headers {
            self.headers.entry(name).or_insert_with(|| columns.clone());
        }
        for (table, lines) in &collected.tables {
            self.table(*table, lines)?;
        }
        match &mut self.parquet {
            Some(parquet) => parquet.put(collected.parquet),
            None => Ok(()),
        }
    }

    fn table(&mut self, table: Table, lines: &[u8]) -> Result<()> {
        let Some(dir) = self.destination.dir() else { return Ok(()) };
        let path = dir.join(format!("{}.csv", table.name()));
        if let Some(file) = self.tables.get_mut(&table) {
            return write(file, lines, &path);
        }
        let mut file = if self.begun.contains(&table) {
            let file = File::options().append(true).open(&path);
            BufWriter::new(file.with_context(|| cannot_write(&path))?)
        } else {
            let file = File::create(&path).with_context(|| cannot_write(&path))?;
            let mut file = BufWriter::with_capacity(16 * 1024, file);
            let own = match table {
                Table::Hums(name) => self.headers.get(name).map(Vec::as_slice).unwrap_or_default(),
                _ => &[],
            };
            write(&mut file, header(table, own).as_bytes(), &path)?;
            self.begun.insert(table);
            file
        };
        write(&mut file, lines, &path)?;
        if self.tables.len() >= OPEN_MAX
            && let Some((closed, mut file)) = self.tables.pop_last()
        {
            settle(file.flush(), &dir.join(closed.name()))?;
        }
        self.tables.insert(table, file);
        Ok(())
    }

    /// A gap beside the tlog, in a table of its own.
    fn gap_beside_tlog(&mut self, gap: &Gap) -> Result<()> {
        let Some(path) = self.destination.path("tlog").filter(|_| self.tlog.is_some()) else { return Ok(()) };
        let row = gap_row(gap);
        let first = self.gaps.is_none();
        let path = appended(&path, "gaps.csv");
        let file = match &mut self.gaps {
            Some(file) => file,
            none => none.insert(Single::file(&path, &self.context.inputs)?),
        };
        let mut line = Vec::new();
        if first {
            let names: Vec<&str> = row.cells.iter().map(|(name, _)| *name).collect();
            line.extend_from_slice(names.join(",").as_bytes());
            line.push(b'\n');
        }
        for (place, (_, cell)) in row.cells.iter().enumerate() {
            if place > 0 {
                line.push(b',');
            }
            cell.push_csv(&mut line);
        }
        line.push(b'\n');
        file.write(&line)
    }

    /// Writes what is still held, and says what was written.
    pub fn finish(mut self) -> Result<Written> {
        let mut lines = Vec::new();
        let (frames, records) = (self.frames, self.records);
        let singles = [self.tlog.take(), self.jsonl.take(), self.influx.take().map(|influx| influx.file)];
        for file in singles.into_iter().flatten() {
            lines.push(format!("{}: {frames} frames", file.finish()?.display()));
        }
        if let Some(file) = self.gaps.take() {
            lines.push(format!("{}: gaps", file.finish()?.display()));
        }
        if let (true, Some(dir)) = (self.context.formats.csv, self.destination.dir()) {
            for (table, file) in &mut self.tables {
                settle(file.flush(), &dir.join(table.name()))?;
            }
            let tables = self.begun.len();
            lines.push(format!("{}: {tables} tables, {frames} frames, {records} records", dir.display()));
        }
        if let (Some(thesis), Some(dir)) = (&mut self.thesis, self.destination.dir()) {
            thesis.finish()?;
            lines.push(format!("{}: {} seconds", dir.join("thesis").display(), thesis.rows));
        }
        if let Some(parquet) = self.parquet.take() {
            let (dir, tables) = parquet.finish()?;
            lines.push(format!("{}: {tables} tables, {frames} frames, {records} records", dir.display()));
        }
        Ok(Written { lines, losses: self.losses })
    }
}

impl<'a> Deliver<Collected<'a>> for Writers<'a> {
    fn gap(&mut self, gap: &Gap) -> Result<()> {
        let mut collected = Collected::new(self.context);
        collected.gap(gap);
        if self.context.selection.overlaps(gap, self.context.epoch_us) {
            self.gap_beside_tlog(gap)?;
        }
        if let Some(thesis) = &mut self.thesis {
            thesis.gap(gap)?;
        }
        self.put(collected)
    }

    fn group(&mut self, collected: Collected<'a>) -> Result<()> {
        self.put(collected)
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
