//! A group's entries as text, made by many threads at once.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use anyhow::Result;
use hums_blackbox::record::{Loss, Lost};
use hums_blackbox::{Entry, Gap, Record};
use hums_core::time::Instant;
use hums_link::{self as link, Check, observe};

use super::Context;
use super::influx::{Lines, Observed};
use super::parquet::Batches;
use super::record::{Cell, CellType, Row, rows};
use super::text::{push_csv_cells, push_hex, push_integer, push_json_object, push_json_text};
use crate::cli;
use crate::logs::reader::Collect;
use crate::mavlink::frame::{Frame, Peek, peek};
use crate::mavlink::values::Payload;
use crate::outcome::usage;
use crate::utc::{When, push_iso8601, push_seconds};

/// A table of the CSV output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Table {
    /// Frames of one message that we have the definition of.
    Message(u32),
    /// Frames of an id that we have a definition of, made with another one.
    Unverified(u32),
    /// Frames of an id that we have no definition of.
    Unknown(u32),
    /// The monitor's own.
    Hums(&'static str),
}

impl Table {
    /// The table of a frame; `known` says that its definition is ours.
    pub fn of(frame: &Frame<'_>, known: bool) -> Self {
        match (known, frame.message()) {
            (true, _) => Self::Message(frame.id),
            (false, Some(_)) => Self::Unverified(frame.id),
            (false, None) => Self::Unknown(frame.id),
        }
    }

    /// Its file's name, without an ending.
    pub fn file_name(self) -> String {
        let name = |id| {
            hums_dialect::message(id)
                .map_or_else(|| format!("UNKNOWN_{id}"), |message| message.name.to_owned())
        };
        match self {
            Self::Message(id) => name(id),
            Self::Unverified(id) => format!("UNVERIFIED_{}", name(id)),
            Self::Unknown(id) => format!("UNKNOWN_{id}"),
            Self::Hums(name) => name.to_owned(),
        }
    }
}

/// Which entries are wanted.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    from: Option<When>,
    to: Option<When>,
    /// Message ids; empty: all.
    ids: Vec<u32>,
}

impl Selection {
    /// As the command line says it.
    pub fn new(args: &cli::Decode) -> Result<Self> {
        let ids = args.message.iter().map(|name| id_of(name)).collect::<Result<_>>()?;
        Ok(Self { from: args.from, to: args.to, ids })
    }

    /// A time in UTC selects nothing in a log that has none: that is told, not guessed.
    pub fn check_without_utc(&self, log: &str) -> Result<()> {
        if [self.from, self.to].iter().any(|when| matches!(when, Some(When::Utc(_)))) {
            return Err(usage(format!(
                "{log}: the time of day is not known in this log; give --from and --to as seconds since its start"
            )));
        }
        Ok(())
    }

    /// Whether this time is wanted.
    pub fn has_time(&self, at: Instant, epoch_us: Option<u64>) -> bool {
        !self.is_before(at, epoch_us) && !self.is_after(at, epoch_us)
    }

    /// Whether any of a gap is in the time wanted.
    pub fn overlaps(&self, gap: &Gap, epoch_us: Option<u64>) -> bool {
        !gap.to.is_some_and(|to| self.is_before(to, epoch_us))
            && !gap.from.is_some_and(|from| self.is_after(from, epoch_us))
    }

    fn is_before(&self, at: Instant, epoch_us: Option<u64>) -> bool {
        self.from.and_then(|from| compare(at, from, epoch_us)).is_some_and(Ordering::is_lt)
    }

    fn is_after(&self, at: Instant, epoch_us: Option<u64>) -> bool {
        self.to.and_then(|to| compare(at, to, epoch_us)).is_some_and(Ordering::is_gt)
    }

    fn has_id(&self, id: u32) -> bool {
        self.ids.is_empty() || self.ids.contains(&id)
    }
}

/// How a time lies to a limit; `None` where one is UTC and the other cannot be.
fn compare(at: Instant, limit: When, epoch_us: Option<u64>) -> Option<Ordering> {
    let boot = at.as_micros();
    match limit {
        When::SinceStart(limit) => Some(boot.cmp(&limit)),
        When::Utc(limit) => Some(epoch_us?.saturating_add(boot).cmp(&limit)),
    }
}

/// A message's id by its name, `UNKNOWN_12345` and plain numbers included.
fn id_of(name: &str) -> Result<u32> {
    let upper = name.to_ascii_uppercase();
    if let Some(message) = hums_dialect::messages().iter().find(|message| message.name == upper) {
        return Ok(message.id);
    }
    let number = upper.strip_prefix("UNKNOWN_").unwrap_or(&upper);
    number.parse().map_err(|_| {
        let mut near: Vec<&str> = hums_dialect::messages().iter().map(|message| message.name).collect();
        near.retain(|known| known.contains(&upper) || upper.contains(known));
        near.truncate(5);
        let hint = if near.is_empty() { String::new() } else { format!("; there is {}", near.join(", ")) };
        usage(format!("--message {name}: no message has this name{hint}"))
    })
}

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
    /// A header for each table of the monitor's own.
    pub headers: BTreeMap<&'static str, Vec<&'static str>>,
    /// Points of the line protocol.
    pub influx: Lines,
    /// Columns of the Parquet output.
    pub parquet: Batches,
    /// What the vehicle told, for what can only be made in order.
    pub observed: Vec<Observed>,
    /// Frames written.
    pub frames: u64,
    /// Records written.
    pub records: u64,
    /// What the log says was lost while recording.
    pub losses: u64,
}

impl<'a> Collected<'a> {
    /// Nothing yet.
    pub fn new(context: &'a Context) -> Self {
        Self {
            context,
            tlog: Vec::new(),
            jsonl: Vec::new(),
            tables: BTreeMap::new(),
            headers: BTreeMap::new(),
            influx: Lines::default(),
            parquet: Batches::default(),
            observed: Vec::new(),
            frames: 0,
            records: 0,
            losses: 0,
        }
    }

    fn frame(&mut self, at: Instant, bytes: &[u8], verified: bool, wanted: bool) {
        let formats = self.context.formats;
        if formats.influx || formats.thesis {
            self.observe(at, bytes, verified);
        }
        let Peek::Frame(frame) = peek(bytes) else { return };
        if !wanted || !self.context.selection.has_id(frame.id) {
            return;
        }
        self.frames += 1;
        if formats.tlog {
            let utc = self.context.epoch_us.unwrap_or(0).saturating_add(at.as_micros());
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
            self.parquet.frame(at, self.context.epoch_us, &frame, known.as_ref());
        }
    }

    /// Whether wanted or not: what is wanted later depends on what the vehicle was before.
    fn observe(&mut self, at: Instant, bytes: &[u8], verified: bool) {
        let check = if verified { Check::Verified } else { Check::Unverified };
        let told = link::Frame::again(bytes, check).and_then(|frame| observe(&frame));
        if let Some((source, observation)) = told {
            self.observed.push(Observed { at, source, observation });
        }
    }

    fn csv_frame(&mut self, at: Instant, frame: &Frame<'_>, known: Option<&Payload>) {
        let out = self.tables.entry(Table::of(frame, known.is_some())).or_default();
        push_times_csv(out, at, self.context.epoch_us);
        for number in [frame.system, frame.component] {
            out.push(b',');
            push_integer(out, u64::from(number));
        }
        if let Some(payload) = known {
            push_csv_cells(out, payload);
        } else {
            out.push(b',');
            push_integer(out, u64::from(frame.sequence));
            out.push(b',');
            push_hex(out, frame.payload);
        }
        out.push(b'\n');
    }

    fn json_frame(&mut self, at: Instant, frame: &Frame<'_>, known: Option<&Payload>) {
        let out = &mut self.jsonl;
        push_times_json(out, at, self.context.epoch_us);
        for (name, number) in [(&b",\"system\":"[..], frame.system), (b",\"component\":", frame.component)] {
            out.extend_from_slice(name);
            push_integer(out, u64::from(number));
        }
        out.extend_from_slice(b",\"id\":");
        push_integer(out, u64::from(frame.id));
        out.extend_from_slice(b",\"message\":");
        match frame.message() {
            Some(message) => push_json_text(out, message.name.as_bytes()),
            None => push_json_text(out, format!("UNKNOWN_{}", frame.id).as_bytes()),
        }
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
                push_times_csv(out, at, self.context.epoch_us);
                for (_, cell) in &row.cells {
                    out.push(b',');
                    cell.push_csv(out);
                }
                out.push(b'\n');
            }
            if self.context.formats.jsonl {
                let out = &mut self.jsonl;
                push_times_json(out, at, self.context.epoch_us);
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
                self.parquet.row(at, self.context.epoch_us, row);
            }
        }
    }

    /// Adds a gap.
    pub fn gap(&mut self, gap: &Gap) {
        let from = gap.from.unwrap_or(Instant::ZERO);
        if self.context.selection.overlaps(gap, self.context.epoch_us) {
            self.rows(from, &[gap_row(gap)]);
        }
    }
}

impl Collect for Collected<'_> {
    fn entry(&mut self, entry: &Entry<'_>) {
        let (Entry::Frame { at, .. } | Entry::Record { at, .. }) = *entry;
        if let Entry::Record { record: Record::Loss(loss), .. } = entry {
            self.losses += lost(loss);
        }
        let wanted = self.context.selection.has_time(at, self.context.epoch_us);
        match entry {
            Entry::Frame { bytes, verified, .. } => self.frame(at, bytes, *verified, wanted),
            Entry::Record { record, .. } if wanted => self.rows(at, &rows(record)),
            Entry::Record { .. } => {}
        }
    }
}

/// How much a loss record says the recorder lost. Noise on the line is not the recorder's loss: it was no frame.
pub fn lost(loss: &Loss) -> u64 {
    match loss.what {
        Lost::NotFrames | Lost::DamagedFrames => 0,
        Lost::UartOverrun | Lost::QueueFull | Lost::Card | Lost::Records | Lost::Other => loss.count,
    }
}

/// A gap as a row.
pub fn gap_row(gap: &Gap) -> Row {
    let time = |at: Option<Instant>| at.map_or(Cell::Unknown(CellType::Time), Cell::Time);
    let frames = gap.frames.map_or(Cell::Unknown(CellType::Count), |frames| Cell::Count(u64::from(frames)));
    Row::new(
        "HUMS_GAP",
        vec![
            ("from[s]", time(gap.from)),
            ("to[s]", time(gap.to)),
            ("cause", Cell::Text(gap.cause.name().to_owned())),
            ("sectors_lost", Cell::Count(u64::from(gap.sectors_lost))),
            ("sectors_skipped", Cell::Count(u64::from(gap.sectors_skipped))),
            ("frames_missing", frames),
        ],
    )
}

/// The first two cells of every row.
fn push_times_csv(out: &mut Vec<u8>, at: Instant, epoch_us: Option<u64>) {
    push_seconds(out, at.as_micros());
    out.push(b',');
    if let Some(epoch) = epoch_us {
        push_iso8601(out, epoch.saturating_add(at.as_micros()));
    }
}

/// The first members of every object.
fn push_times_json(out: &mut Vec<u8>, at: Instant, epoch_us: Option<u64>) {
    out.extend_from_slice(b"{\"time_boot\":");
    push_seconds(out, at.as_micros());
    out.extend_from_slice(b",\"time_utc\":");
    match epoch_us {
        Some(epoch) => {
            out.push(b'"');
            push_iso8601(out, epoch.saturating_add(at.as_micros()));
            out.push(b'"');
        }
        None => out.extend_from_slice(b"null"),
    }
}
