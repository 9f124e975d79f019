//! Typed columns for the tools that read a whole fleet as one table: `DuckDB`, Spark, `DataFusion`, pandas.
//!
//! ```text
//! OUT/vehicle=uid-0031002a3035510a/date=2026-11-21/session=s1a2b3c4d/ATTITUDE.parquet
//! ```
//! One file for each message type and for each table of the monitor's own, below what is known of the session: these
//! tools read `vehicle`, `date` and `session` as columns. Columns keep the type that was sent (arrays are lists, `char`
//! arrays text); the fields' metadata has their `units` and `enum`. Each table begins with `boot_s`, seconds since the
//! monitor's power-on, and `utc`, null where nobody told it; those of frames go on with `system` and `component`.
//!
//! Memory is bounded: rows wait as plain columns, 20 MiB in all; then the tables with the most become row groups
//! and are written out. So no encoder is open longer than for one row group, which costs far more than the rows in it.
//! What a file says of its row groups stands at its end and waits until then: a session of days goes on in
//! `ATTITUDE.2.parquet`.

use std::cmp::Reverse;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use arrow_array::{ArrayRef, Float64Array, RecordBatch, TimestampMicrosecondArray, UInt8Array, UInt32Array};
use arrow_schema::{DataType, Field, Schema, SchemaRef, TimeUnit};
use arrow_select::concat::concat_batches;
use hums_core::time::Instant;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::metadata::{KeyValue, RowGroupMetaData};
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesBuilder};
use rayon::prelude::*;

use super::columns::{Column, TextColumn, cell_array, cell_data_type};
use super::field_names::free_name;
use super::row::Row;
use super::table::Table;
use crate::files::{Folder, FolderFile, cannot_write};
use crate::mavlink::frame::Frame;
use crate::mavlink::values::Payload;

/// What is held at most: some 55 MiB with all that reading takes.
const LIMITS: Limits = Limits { pending_bytes: 20 << 20, chunks: 8_000 };
/// Batches of a table that wait, before they are made one: each array of a batch takes some 200 bytes besides its values.
const BATCHES_MAX: usize = 16;
/// Rows of a row group at most: what engines like to read at once.
const GROUP_ROWS: usize = 128 * 1024;
/// Bytes of a page and of a column's dictionary at most.
const PAGE_BYTES: usize = 32 * 1024;

/// Names that every table has: its own first columns, and those that its place among the directories adds.
const TAKEN: [&str; 5] = ["boot_s", "utc", "vehicle", "date", "session"];
/// Names that tables of frames have: those, and who sent the frame.
pub(super) const TAKEN_FRAMES: [&str; 7] =
    ["boot_s", "utc", "vehicle", "date", "session", "system", "component"];

/// One group's entries as columns.
#[derive(Debug, Default)]
pub struct Batches {
    frames: BTreeMap<Table, FrameColumns>,
    rows: BTreeMap<&'static str, RowColumns>,
    held_bytes: usize,
}

/// What a table takes without a row, and a row besides the values of its message: its times, its sender.
const TABLE_BYTES: usize = 4_096;
const ROW_BYTES: usize = 32;
/// What an offset or a length takes, for each field.
const FIELD_BYTES: usize = 4;
/// What a cell of the monitor's own takes, its text on the heap included.
const CELL_BYTES: usize = 96;

/// The columns of frames of one type.
#[derive(Debug)]
struct FrameColumns {
    times: Times,
    system: Vec<u8>,
    component: Vec<u8>,
    fields: Vec<Column>,
    /// Where the definition is not ours.
    opaque: Option<Opaque>,
}

/// Frames as they came. All ids are in one table: there are 16 million of them, and files are few.
#[derive(Debug, Default)]
struct Opaque {
    ids: Vec<u32>,
    sequences: Vec<u8>,
    /// Payloads as hexadecimal digits.
    payloads: TextColumn,
}

/// The table of a frame: one for all ids without a definition of ours, and one for those made with another.
fn table_of(frame: &Frame<'_>, known: bool) -> Table {
    match Table::of(frame, known) {
        Table::Unknown(_) => Table::Hums("UNKNOWN"),
        Table::Unverified(_) => Table::Hums("UNVERIFIED"),
        table => table,
    }
}

#[derive(Debug, Default)]
struct Times {
    boot_s: Vec<f64>,
    utc_us: Vec<Option<i64>>,
}

impl Times {
    fn push(&mut self, at: Instant, epoch_us: Option<u64>) {
        self.boot_s.push(at.as_secs_f64());
        let utc = epoch_us.and_then(|epoch| i64::try_from(epoch.saturating_add(at.as_micros())).ok());
        self.utc_us.push(utc);
    }

    fn arrays(self) -> Vec<ArrayRef> {
        let utc = TimestampMicrosecondArray::from(self.utc_us).with_timezone("UTC");
        vec![Arc::new(Float64Array::from(self.boot_s)), Arc::new(utc)]
    }

    fn fields() -> Vec<Field> {
        let utc = DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into()));
        vec![
            with_units(Field::new("boot_s", DataType::Float64, false), "s", ""),
            Field::new("utc", utc, true),
        ]
    }
}

/// Rows of one table of the monitor's own.
#[derive(Debug, Default)]
struct RowColumns {
    times: Times,
    rows: Vec<Row>,
}

impl Batches {
    /// Adds a frame.
    pub fn frame(&mut self, at: Instant, epoch_us: Option<u64>, frame: &Frame<'_>, known: Option<&Payload>) {
        let table = table_of(frame, known.is_some());
        let columns = self.frames.entry(table).or_insert_with(|| {
            self.held_bytes += TABLE_BYTES;
            FrameColumns::new(frame, known.is_some())
        });
        // A payload is sent without the zeros at its end; opaque ones are digits.
        let sent =
            known.and(frame.message()).map_or(2 * frame.payload.len(), |message| message.len_max.into());
        self.held_bytes += ROW_BYTES + FIELD_BYTES * columns.fields.len() + sent;
        columns.times.push(at, epoch_us);
        columns.system.push(frame.system);
        columns.component.push(frame.component);
        if let Some(payload) = known {
            for (column, (_, value)) in columns.fields.iter_mut().zip(payload.fields()) {
                column.push(value);
            }
        }
        if let Some(opaque) = &mut columns.opaque {
            opaque.ids.push(frame.id);
            opaque.sequences.push(frame.sequence);
            let mut digits = Vec::new();
            crate::hex::push_hex(&mut digits, frame.payload);
            opaque.payloads.push(&digits);
        }
    }

    /// Adds a row of the monitor's own.
    pub fn row(&mut self, at: Instant, epoch_us: Option<u64>, row: &Row) {
        let columns = self.rows.entry(row.table).or_default();
        self.held_bytes += ROW_BYTES + CELL_BYTES * (1 + row.cells.len());
        columns.times.push(at, epoch_us);
        columns.rows.push(row.clone());
    }

    /// Bytes of memory that it holds, roughly.
    pub fn held_bytes(&self) -> usize {
        self.held_bytes
    }

    /// Each table's rows.
    fn finish(self) -> impl Iterator<Item = (Table, Result<RecordBatch>)> {
        let frames = self.frames.into_iter().map(|(table, columns)| (table, columns.batch(table)));
        let rows = self.rows.into_iter().map(|(name, columns)| (Table::Hums(name), columns.batch()));
        frames.chain(rows)
    }
}

impl FrameColumns {
    fn new(frame: &Frame<'_>, known: bool) -> Self {
        let fields = frame.message().filter(|_| known).map(|message| message.fields).unwrap_or_default();
        Self {
            times: Times::default(),
            system: Vec::new(),
            component: Vec::new(),
            fields: fields.iter().map(Column::of).collect(),
            opaque: (!known).then(Default::default),
        }
    }

    fn batch(self, table: Table) -> Result<RecordBatch> {
        let mut arrays = self.times.arrays();
        arrays.push(Arc::new(UInt8Array::from(self.system)));
        arrays.push(Arc::new(UInt8Array::from(self.component)));
        arrays.extend(self.fields.into_iter().map(Column::array));
        if let Some(opaque) = self.opaque {
            arrays.push(Arc::new(UInt32Array::from(opaque.ids)));
            arrays.push(Arc::new(UInt8Array::from(opaque.sequences)));
            arrays.push(opaque.payloads.array());
        }
        Ok(RecordBatch::try_new(frame_schema(table), arrays)?)
    }
}

/// The columns of a table of frames.
fn frame_schema(table: Table) -> SchemaRef {
    let mut fields = Times::fields();
    let byte = |name| Field::new(name, DataType::UInt8, false);
    fields.extend([byte("system"), byte("component")]);
    if let Table::Message(id) = table {
        for field in hums_dialect::message(id).map(|message| message.fields).unwrap_or_default() {
            let arrow =
                Field::new(free_name(field.name, &TAKEN_FRAMES), Column::of(field).data_type(), false);
            fields.push(with_units(arrow, field.units, field.enumeration));
        }
    } else {
        let id = Field::new("id", DataType::UInt32, false);
        fields.extend([id, byte("sequence"), Field::new("payload", DataType::Utf8, false)]);
    }
    Arc::new(Schema::new(fields))
}

fn with_units(field: Field, units: &str, enumeration: &str) -> Field {
    let known = [("units", units), ("enum", enumeration)];
    let metadata: HashMap<String, String> = known
        .into_iter()
        .filter(|(_, value)| !value.is_empty())
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
        .collect();
    field.with_metadata(metadata)
}

impl RowColumns {
    fn batch(self) -> Result<RecordBatch> {
        let mut fields = Times::fields();
        let mut arrays = self.times.arrays();
        let first = self.rows.first().map(|row| row.cells.as_slice()).unwrap_or_default();
        for (place, (name, cell)) in first.iter().enumerate() {
            let data_type = cell_data_type(name, cell.cell_type());
            // `at[s]` as a name would need quoting in every query.
            let (plain, units) =
                name.strip_suffix(']').and_then(|name| name.rsplit_once('[')).unwrap_or((name, ""));
            // An element of an array: `q[0]`.
            let (plain, units) = if units.parse::<u32>().is_ok() { (*name, "") } else { (plain, units) };
            let plain = if units.is_empty() { plain.to_owned() } else { format!("{plain}_{units}") };
            let plain = plain.replace('%', "percent");
            let cells = self.rows.iter().map(|row| row.cells.get(place).map(|(_, cell)| cell));
            arrays.push(cell_array(&data_type, cells));
            fields.push(with_units(Field::new(free_name(&plain, &TAKEN), data_type, true), units, ""));
        }
        Ok(RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)?)
    }
}

/// What the tables of one session hold at most, all together.
#[derive(Clone, Copy)]
struct Limits {
    /// Bytes of columns that wait to be encoded.
    pending_bytes: usize,
    /// Columns of row groups written, of files that are open: each takes some 800 bytes until its file's end.
    chunks: usize,
}

/// The tables of one session, open.
pub struct ParquetTables {
    folder: Folder,
    limits: Limits,
    properties: WriterPropertiesBuilder,
    /// The file of each table that is open.
    tables: BTreeMap<Table, TableFile>,
    /// Files of each table so far.
    parts: BTreeMap<Table, u32>,
}

struct TableFile {
    path: PathBuf,
    writer: ArrowWriter<FolderFile>,
    pending: Vec<RecordBatch>,
    pending_bytes: usize,
    /// Columns of the row groups written.
    chunks: usize,
}

impl ParquetTables {
    /// Tables in a folder; `about` goes into each file's metadata.
    pub fn new(folder: Folder, about: &[(&str, String)]) -> Self {
        let about =
            about.iter().map(|(name, value)| KeyValue::new((*name).to_owned(), value.clone())).collect();
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_max_row_group_row_count(Some(GROUP_ROWS))
            .set_data_page_size_limit(PAGE_BYTES)
            .set_dictionary_page_size_limit(PAGE_BYTES)
            .set_dictionary_enabled(false)
            // What there is to know of each page would be kept until the file's end.
            .set_statistics_enabled(EnabledStatistics::Chunk)
            .set_offset_index_disabled(true)
            .set_created_by(concat!("hums ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_key_value_metadata(Some(about));
        Self { folder, limits: LIMITS, properties, tables: BTreeMap::new(), parts: BTreeMap::new() }
    }

    /// Takes a group's columns.
    pub fn put(&mut self, batches: Batches) -> Result<()> {
        for (table, batch) in batches.finish() {
            let batch = batch.with_context(|| format!("{}: its columns do not fit", table.name()))?;
            let file = match self.tables.entry(table) {
                Entry::Occupied(file) => file.into_mut(),
                Entry::Vacant(place) => {
                    let part = self.parts.entry(table).or_default();
                    *part += 1;
                    let name = file_name(table, *part);
                    let file = TableFile::begin(&self.folder, &name, &batch.schema(), &self.properties);
                    place.insert(file?)
                }
            };
            file.push(batch)?;
        }
        let pending_bytes = self.tables.values().map(|file| file.pending_bytes).sum();
        if pending_bytes > self.limits.pending_bytes {
            self.write_largest(pending_bytes)?;
            self.close_longest()?;
        }
        Ok(())
    }

    /// Makes room: half of what waits, in as few row groups as can be.
    fn write_largest(&mut self, pending_bytes: usize) -> Result<()> {
        let mut files: Vec<&mut TableFile> = self.tables.values_mut().collect();
        files.sort_unstable_by_key(|file| Reverse(file.pending_bytes));
        let mut chosen_bytes = 0;
        let chosen = files.iter().position(|file| {
            chosen_bytes += file.pending_bytes;
            chosen_bytes >= pending_bytes / 2
        });
        files.truncate(chosen.map_or(files.len(), |last| last + 1));
        files.par_iter_mut().try_for_each(|file| file.write_group())
    }

    /// Ends the files with the most row groups, if there are too many: their tables go on in further ones.
    fn close_longest(&mut self) -> Result<()> {
        while self.tables.values().map(|file| file.chunks).sum::<usize>() > self.limits.chunks
            && let Some((&table, _)) = self.tables.iter().max_by_key(|(_, file)| file.chunks)
            && let Some(file) = self.tables.remove(&table)
        {
            file.close()?;
        }
        Ok(())
    }

    /// Writes what is still held, and each file's end: the folder gets its name. Gives it and how many tables there are.
    pub fn finish(mut self) -> Result<(PathBuf, usize)> {
        let tables = self.parts.len();
        std::mem::take(&mut self.tables).into_par_iter().try_for_each(|(_, file)| file.close())?;
        let path = self.folder.path().to_owned();
        self.folder.finish()?;
        Ok((path, tables))
    }
}

/// The name of a table's `part`th file, from 1: `ATTITUDE.*parquet` is all of them.
fn file_name(table: Table, part: u32) -> String {
    match part {
        ..=1 => format!("{}.parquet", table.name()),
        part => format!("{}.{part}.parquet", table.name()),
    }
}

impl TableFile {
    fn begin(
        folder: &Folder,
        name: &str,
        schema: &SchemaRef,
        properties: &WriterPropertiesBuilder,
    ) -> Result<Self> {
        let path = folder.path().join(name);
        // A dictionary takes 73 kB of each column, and files of numbers are a sixth smaller without; texts gain by it.
        let texts = schema.fields().iter().filter(|field| *field.data_type() == DataType::Utf8);
        let properties = texts.fold(properties.clone(), |properties, field| {
            properties.set_column_dictionary_enabled(vec![field.name().clone()].into(), true)
        });
        let writer = ArrowWriter::try_new(folder.file(name)?, schema.clone(), Some(properties.build()))
            .with_context(|| cannot_write(&path))?;
        Ok(Self { path, writer, pending: Vec::new(), pending_bytes: 0, chunks: 0 })
    }

    fn push(&mut self, batch: RecordBatch) -> Result<()> {
        self.pending_bytes += batch.get_array_memory_size();
        self.pending.push(batch);
        // Those made one before stay apart, so that no row is copied again and again.
        let small = self.pending.iter().rev().take_while(|batch| batch.num_rows() < GROUP_ROWS / 64).count();
        if small >= BATCHES_MAX {
            let few = self.pending.split_off(self.pending.len() - small);
            self.pending.push(concat_batches(&few[0].schema(), &few)?);
            self.pending_bytes = self.pending.iter().map(RecordBatch::get_array_memory_size).sum();
        }
        Ok(())
    }

    /// Writes what waits, as a row group.
    fn write_group(&mut self) -> Result<()> {
        self.pending_bytes = 0;
        for batch in self.pending.drain(..) {
            self.writer.write(&batch).with_context(|| cannot_write(&self.path))?;
        }
        self.writer.flush().with_context(|| cannot_write(&self.path))?;
        self.chunks = self.writer.flushed_row_groups().iter().map(RowGroupMetaData::num_columns).sum();
        Ok(())
    }

    fn close(mut self) -> Result<()> {
        self.write_group()?;
        self.writer.close().map(|_| ()).with_context(|| cannot_write(&self.path))
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;

    use arrow_array::cast::AsArray as _;
    use arrow_array::types::Float64Type;
    use parquet::arrow::arrow_reader::ParquetRecordBatchReaderBuilder;

    use super::*;
    use crate::files::Inputs;

    #[test]
    fn no_message_has_two_columns_of_one_name() {
        for message in hums_dialect::messages() {
            let schema = frame_schema(Table::Message(message.id));
            let mut names: Vec<&str> = schema.fields().iter().map(|field| field.name().as_str()).collect();
            names.extend(["vehicle", "date", "session"]);
            let count = names.len();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), count, "{}", message.name);
        }
    }

    fn frame(id: u32) -> Frame<'static> {
        Frame { bytes: &[], id, sequence: 0, system: 1, component: 1, payload: &[0x5a; 255] }
    }

    #[test]
    fn a_session_of_many_row_groups_goes_on_in_further_files_and_no_row_is_lost() {
        let dir = tempfile::tempdir().expect("a directory");
        let decode = |limits| {
            let path = dir.path().join("session=s1");
            let inputs = Inputs::none().replacing(true);
            let folder = Folder::create(&path, &inputs, "a session").expect("a folder");
            let mut tables = ParquetTables::new(folder, &[]);
            tables.limits = limits;
            for second in 0..2000_u32 {
                let mut batches = Batches::default();
                for id in [0, 30] {
                    let frame = frame(id);
                    let payload = frame.message().map(|message| Payload::new(message, frame.payload));
                    batches.frame(
                        Instant::from_millis(u64::from(second) * 1000),
                        None,
                        &frame,
                        payload.as_ref(),
                    );
                }
                tables.put(batches).expect("put");
            }
            assert_eq!(tables.finish().expect("finish").1, 2);
            let mut seconds = Vec::new();
            let files = (1..).map(|part| path.join(file_name(Table::Message(30), part)));
            let files: Vec<PathBuf> = files.take_while(|path| path.exists()).collect();
            for path in &files {
                let file = File::open(path).expect("a file");
                let reader = ParquetRecordBatchReaderBuilder::try_new(file)
                    .and_then(ParquetRecordBatchReaderBuilder::build);
                for batch in reader.expect("a Parquet file") {
                    let batch = batch.expect("a batch");
                    seconds.extend_from_slice(batch.column(0).as_primitive::<Float64Type>().values());
                }
            }
            assert!(seconds.iter().copied().eq((0..2000_u32).map(f64::from)), "{seconds:?}");
            files.len()
        };
        // The whole in fewer row groups has fewer bytes: it is written first.
        assert_eq!(decode(LIMITS), 1);
        let few = decode(Limits { pending_bytes: 20_000, chunks: 100 });
        assert!(few > 3, "{few}");
    }

    #[test]
    fn every_message_makes_a_batch_of_its_schema() {
        for message in hums_dialect::messages() {
            let mut batches = Batches::default();
            let frame = frame(message.id);
            let payload = Payload::new(message, frame.payload);
            batches.frame(Instant::from_millis(5), Some(7), &frame, Some(&payload));
            batches.frame(Instant::from_millis(6), None, &frame, Some(&payload));
            let (_, batch) = batches.finish().next().expect("a table");
            let batch = batch.expect(message.name);
            assert_eq!(
                (batch.num_rows(), batch.num_columns()),
                (2, 4 + message.fields.len()),
                "{}",
                message.name
            );
        }
    }
}
