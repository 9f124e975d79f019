//! Rows of the monitor's own and of an autopilot's log, gathered as columns until they are written. A row takes as many bytes
//! as its values: a log of thousands of topics, each with a few rows, takes no more than one of a few.

use std::sync::Arc;

use anyhow::Result;
use arrow_array::types::{ArrowPrimitiveType, Float32Type, Float64Type, Int64Type, UInt64Type};
use arrow_array::{ArrayRef, BooleanArray, PrimitiveArray, RecordBatch, StringArray};
use arrow_buffer::{BooleanBuffer, Buffer, NullBuffer, OffsetBuffer, ScalarBuffer};
use arrow_schema::{DataType, Field, Schema};

use super::batches::{Rows, TAKEN, Times, with_units};
use super::field_names::free_name;
use super::row::{Cell, CellType, Row};

/// The columns of one table. The first row says what they are.
#[derive(Debug, Default)]
pub(super) struct CellColumns {
    times: Times,
    columns: Vec<(&'static str, CellColumn)>,
}

impl CellColumns {
    /// Adds rows.
    pub(super) fn append(&mut self, mut rows: Rows) {
        self.times.append(&mut rows.times);
        for row in rows.rows {
            self.push(row);
        }
    }

    fn push(&mut self, row: Row) {
        if self.columns.is_empty() {
            let column =
                |(name, cell): &(&'static str, Cell)| (*name, CellColumn::of(name, cell.cell_type()));
            self.columns = row.cells.iter().map(column).collect();
        }
        let mut cells = row.cells.into_iter();
        for (_, column) in &mut self.columns {
            column.push(cells.next().map(|(_, cell)| cell));
        }
    }

    /// Bytes of memory that they take.
    pub(super) fn held_bytes(&self) -> usize {
        let own = size_of::<(&str, CellColumn)>() * self.columns.capacity();
        own + self.times.held_bytes()
            + self.columns.iter().map(|(_, column)| column.held_bytes()).sum::<usize>()
    }

    /// All rows so far; none are left.
    pub(super) fn take_batch(&mut self) -> Result<Option<RecordBatch>> {
        let Self { times, columns } = std::mem::take(self);
        let mut arrays = times.arrays();
        if arrays.first().is_none_or(|times| times.is_empty()) {
            return Ok(None);
        }
        let mut fields = Times::fields();
        for (name, column) in columns {
            let array = column.array();
            fields.push(field(name, array.data_type().clone()));
            arrays.push(array);
        }
        Ok(Some(RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)?))
    }
}

/// A column by its name: `at[s]` as a name would need quoting in every query.
fn field(name: &str, data_type: DataType) -> Field {
    let (plain, units) = name.strip_suffix(']').and_then(|name| name.rsplit_once('[')).unwrap_or((name, ""));
    // An element of an array: `q[0]`.
    let (plain, units) = if units.parse::<u32>().is_ok() { (name, "") } else { (plain, units) };
    let plain = if units.is_empty() { plain.to_owned() } else { format!("{plain}_{units}") };
    let plain = plain.replace('%', "percent");
    with_units(Field::new(free_name(&plain, &TAKEN), data_type, true), units, "")
}

/// One column. A cell that is not of its type is null.
#[derive(Debug)]
enum CellColumn {
    Counts(Values<u64>),
    Signed(Values<i64>),
    Singles(Values<f32>),
    Doubles(Values<f64>),
    Flags(Values<bool>),
    Texts(Texts),
}

/// Values, and which of them are there.
#[derive(Debug, Default)]
struct Values<T> {
    values: Vec<T>,
    there: There,
}

/// Which values are there; nothing while all of them are.
#[derive(Debug, Default)]
struct There(Vec<bool>);

impl There {
    /// One more behind so many.
    fn push(&mut self, is_there: bool, before: usize) {
        if self.0.is_empty() && !is_there {
            self.0.resize(before, true);
        }
        if !self.0.is_empty() || !is_there {
            self.0.push(is_there);
        }
    }

    fn nulls(self) -> Option<NullBuffer> {
        (!self.0.is_empty()).then(|| NullBuffer::from(self.0))
    }
}

impl<T: Default> Values<T> {
    fn push(&mut self, value: Option<T>) {
        self.there.push(value.is_some(), self.values.len());
        self.values.push(value.unwrap_or_default());
    }

    fn held_bytes(&self) -> usize {
        size_of::<T>() * self.values.capacity() + self.there.0.capacity()
    }
}

fn primitive<A: ArrowPrimitiveType>(column: Values<A::Native>) -> ArrayRef {
    Arc::new(PrimitiveArray::<A>::new(ScalarBuffer::from(column.values), column.there.nulls()))
}

/// Texts one behind the other, and where each ends.
#[derive(Debug)]
struct Texts {
    text: String,
    /// The first one begins at 0.
    bounds: Vec<i32>,
    there: There,
}

impl Texts {
    fn push(&mut self, text: Option<&str>) {
        self.there.push(text.is_some(), self.bounds.len() - 1);
        self.text.push_str(text.unwrap_or_default());
        // The rows that wait are far fewer bytes.
        self.bounds.push(i32::try_from(self.text.len()).unwrap_or(i32::MAX));
    }

    fn held_bytes(&self) -> usize {
        self.text.capacity() + size_of::<i32>() * self.bounds.capacity() + self.there.0.capacity()
    }

    fn array(self) -> ArrayRef {
        let bounds = OffsetBuffer::new(ScalarBuffer::from(self.bounds));
        Arc::new(StringArray::new(bounds, Buffer::from_vec(self.text.into_bytes()), self.there.nulls()))
    }
}

impl CellColumn {
    /// A column `value` holds quantities, whole ones too.
    fn of(name: &str, cell: CellType) -> Self {
        match cell {
            CellType::Count if name == "value" => Self::Doubles(Values::default()),
            CellType::Count => Self::Counts(Values::default()),
            CellType::Signed => Self::Signed(Values::default()),
            CellType::Single => Self::Singles(Values::default()),
            CellType::Double | CellType::Time => Self::Doubles(Values::default()),
            CellType::Flag => Self::Flags(Values::default()),
            CellType::Text | CellType::Hex => {
                Self::Texts(Texts { text: String::new(), bounds: vec![0], there: There::default() })
            }
        }
    }

    fn push(&mut self, cell: Option<Cell>) {
        match (self, cell) {
            (Self::Counts(column), Some(Cell::Count(value))) => column.push(Some(value)),
            (Self::Counts(column), _) => column.push(None),
            (Self::Signed(column), Some(Cell::Signed(value))) => column.push(Some(value)),
            (Self::Signed(column), _) => column.push(None),
            (Self::Singles(column), Some(Cell::Single(value))) => column.push(Some(value)),
            (Self::Singles(column), _) => column.push(None),
            (Self::Doubles(column), cell) => column.push(match cell {
                Some(Cell::Double(value)) => Some(value),
                Some(Cell::Single(value)) => Some(f64::from(value)),
                Some(Cell::Count(value)) => Some(value as f64),
                Some(Cell::Time(at)) => Some(at.as_secs_f64()),
                _ => None,
            }),
            (Self::Flags(column), Some(Cell::Flag(value))) => column.push(Some(value)),
            (Self::Flags(column), _) => column.push(None),
            (Self::Texts(column), Some(Cell::Text(text))) => column.push(Some(&text)),
            (Self::Texts(column), Some(cell @ Cell::Hex(_))) => {
                let mut digits = Vec::new();
                cell.push_csv(&mut digits);
                column.push(Some(&String::from_utf8_lossy(&digits)));
            }
            (Self::Texts(column), _) => column.push(None),
        }
    }

    fn held_bytes(&self) -> usize {
        match self {
            Self::Counts(column) => column.held_bytes(),
            Self::Signed(column) => column.held_bytes(),
            Self::Singles(column) => column.held_bytes(),
            Self::Doubles(column) => column.held_bytes(),
            Self::Flags(column) => column.held_bytes(),
            Self::Texts(column) => column.held_bytes(),
        }
    }

    fn array(self) -> ArrayRef {
        match self {
            Self::Counts(column) => primitive::<UInt64Type>(column),
            Self::Signed(column) => primitive::<Int64Type>(column),
            Self::Singles(column) => primitive::<Float32Type>(column),
            Self::Doubles(column) => primitive::<Float64Type>(column),
            Self::Flags(Values { values, there }) => {
                Arc::new(BooleanArray::new(BooleanBuffer::from(values), there.nulls()))
            }
            Self::Texts(column) => column.array(),
        }
    }
}

#[cfg(test)]
mod tests {
    use arrow_array::Array as _;
    use arrow_array::cast::AsArray as _;
    use hums_core::clock::Instant;

    use super::*;

    #[test]
    fn a_value_that_is_not_there_is_null_wherever_it_stands() {
        let unknown = || Cell::Unknown(CellType::Count);
        let text = |words: &str| Cell::Text(words.to_owned());
        let mut rows = Rows::default();
        for (count, words) in [
            (unknown(), text("a")),
            (Cell::Count(7), Cell::Unknown(CellType::Text)),
            (Cell::Words("none".to_owned(), CellType::Count), text("")),
            (Cell::Count(9), text("dé")),
        ] {
            rows.times.push(Instant::from_millis(5), None);
            rows.rows.push(Row::new("T", vec![("count[m]", count), ("words", words)]));
        }
        let mut columns = CellColumns::default();
        columns.append(rows);
        assert!(columns.held_bytes() > 0);
        let batch = columns.take_batch().expect("columns that fit").expect("rows");
        let names: Vec<&String> = batch.schema_ref().fields().iter().map(|field| field.name()).collect();
        assert_eq!(names, ["boot_s", "utc", "count_m", "words"]);
        let counts = batch.column(2).as_primitive::<UInt64Type>();
        assert_eq!(counts.iter().collect::<Vec<_>>(), [None, Some(7), None, Some(9)]);
        let words = batch.column(3).as_string::<i32>();
        assert_eq!(words.iter().collect::<Vec<_>>(), [Some("a"), None, Some(""), Some("dé")]);
        assert_eq!(batch.column(1).null_count(), 4, "no UTC");
        assert!(columns.take_batch().expect("nothing").is_none(), "nothing is left");
    }
}
