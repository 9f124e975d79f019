//! The rows of an autopilot's own log, with its own tables and units.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;

use super::row::{Cell, Row};
use crate::source::item::{self, CellValue, ColumnType, Table};

/// Names of tables and columns of all logs together, bytes: they are kept for as long as the program runs. No
/// autopilot's log has more: further tables are left out, and counted.
const NAMES_BYTES_MAX: usize = 4 << 20;

/// The names of one log's tables, and of their columns with units; `None` if there was no room for them.
#[derive(Debug, Default)]
pub struct NativeTables(Mutex<BTreeMap<String, Option<Names>>>);

type Names = (&'static str, Vec<&'static str>);

impl NativeTables {
    /// A row as cells; `None` if there was no room for the names of its table.
    pub fn row(&self, row: item::Row<'_>) -> Option<Row> {
        let item::Row { table, values } = row;
        let mut seen = self.0.lock().ok()?;
        if !seen.contains_key(&table.name) {
            seen.insert(table.name.clone(), names(table));
        }
        let (name, columns) = seen.get(&table.name)?.as_ref()?;
        let kinds = table.columns.iter().map(|column| column.kind);
        let cells = columns.iter().zip(kinds).zip(values);
        let cells = cells.map(|((name, kind), value)| (*name, cell(kind, *value))).collect();
        Some(Row::new(name, cells))
    }
}

/// Names, kept for ever.
fn names(table: &Table) -> Option<Names> {
    let columns = table.columns.iter().map(|column| {
        if column.unit.is_empty() {
            kept(&column.name)
        } else {
            kept(&format!("{}[{}]", column.name, column.unit))
        }
    });
    let columns = columns.collect::<Option<Vec<_>>>()?;
    Some((kept(&table.name)?, columns))
}

fn kept(name: &str) -> Option<&'static str> {
    static KEPT: Mutex<(BTreeSet<&'static str>, usize)> = Mutex::new((BTreeSet::new(), 0));
    let mut kept = KEPT.lock().ok()?;
    if let Some(known) = kept.0.get(name) {
        return Some(known);
    }
    kept.1 += name.len();
    if kept.1 > NAMES_BYTES_MAX {
        return None;
    }
    let name: &'static str = Box::leak(name.to_owned().into_boxed_str());
    kept.0.insert(name);
    Some(name)
}

fn cell(kind: ColumnType, value: CellValue<'_>) -> Cell {
    match value {
        CellValue::Number(number) => Cell::Number(number),
        CellValue::Flag(value) => Cell::Flag(value),
        CellValue::Text(words) if kind == ColumnType::Text => Cell::Text(words.to_owned()),
        CellValue::Text(words) => Cell::Words(words.to_owned(), kind),
        CellValue::Bytes(bytes) => Cell::Hex(bytes.to_owned()),
        CellValue::Unknown => Cell::Unknown(kind),
    }
}
