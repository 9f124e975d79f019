//! The columns of a Parquet table, gathered until they are written as a row group. Columns of frames have the sent
//! types, columns of rows those of the first row's cells. A row takes the bytes of its values, so thousands of
//! small tables take no more than a few large ones.

use hums_core::clock::Instant;
use hums_dialect::Kind as Sent;
use hums_link::Frame;
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::errors::Result;
use parquet::file::writer::SerializedColumnWriter;
use parquet::schema::types::Type;

use crate::field_names::free_name;
use crate::hex::hex;
use crate::mavlink::values::{FieldValue, Payload, Scalar};
use crate::row::{Cell, Row, plain_name};
use crate::source::item::ColumnType;
use crate::table::Table;

/// The first two columns of every table: the vehicle, and the unique name of the recording.
pub(super) const NAMES: [&str; 2] = ["vehicle", "session"];
/// Names that every table has: its own first columns, and those that its place among the directories adds.
const TAKEN: [&str; 6] = ["boot_s", "utc", "vehicle", "date", "session", "bucket"];
pub(crate) const TAKEN_FRAMES: [&str; 8] =
    ["boot_s", "utc", "vehicle", "date", "session", "bucket", "system", "component"];
/// Digits of seconds, and those behind the point.
const SECONDS_PRECISION: i32 = 18;
const SECONDS_SCALE: i32 = 6;
/// Texts that are handed to the encoder at once: each takes some 40 bytes there.
const TEXTS_AT_ONCE: usize = 1024;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Unsigned(i8),
    Signed(i8),
    Single,
    Double,
    Flag,
    Text,
    /// Microseconds of UTC.
    Utc,
    /// Seconds as a decimal number with six decimals: a sixth of the bytes that a binary fraction takes.
    Seconds,
}

impl Kind {
    fn of_field(sent: Sent) -> Self {
        match sent {
            Sent::U8 => Self::Unsigned(8),
            Sent::U16 => Self::Unsigned(16),
            Sent::U32 => Self::Unsigned(32),
            Sent::U64 => Self::Unsigned(64),
            Sent::I8 => Self::Signed(8),
            Sent::I16 => Self::Signed(16),
            Sent::I32 => Self::Signed(32),
            Sent::I64 => Self::Signed(64),
            Sent::F32 => Self::Single,
            Sent::F64 => Self::Double,
            Sent::Char => Self::Text,
        }
    }

    /// A column `value` holds quantities, whole ones too; `end_utc` is microseconds since 1970.
    fn of_cell(name: &str, cell: ColumnType) -> Self {
        match cell {
            ColumnType::Unsigned if name == "value" => Self::Double,
            ColumnType::Unsigned if name == "end_utc" => Self::Utc,
            ColumnType::Unsigned => Self::Unsigned(64),
            ColumnType::Signed => Self::Signed(64),
            ColumnType::Single => Self::Single,
            ColumnType::Double => Self::Double,
            ColumnType::Flag => Self::Flag,
            ColumnType::Text | ColumnType::Bytes => Self::Text,
        }
    }

    fn values(self) -> Values {
        match self {
            Self::Unsigned(64) | Self::Signed(64) | Self::Utc | Self::Seconds => Values::Longs(Vec::new()),
            Self::Unsigned(_) | Self::Signed(_) => Values::Integers(Vec::new()),
            Self::Single => Values::Singles(Vec::new()),
            Self::Double => Values::Doubles(Vec::new()),
            Self::Flag => Values::Flags(Vec::new()),
            Self::Text => Values::Texts(Texts::default()),
        }
    }

    fn logical_type(self) -> Option<LogicalType> {
        match self {
            // Parquet's own types.
            Self::Signed(32 | 64) | Self::Single | Self::Double | Self::Flag => None,
            Self::Signed(bits) => Some(LogicalType::integer(bits, true)),
            Self::Unsigned(bits) => Some(LogicalType::integer(bits, false)),
            Self::Text => Some(LogicalType::String),
            Self::Utc => Some(LogicalType::timestamp(true, TimeUnit::MICROS)),
            Self::Seconds => Some(LogicalType::decimal(SECONDS_SCALE, SECONDS_PRECISION)),
        }
    }
}

#[derive(Debug)]
enum Values {
    Flags(Vec<bool>),
    Integers(Vec<i32>),
    Longs(Vec<i64>),
    Singles(Vec<f32>),
    Doubles(Vec<f64>),
    Texts(Texts),
}

impl Values {
    fn count(&self) -> usize {
        match self {
            Self::Flags(values) => values.len(),
            Self::Integers(values) => values.len(),
            Self::Longs(values) => values.len(),
            Self::Singles(values) => values.len(),
            Self::Doubles(values) => values.len(),
            Self::Texts(values) => values.ends.len(),
        }
    }
}

#[derive(Debug, Default)]
struct Texts {
    text: String,
    ends: Vec<usize>,
}

impl Texts {
    fn push(&mut self, text: &str) {
        self.text.push_str(text);
        self.ends.push(self.text.len());
    }

    fn append(&mut self, next: &mut Self) {
        let begin = self.text.len();
        self.text.push_str(&std::mem::take(&mut next.text));
        self.ends.extend(next.ends.drain(..).map(|end| begin + end));
    }

    fn some(&self, from: usize, count: usize) -> Vec<ByteArray> {
        let begins = std::iter::once(0).chain(self.ends.iter().copied());
        let texts = begins.zip(&self.ends).skip(from).take(count);
        texts.map(|(begin, end)| ByteArray::from(self.text.get(begin..*end).unwrap_or_default())).collect()
    }
}

#[derive(Debug)]
pub(super) struct Column {
    name: String,
    kind: Kind,
    units: &'static str,
    enumeration: &'static str,
    length: usize,
    is_optional: bool,
    /// Those that are there.
    values: Values,
    /// Of an optional column for each row: 1 if its value is there, otherwise 0.
    levels: Vec<i16>,
}

impl Column {
    fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self {
            name: name.into(),
            kind,
            units: "",
            enumeration: "",
            length: 0,
            is_optional: false,
            values: kind.values(),
            levels: Vec::new(),
        }
    }

    fn optional(self) -> Self {
        Self { is_optional: true, ..self }
    }

    fn of_field(field: &hums_dialect::Field) -> Self {
        let length = if field.kind == Sent::Char { 0 } else { usize::from(field.array) };
        let (units, enumeration) = (field.units, field.enumeration);
        let name = free_name(field.name, &TAKEN_FRAMES);
        Self { units, enumeration, length, ..Self::new(name, Kind::of_field(field.kind)) }
    }

    fn of_cell(name: &'static str, cell: ColumnType) -> Self {
        let kind = Kind::of_cell(name, cell);
        let (plain, units) = plain_name(name);
        Self { units, ..Self::new(free_name(&plain, &TAKEN), kind).optional() }
    }

    pub(super) fn about(&self) -> impl Iterator<Item = (String, &'static str)> {
        let known = [("units", self.units), ("enum", self.enumeration)];
        let name = &self.name;
        known
            .into_iter()
            .filter(|(_, value)| !value.is_empty())
            .map(move |(what, value)| (format!("{what}.{name}"), value))
    }

    pub(super) fn text_name(&self) -> Option<&str> {
        (self.kind == Kind::Text).then_some(self.name.as_str())
    }

    /// As Parquet's schema has it; a list has a group round its elements.
    pub(super) fn parquet_type(&self) -> Result<Type> {
        let physical = match self.values {
            Values::Flags(_) => Physical::BOOLEAN,
            Values::Integers(_) => Physical::INT32,
            Values::Longs(_) => Physical::INT64,
            Values::Singles(_) => Physical::FLOAT,
            Values::Doubles(_) => Physical::DOUBLE,
            Values::Texts(_) => Physical::BYTE_ARRAY,
        };
        let plain = |name, repetition| {
            let plain = Type::primitive_type_builder(name, physical).with_repetition(repetition);
            let (precision, scale) =
                if self.kind == Kind::Seconds { (SECONDS_PRECISION, SECONDS_SCALE) } else { (-1, -1) };
            let plain = plain.with_precision(precision).with_scale(scale);
            plain.with_logical_type(self.kind.logical_type()).build()
        };
        if self.length == 0 {
            let repetition = if self.is_optional { Repetition::OPTIONAL } else { Repetition::REQUIRED };
            return plain(&self.name, repetition);
        }
        let elements = Type::group_type_builder("list")
            .with_repetition(Repetition::REPEATED)
            .with_fields(vec![plain("element", Repetition::REQUIRED)?.into()])
            .build()?;
        Type::group_type_builder(&self.name)
            .with_repetition(Repetition::REQUIRED)
            .with_logical_type(Some(LogicalType::List))
            .with_fields(vec![elements.into()])
            .build()
    }

    fn push_value(&mut self, value: FieldValue<'_>) {
        match value {
            // Invalid UTF-8 gets replacement characters.
            FieldValue::Text(text) => self.push_text(&String::from_utf8_lossy(text)),
            FieldValue::Scalar(scalar) => self.push_scalar(scalar),
            FieldValue::Array(array) => array.iter().for_each(|scalar| self.push_scalar(scalar)),
        }
    }

    fn push_cell(&mut self, cell: Option<&Cell>) {
        let scalar = match (self.kind, cell) {
            (Kind::Text, Some(Cell::Text(text))) => return self.push_text(text),
            (Kind::Text, Some(Cell::Hex(bytes))) => return self.push_text(&hex(bytes)),
            (Kind::Unsigned(_) | Kind::Utc, Some(Cell::Number(number @ Scalar::Unsigned(_))))
            | (Kind::Signed(_), Some(Cell::Number(number @ Scalar::Signed(_))))
            | (Kind::Single, Some(Cell::Number(number @ Scalar::Single(_)))) => Some(*number),
            (Kind::Double, Some(Cell::Number(number))) => Some(Scalar::Double(number.as_f64())),
            (Kind::Double, Some(Cell::Time(at))) => Some(Scalar::Double(at.as_secs_f64())),
            (Kind::Flag, Some(Cell::Flag(value))) => Some(Scalar::Unsigned(u64::from(*value))),
            _ => None,
        };
        match scalar {
            Some(scalar) => self.push_scalar(scalar),
            None => self.levels.push(0),
        }
    }

    fn push_scalar(&mut self, scalar: Scalar) {
        if self.is_optional {
            self.levels.push(1);
        }
        match (&mut self.values, scalar) {
            (Values::Flags(column), Scalar::Unsigned(value)) => column.push(value > 0),
            // Parquet keeps unsigned integers as the signed ones of the same bits.
            (Values::Integers(column), Scalar::Unsigned(value)) => column.push(value as i32),
            (Values::Integers(column), Scalar::Signed(value)) => column.push(value as i32),
            (Values::Longs(column), Scalar::Unsigned(value)) => column.push(value as i64),
            (Values::Longs(column), Scalar::Signed(value)) => column.push(value),
            (Values::Singles(column), Scalar::Single(value)) => column.push(value),
            (Values::Doubles(column), Scalar::Double(value)) => column.push(value),
            // The reader of payloads gives each kind its own type; a test checks that.
            _ => {}
        }
    }

    fn push_text(&mut self, text: &str) {
        if self.is_optional {
            self.levels.push(1);
        }
        if let Values::Texts(column) = &mut self.values {
            column.push(text);
        }
    }

    fn append(&mut self, next: &mut Self) {
        self.levels.append(&mut next.levels);
        match (&mut self.values, &mut next.values) {
            (Values::Flags(column), Values::Flags(next)) => column.append(next),
            (Values::Integers(column), Values::Integers(next)) => column.append(next),
            (Values::Longs(column), Values::Longs(next)) => column.append(next),
            (Values::Singles(column), Values::Singles(next)) => column.append(next),
            (Values::Doubles(column), Values::Doubles(next)) => column.append(next),
            (Values::Texts(column), Values::Texts(next)) => column.append(next),
            _ => {}
        }
    }

    fn held_bytes(&self) -> usize {
        let values = match &self.values {
            Values::Flags(values) => values.capacity(),
            Values::Integers(values) => 4 * values.capacity(),
            Values::Longs(values) => 8 * values.capacity(),
            Values::Singles(values) => 4 * values.capacity(),
            Values::Doubles(values) => 8 * values.capacity(),
            Values::Texts(values) => values.text.capacity() + size_of::<usize>() * values.ends.capacity(),
        };
        size_of::<Self>() + values + size_of::<i16>() * self.levels.capacity()
    }

    pub(super) fn write(&self, writer: &mut SerializedColumnWriter<'_>) -> Result<()> {
        let values = self.values.count();
        // The first element of a list begins a row; lists have no gaps.
        let begins: Vec<i16> = match self.length {
            0 => Vec::new(),
            length => (0..values).map(|at| i16::from(at % length > 0)).collect(),
        };
        let all = vec![1; begins.len()];
        let (levels, begins) = match (self.is_optional, self.length) {
            (true, _) => (Some(self.levels.as_slice()), None),
            (false, 0) => (None, None),
            (false, _) => (Some(all.as_slice()), Some(begins.as_slice())),
        };
        match &self.values {
            Values::Flags(values) => writer.typed::<BoolType>().write_batch(values, levels, begins)?,
            Values::Integers(values) => writer.typed::<Int32Type>().write_batch(values, levels, begins)?,
            Values::Longs(values) => writer.typed::<Int64Type>().write_batch(values, levels, begins)?,
            Values::Singles(values) => writer.typed::<FloatType>().write_batch(values, levels, begins)?,
            Values::Doubles(values) => writer.typed::<DoubleType>().write_batch(values, levels, begins)?,
            Values::Texts(texts) => {
                let writer = writer.typed::<ByteArrayType>();
                let (mut from, all) = (0, vec![1; if levels.is_some() { 0 } else { values }]);
                for some in levels.unwrap_or(&all).chunks(TEXTS_AT_ONCE) {
                    let count = some.iter().filter(|level| **level > 0).count();
                    writer.write_batch(&texts.some(from, count), levels.map(|_| some), None)?;
                    from += count;
                }
                from
            }
        };
        Ok(())
    }
}

pub(super) fn name_type(name: &str) -> Result<Type> {
    let text = Type::primitive_type_builder(name, Physical::BYTE_ARRAY).with_repetition(Repetition::REQUIRED);
    text.with_logical_type(Some(LogicalType::String)).build()
}

pub(super) fn write_name(
    writer: &mut SerializedColumnWriter<'_>,
    name: &ByteArray,
    rows: usize,
) -> Result<()> {
    let names = vec![name.clone(); rows.min(TEXTS_AT_ONCE)];
    let writer = writer.typed::<ByteArrayType>();
    for begin in (0..rows).step_by(TEXTS_AT_ONCE) {
        let some = names.get(..names.len().min(rows - begin)).unwrap_or_default();
        writer.write_batch(some, None, None)?;
    }
    Ok(())
}

#[derive(Debug)]
pub(crate) struct TableRows {
    columns: Vec<Column>,
    rows: usize,
    has_frames: bool,
}

impl TableRows {
    fn new(columns: impl IntoIterator<Item = Column>, has_frames: bool) -> Self {
        let boot = Column { units: "s", ..Column::new("boot_s", Kind::Seconds) };
        let times = [boot, Column::new("utc", Kind::Utc).optional()];
        Self { columns: times.into_iter().chain(columns).collect(), rows: 0, has_frames }
    }

    pub(crate) fn of_frames(table: Table) -> Self {
        let sender = ["system", "component"].map(|name| Column::new(name, Kind::Unsigned(8)));
        let fields = match table {
            Table::Message(id) => {
                let fields = hums_dialect::message(id).map(|message| message.fields).unwrap_or_default();
                fields.iter().map(Column::of_field).collect()
            }
            // All ids are in one table: there are 16 million of them, and files are few.
            _ => vec![
                Column::new("id", Kind::Unsigned(32)),
                Column::new("sequence", Kind::Unsigned(8)),
                Column::new("payload", Kind::Text),
            ],
        };
        Self::new(sender.into_iter().chain(fields), true)
    }

    /// Columns for rows like this one.
    pub(super) fn of_rows(first: &Row) -> Self {
        Self::new(first.cells.iter().map(|(name, cell)| Column::of_cell(name, cell.column_type())), false)
    }

    fn begin(&mut self, at: Instant, utc_us: Option<u64>) -> impl Iterator<Item = &mut Column> {
        self.rows += 1;
        let mut columns = self.columns.iter_mut();
        if let Some(boot) = columns.next() {
            boot.push_scalar(Scalar::Signed(at.as_micros() as i64));
        }
        if let Some(utc) = columns.next() {
            match utc_us.and_then(|utc_us| i64::try_from(utc_us).ok()) {
                Some(utc_us) => utc.push_scalar(Scalar::Signed(utc_us)),
                None => utc.levels.push(0),
            }
        }
        columns
    }

    pub(crate) fn frame(
        &mut self,
        at: Instant,
        utc_us: Option<u64>,
        frame: &Frame<'_>,
        known: Option<&Payload>,
    ) {
        let mut columns = self.begin(at, utc_us);
        let mut push = |value| columns.next().into_iter().for_each(|column| column.push_value(value));
        let number = |number: u32| FieldValue::Scalar(Scalar::Unsigned(number.into()));
        push(number(frame.system().into()));
        push(number(frame.component().into()));
        if let Some(payload) = known {
            payload.fields().for_each(|(_, value)| push(value));
            return;
        }
        push(number(frame.id()));
        push(number(frame.sequence().into()));
        push(FieldValue::Text(hex(frame.payload()).as_bytes()));
    }

    pub(super) fn row(&mut self, at: Instant, utc_us: Option<u64>, row: &Row) {
        let mut cells = row.cells.iter();
        for column in self.begin(at, utc_us) {
            column.push_cell(cells.next().map(|(_, cell)| cell));
        }
    }

    pub(crate) fn append(&mut self, mut next: Self) {
        self.rows += std::mem::take(&mut next.rows);
        for (column, next) in self.columns.iter_mut().zip(&mut next.columns) {
            column.append(next);
        }
    }

    pub(super) fn clear(&mut self) {
        self.rows = 0;
        for column in &mut self.columns {
            (column.values, column.levels) = (column.kind.values(), Vec::new());
        }
    }

    pub(super) fn columns(&self) -> &[Column] {
        &self.columns
    }

    pub(crate) fn rows(&self) -> usize {
        self.rows
    }

    pub(crate) fn has_frames(&self) -> bool {
        self.has_frames
    }

    pub(crate) fn held_bytes(&self) -> usize {
        self.columns.iter().map(Column::held_bytes).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::row::{count, text};

    #[test]
    fn every_message_fills_its_columns_which_have_different_names() {
        let frame =
            Frame::again(&[0xfe, 0, 0, 1, 1, 0, 0, 0], hums_link::Check::Unverified).expect("a frame");
        for message in hums_dialect::messages() {
            let payload = Payload::new(message, &[0x5a; 255]);
            let mut columns = TableRows::of_frames(Table::Message(message.id));
            columns.frame(Instant::from_millis(5), Some(7), &frame, Some(&payload));
            columns.frame(Instant::from_millis(6), None, &frame, Some(&payload));
            let mut all = TableRows::of_frames(Table::Message(message.id));
            all.append(columns);
            assert_eq!((all.rows, all.columns.len()), (2, 4 + message.fields.len()), "{}", message.name);
            for (index, column) in all.columns.iter().enumerate() {
                let expected = if index == 1 { 1 } else { 2 * column.length.max(1) };
                assert_eq!(column.values.count(), expected, "{} {}", message.name, column.name);
                column.parquet_type().expect("a type");
            }
            let mut names: Vec<&str> = all.columns.iter().map(|column| column.name.as_str()).collect();
            names.extend(["vehicle", "date", "session", "bucket"]);
            let count = names.len();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), count, "{}", message.name);
        }
    }

    #[test]
    fn a_value_that_is_not_there_is_null_wherever_it_stands() {
        let unknown = || Cell::Unknown(ColumnType::Unsigned);
        let rows: Vec<Row> = [
            (unknown(), text("a")),
            (count(7_u64), Cell::Unknown(ColumnType::Text)),
            (Cell::Words("none".to_owned(), ColumnType::Unsigned), text("")),
            (count(9_u64), text("d\u{e9}")),
        ]
        .map(|(number, words)| Row::new("T", vec![("count[m]", number), ("words", words)]))
        .into();
        let mut columns = TableRows::of_rows(&rows[0]);
        for row in &rows {
            columns.row(Instant::from_millis(5), None, row);
        }
        assert!(columns.held_bytes() > 0);
        let taken = &columns;
        let names: Vec<&str> = taken.columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["boot_s", "utc", "count_m", "words"]);
        assert_eq!(taken.columns[1].levels, [0; 4], "no UTC");
        assert_eq!(taken.columns[2].levels, [0, 1, 0, 1]);
        assert!(matches!(&taken.columns[2].values, Values::Longs(values) if *values == [7, 9]));
        assert_eq!(taken.columns[3].levels, [1, 0, 1, 1]);
        let Values::Texts(texts) = &taken.columns[3].values else { panic!("texts") };
        assert_eq!(texts.some(1, 2), [ByteArray::from(""), ByteArray::from("d\u{e9}")]);
        columns.clear();
        assert!(columns.rows() == 0 && columns.columns[0].values.count() == 0, "nothing is left");
    }
}
