//! Rows' tables: a name for each set of columns.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::format::{ARRAY_LENGTH, FieldKind, Format};
use super::message::Message;
use crate::mavlink::values::Scalar;
use crate::source::item::{CellValue, Column, ColumnType, Columns, Table};

/// Tables of one name: a file may redefine it for ever.
const VERSIONS_MAX: usize = 16;
/// Of 256 types with changing definitions. Each is a Parquet file, with some 16 KiB of memory until its end.
const TABLES_MAX: usize = 1_024;

#[derive(Debug, Default)]
pub(super) struct Tables {
    by_name: BTreeMap<String, Vec<Arc<Table>>>,
    /// Two messages may share a name of only letters and digits.
    taken: BTreeSet<String>,
}

impl Tables {
    /// `None` if there are too many. `is_words`: of a text log.
    pub(super) fn of(&mut self, format: &Format, units: Vec<String>, is_words: bool) -> Option<Arc<Table>> {
        let columns = columns(format, units, is_words);
        if self.taken.len() >= TABLES_MAX && !self.by_name.contains_key(&format.name) {
            return None;
        }
        let versions = self.by_name.entry(format.name.clone()).or_default();
        if let Some(table) = versions.iter().find(|table| table.columns == columns) {
            return Some(Arc::clone(table));
        }
        if versions.len() >= VERSIONS_MAX || self.taken.len() >= TABLES_MAX {
            return None;
        }
        let name = Table::free_name(&mut self.taken, &safe(&format.name));
        let table = Arc::new(Table { name, columns });
        versions.push(Arc::clone(&table));
        Some(table)
    }
}

/// Safe in a file's name.
pub(super) fn safe(name: &str) -> String {
    let safe = |character: char| {
        let keeps = character.is_ascii_alphanumeric() || matches!(character, '_' | '-');
        if keeps { character } else { '_' }
    };
    let name: String = name.chars().map(safe).collect();
    if name.is_empty() { "_".to_owned() } else { name }
}

fn columns(format: &Format, units: Vec<String>, is_words: bool) -> Vec<Column> {
    let mut columns = Columns::default();
    for (field, unit) in format.fields.iter().zip(units) {
        if field.kind == FieldKind::Array {
            for element in 0..ARRAY_LENGTH {
                columns.push(&format!("{}[{element}]", field.name), &unit, ColumnType::Signed);
            }
        } else {
            columns.push(&field.name, &unit, kind(format, field.kind, is_words));
        }
    }
    columns.finish()
}

const FILE: &str = "FILE";

fn kind(format: &Format, field: FieldKind, is_words: bool) -> ColumnType {
    match field {
        FieldKind::Text(64) if format.name == FILE && !is_words => ColumnType::Bytes,
        FieldKind::Mode if is_words => ColumnType::Text,
        FieldKind::Number(kind) => ColumnType::of(kind),
        FieldKind::Mode => ColumnType::Unsigned,
        FieldKind::Array => ColumnType::Signed,
        FieldKind::Half => ColumnType::Single,
        FieldKind::Hundredths(_) | FieldKind::Degrees => ColumnType::Double,
        FieldKind::Text(_) => ColumnType::Text,
    }
}

pub(super) fn with_values<T>(message: &Message<'_>, take: impl FnOnce(&[CellValue<'_>]) -> T) -> T {
    let (format, fields) = (message.format(), &message.format().fields);
    let kinds: Vec<_> = fields.iter().map(|field| kind(format, field.kind, message.is_words())).collect();
    let texts: Vec<_> = (0..fields.len())
        .map(|column| match kinds.get(column) {
            Some(ColumnType::Text) => message.text(column),
            _ => None,
        })
        .collect();
    let mut values = Vec::with_capacity(fields.len());
    for (column, ((field, kind), text)) in fields.iter().zip(&kinds).zip(&texts).enumerate() {
        if field.kind == FieldKind::Array {
            values.extend((0..ARRAY_LENGTH).map(|element| {
                message
                    .element(column, element)
                    .map_or(CellValue::Unknown, |number| CellValue::Number(Scalar::Signed(number.into())))
            }));
            continue;
        }
        let value = match kind {
            ColumnType::Text => text.as_deref().map(CellValue::Text),
            ColumnType::Bytes => message.bytes(column).map(CellValue::Bytes),
            ColumnType::Unsigned => message.unsigned(column).map(Scalar::Unsigned).map(CellValue::Number),
            ColumnType::Signed => message.signed(column).map(Scalar::Signed).map(CellValue::Number),
            ColumnType::Single => {
                message.any_number(column).map(|number| CellValue::Number(Scalar::Single(number as f32)))
            }
            _ => message.any_number(column).map(Scalar::Double).map(CellValue::Number),
        };
        let words = || message.no_number(column).map(CellValue::Text);
        values.push(value.or_else(words).unwrap_or(CellValue::Unknown));
    }
    take(&values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_one_table_for_each_set_of_columns() {
        let mut tables = Tables::default();
        let format = |columns| Format::new(130, 13, "A/B", b"Qc", columns);
        let units = || vec![String::new(); 2];
        let first = tables.of(&format("TimeUS,Roll"), units(), false).expect("a table");
        let second = tables.of(&format("TimeUS,Pitch"), units(), false).expect("a table");
        let again = tables.of(&format("TimeUS,Roll"), units(), false).expect("a table");
        assert_eq!((first.name.as_str(), second.name.as_str()), ("A_B", "A_B_2"));
        assert!(Arc::ptr_eq(&first, &again));
    }

    #[test]
    fn two_messages_whose_names_become_one_name_of_a_file_have_a_table_each() {
        let mut tables = Tables::default();
        let mut of = |name: &str, columns: &str| {
            let format = Format::new(130, 13, name, b"Qc", columns);
            tables.of(&format, vec![String::new(); 2], false).expect("a table").name.clone()
        };
        let names = [("A/B", "TimeUS,V"), ("A\\B", "TimeUS,V"), ("A_B_2", "TimeUS,V"), ("A/B", "TimeUS,W")];
        let made = names.map(|(name, columns)| of(name, columns));
        assert_eq!(made, ["A_B", "A_B_2", "A_B_2_2", "A_B_3"]);
        assert_eq!(names.map(|(name, columns)| of(name, columns)), made, "the same once more");
    }

    #[test]
    fn labels_that_come_twice_get_numbers_that_no_other_label_has() {
        let format = Format::new(130, 0, "X", b"BBBB", "A,A_2,A,A");
        let table = Tables::default().of(&format, vec![String::new(); 4], false).expect("a table");
        let names: Vec<&str> = table.columns.iter().map(|column| column.name.as_str()).collect();
        assert_eq!(names, ["A", "A_2", "A_3", "A_4"]);
    }
}
