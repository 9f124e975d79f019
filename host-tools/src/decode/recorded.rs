//! Recordings that are no logs of ours, decoded: the frames of a tlog, the native rows of an autopilot's log.
//!
//! They go through the same collectors and writers as a log of ours, in parts of bounded size, on one thread.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Mutex;

use anyhow::Result;
use hums_blackbox::Entry;
use hums_core::observation::Observation;
use hums_core::time::Instant;
use hums_link::Check;
use sha2::{Digest as _, Sha256};

use super::checked::Checked;
use super::collect::Collected;
use super::context::Context;
use super::identity::Identity;
use super::reference::Observed;
use super::row::{Cell, CellType, Row};
use super::write::Writers;
use crate::check::judge::{Judge, Limits};
use crate::logs::reader::{Collect as _, Deliver as _, Summary};
use crate::progress;
use crate::source::epochs::Epochs;
use crate::source::item::{Cause, Item, Kind, Rows, Table, Value, Want};
use crate::source::recording::Place;
use crate::utc::iso8601;

/// Items of one part, and bytes that they take: one message can have a table of a thousand columns.
const PART_ITEMS: u32 = 4_096;
const PART_BYTES: usize = 4 << 20;
/// Names of tables and columns of all logs together, bytes: they are kept for as long as the program runs. A log that
/// has more of them is not made by an autopilot; its further tables are left out, and counted.
const NAMES_BYTES_MAX: usize = 4 << 20;

/// Who flew and when, and UTC; where it is asked for, what the monitor here says of it, as `hums check` does.
/// The recording is read through for it.
pub fn identity(place: &Place, judges: bool) -> Result<(Identity, Option<Checked>)> {
    let (mut epochs, mut first, mut system, mut uid) = (Epochs::default(), None, None, None);
    let mut hash = Sha256::new();
    let want = Want { observations: true, ..Want::default() };
    let recording = place.open()?;
    let mut judge = judges.then(|| Judge::new(&Limits::default(), recording.format));
    recording.read(want, &mut |at, item| {
        if let Some(judge) = &mut judge {
            judge.item(at, item);
        }
        epochs.take(at, &item);
        if let Item::Observation(source, observation) = item {
            first.get_or_insert(at);
            hash.update(at.as_micros().to_le_bytes());
            match observation {
                Observation::Heartbeat(_) => system = system.or(Some(source.system)),
                Observation::Identity(told) if told.uid != 0 => uid = uid.or(Some(told.uid)),
                _ => {}
            }
        }
        Ok(())
    })?;
    let vehicle = match (uid, system) {
        (Some(uid), _) => format!("uid-{uid:016x}"),
        (None, Some(system)) => format!("system-{system}"),
        (None, None) => "unknown".to_owned(),
    };
    let utc_us = first.and_then(|first| epochs.utc_us(first));
    let date = utc_us.map(|utc| iso8601(utc).chars().take(10).collect());
    // No recorder gave it a number: the times in it are its own.
    let number: [u8; 4] = hash.finalize().first_chunk().copied().unwrap_or_default();
    let session = format!("r{:08x}", u32::from_be_bytes(number));
    let checked = judge.and_then(|judge| Checked::new(judge.end()));
    Ok((Identity { vehicle, date, session, epochs }, checked))
}

/// Reads a recording into the writers.
pub fn read<'a>(place: &Place, context: &'a Context, writers: &mut Writers<'a>) -> Result<Summary> {
    let recording = place.open()?;
    let (format, seen) = (recording.format, recording.progress.clone());
    let bar = progress::bytes(seen.total(), &place.title);
    let formats = context.formats;
    let rows = if formats.csv || formats.jsonl || formats.influx || formats.parquet {
        Rows::All
    } else {
        Rows::None
    };
    let rows = match context.selection.names() {
        [] => rows,
        names => Rows::Named(names),
    };
    let want = Want {
        frames: format.is_of_link(),
        observations: formats.influx || formats.thesis,
        rows,
        ..Want::default()
    };
    let mut part = Part::new(context);
    let mut summary = Summary::default();
    recording.read(want, &mut |at, item| {
        if matches!(item, Item::Frame(_) | Item::Row(_) | Item::Observation(..)) {
            // Of all that there is, wanted or not.
            summary.first = summary.first.or(Some(at));
            summary.last = summary.last.max(Some(at));
        }
        match item {
            Item::Frame(frame) => {
                let verified = frame.check() == Check::Verified;
                summary.frames += 1;
                part.collected.entry(&Entry::Frame { at, bytes: frame.bytes(), verified });
            }
            Item::Observation(source, observation) if !format.is_of_link() => {
                part.collected.observed.push(Observed { at, source, observation: *observation });
            }
            Item::Row(row) if context.selection.has_time(at, &context.epochs) => {
                part.row(at, row.table, row.values);
            }
            Item::Gap(gap) => {
                summary.gaps += u64::from(gap.cause.is_damage());
                summary.losses += u64::from(gap.cause == Cause::Lost);
                writers.group(part.take())?;
                writers.gap(&gap.to_own())?;
            }
            _ => return Ok(()),
        }
        part.items += 1;
        if part.items >= PART_ITEMS || part.collected.held_bytes() >= PART_BYTES {
            bar.set_position(seen.taken());
            writers.group(part.take())?;
        }
        Ok(())
    })?;
    writers.group(part.take())?;
    writers.leave_out(part.rows_left_out);
    bar.finish_and_clear();
    Ok(summary)
}

/// What waits to be written.
struct Part<'a> {
    context: &'a Context,
    collected: Collected<'a>,
    items: u32,
    /// The names of tables that were seen, and of their columns with units; none where there was no room for them.
    tables: BTreeMap<String, Option<Names>>,
    rows_left_out: u64,
}

type Names = (&'static str, Vec<&'static str>);

impl<'a> Part<'a> {
    fn new(context: &'a Context) -> Self {
        let collected = Collected::new(context);
        Self { context, collected, items: 0, tables: BTreeMap::new(), rows_left_out: 0 }
    }

    fn take(&mut self) -> Collected<'a> {
        self.items = 0;
        std::mem::replace(&mut self.collected, Collected::new(self.context))
    }

    fn row(&mut self, at: Instant, table: &Table, values: &[Value<'_>]) {
        if !self.tables.contains_key(&table.name) {
            self.tables.insert(table.name.clone(), names(table));
        }
        let Some(Some((name, columns))) = self.tables.get(&table.name) else {
            self.rows_left_out += 1;
            return;
        };
        let kinds = table.columns.iter().map(|column| column.kind);
        let cells = columns.iter().zip(kinds).zip(values);
        let cells = cells.map(|((name, kind), value)| (*name, cell(kind, *value))).collect();
        self.collected.rows(at, &[Row::new(name, cells)]);
    }
}

/// The names of a table, kept for ever.
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

/// A name that lives as long as the program; none where there are too many.
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

fn cell(kind: Kind, value: Value<'_>) -> Cell {
    match value {
        Value::Unsigned(value) => Cell::Count(value),
        Value::Signed(value) => Cell::Signed(value),
        Value::Single(value) => Cell::Single(value),
        Value::Double(value) => Cell::Double(value),
        Value::Flag(value) => Cell::Flag(value),
        Value::Text(words) if kind == Kind::Text => Cell::Text(words.to_owned()),
        Value::Text(words) => Cell::Words(words.to_owned(), cell_type(kind)),
        Value::Bytes(bytes) => Cell::Hex(bytes.to_owned()),
        Value::Unknown => Cell::Unknown(cell_type(kind)),
    }
}

const fn cell_type(kind: Kind) -> CellType {
    match kind {
        Kind::Unsigned => CellType::Count,
        Kind::Signed => CellType::Signed,
        Kind::Single => CellType::Single,
        Kind::Double => CellType::Double,
        Kind::Flag => CellType::Flag,
        Kind::Text => CellType::Text,
        Kind::Bytes => CellType::Hex,
    }
}
