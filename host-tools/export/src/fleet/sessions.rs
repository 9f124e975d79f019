//! The table `sessions`: a row for each session.

use std::sync::LazyLock;

use hums_analysis::log_json::{VehicleJson, duration_s, finite, vehicle};
use hums_core::figures::Quantity;
use hums_core::health::Level;
use hums_core::usage::UsageCounter;
use serde::Serialize;

use super::SESSIONS;
use crate::check::grouped::{Group, grouped};
use crate::checked::{Checked, FindingCount, problems_of};
use crate::context::Context;
use crate::hex::hex;
use crate::identity::RecordingContent;
use crate::names::{CounterName, counter_meaning, counter_name};
use crate::row::{Cell, Row, count, known, quantity, single, text};
use crate::source::item::ColumnType;
use crate::source::recording::Format;
use crate::summary::BootLine;
use crate::wear::parts_of;

static COUNTERS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let has_column = |number: &u8| match counter_meaning(*number) {
        Some(CounterName::Vehicle(_) | CounterName::Motor("run_time_s", _)) => true,
        Some(CounterName::Figure(figure)) => {
            !matches!(figure, Quantity::MotorSpeed(_) | Quantity::MotorOutput(_))
        }
        _ => false,
    };
    (0..=u8::MAX).filter(has_column).map(counter_name).collect()
});

#[derive(Serialize)]
struct ProblemJson<'a> {
    level: &'static str,
    check: &'a str,
    instance: u8,
    /// Number of changes from good to a warning or worse.
    times: u32,
    /// Time of the worst level, s since power-on.
    at_s: f64,
    /// Worst value; `null` if the input stopped.
    value: Option<f32>,
    limit: Option<f32>,
    unit: &'a str,
}

/// The whole recording counts, also if a part is decoded.
pub(crate) fn row(context: &Context, about: &RecordingContent) -> Row {
    let RecordingContent { overview, board, fingerprint, track, .. } = about;
    let summary = &overview.ending.summary;
    let place = track.points().first();
    let end_utc_us = summary.last.and_then(|last| context.epochs.utc_us(last));
    let mut cells = vec![
        ("fingerprint", text(hex(fingerprint))),
        ("file", known(overview.file_name(), text, ColumnType::Text)),
        ("format", text(overview.format.map_or("hums", Format::name))),
        ("end_utc", known(end_utc_us, count, ColumnType::Unsigned)),
        ("duration[s]", quantity(duration_s(overview))),
        ("latitude[deg]", known(place.map(|place| place.latitude_deg), quantity, ColumnType::Double)),
        ("longitude[deg]", known(place.map(|place| place.longitude_deg), quantity, ColumnType::Double)),
        ("box", known(board.map(|board| hex(&board)), text, ColumnType::Text)),
    ];
    cells.extend(machines(about));
    cells.extend(record(about));
    cells.extend(health(context, about));
    let contents = &overview.contents;
    let counter = |name: &'static String| {
        let counted = contents.usage.get(name).copied();
        // The counters count since power-on, and a later log of one power-on begins with them.
        let value = if *name == UsageCounter::Flight.name() {
            overview.flight_s()
        } else if *name == UsageCounter::Flights.name() {
            counted.map(|_| contents.flights().len() as f64)
        } else {
            counted
        };
        (name.as_str(), known(value, quantity, ColumnType::Double))
    };
    cells.extend(COUNTERS.iter().map(counter));
    Row::new(SESSIONS, cells)
}

fn machines(about: &RecordingContent) -> Vec<(&'static str, Cell)> {
    let vehicle = vehicle(&about.overview);
    let of_vehicle =
        |of: fn(&VehicleJson) -> Option<String>| known(vehicle.as_ref().and_then(of), text, ColumnType::Text);
    let boot = about.overview.contents.boot.as_ref();
    let of_box =
        |of: fn(&BootLine) -> &String| known(boot.map(|boot| of(boot).clone()), text, ColumnType::Text);
    vec![
        ("autopilot", of_vehicle(|vehicle| Some(vehicle.autopilot.clone()))),
        ("type", of_vehicle(|vehicle| Some(vehicle.r#type.clone()))),
        ("firmware", of_vehicle(|vehicle| vehicle.firmware.clone())),
        ("box_version", of_box(|boot| &boot.version)),
        ("box_git", of_box(|boot| &boot.git)),
        ("box_board", of_box(|boot| &boot.board)),
    ]
}

fn record(about: &RecordingContent) -> Vec<(&'static str, Cell)> {
    let overview = &about.overview;
    let bytes = if overview.format.is_some() { overview.bytes_on_card } else { overview.log_bytes() };
    let stats = overview.contents.stats.as_ref();
    let number = |value: Option<u64>| known(value, count, ColumnType::Unsigned);
    let queue = stats
        .filter(|stats| stats.queue_bytes_capacity > 0)
        .map(|stats| 100.0 * stats.queue_bytes_max as f64 / stats.queue_bytes_capacity as f64);
    vec![
        ("whole", Cell::Flag(overview.is_sound())),
        ("gaps", count(overview.ending.summary.gaps + overview.ending.summary.losses)),
        ("frames", count(overview.contents.frames())),
        ("log_bytes", count(bytes)),
        ("compression_ratio", known(overview.ratio(), quantity, ColumnType::Double)),
        ("frames_in", number(stats.map(|stats| stats.frames_in))),
        ("frames_lost", number(stats.map(|stats| stats.frames_lost))),
        ("queue[%]", known(queue, quantity, ColumnType::Double)),
        ("longest_stall[ms]", number(stats.map(|stats| stats.sd_stall_ms_max))),
    ]
}

fn health(context: &Context, about: &RecordingContent) -> Vec<(&'static str, Cell)> {
    let contents = &about.overview.contents;
    let checked = context.checked.as_ref().map_or_else(
        || {
            let mut on_board = FindingCount::default();
            contents.findings.iter().for_each(|finding| on_board.add(finding.level));
            on_board.row()
        },
        |checked: &Checked| checked.row(None),
    );
    let mut cells = checked.cells;
    let problems = problems_of(contents);
    let of_level = |level: Level| problems.iter().filter(|problem| problem.level == level).count() as u64;
    let groups = grouped(&problems);
    let worst = groups.first().and_then(Group::first);
    let json: Vec<ProblemJson<'_>> = problems
        .iter()
        .map(|problem| ProblemJson {
            level: problem.level.name(),
            check: &problem.check,
            instance: problem.instance,
            times: problem.times,
            at_s: problem.at.as_secs_f64(),
            value: finite(problem.value),
            limit: finite(problem.limit),
            unit: &problem.unit,
        })
        .collect();
    let parts = parts_of(contents);
    let due = parts.iter().filter(|part| part.used_percent.is_some());
    let due = due
        .max_by(|one, other| one.used_percent.unwrap_or(0.0).total_cmp(&other.used_percent.unwrap_or(0.0)));
    cells.extend([
        ("criticals", count(of_level(Level::Critical))),
        ("warnings", count(of_level(Level::Warning))),
        ("worst_check", known(worst.map(|worst| worst.check.clone()), text, ColumnType::Text)),
        ("worst_level", known(worst.map(|worst| worst.level.name().to_owned()), text, ColumnType::Text)),
        ("problems", text(serde_json::to_string(&json).unwrap_or_default())),
        ("most_used_part", known(due.map(|part| part.name.clone()), text, ColumnType::Text)),
        ("most_used[%]", known(due.and_then(|part| part.used_percent), single, ColumnType::Single)),
        ("parts", text(serde_json::to_string(&parts).unwrap_or_default())),
    ]);
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_later_log_of_one_power_on_has_its_own_flights_and_not_those_before_it() {
        let mut about = RecordingContent::default();
        let usage = [("flight_time_s", 900.0), ("flights", 3.0), ("charge_ah", 2.0)];
        about.overview.contents.usage = usage.map(|(name, value)| (name.to_owned(), value)).into();
        about.overview.contents.flight_before_s = Some(600.0);
        about.overview.contents.moves = vec![(hums_core::clock::Instant::from_millis(700_000), true)];
        about.overview.ending.summary.first_number = Some(9);
        let row = row(&Context::default(), &about);
        let cell = |name| row.cells.iter().find(|(of, _)| *of == name).map(|(_, cell)| cell.clone());
        let cells = ["flight_time_s", "flights", "charge_ah"].map(cell);
        assert_eq!(cells, [300.0, 1.0, 2.0].map(|value| Some(quantity(value))));
    }
}
