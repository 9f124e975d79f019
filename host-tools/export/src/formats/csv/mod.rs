//! CSV: one file for each table.

mod tables;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Result;
use hums_core::clock::Instant;

use crate::context::Context;
use crate::files::Folder;
use crate::format::{Entry, Files, Finished, FormatDetails, GroupEncoder, Totals, Writer};
use crate::hex::push_hex;
use crate::row::Row;
use crate::story::Story;
use crate::table::Table;
use crate::text::{push_csv_cells, push_integer};
use crate::utc::{push_iso8601, push_seconds};
use tables::CsvTables;

/// The open tables.
pub(super) struct Csv {
    dir: PathBuf,
    tables: CsvTables,
}

#[derive(Default)]
pub(super) struct Lines {
    tables: BTreeMap<Table, Vec<u8>>,
    headers: BTreeMap<&'static str, Vec<&'static str>>,
    tables_bytes: usize,
}

/// A table with its first buffer, in a tree.
const TABLE_BYTES: usize = 256;

impl Lines {
    fn line(&mut self, table: Table, write: impl FnOnce(&mut Vec<u8>)) {
        let out = self.tables.entry(table).or_default();
        let before = table_bytes(out);
        write(out);
        out.push(b'\n');
        self.tables_bytes += table_bytes(out) - before;
    }
}

impl GroupEncoder for Lines {
    fn frame(&mut self, _: &Context, entry: &Entry<'_>) {
        let Entry { frame, known, .. } = entry;
        let table = match Table::of(frame, known.is_some()) {
            // There are 16 million ids, and few files.
            Table::Unknown(_) => Table::Unknowns,
            table => table,
        };
        self.line(table, |out| {
            push_times(out, entry.at, entry.utc_us);
            let id = (table == Table::Unknowns).then_some(frame.id());
            let sequence = known.is_none().then(|| frame.sequence().into());
            let numbers = [Some(frame.system().into()), Some(frame.component().into()), id, sequence];
            for number in numbers.into_iter().flatten() {
                out.push(b',');
                push_integer(out, u64::from(number));
            }
            if let Some(payload) = known {
                push_csv_cells(out, payload);
            } else {
                out.push(b',');
                push_hex(out, frame.payload());
            }
        });
    }

    fn row(&mut self, context: &Context, at: Instant, row: &Row) {
        self.headers.entry(row.table).or_insert_with(|| row.cells.iter().map(|(name, _)| *name).collect());
        self.line(Table::Hums(row.table), |out| {
            push_times(out, at, context.epochs.utc_us(at));
            for (_, cell) in &row.cells {
                out.push(b',');
                cell.push_csv(out);
            }
        });
    }

    fn held_bytes(&self) -> usize {
        self.tables_bytes
    }
}

impl Writer for Csv {
    const ABOUT: FormatDetails = FormatDetails::new(
        "csv",
        "A table for each type of message, units in the header, for spreadsheets and scripts",
        Files::Tables(None, "csv"),
    );
    type Encoder = Lines;

    fn open(context: &Context, path: &Path) -> Result<Self> {
        let folder = Folder::create(path, &context.inputs, &context.session)?;
        Ok(Self { dir: path.to_owned(), tables: CsvTables::new(folder) })
    }

    fn part(&mut self, _: &Context, part: Lines, _: &Story) -> Result<()> {
        self.tables.headers(&part.headers);
        part.tables.iter().try_for_each(|(table, lines)| self.tables.put(*table, lines))
    }

    fn finish(self, _: &Context, totals: Totals) -> Result<Finished> {
        let tables = self.tables.count();
        self.tables.finish()?;
        Ok(totals.of_tables(self.dir, "csv", tables).into())
    }
}

/// Bytes; 0 before the first line.
fn table_bytes(lines: &[u8]) -> usize {
    if lines.is_empty() { 0 } else { TABLE_BYTES + lines.len() }
}

fn push_times(out: &mut Vec<u8>, at: Instant, utc_us: Option<u64>) {
    push_seconds(out, at.as_micros());
    out.push(b',');
    if let Some(utc_us) = utc_us {
        push_iso8601(out, utc_us);
    }
}
