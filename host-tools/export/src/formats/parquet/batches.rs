//! Frames and rows of one group as they wait for their Parquet tables.

use std::collections::BTreeMap;

use hums_core::clock::Instant;
use hums_link::Frame;

use super::columns::TableRows;
use crate::context::Context;
use crate::format::{Entry, GroupEncoder};
use crate::row::{Cell, Row};
use crate::table::Table;

/// One group's entries: frames as columns; rows unchanged, since the first row of the whole log determines
/// the columns.
#[derive(Debug, Default)]
pub(crate) struct Batches {
    frames: BTreeMap<Table, TableRows>,
    rows: BTreeMap<&'static str, Vec<TimedRow>>,
    held_bytes: usize,
}

pub(crate) type TimedRow = (Instant, Option<u64>, Row);

/// Memory of an empty table, and of a row besides the values of its message: its times, its sender.
const TABLE_BYTES: usize = 4_096;
const ROW_BYTES: usize = 32;
const FIELD_BYTES: usize = 4;
/// Memory of a cell of a row, a short text on the heap included; a long one takes its length in addition.
const CELL_BYTES: usize = 96;

fn table_of(frame: &Frame<'_>, known: bool) -> Table {
    match Table::of(frame, known) {
        Table::Unknown(_) => Table::Hums("UNKNOWN"),
        Table::Unverified(_) => Table::Hums("UNVERIFIED"),
        table => table,
    }
}

impl GroupEncoder for Batches {
    fn frame(&mut self, _: &Context, entry: &Entry<'_>) {
        let Entry { at, utc_us, frame, known } = *entry;
        let table = table_of(frame, known.is_some());
        let columns = self.frames.entry(table).or_insert_with(|| {
            self.held_bytes += TABLE_BYTES;
            TableRows::of_frames(table)
        });
        // A payload is sent without the zeros at its end; opaque ones are digits.
        let sent = known
            .and(hums_dialect::message(frame.id()))
            .map_or(2 * frame.payload().len(), |message| message.len_max.into());
        self.held_bytes += ROW_BYTES + FIELD_BYTES * columns.columns().len() + sent;
        columns.frame(at, utc_us, frame, known);
    }

    fn row(&mut self, context: &Context, at: Instant, row: &Row) {
        let texts = row.cells.iter().map(|(_, cell)| match cell {
            Cell::Text(text) | Cell::Words(text, _) => text.len(),
            Cell::Hex(bytes) => bytes.len(),
            _ => 0,
        });
        self.held_bytes += ROW_BYTES + CELL_BYTES * (1 + row.cells.len()) + texts.sum::<usize>();
        self.rows.entry(row.table).or_default().push((at, context.epochs.utc_us(at), row.clone()));
    }

    fn held_bytes(&self) -> usize {
        self.held_bytes
    }
}

impl Batches {
    pub(crate) fn parts(self) -> (BTreeMap<Table, TableRows>, BTreeMap<&'static str, Vec<TimedRow>>) {
        (self.frames, self.rows)
    }
}
