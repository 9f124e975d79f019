//! A row of a table of the monitor's own, and how its cells are written.

use hums_core::clock::Instant;

use super::text::{push_csv_number, push_csv_text, push_json_number, push_json_text};
use crate::hex::push_hex;
use crate::mavlink::values::Scalar;
use crate::source::item::ColumnType;
use crate::utc::push_seconds;

/// One value of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A number: an unsigned one counts, or names something.
    Number(Scalar),
    /// Seconds since power-on.
    Time(Instant),
    /// Yes or no.
    Flag(bool),
    /// Text.
    Text(String),
    /// Bytes.
    Hex(Vec<u8>),
    /// Words in the place of a value of this type: in text and JSON only.
    Words(String, ColumnType),
    /// Not known; it would be of this type.
    Unknown(ColumnType),
}

/// A cell with this text.
pub fn text(text: impl Into<String>) -> Cell {
    Cell::Text(text.into())
}

/// A cell with this number of something.
pub fn count(number: impl Into<u64>) -> Cell {
    Cell::Number(Scalar::Unsigned(number.into()))
}

/// A cell with this quantity.
pub fn quantity(number: impl Into<f64>) -> Cell {
    Cell::Number(Scalar::Double(number.into()))
}

/// A cell with this quantity of single precision.
pub fn single(number: f32) -> Cell {
    Cell::Number(Scalar::Single(number))
}

/// A cell that may be unknown.
pub fn known<T>(value: Option<T>, cell: impl FnOnce(T) -> Cell, unknown: ColumnType) -> Cell {
    value.map_or(Cell::Unknown(unknown), cell)
}

/// One row: the table and its columns, always the same ones for a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The table's name.
    pub table: &'static str,
    /// Column names, with units, and values.
    pub cells: Vec<(&'static str, Cell)>,
}

impl Row {
    /// A row of this table.
    pub fn new(table: &'static str, cells: Vec<(&'static str, Cell)>) -> Self {
        Self { table, cells }
    }
}

/// A column's name without brackets, and its unit: `at[s]`, which would need quoting in every query, is `at_s`,
/// and so is `at_s[s]`.
pub fn plain_name(name: &'static str) -> (String, &'static str) {
    let (plain, units) = name.strip_suffix(']').and_then(|name| name.rsplit_once('[')).unwrap_or((name, ""));
    // An element of an array: `q[0]`.
    let (plain, units) = if units.parse::<u32>().is_ok() { (name, "") } else { (plain, units) };
    let is_told = units.is_empty() || plain.to_lowercase().ends_with(&format!("_{}", units.to_lowercase()));
    let plain = if is_told { plain.to_owned() } else { format!("{plain}_{units}") };
    (plain.replace('%', "percent"), units)
}

impl Cell {
    /// The type of its column.
    pub fn column_type(&self) -> ColumnType {
        match self {
            Self::Number(Scalar::Unsigned(_)) => ColumnType::Unsigned,
            Self::Number(Scalar::Signed(_)) => ColumnType::Signed,
            Self::Number(Scalar::Single(_)) => ColumnType::Single,
            Self::Number(Scalar::Double(_)) | Self::Time(_) => ColumnType::Double,
            Self::Flag(_) => ColumnType::Flag,
            Self::Text(_) => ColumnType::Text,
            Self::Hex(_) => ColumnType::Bytes,
            Self::Words(_, kind) | Self::Unknown(kind) => *kind,
        }
    }

    /// As a CSV cell; unknown values are empty.
    pub fn push_csv(&self, out: &mut Vec<u8>) {
        match self {
            Self::Number(number) => push_csv_number(out, *number),
            Self::Time(at) => push_seconds(out, at.as_micros()),
            Self::Flag(value) => out.extend_from_slice(if *value { b"true" } else { b"false" }),
            Self::Text(text) | Self::Words(text, _) => push_csv_text(out, text.as_bytes()),
            Self::Hex(bytes) => push_hex(out, bytes),
            Self::Unknown(_) => {}
        }
    }

    /// As a JSON value.
    pub fn push_json(&self, out: &mut Vec<u8>) {
        match self {
            Self::Number(number) => push_json_number(out, *number),
            Self::Text(text) | Self::Words(text, _) => push_json_text(out, text.as_bytes()),
            Self::Hex(bytes) => {
                out.push(b'"');
                push_hex(out, bytes);
                out.push(b'"');
            }
            Self::Unknown(_) => out.extend_from_slice(b"null"),
            plain => plain.push_csv(out),
        }
    }
}

impl Row {
    /// The members of this row as one JSON object. A unit in a column's name stays there: `at[s]`.
    pub fn push_json_object(&self, out: &mut Vec<u8>) {
        let mut separator = b'{';
        for (name, cell) in &self.cells {
            out.push(separator);
            separator = b',';
            push_json_text(out, name.as_bytes());
            out.push(b':');
            cell.push_json(out);
        }
        if separator == b'{' {
            out.push(b'{');
        }
        out.push(b'}');
    }
}
