//! The monitor's own records and gaps as rows of tables.

use hums_blackbox::Gap;
use hums_blackbox::record::Record;

use super::checked::{BOARD, finding_row};
use super::row::{Cell, Row, count, known, quantity, single, text};
use super::wear;
use crate::loss;
use crate::names::{clock_source_name, counter_name, event_name, fault_name};
use crate::source::item::ColumnType;
use crate::source::told::Finding;

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
                ("before", text(boot.before.found.name())),
                ("before_number", count(boot.before.number)),
                ("before_session", count(boot.before.session)),
                ("before_sectors", count(boot.before.sectors)),
                ("before_frames", count(boot.before.frames)),
                ("before_check", count(boot.before.check)),
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
                ("value", quantity(parameter.value)),
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
                ("source", text(clock_source_name(clock.source))),
            ],
        ),
        Record::Finding(finding) => vec![finding_row(&Finding::from(finding), BOARD)],
        _ => recorder_rows(record),
    }
}

fn recorder_rows(record: &Record<'_>) -> Vec<Row> {
    let one = |table, cells| vec![Row::new(table, cells)];
    match record {
        Record::Usage(usage) => {
            let moment = format!("{:?}", usage.moment).to_ascii_lowercase();
            let row = |(number, value)| {
                let (name, value) = (Cell::Text(counter_name(number)), single(value));
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
        Record::Stats(stats) => {
            one("HUMS_STATS", stats.named().map(|(name, number)| (name, count(number))).collect())
        }
        Record::Fault(fault) => one(
            "HUMS_FAULT",
            vec![
                ("kind", text(fault_name(fault.kind))),
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
        Record::Lifetime(life) => wear::lifetime(life),
        Record::Exceedance(exceedance) => wear::exceedance(exceedance),
        Record::Component(component) => vec![wear::component(component)],
        Record::Mark(mark) => one(
            "HUMS_MARK",
            vec![
                ("why", text(mark.why.name())),
                ("sector", count(mark.sector)),
                ("frames", count(mark.frames)),
            ],
        ),
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

/// A gap as a row.
pub fn gap_row(gap: &Gap) -> Row {
    let time = |at| known(at, Cell::Time, ColumnType::Double);
    let number = |number: Option<u32>| known(number, count, ColumnType::Unsigned);
    Row::new(
        "HUMS_GAP",
        vec![
            ("from[s]", time(gap.from)),
            ("to[s]", time(gap.to)),
            ("cause", text(gap.cause.name())),
            ("sectors_lost", number(loss::sectors_lost(gap))),
            ("sectors_skipped", count(gap.sectors_skipped)),
            ("frames_missing", number(gap.frames)),
        ],
    )
}
