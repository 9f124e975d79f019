//! A row of a table of the monitor's own, and how its cells are written.

use hums_core::clock::Instant;

use super::text::{push_csv_number, push_csv_text, push_integer, push_json_number, push_json_text};
use crate::hex::push_hex;
use crate::mavlink::values::Scalar;
use crate::utc::push_seconds;

/// One value of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A count or a number that names something.
    Count(u64),
    /// An integer that may be negative.
    Signed(i64),
    /// A quantity of single precision.
    Single(f32),
    /// A quantity of double precision.
    Double(f64),
    /// Seconds since power-on.
    Time(Instant),
    /// Yes or no.
    Flag(bool),
    /// Text.
    Text(String),
    /// Bytes.
    Hex(Vec<u8>),
    /// Words in the place of a value of this type: in text and JSON only.
    Words(String, CellType),
    /// Not known; it would be of this type.
    Unknown(CellType),
}

/// The type of a cell and its column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellType {
    /// [`Cell::Count`]
    Count,
    /// [`Cell::Signed`]
    Signed,
    /// [`Cell::Single`]
    Single,
    /// [`Cell::Double`]
    Double,
    /// [`Cell::Time`]
    Time,
    /// [`Cell::Flag`]
    Flag,
    /// [`Cell::Text`]
    Text,
    /// [`Cell::Hex`]
    Hex,
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
    /// Its type.
    pub fn cell_type(&self) -> CellType {
        match self {
            Self::Count(_) => CellType::Count,
            Self::Signed(_) => CellType::Signed,
            Self::Single(_) => CellType::Single,
            Self::Double(_) => CellType::Double,
            Self::Time(_) => CellType::Time,
            Self::Flag(_) => CellType::Flag,
            Self::Text(_) => CellType::Text,
            Self::Hex(_) => CellType::Hex,
            Self::Words(_, cell_type) | Self::Unknown(cell_type) => *cell_type,
        }
    }

    /// As a CSV cell; unknown values are empty.
    pub fn push_csv(&self, out: &mut Vec<u8>) {
        match self {
            Self::Count(value) => push_integer(out, *value),
            Self::Signed(value) => push_csv_number(out, Scalar::Signed(*value)),
            Self::Single(value) => push_csv_number(out, Scalar::Single(*value)),
            Self::Double(value) => push_csv_number(out, Scalar::Double(*value)),
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
            Self::Single(value) => push_json_number(out, Scalar::Single(*value)),
            Self::Double(value) => push_json_number(out, Scalar::Double(*value)),
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
