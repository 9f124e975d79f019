//! Typed columns for the tools that read a whole fleet as one table: `DuckDB`, Spark, `DataFusion`, pandas.
//!
//! ```text
//! OUT/ATTITUDE/date=2026-11-21/bucket=07/s1a2b3c4d-3f0042000d51373435363338.parquet
//! ```
//!
//! The folders are those of [`crate::fleet`], the columns are in `docs/decode.md`.
//!
//! Rows wait as plain columns, 12 MiB in all; then the largest tables are written as row groups. An encoder costs far
//! more than its rows, so it is open for one row group only. An open file takes memory for its columns and row
//! groups: beyond a limit the largest files are closed, and their tables go on in `SESSION.2.parquet`.

mod batches;
mod columns;

#[cfg(test)]
pub(crate) use columns::TAKEN_FRAMES;

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry::{Occupied, Vacant};
use std::fs::File;
use std::io::{self, BufWriter, IntoInnerError, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::{Context as _, Result, bail};
use hums_core::clock::Instant;
use parquet::basic::{Compression, Repetition};
use parquet::data_type::ByteArray;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesBuilder};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::context::Context;
use crate::files::cannot_write;
use crate::fleet::{Ended, SESSIONS, Session, sessions};
use crate::format::GroupEncoder as _;
use crate::format::{Files, Finished, FormatDetails, Totals, Writer};
use crate::identity::Identity;
use crate::logs::in_order::{in_order, workers};
use crate::story::Story;
use crate::table::Table;
use crate::utc::iso8601;
use batches::{Batches, TimedRow};
use columns::{Column, NAMES, TableRows, name_type, write_name};

/// Memory limits: some 55 MiB with the reading.
const LIMITS: Limits = Limits { pending_bytes: 12 << 20, open_bytes: 8 << 20 };
/// Number of rows in a row group: a good size for one read of an engine.
const GROUP_ROWS: usize = 128 * 1024;
const PAGE_BYTES: usize = 32 * 1024;
/// Columns of texts of a table at most that have a dictionary: it takes 73 kB of each.
const DICTIONARIES_MAX: usize = 32;
/// So few rows are read as fast as their statistics.
const ROWS_FEW: usize = 1024;
const SELECTING: [&str; 3] = ["vehicle", "session", "utc"];
const OPEN_FILE_BYTES: usize = 18 << 10;
const OPEN_COLUMN_BYTES: usize = 1_000;
/// Memory of each column of a written row group.
const CHUNK_BYTES: usize = 800;
/// No recording is older than MAVLink.
const MAVLINK_SINCE: &str = "2009";
const DAY_US: u64 = 86_400_000_000;
/// Tables that are written before it is looked at how many are open.
const AT_ONCE: usize = 16;

#[derive(Clone, Copy)]
struct Limits {
    pending_bytes: usize,
    open_bytes: usize,
}

pub(super) struct Parquet {
    session: Session,
    limits: Limits,
    properties: Properties,
    tables: BTreeMap<Table, TableFile>,
}

struct Properties {
    writer: WriterPropertiesBuilder,
    about: Vec<KeyValue>,
    names: [ByteArray; 2],
}

struct TableFile {
    table: Table,
    columns: TableRows,
    pending_bytes: usize,
    open: Option<Open>,
    parts: u32,
}

struct Open {
    path: PathBuf,
    writer: SerializedFileWriter<Buffer>,
    bytes: usize,
}

/// Without flushes: the library flushes each column.
struct Buffer(BufWriter<File>);

impl Write for Buffer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Parquet {
    fn new(session: Session, identity: &Identity) -> Self {
        let names = [("vehicle", &identity.vehicle), ("session", &identity.recording)];
        let about = names.map(|(name, value)| KeyValue::new(format!("hums.{name}"), value.clone())).into();
        let names = names.map(|(_, value)| ByteArray::from(value.as_str()));
        let writer = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_data_page_size_limit(PAGE_BYTES)
            .set_dictionary_page_size_limit(PAGE_BYTES)
            .set_dictionary_enabled(false)
            .set_offset_index_disabled(true)
            .set_created_by(concat!("hums ", env!("CARGO_PKG_VERSION")).to_owned());
        let properties = Properties { writer, about, names };
        Self { session, limits: LIMITS, properties, tables: BTreeMap::new() }
    }

    fn put(&mut self, batches: Batches) -> Result<()> {
        let (frames, rows) = batches.parts();
        for (table, columns) in frames {
            match self.tables.entry(table) {
                Occupied(file) => file.into_mut().frames(columns)?,
                Vacant(place) => {
                    place.insert(TableFile::new(table, columns));
                }
            }
        }
        for (name, rows) in rows {
            let Some((_, _, first)) = rows.first() else { continue };
            let table = Table::Hums(name);
            let new = || TableFile::new(table, TableRows::of_rows(first));
            self.tables.entry(table).or_insert_with(new).rows(&rows)?;
        }
        let Self { session, properties, tables, .. } = self;
        for file in tables.values_mut().filter(|file| file.columns.rows() >= GROUP_ROWS) {
            file.write_group(session, properties, false)?;
        }
        let pending_bytes: usize = self.tables.values().map(|table| table.pending_bytes).sum();
        if pending_bytes > self.limits.pending_bytes {
            self.write_largest(pending_bytes / 2)?;
        }
        Ok(())
    }

    /// Writes this many waiting bytes, in few row groups.
    fn write_largest(&mut self, bytes: usize) -> Result<()> {
        let mut sizes: Vec<_> =
            self.tables.iter().map(|(table, file)| (Reverse(file.pending_bytes), *table)).collect();
        sizes.sort_unstable();
        let mut written = 0;
        let enough = sizes.iter().position(|(Reverse(size), _)| {
            written += size;
            written >= bytes
        });
        sizes.truncate(enough.map_or(sizes.len(), |last| last + 1));
        for few in sizes.chunks(AT_ONCE) {
            let Self { session, properties, tables, .. } = self;
            let is_one = |table: &Table| few.iter().any(|(_, few)| few == table);
            let mut few = tables.iter_mut().filter(|(table, _)| is_one(table));
            let write = |(_, file): (&Table, &mut TableFile)| file.write_group(session, properties, false);
            in_order(workers(), AT_ONCE, || Ok(few.next()), write, |written| written)?;
            self.close_largest()?;
        }
        Ok(())
    }

    /// Ends the largest files beyond the limit.
    fn close_largest(&mut self) -> Result<()> {
        let mut open: Vec<&mut TableFile> =
            self.tables.values_mut().filter(|table| table.open.is_some()).collect();
        let mut bytes: usize = open.iter().map(|table| table.open_bytes()).sum();
        open.sort_unstable_by_key(|table| Reverse(table.open_bytes()));
        for table in open {
            if bytes <= self.limits.open_bytes {
                break;
            }
            bytes -= table.open_bytes();
            table.end_file(&self.session)?;
        }
        Ok(())
    }

    fn end(mut self) -> Result<(Session, usize)> {
        let count = self.tables.len();
        let (session, properties) = (&self.session, &self.properties);
        let mut tables = std::mem::take(&mut self.tables).into_values();
        let write = |mut table: TableFile| {
            table.write_group(session, properties, true)?;
            table.end_file(session)
        };
        in_order(workers(), AT_ONCE, || Ok(tables.next()), write, |written| written)?;
        Ok((self.session, count))
    }
}

impl Writer for Parquet {
    const ABOUT: FormatDetails = FormatDetails {
        needs_identity: true,
        ..FormatDetails::new(
            "parquet",
            "Typed columns of a whole fleet, for DuckDB, Spark, pandas",
            Files::Fleet("parquet"),
        )
    };
    type Encoder = Batches;

    fn open(context: &Context, _: &Path) -> Result<Self> {
        Ok(Self::new(Session::begin(context)?, &context.identity))
    }

    fn part(&mut self, _: &Context, part: Batches, _: &Story) -> Result<()> {
        self.put(part)
    }

    fn finish(mut self, context: &Context, totals: Totals) -> Result<Finished> {
        if let Some(about) = &context.about {
            let mut row = Batches::default();
            let (summary, contents) = (&about.overview.ending.summary, &about.overview.contents);
            if contents.messages.is_empty() && contents.records == 0 {
                let remarks = vec!["no entry is in it, so it is no session".to_owned()];
                return Ok(Finished { made: Vec::new(), remarks });
            }
            let first = summary.first.unwrap_or(Instant::ZERO);
            row.row(context, first, &sessions::row(context, about));
            self.put(row)?;
        }
        let (session, tables) = self.end()?;
        let path = session.path(SESSIONS, 1);
        let mut remarks = Vec::new();
        let files = match session.finish(context, totals.frames)? {
            Ended::Alone(files) => files,
            Ended::Replaces(files) => {
                remarks.push("has replaced another log of this session, which has fewer frames".to_owned());
                files
            }
            Ended::Dropped => {
                let why = "another log of this session has more frames, and is in the tables instead";
                return Ok(Finished { made: Vec::new(), remarks: vec![why.to_owned()] });
            }
        };
        let today_us = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |now| now.as_micros() as u64);
        let tomorrow = iso8601(today_us + DAY_US);
        let date = context.identity.date.as_deref();
        let wrong = date.filter(|date| *date < MAVLINK_SINCE || *date > tomorrow.as_str());
        remarks.extend(
            wrong.map(|date| format!("its clock says {date}, which cannot be; its tables have that date")),
        );
        Ok(Finished { made: vec![totals.of_tables(path, "parquet", tables).with_files(files)], remarks })
    }
}

impl Open {
    fn new(
        session: &Session,
        table: &str,
        part: u32,
        columns: &[Column],
        properties: &Properties,
        is_large: bool,
    ) -> Result<Self> {
        let path = session.path(table, part);
        // Files of numbers are a sixth smaller without a dictionary; texts gain by it.
        let texts = columns.iter().filter_map(Column::text_name).take(DICTIONARIES_MAX);
        let texts = NAMES.into_iter().chain(texts.filter(|_| is_large));
        let writer = texts.fold(properties.writer.clone(), |writer, name| {
            writer.set_column_dictionary_enabled(vec![name.to_owned()].into(), true)
        });
        let writer = SELECTING.into_iter().fold(writer, |writer, name| {
            writer.set_column_statistics_enabled(vec![name.to_owned()].into(), EnabledStatistics::Chunk)
        });
        // Metadata of each page would be kept until the file's end.
        let statistics = if is_large { EnabledStatistics::Chunk } else { EnabledStatistics::None };
        let writer = writer.set_statistics_enabled(statistics);
        let about = columns.iter().flat_map(Column::about);
        let about = about.map(|(name, value)| KeyValue::new(name, value.to_owned()));
        let writer =
            writer.set_key_value_metadata(Some(properties.about.iter().cloned().chain(about).collect()));
        let types = NAMES.into_iter().map(name_type).chain(columns.iter().map(Column::parquet_type));
        let types: parquet::errors::Result<Vec<_>> = types.map(|made| made.map(Arc::new)).collect();
        let schema = types.and_then(|types| {
            Type::group_type_builder("hums").with_repetition(Repetition::REQUIRED).with_fields(types).build()
        });
        let file = Buffer(BufWriter::new(session.file(table, part)?));
        let writer = schema
            .and_then(|schema| SerializedFileWriter::new(file, Arc::new(schema), Arc::new(writer.build())))
            .with_context(|| cannot_write(&path))?;
        let bytes = OPEN_FILE_BYTES + OPEN_COLUMN_BYTES * columns.len();
        Ok(Self { path, writer, bytes })
    }

    fn write(&mut self, rows: &TableRows, properties: &Properties) -> parquet::errors::Result<()> {
        let columns = rows.columns();
        let mut group = self.writer.next_row_group()?;
        for name in &properties.names {
            if let Some(mut writer) = group.next_column()? {
                write_name(&mut writer, name, rows.rows())?;
                writer.close()?;
            }
        }
        for column in columns {
            if let Some(mut writer) = group.next_column()? {
                column.write(&mut writer)?;
                writer.close()?;
            }
        }
        group.close()?;
        self.bytes += CHUNK_BYTES * columns.len();
        Ok(())
    }
}

impl TableFile {
    fn new(table: Table, columns: TableRows) -> Self {
        Self { table, pending_bytes: columns.held_bytes(), columns, open: None, parts: 0 }
    }

    fn frames(&mut self, columns: TableRows) -> Result<()> {
        self.check(true)?;
        self.columns.append(columns);
        self.pending_bytes = self.columns.held_bytes();
        Ok(())
    }

    fn rows(&mut self, rows: &[TimedRow]) -> Result<()> {
        self.check(false)?;
        for (at, utc_us, row) in rows {
            self.columns.row(*at, *utc_us, row);
        }
        self.pending_bytes = self.columns.held_bytes();
        Ok(())
    }

    fn check(&self, has_frames: bool) -> Result<()> {
        if self.columns.has_frames() != has_frames {
            bail!("{}: is the name of two tables of different columns", self.table.name())
        }
        Ok(())
    }

    fn open_bytes(&self) -> usize {
        self.open.as_ref().map_or(0, |open| open.bytes)
    }

    /// `is_end`: no rows follow.
    fn write_group(&mut self, session: &Session, properties: &Properties, is_end: bool) -> Result<()> {
        if self.columns.rows() == 0 {
            return Ok(());
        }
        let open = match &mut self.open {
            Some(open) => open,
            none => {
                self.parts += 1;
                let (name, columns) = (self.table.name(), self.columns.columns());
                let is_large = !is_end || self.columns.rows() > ROWS_FEW;
                none.insert(Open::new(session, &name, self.parts, columns, properties, is_large)?)
            }
        };
        open.write(&self.columns, properties).with_context(|| cannot_write(&open.path))?;
        self.columns.clear();
        self.pending_bytes = 0;
        Ok(())
    }

    fn end_file(&mut self, session: &Session) -> Result<()> {
        let Some(Open { path, writer, .. }) = self.open.take() else { return Ok(()) };
        let file = writer
            .into_inner()
            .and_then(|file| Ok(file.0.into_inner().map_err(IntoInnerError::into_error)?));
        session.end_file(file.with_context(|| cannot_write(&path))?)
    }
}

#[cfg(test)]
mod tests {
    use hums_link::{Check, Frame};
    use parquet::file::metadata::RowGroupMetaData;
    use parquet::file::reader::{FileReader as _, SerializedFileReader};
    use parquet::record::RowAccessor as _;

    use super::*;
    use crate::files::Inputs;
    use crate::fleet::Fleet;
    use crate::format::Entry;
    use crate::mavlink::values::Payload;

    #[test]
    fn a_session_of_many_row_groups_goes_on_in_further_files_and_no_row_is_lost() {
        let dir = tempfile::tempdir().expect("a directory");
        let decode = |limits, name: &str| {
            let context = Context {
                fleet: Some(Arc::new(Fleet::new(dir.path(), None))),
                inputs: Arc::new(Inputs::none().forcing(true)),
                identity: Identity {
                    vehicle: "uid-1".to_owned(),
                    recording: name.to_owned(),
                    ..Identity::default()
                },
                ..Context::default()
            };
            let session = Session::begin(&context).expect("a session");
            let mut tables = Parquet::new(session, &context.identity);
            tables.limits = limits;
            for second in 0..2000_u32 {
                let mut batches = Batches::default();
                for id in [0_u8, 30] {
                    let bytes = [0xfe, 0, 0, 1, 1, id, 0, 0];
                    let frame = Frame::again(&bytes, Check::Unverified).expect("a frame");
                    let message = hums_dialect::message(id.into());
                    let payload = message.map(|message| Payload::new(message, &[0x5a; 255]));
                    let at = Instant::from_millis(u64::from(second) * 1000);
                    let entry = Entry { at, utc_us: None, frame: &frame, known: payload.as_ref() };
                    batches.frame(&context, &entry);
                }
                tables.put(batches).expect("put");
            }
            let (session, count) = tables.end().expect("ended");
            assert_eq!(count, 2);
            let paths: Vec<PathBuf> = (1..100).map(|part| session.path("ATTITUDE", part)).collect();
            let Ended::Alone(made) = session.finish(&context, 4000).expect("finish") else { panic!("alone") };
            let mut seconds = Vec::new();
            let files: Vec<PathBuf> = paths.into_iter().take_while(|path| path.exists()).collect();
            assert!(files.iter().all(|path| made.contains(path)) && made.iter().all(|path| path.exists()));
            for path in &files {
                let file = File::open(path).expect("a file");
                let reader = SerializedFileReader::new(file).expect("a Parquet file");
                let mut columns = reader.metadata().row_groups().iter().flat_map(RowGroupMetaData::columns);
                let has_all = columns.all(|column| column.statistics().is_some());
                assert!(
                    has_all || Some(path) == files.last().filter(|_| files.len() > 1),
                    "{}",
                    path.display()
                );
                seconds.extend(reader.into_iter().map(|row| {
                    let row = row.expect("a row");
                    assert_eq!(row.get_string(1).expect("a session"), name);
                    let digits = row.get_decimal(2).expect("seconds").data();
                    i64::from_be_bytes(digits.try_into().expect("eight bytes"))
                }));
            }
            assert!(seconds.iter().copied().eq((0..2000).map(|second| second * 1_000_000)), "{seconds:?}");
            files.len()
        };
        // The whole in fewer row groups has fewer bytes: it is written first.
        assert_eq!(decode(LIMITS, "s00000001-000000000000000000000000"), 1);
        let few = Limits { pending_bytes: 20_000, open_bytes: 80_000 };
        let few = decode(few, "s00000002-000000000000000000000000");
        assert!(few > 3, "{few}");
    }
}
