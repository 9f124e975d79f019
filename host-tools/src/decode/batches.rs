//! Frames and rows of one group as they wait for their Parquet tables: columns of what was sent, rows of cells.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use anyhow::Result;
use arrow_array::{ArrayRef, Float64Array, RecordBatch, TimestampMicrosecondArray, UInt8Array, UInt32Array};
use arrow_schema::{DataType, Field, Schema, SchemaRef, TimeUnit};
use hums_core::clock::Instant;

use super::columns::{Column, TextColumn};
use super::field_names::free_name;
use super::row::{Cell, Row};
use super::table::Table;
use crate::mavlink::frame::Frame;
use crate::mavlink::values::Payload;

/// Names that every table has: its own first columns, and those that its place among the directories adds.
pub(super) const TAKEN: [&str; 5] = ["boot_s", "utc", "vehicle", "date", "session"];
/// Names that tables of frames have: those, and who sent the frame.
pub(super) const TAKEN_FRAMES: [&str; 7] =
    ["boot_s", "utc", "vehicle", "date", "session", "system", "component"];

/// One group's entries as columns.
#[derive(Debug, Default)]
pub struct Batches {
    frames: BTreeMap<Table, FrameColumns>,
    rows: BTreeMap<&'static str, Rows>,
    held_bytes: usize,
}

/// What a table takes without a row, and a row besides the values of its message: its times, its sender.
const TABLE_BYTES: usize = 4_096;
const ROW_BYTES: usize = 32;
/// What an offset or a length takes, for each field.
const FIELD_BYTES: usize = 4;
/// What a cell of a row takes, a short text on the heap included; a long one takes its length besides.
const CELL_BYTES: usize = 96;

/// The columns of frames of one type.
#[derive(Debug)]
pub struct FrameColumns {
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

/// When rows were: since power-on, and UTC.
#[derive(Debug, Default)]
pub struct Times {
    boot_s: Vec<f64>,
    utc_us: Vec<Option<i64>>,
}

impl Times {
    /// Adds one.
    pub fn push(&mut self, at: Instant, utc_us: Option<u64>) {
        self.boot_s.push(at.as_secs_f64());
        let utc = utc_us.and_then(|utc_us| i64::try_from(utc_us).ok());
        self.utc_us.push(utc);
    }

    /// Adds those that come next.
    pub fn append(&mut self, next: &mut Self) {
        self.boot_s.append(&mut next.boot_s);
        self.utc_us.append(&mut next.utc_us);
    }

    /// Bytes of memory that they take.
    pub fn held_bytes(&self) -> usize {
        size_of::<f64>() * self.boot_s.capacity() + size_of::<Option<i64>>() * self.utc_us.capacity()
    }

    /// The columns that every table begins with.
    pub fn arrays(self) -> Vec<ArrayRef> {
        let utc = TimestampMicrosecondArray::from(self.utc_us).with_timezone("UTC");
        vec![Arc::new(Float64Array::from(self.boot_s)), Arc::new(utc)]
    }

    /// What these columns are.
    pub fn fields() -> Vec<Field> {
        let utc = DataType::Timestamp(TimeUnit::Microsecond, Some("UTC".into()));
        vec![
            with_units(Field::new("boot_s", DataType::Float64, false), "s", ""),
            Field::new("utc", utc, true),
        ]
    }
}

/// Rows of one table of the monitor's own, or of an autopilot's log.
#[derive(Debug, Default)]
pub struct Rows {
    /// When they were.
    pub times: Times,
    /// What they say.
    pub rows: Vec<Row>,
}

impl Batches {
    /// Adds a frame.
    pub fn frame(&mut self, at: Instant, utc_us: Option<u64>, frame: &Frame<'_>, known: Option<&Payload>) {
        let table = table_of(frame, known.is_some());
        let columns = self.frames.entry(table).or_insert_with(|| {
            self.held_bytes += TABLE_BYTES;
            FrameColumns::new(frame, known.is_some())
        });
        // A payload is sent without the zeros at its end; opaque ones are digits.
        let sent =
            known.and(frame.message()).map_or(2 * frame.payload.len(), |message| message.len_max.into());
        self.held_bytes += ROW_BYTES + FIELD_BYTES * columns.fields.len() + sent;
        columns.times.push(at, utc_us);
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
    pub fn row(&mut self, at: Instant, utc_us: Option<u64>, row: &Row) {
        let columns = self.rows.entry(row.table).or_default();
        let texts = row.cells.iter().map(|(_, cell)| match cell {
            Cell::Text(text) | Cell::Words(text, _) => text.len(),
            Cell::Hex(bytes) => bytes.len(),
            _ => 0,
        });
        self.held_bytes += ROW_BYTES + CELL_BYTES * (1 + row.cells.len()) + texts.sum::<usize>();
        columns.times.push(at, utc_us);
        columns.rows.push(row.clone());
    }

    /// Bytes of memory that it holds, roughly.
    pub fn held_bytes(&self) -> usize {
        self.held_bytes
    }

    /// The frames and the rows of each table.
    pub fn parts(self) -> (BTreeMap<Table, FrameColumns>, BTreeMap<&'static str, Rows>) {
        (self.frames, self.rows)
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

    /// As arrays of this schema.
    pub fn batch(self, schema: &SchemaRef) -> Result<RecordBatch> {
        let mut arrays = self.times.arrays();
        arrays.push(Arc::new(UInt8Array::from(self.system)));
        arrays.push(Arc::new(UInt8Array::from(self.component)));
        arrays.extend(self.fields.into_iter().map(Column::array));
        if let Some(opaque) = self.opaque {
            arrays.push(Arc::new(UInt32Array::from(opaque.ids)));
            arrays.push(Arc::new(UInt8Array::from(opaque.sequences)));
            arrays.push(opaque.payloads.array());
        }
        Ok(RecordBatch::try_new(Arc::clone(schema), arrays)?)
    }
}

/// The columns of a table of frames.
pub fn frame_schema(table: Table) -> SchemaRef {
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

/// A column with its unit and its enumeration, where it has any.
pub fn with_units(field: Field, units: &str, enumeration: &str) -> Field {
    let known = [("units", units), ("enum", enumeration)];
    let metadata: HashMap<String, String> = known
        .into_iter()
        .filter(|(_, value)| !value.is_empty())
        .map(|(name, value)| (name.to_owned(), value.to_owned()))
        .collect();
    field.with_metadata(metadata)
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn every_message_makes_a_batch_of_its_schema() {
        for message in hums_dialect::messages() {
            let mut batches = Batches::default();
            let frame = Frame {
                bytes: &[],
                id: message.id,
                sequence: 0,
                system: 1,
                component: 1,
                payload: &[0x5a; 255],
            };
            let payload = Payload::new(message, frame.payload);
            batches.frame(Instant::from_millis(5), Some(7), &frame, Some(&payload));
            batches.frame(Instant::from_millis(6), None, &frame, Some(&payload));
            let (table, columns) = batches.parts().0.pop_first().expect("a table");
            let batch = columns.batch(&frame_schema(table)).expect(message.name);
            assert_eq!(
                (batch.num_rows(), batch.num_columns()),
                (2, 4 + message.fields.len()),
                "{}",
                message.name
            );
        }
    }
}
