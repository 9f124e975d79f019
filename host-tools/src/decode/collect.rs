//! A group's entries as text and columns, made by many threads at once.

use std::collections::BTreeMap;

use hums_blackbox::{Gap, Record};
use hums_core::clock::Instant;
use hums_link as link;

use super::batches::Batches;
use super::checked::OnBoard;
use super::context::Context;
use super::influx::Lines;
use super::record::{gap_row, rows};
use super::row::Row;
use super::table::Table;
use super::text::{push_csv_cells, push_integer, push_json_object, push_json_text};
use super::unknown::UnknownLines;
use crate::hex::push_hex;
use crate::mavlink::frame::{Frame, Peek, peek};
use crate::mavlink::values::Payload;
use crate::names::message_name;
use crate::reference::Observed;
use crate::source::item::Item;
use crate::source::parts::Collect;
use crate::utc::{push_iso8601, push_seconds};

/// One group as text and columns.
#[derive(Debug)]
pub struct Collected<'a> {
    context: &'a Context,
    /// Bytes of the tlog.
    pub tlog: Vec<u8>,
    /// Lines of the JSON output.
    pub jsonl: Vec<u8>,
    /// Lines of each table.
    pub tables: BTreeMap<Table, Vec<u8>>,
    /// Lines of frames that we have no definition of.
    pub unknown: UnknownLines,
    /// A header for each table of the monitor's own.
    pub headers: BTreeMap<&'static str, Vec<&'static str>>,
    /// Points of the line protocol.
    pub influx: Lines,
    /// Columns of the Parquet output.
    pub parquet: Batches,
    /// The vehicle's observations, for outputs that are made in order.
    pub observed: Vec<Observed>,
    /// Frames written.
    pub frames: u64,
    /// Records written.
    pub records: u64,
    /// Findings of the log's own monitor, wanted or not.
    pub on_board: OnBoard,
    /// Rows of tables without room for their names.
    pub rows_left_out: u64,
    /// Bytes in `tables`, with the tables' own memory.
    tables_bytes: usize,
}

/// A table with its first buffer, in a tree.
const TABLE_BYTES: usize = 256;

impl<'a> Collected<'a> {
    /// Empty.
    pub fn new(context: &'a Context) -> Self {
        Self {
            context,
            tlog: Vec::new(),
            jsonl: Vec::new(),
            tables: BTreeMap::new(),
            unknown: UnknownLines::default(),
            headers: BTreeMap::new(),
            influx: Lines::default(),
            parquet: Batches::default(),
            observed: Vec::new(),
            frames: 0,
            records: 0,
            on_board: OnBoard::default(),
            rows_left_out: 0,
            tables_bytes: 0,
        }
    }

    fn frame(&mut self, at: Instant, frame: &link::Frame<'_>) {
        let formats = self.context.formats;
        let (bytes, verified) = (frame.bytes(), frame.check() == link::Check::Verified);
        let Peek::Frame(frame) = peek(bytes) else { return };
        if !self.context.selection.has_id(frame.id) {
            return;
        }
        self.frames += 1;
        if formats.tlog {
            let utc = self.context.epochs.utc_us(at).unwrap_or_else(|| at.as_micros());
            self.tlog.extend_from_slice(&utc.to_be_bytes());
            self.tlog.extend_from_slice(bytes);
        }
        let known =
            if verified { frame.message().map(|message| Payload::new(message, frame.payload)) } else { None };
        if formats.csv {
            self.csv_frame(at, &frame, known.as_ref());
        }
        if formats.jsonl {
            self.json_frame(at, &frame, known.as_ref());
        }
        if formats.influx {
            self.influx.frame(&self.context.tags, at, &frame, known.as_ref());
        }
        if formats.parquet {
            self.parquet.frame(at, self.context.epochs.utc_us(at), &frame, known.as_ref());
        }
    }

    fn csv_frame(&mut self, at: Instant, frame: &Frame<'_>, known: Option<&Payload>) {
        let utc_us = self.context.epochs.utc_us(at);
        let head = |out: &mut Vec<u8>| {
            push_times_csv(out, at, utc_us);
            for number in [frame.system, frame.component] {
                out.push(b',');
                push_integer(out, u64::from(number));
            }
        };
        let opaque = |out: &mut Vec<u8>| {
            out.push(b',');
            push_integer(out, u64::from(frame.sequence));
            out.push(b',');
            push_hex(out, frame.payload);
        };
        let table = Table::of(frame, known.is_some());
        if matches!(table, Table::Unknown(_)) {
            self.unknown.push(frame.id, head, opaque);
            return;
        }
        let out = self.tables.entry(table).or_default();
        let before = table_bytes(out);
        head(out);
        match known {
            Some(payload) => push_csv_cells(out, payload),
            None => opaque(out),
        }
        out.push(b'\n');
        self.tables_bytes += table_bytes(out) - before;
    }

    fn json_frame(&mut self, at: Instant, frame: &Frame<'_>, known: Option<&Payload>) {
        let out = &mut self.jsonl;
        push_times_json(out, at, self.context.epochs.utc_us(at));
        for (name, number) in [(&b",\"system\":"[..], frame.system), (b",\"component\":", frame.component)] {
            out.extend_from_slice(name);
            push_integer(out, u64::from(number));
        }
        out.extend_from_slice(b",\"id\":");
        push_integer(out, u64::from(frame.id));
        out.extend_from_slice(b",\"message\":");
        push_json_text(out, message_name(frame.id).as_bytes());
        if let Some(payload) = known {
            out.extend_from_slice(b",\"fields\":");
            push_json_object(out, payload);
        } else {
            out.extend_from_slice(b",\"verified\":false,\"payload\":\"");
            push_hex(out, frame.payload);
            out.push(b'"');
        }
        out.extend_from_slice(b"}\n");
    }

    /// Adds rows of the monitor's own.
    pub fn rows(&mut self, at: Instant, rows: &[Row]) {
        for row in rows {
            self.records += 1;
            if self.context.formats.csv {
                self.headers
                    .entry(row.table)
                    .or_insert_with(|| row.cells.iter().map(|(name, _)| *name).collect());
                let out = self.tables.entry(Table::Hums(row.table)).or_default();
                let before = table_bytes(out);
                push_times_csv(out, at, self.context.epochs.utc_us(at));
                for (_, cell) in &row.cells {
                    out.push(b',');
                    cell.push_csv(out);
                }
                out.push(b'\n');
                self.tables_bytes += table_bytes(out) - before;
            }
            if self.context.formats.jsonl {
                let out = &mut self.jsonl;
                push_times_json(out, at, self.context.epochs.utc_us(at));
                out.extend_from_slice(b",\"record\":");
                push_json_text(out, row.table.as_bytes());
                out.extend_from_slice(b",\"fields\":");
                row.push_json_object(out);
                out.extend_from_slice(b"}\n");
            }
            if self.context.formats.influx {
                self.influx.row(&self.context.tags, at, row);
            }
            if self.context.formats.parquet {
                self.parquet.row(at, self.context.epochs.utc_us(at), row);
            }
        }
    }

    /// Adds a gap.
    pub fn gap(&mut self, gap: &Gap) {
        let from = gap.from.unwrap_or(Instant::ZERO);
        if self.context.selection.overlaps(gap, &self.context.epochs) {
            self.rows(from, &[gap_row(gap)]);
        }
    }
}

impl Collect for Collected<'_> {
    fn item(&mut self, at: Instant, item: Item<'_>) {
        // Always: later items depend on the vehicle's earlier state.
        if let Item::Observation(source, observation) = item {
            self.observed.push(Observed { at, source, observation: *observation });
        }
        if !self.context.selection.has_time(at, &self.context.epochs) {
            return;
        }
        match item {
            Item::Frame(frame) => self.frame(at, frame),
            Item::Row(row) => match self.context.tables.row(row) {
                Some(row) => self.rows(at, &[row]),
                None => self.rows_left_out += 1,
            },
            Item::Record(record) => {
                if let Record::Finding(finding) = record {
                    self.on_board.add(finding.level);
                }
                self.rows(at, &rows(record));
            }
            _ => {}
        }
    }

    fn held_bytes(&self) -> usize {
        self.tlog.len()
            + self.jsonl.len()
            + self.tables_bytes
            // Twice, because it is also split by tables.
            + 2 * self.unknown.held_bytes()
            + self.influx.held_bytes()
            + self.parquet.held_bytes()
            + size_of::<Observed>() * self.observed.len()
    }
}

/// Memory of a table's lines; 0 before the first one.
fn table_bytes(lines: &[u8]) -> usize {
    if lines.is_empty() { 0 } else { TABLE_BYTES + lines.len() }
}

/// The first two cells of every row.
fn push_times_csv(out: &mut Vec<u8>, at: Instant, utc_us: Option<u64>) {
    push_seconds(out, at.as_micros());
    out.push(b',');
    if let Some(utc_us) = utc_us {
        push_iso8601(out, utc_us);
    }
}

/// The first members of every object.
fn push_times_json(out: &mut Vec<u8>, at: Instant, utc_us: Option<u64>) {
    out.extend_from_slice(b"{\"time_boot\":");
    push_seconds(out, at.as_micros());
    out.extend_from_slice(b",\"time_utc\":");
    match utc_us {
        Some(utc_us) => {
            out.push(b'"');
            push_iso8601(out, utc_us);
            out.push(b'"');
        }
        None => out.extend_from_slice(b"null"),
    }
}
