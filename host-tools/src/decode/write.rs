//! The files of the output formats.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Result;
use hums_blackbox::{Cause, Gap};
use hums_core::clock::Instant;

use super::checked::{Checked, OnBoard};
use super::collect::Collected;
use super::context::Context;
use super::destination::Destination;
use super::findings::Texts;
use super::influx::{Clock, Lines};
use super::made::OutputFile;
use super::parquet::ParquetTables;
use super::record::gap_row;
use super::tables::{Tables, UNKNOWN_TABLES_MAX};
use super::thesis::Thesis;
use crate::files::{Folder, Output, appended, make_parent, settle};
use crate::plural::count;
use crate::reference::Reference;
use crate::source::item;
use crate::source::parts::Deliver;

/// A single file, open.
struct Single(Output);

impl Single {
    fn open(destination: &Destination, extension: &str, context: &Context) -> Result<Self> {
        let path = destination.path(extension);
        Self::file(path.as_deref().unwrap_or(Path::new("-")), context)
    }

    fn file(path: &Path, context: &Context) -> Result<Self> {
        context.inputs.refuse(path)?;
        make_parent(path)?;
        Ok(Self(Output::create(path, &context.inputs)?))
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        settle(self.0.write_all(bytes), self.0.path())
    }

    /// Path of a tlog's table of gaps; `None` if the tlog is not a file.
    fn gaps_path(&self) -> Option<PathBuf> {
        (!self.0.is_stream()).then(|| appended(self.0.path(), "gaps.csv"))
    }

    /// The tlog is complete; returns its name.
    fn finish(mut self) -> Result<PathBuf> {
        self.0.finish()?;
        Ok(self.0.path().to_owned())
    }
}

/// The outputs of a decoding.
#[derive(Debug, Default)]
pub struct Written {
    /// Each file with its content.
    pub made: Vec<OutputFile>,
    /// Rows of tables without room for their names.
    pub rows_left_out: u64,
    /// Gaps of a tlog that cannot have a table beside it.
    pub gaps_left_out: u64,
    /// No tlog was made, because none of the requested frames is there.
    pub has_no_frame: bool,
}

impl Written {
    /// Omitted data, as sentences.
    pub fn left_out(&self) -> impl Iterator<Item = String> {
        let rows = (self.rows_left_out > 0).then(|| {
            let rows = count(self.rows_left_out, "row");
            format!("{rows} left out: the names of its tables take more room than any autopilot's")
        });
        let gaps = (self.gaps_left_out > 0).then(|| {
            let gaps = count(self.gaps_left_out, "gap");
            format!("{gaps} without a table: beside what is no file there is no place for one; name a file")
        });
        let frames = "no frame of what was asked for is in it, so no tlog was written";
        rows.into_iter().chain(gaps).chain(self.has_no_frame.then(|| frames.to_owned()))
    }
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
    csv: Option<Tables>,
    /// A tlog has no place for gaps: their table is beside it.
    gaps: Option<Single>,
    /// Gaps of a tlog that is not a file and so has no table beside it.
    gaps_left_out: u64,
    /// Texts that go into the tlog.
    texts: Option<Texts>,
    frames: u64,
    records: u64,
    /// JSON's.
    objects: u64,
    on_board: OnBoard,
    rows_left_out: u64,
}

/// The line protocol's file, and the state of points that are made in order.
struct Influx {
    file: Single,
    messages: Clock,
    quantities: Clock,
    reference: Reference,
    points: Vec<u8>,
    /// Points so far.
    count: u64,
}

impl Influx {
    /// Writes the frames of a group, and their quantities of the reference system.
    fn put(&mut self, context: &Context, collected: &Collected<'_>) -> Result<()> {
        self.points.clear();
        self.messages.write(&collected.influx, &context.epochs, &mut self.points);
        let mut lines = Lines::default();
        for observed in &collected.observed {
            let own = self.reference.observe(observed.at, observed.source, &observed.observation);
            if own && context.selection.has_time(observed.at, &context.epochs) {
                lines.observed(&context.tags, observed.at, &self.reference, &observed.observation);
            }
        }
        self.quantities.write(&lines, &context.epochs, &mut self.points);
        self.count += lines_of(&self.points);
        self.file.write(&self.points)
    }
}

impl<'a> Writers<'a> {
    /// Opens the files that are always written; a table is opened for its first row.
    pub fn new(context: &'a Context, destination: Destination, parquet: Option<PathBuf>) -> Result<Self> {
        let (formats, inputs) = (context.formats, &context.inputs);
        let open = |wanted: bool, extension| {
            wanted.then(|| Single::open(&destination, extension, context)).transpose()
        };
        let tlog = open(formats.tlog, "tlog")?;
        if let Some(path) = tlog.as_ref().and_then(Single::gaps_path) {
            Output::check(&path, inputs)?;
        }
        let jsonl = open(formats.jsonl, "jsonl")?;
        let influx = open(formats.influx, "lp")?.map(|file| Influx {
            file,
            messages: Clock::default(),
            quantities: Clock::default(),
            reference: Reference::new(),
            points: Vec::new(),
            count: 0,
        });
        let folder = |wanted: bool, path: Option<PathBuf>| -> Result<Option<Folder>> {
            let path = path.filter(|_| wanted);
            path.map(|path| Folder::create(&path, inputs, &context.session)).transpose()
        };
        let csv = folder(formats.csv, destination.tables())?.map(Tables::new);
        let thesis = folder(formats.thesis, destination.thesis())?
            .map(|folder| Thesis::new(folder, context.selection.clone(), context.epochs.clone()))
            .transpose()?;
        let about = [
            ("hums.vehicle", context.identity.vehicle.clone()),
            ("hums.session", context.identity.session.clone()),
        ];
        let parquet = folder(formats.parquet, parquet)?.map(|folder| ParquetTables::new(folder, &about));
        Ok(Self {
            context,
            destination,
            tlog,
            jsonl,
            influx,
            thesis,
            parquet,
            csv,
            gaps: None,
            gaps_left_out: 0,
            texts: Texts::of(context),
            frames: 0,
            records: 0,
            objects: 0,
            on_board: OnBoard::default(),
            rows_left_out: 0,
        })
    }

    /// The log was read up to this time. Writes its checker, and this program's findings, from an earlier
    /// reading or this one. Returns the reason if it was not checked, as a part of a sentence.
    pub fn checked(
        &mut self,
        last: Option<Instant>,
        checked: Option<&Checked>,
    ) -> Result<Option<&'static str>> {
        let context = self.context;
        let checked = context.checked.as_ref().or(checked);
        if !context.formats.has_records() {
            return Ok(None);
        }
        let mut collected = Collected::new(context);
        for (at, row) in checked.iter().flat_map(|checked| checked.findings()) {
            if context.selection.has_time(at, &context.epochs) {
                collected.rows(at, &[row]);
            }
        }
        let is_wanted = |at| context.selection.has_time(at, &context.epochs);
        let part: Option<&dyn Fn(Instant) -> bool> =
            if context.selection.has_limits() { Some(&is_wanted) } else { None };
        let row = checked.map_or_else(|| self.on_board.row(), |checked| checked.row(part));
        collected.rows(last.unwrap_or(Instant::ZERO), &[row]);
        self.put(collected)?;
        Ok(checked.and_then(Checked::not_checked))
    }

    fn put(&mut self, collected: Collected<'_>) -> Result<()> {
        self.frames += collected.frames;
        self.records += collected.records;
        self.objects += lines_of(&collected.jsonl);
        self.on_board.and(collected.on_board);
        self.rows_left_out += collected.rows_left_out;
        let with_texts = self.texts.as_mut().map(|texts| texts.among(&collected.tlog));
        let tlog = with_texts.as_ref().unwrap_or(&collected.tlog);
        for (file, bytes) in [(&mut self.tlog, tlog), (&mut self.jsonl, &collected.jsonl)] {
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
        if let Some(csv) = &mut self.csv {
            csv.headers(&collected.headers);
            for (table, lines) in &collected.tables {
                csv.put(*table, lines)?;
            }
            csv.put_unknown(&collected.unknown)?;
        }
        match &mut self.parquet {
            Some(parquet) => parquet.put(collected.parquet),
            None => Ok(()),
        }
    }

    /// A gap beside the tlog, in a table of its own.
    fn gap_beside_tlog(&mut self, gap: &Gap) -> Result<()> {
        let Some(tlog) = &self.tlog else { return Ok(()) };
        let Some(path) = tlog.gaps_path() else {
            self.gaps_left_out += 1;
            return Ok(());
        };
        let row = gap_row(gap);
        let first = self.gaps.is_none();
        let file = match &mut self.gaps {
            Some(file) => file,
            none => none.insert(Single::file(&path, self.context)?),
        };
        let mut line = Vec::new();
        if first {
            line.extend_from_slice(gaps_header().as_bytes());
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

    /// Whether only the beginnings of files were written.
    pub fn is_empty(&self) -> bool {
        let has_records = self.context.formats.has_records() && self.records > 0;
        let has_points = self.influx.as_ref().is_some_and(|influx| influx.count > 0);
        let has_rows = self.thesis.as_ref().is_some_and(|thesis| !thesis.is_empty());
        self.frames == 0 && !has_records && !has_points && !has_rows
    }

    /// The log is complete: the files get their names. Returns the outputs.
    pub fn finish(mut self) -> Result<Written> {
        let mut made = Vec::new();
        let frames = (self.frames, "frame");
        let rows = if self.frames == 0 {
            vec![(self.records, "row")]
        } else {
            vec![frames, (self.records, "record")]
        };
        let of_tables = |tables: usize| [&[(tables as u64, "table")], &rows[..]].concat();
        // An empty tlog would look like a log without any messages.
        let has_no_frame = self.frames == 0 && self.context.selection.is_part() && self.tlog.take().is_some();
        self.gaps = self.gaps.filter(|_| !has_no_frame);
        // Old gaps beside a tlog without gaps would look like its own.
        let stale = self.tlog.as_ref().filter(|_| self.gaps.is_none()).and_then(Single::gaps_path);
        if let Some(path) = stale.filter(|path| path.exists()) {
            settle(fs::remove_file(&path), &path)?;
        }
        if let (Some(tlog), Some(texts)) = (&mut self.tlog, &mut self.texts) {
            tlog.write(&texts.rest())?;
        }
        let gaps = self.gaps.take().map(Single::finish).transpose()?;
        let mut singles =
            vec![(self.tlog.take(), "tlog", frames), (self.jsonl.take(), "jsonl", (self.objects, "object"))];
        if let Some(Influx { file, count: points, .. }) = self.influx.take() {
            singles.push((Some(file), "influx", (points, "point")));
        }
        for (file, format, what) in singles {
            if let Some(file) = file {
                made.push(OutputFile::of(file.finish()?, format, &[what]));
            }
        }
        if let Some(path) = gaps {
            made.push(OutputFile::with_words(path, "gaps", "gaps".to_owned()));
        }
        if let (Some(csv), Some(dir)) = (self.csv.take(), self.destination.tables()) {
            let (tables, shared) = (csv.count(), csv.has_shared());
            csv.finish()?;
            made.push(OutputFile::of(dir.clone(), "csv", &of_tables(tables)));
            if shared {
                let words = format!(
                    "the messages without a definition beyond the first {UNKNOWN_TABLES_MAX}, with their ids in a column"
                );
                made.push(OutputFile::with_words(dir.join("UNKNOWN.csv"), "csv", words));
            }
        }
        if let Some(thesis) = self.thesis.take() {
            let (dir, seconds) = thesis.finish()?;
            made.push(OutputFile::of(dir, "thesis", &[(seconds, "second")]));
        }
        if let Some(parquet) = self.parquet.take() {
            let (dir, tables) = parquet.finish()?;
            made.push(OutputFile::of(dir, "parquet", &of_tables(tables)));
        }
        let Self { rows_left_out, gaps_left_out, .. } = self;
        Ok(Written { made, rows_left_out, gaps_left_out, has_no_frame })
    }
}

fn lines_of(text: &[u8]) -> u64 {
    // The last line end has no line after it.
    text.split(|byte| *byte == b'\n').count() as u64 - 1
}

/// The first line of a table of gaps beside a tlog.
fn gaps_header() -> String {
    let nothing = Gap {
        from: None,
        to: None,
        cause: Cause::Missing,
        sectors_lost: 0,
        sectors_skipped: 0,
        frames: None,
    };
    gap_row(&nothing).cells.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(",")
}

impl<'a> Deliver<Collected<'a>> for Writers<'a> {
    fn gap(&mut self, gap: &item::Gap) -> Result<()> {
        let gap = &gap.to_own();
        let mut collected = Collected::new(self.context);
        collected.gap(gap);
        if self.context.selection.overlaps(gap, &self.context.epochs) {
            self.gap_beside_tlog(gap)?;
        }
        if let Some(thesis) = &mut self.thesis {
            thesis.gap(gap)?;
        }
        self.put(collected)
    }

    fn part(&mut self, collected: Collected<'a>) -> Result<()> {
        self.put(collected)
    }
}
