//! The monitor's own records as rows of tables: `HUMS_FINDING`, `HUMS_USAGE`, `HUMS_LOSS` and so on.

use hums_blackbox::record::Record;
use hums_core::time::Instant;

use super::text::{push_csv_number, push_csv_text, push_hex, push_integer, push_json_number, push_json_text};
use crate::mavlink::values::Scalar;

/// One value of a row.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A count or a number that names something.
    Count(u64),
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
    /// Not known; it would be of this type.
    Unknown(CellType),
}

/// The type of a cell, which is that of its column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellType {
    /// [`Cell::Count`]
    Count,
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

fn text(text: &str) -> Cell {
    Cell::Text(text.to_owned())
}

fn count(number: impl Into<u64>) -> Cell {
    Cell::Count(number.into())
}

/// The rows of a record: one, but for usage one a counter.
pub fn rows(record: &Record<'_>) -> Vec<Row> {
    let one = |table, cells| vec![Row::new(table, cells)];
    match record {
        Record::Boot(boot) => one(
            "HUMS_BOOT",
            vec![
                ("version", text(boot.version)),
                ("git", text(boot.git)),
                ("board", text(boot.board)),
                ("reset", count(boot.reset)),
                ("reset_name", text(boot.reset_name)),
                ("uid", Cell::Hex(boot.uid.to_vec())),
                ("boots", count(boot.boots)),
            ],
        ),
        Record::Vehicle(vehicle) => one(
            "HUMS_VEHICLE",
            vec![
                ("system", count(vehicle.system)),
                ("component", count(vehicle.component)),
                ("autopilot", count(vehicle.autopilot)),
                ("type", count(vehicle.vehicle_type)),
                ("firmware", count(vehicle.firmware)),
                ("uid", count(vehicle.uid)),
            ],
        ),
        Record::Parameter(parameter) => one(
            "HUMS_PARAM",
            vec![
                ("name", text(parameter.name)),
                ("value", Cell::Double(parameter.value)),
                ("changed", Cell::Flag(parameter.changed)),
                ("by_system", count(parameter.by.0)),
                ("by_component", count(parameter.by.1)),
            ],
        ),
        Record::Clock(clock) => one(
            "HUMS_CLOCK",
            vec![
                ("boot[s]", Cell::Time(clock.boot)),
                ("utc[us]", count(clock.utc_micros)),
                ("source", text(clock_source(clock.source))),
            ],
        ),
        Record::Finding(finding) => one(
            "HUMS_FINDING",
            vec![
                ("at[s]", Cell::Time(finding.at)),
                ("subsystem", text(finding.subsystem.name())),
                ("check", text(finding.check)),
                ("instance", count(finding.instance)),
                ("level", text(finding.level.name())),
                ("previous", text(finding.previous.name())),
                ("value", Cell::Single(finding.value)),
                ("limit", Cell::Single(finding.limit)),
                ("unit", text(finding.unit)),
            ],
        ),
        _ => recorder_rows(record),
    }
}

fn recorder_rows(record: &Record<'_>) -> Vec<Row> {
    let one = |table, cells| vec![Row::new(table, cells)];
    match record {
        Record::Usage(usage) => {
            let moment = format!("{:?}", usage.moment).to_ascii_lowercase();
            let row = |(number, value)| {
                let (name, value) = (Cell::Text(super::usage::name(number)), Cell::Single(value));
                Row::new("HUMS_USAGE", vec![("moment", text(&moment)), ("counter", name), ("value", value)])
            };
            usage.iter().map(row).collect()
        }
        Record::Loss(loss) => one(
            "HUMS_LOSS",
            vec![
                ("what", text(loss.what.name())),
                ("count", count(loss.count)),
                ("from[s]", Cell::Time(loss.from)),
                ("to[s]", Cell::Time(loss.to)),
            ],
        ),
        Record::Stats(stats) => one(
            "HUMS_STATS",
            vec![
                ("frames_in", count(stats.frames_in)),
                ("frames_logged", count(stats.frames_logged)),
                ("frames_lost", count(stats.frames_lost)),
                ("bytes_in", count(stats.bytes_in)),
                ("bytes_not_frames", count(stats.bytes_not_frames)),
                ("bytes_logged", count(stats.bytes_logged)),
                ("blocks_written", count(stats.blocks_written)),
                ("queue_bytes_max", count(stats.queue_bytes_max)),
                ("queue_bytes_capacity", count(stats.queue_bytes_capacity)),
                ("sd_stall_ms_max", count(stats.sd_stall_ms_max)),
                ("gs_frames", count(stats.gs_frames)),
                ("gs_bytes", count(stats.gs_bytes)),
                ("frame_queue_bytes_max", count(stats.frame_queue_bytes_max)),
                ("frame_queue_bytes_capacity", count(stats.frame_queue_bytes_capacity)),
                ("gs_queue_bytes_max", count(stats.gs_queue_bytes_max)),
                ("gs_queue_bytes_capacity", count(stats.gs_queue_bytes_capacity)),
                ("cpu_permille", count(stats.cpu_permille)),
                ("cpu_permille_max", count(stats.cpu_permille_max)),
                ("stack_bytes_max", count(stats.stack_bytes_max)),
                ("stack_bytes_capacity", count(stats.stack_bytes_capacity)),
            ],
        ),
        Record::Fault(fault) => one(
            "HUMS_FAULT",
            vec![
                ("kind", text(fault_kind(fault.kind))),
                ("task", text(fault.task)),
                ("place", text(fault.place)),
                (
                    "registers",
                    Cell::Hex(fault.registers.iter().flat_map(|register| register.to_be_bytes()).collect()),
                ),
                ("message", text(fault.message)),
            ],
        ),
        Record::Event(event) => {
            one("HUMS_EVENT", vec![("event", text(event_name(event.number))), ("text", text(event.text))])
        }
        Record::Note(note) => {
            one("HUMS_NOTE", vec![("severity", count(note.severity)), ("text", text(note.text))])
        }
        Record::Lifetime(life) => super::wear::lifetime(life),
        Record::Exceedance(exceedance) => super::wear::exceedance(exceedance),
        Record::Component(component) => vec![super::wear::component(component)],
        Record::Keep(keep) => one(
            "HUMS_KEEP",
            vec![
                ("all", count(u8::from(keep.all))),
                ("from_sector", count(keep.from)),
                ("seconds", count(keep.seconds)),
            ],
        ),
        Record::Snapshot(snapshot) => super::wear::snapshot(snapshot),
        Record::Protection(protection) => one(
            "HUMS_PROTECTION",
            vec![
                ("action", text(protection.action.name())),
                ("stage", text(protection.stage.name())),
                ("detail", count(protection.detail)),
                ("command", count(protection.command)),
            ],
        ),
        Record::Unknown { kind, version, bytes } => one(
            "HUMS_UNKNOWN",
            vec![("kind", count(*kind)), ("version", count(*version)), ("bytes", Cell::Hex(bytes.to_vec()))],
        ),
        // A kind that this version of the host tools has no table for; the record itself stays in the log.
        _ => Vec::new(),
    }
}

fn clock_source(number: u8) -> &'static str {
    match number {
        1 => "SYSTEM_TIME",
        2 => "recording",
        3 => "GNSS",
        _ => "unknown",
    }
}

fn fault_kind(number: u8) -> &'static str {
    match number {
        1 => "panic",
        2 => "hard_fault",
        3 => "watchdog",
        _ => "unknown",
    }
}

/// The name of an event's number.
pub fn event_name(number: u8) -> &'static str {
    match number {
        1 => "armed",
        2 => "disarmed",
        3 => "take_off",
        4 => "landing",
        5 => "snapshot",
        6 => "card_in",
        7 => "card_out",
        8 => "critical",
        9 => "phase",
        10 => "autopilot_reboot",
        11 => "other_airframe",
        12 => "by_link",
        _ => "other",
    }
}

impl Cell {
    /// Its type.
    pub fn cell_type(&self) -> CellType {
        match self {
            Self::Count(_) => CellType::Count,
            Self::Single(_) => CellType::Single,
            Self::Double(_) => CellType::Double,
            Self::Time(_) => CellType::Time,
            Self::Flag(_) => CellType::Flag,
            Self::Text(_) => CellType::Text,
            Self::Hex(_) => CellType::Hex,
            Self::Unknown(cell_type) => *cell_type,
        }
    }

    /// As a CSV cell; what is not known is empty.
    pub fn push_csv(&self, out: &mut Vec<u8>) {
        match self {
            Self::Count(value) => push_integer(out, *value),
            Self::Single(value) => push_csv_number(out, Scalar::Single(*value)),
            Self::Double(value) => push_csv_number(out, Scalar::Double(*value)),
            Self::Time(at) => crate::utc::push_seconds(out, at.as_micros()),
            Self::Flag(value) => out.extend_from_slice(if *value { b"true" } else { b"false" }),
            Self::Text(text) => push_csv_text(out, text.as_bytes()),
            Self::Hex(bytes) => push_hex(out, bytes),
            Self::Unknown(_) => {}
        }
    }

    /// As a JSON value.
    pub fn push_json(&self, out: &mut Vec<u8>) {
        match self {
            Self::Single(value) => push_json_number(out, Scalar::Single(*value)),
            Self::Double(value) => push_json_number(out, Scalar::Double(*value)),
            Self::Text(text) => push_json_text(out, text.as_bytes()),
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
