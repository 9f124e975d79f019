//! `hums due`: what each part of a vehicle has run, and what is left of it; and the hours of each vehicle.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use anyhow::Result;
use hums_analysis::log_json::finite;
use hums_analysis::order::{self, LogTime};
use serde::Serialize;

use super::each::each;
use super::number::short;
use crate::cli;
use crate::colour::level;
use crate::names::{autopilot_name, type_name};
use crate::outcome::Outcome;
use crate::output::{self, Schema};
use crate::part::Limit;
use crate::plural::count;
use crate::printable::word;
use crate::source::find::{FoundRecordings, find_each};
use crate::source::recording::LogPlace;
use crate::summary::{ComponentLine, Overview};
use crate::table::{Table, left};
use crate::utc::{clock, iso8601};

const SCHEMA: Schema = Schema::first("hums-due");
const DAY_US: f64 = 86_400e6;

/// Runs `hums due`.
pub fn run(args: &cli::Due) -> Result<Outcome> {
    let found = find_each(&args.inputs, false)?;
    let mut logs = Vec::new();
    let read = each(&found, None, |log| {
        if log.ending.is_counted() {
            logs.push((LogTime::of(log), (vehicle(log, &found, args.vehicle.as_deref()), Log::of(log))));
        }
        Ok(())
    })?;
    let mut vehicles: BTreeMap<String, Vehicle> = BTreeMap::new();
    for (time, (name, log)) in order::sort(logs) {
        let vehicle = vehicles.entry(name.clone()).or_insert_with(|| Vehicle { name, ..Vehicle::default() });
        vehicle.add(log, time.start_us);
    }
    let vehicles: Vec<VehicleJson> = vehicles.into_values().map(VehicleJson::from).collect();
    let is_due = vehicles.iter().flat_map(|vehicle| &vehicle.parts).any(|part| part.status == "red");
    if args.json {
        output::json(SCHEMA, &DueJson { vehicles })?;
    } else {
        vehicles.iter().try_for_each(|vehicle| output::line(text(vehicle).trim_end()))?;
    }
    Ok(read.end()?.and(if is_due { Outcome::Findings } else { Outcome::Done }))
}

fn vehicle(log: &Overview, found: &FoundRecordings, given: Option<&str>) -> String {
    let known = log.contents.vehicle;
    if let Some(vehicle) = known.filter(|vehicle| vehicle.uid != 0) {
        return format!("uid {:016x}, {}", vehicle.uid, type_name(vehicle.vehicle_type));
    }
    if let Some(given) = given {
        return given.to_owned();
    }
    let place = found.places.iter().find(|place| place.name == log.ending.name);
    let folder = place.and_then(LogPlace::folder);
    let folder = folder.map_or_else(|| "no folder".to_owned(), |folder| folder.display().to_string());
    let kind = known.map_or_else(
        || "unknown vehicle".to_owned(),
        |vehicle| format!("{}, {}", type_name(vehicle.vehicle_type), autopilot_name(vehicle.autopilot)),
    );
    format!("folder {folder}, {kind}")
}

struct Log {
    flight_s: f64,
    flights: u64,
    parts: Vec<(u8, ComponentLine, Option<Limit>)>,
    is_of_box: bool,
}

impl Log {
    fn of(log: &Overview) -> Self {
        let contents = &log.contents;
        let part =
            |(place, line): (&u8, &ComponentLine)| (*place, line.clone(), contents.first_limit(*place, line));
        Self {
            flight_s: log.flight_s().unwrap_or(0.0),
            flights: contents.flights().len() as u64,
            parts: contents.components.iter().map(part).collect(),
            is_of_box: contents.boot.is_some(),
        }
    }
}

#[derive(Default)]
struct Vehicle {
    name: String,
    logs: u64,
    flights: u64,
    flight_s: f64,
    /// First and last start, microseconds since 1970.
    span_us: Option<(u64, u64)>,
    is_of_box: bool,
    /// By place, from 1.
    parts: BTreeMap<u8, PartInUse>,
}

struct PartInUse {
    line: ComponentLine,
    limit: Option<Limit>,
    /// Figures of the first log that has it.
    first: (f64, f64, Option<u64>),
    last_us: Option<u64>,
    /// The logs have an earlier part in its place.
    is_new: bool,
}

impl Vehicle {
    fn add(&mut self, log: Log, start_us: Option<u64>) {
        self.logs += 1;
        self.flights += log.flights;
        self.flight_s += log.flight_s;
        self.is_of_box |= log.is_of_box;
        if let Some(at) = start_us {
            let (first, last) = self.span_us.unwrap_or((at, at));
            self.span_us = Some((first.min(at), last.max(at)));
        }
        for (place, line, limit) in log.parts {
            let first = (limit.map_or(0.0, |limit| limit.run), line.figures.flights, start_us);
            let new = |is_new| PartInUse { line: line.clone(), limit, first, last_us: start_us, is_new };
            let part = self.parts.entry(place).or_insert_with(|| new(false));
            let is_same = |of: &PartInUse| {
                (of.line.kind, of.line.number, &of.line.serial, of.line.replaced)
                    == (line.kind, line.number, &line.serial, line.replaced)
            };
            if is_same(part) {
                // Another unit has another history.
                if part.limit.map(|limit| limit.end) != limit.map(|limit| limit.end) {
                    part.first = first;
                }
                (part.line, part.limit, part.last_us) = (line, limit, start_us.or(part.last_us));
            } else {
                *part = new(true);
            }
        }
    }
}

#[derive(Debug, Serialize)]
struct DueJson {
    /// By their names.
    vehicles: Vec<VehicleJson>,
}

#[derive(Debug, Serialize)]
struct VehicleJson {
    /// Unique id, folder or `--vehicle`.
    vehicle: String,
    /// Number of logs.
    logs: u64,
    flights: u64,
    flight_s: f64,
    /// Start of the first log.
    first_utc: Option<String>,
    /// Start of the last log.
    last_utc: Option<String>,
    #[serde(skip)]
    is_of_box: bool,
    /// The most used first; empty without a box.
    parts: Vec<PartJson>,
}

#[derive(Debug, Serialize)]
struct PartJson {
    /// Component, from 1.
    place: u8,
    part: String,
    /// As `hums box replaced` has it.
    #[serde(skip)]
    name: String,
    serial: String,
    /// `green`, `yellow`, `red`.
    status: &'static str,
    /// Of the limit that it reaches first; `null` without a limit.
    used_percent: Option<f32>,
    run: Option<f64>,
    limit: Option<f64>,
    left: Option<f64>,
    /// Of `run`, `limit`, `left`: `h`, `flights`, `cycles`.
    unit: Option<&'static str>,
    /// Hours that count: `in the air`, `powered`, `turning`.
    hours: Option<&'static str>,
    /// At the rate of the logs read.
    left_flights: Option<f64>,
    /// At the rate of the logs read.
    due_utc: Option<String>,
    /// Start of the first log with this part.
    since_utc: Option<String>,
    /// False: the part may be older.
    since_known: bool,
    /// The limit's parameter.
    rule: Option<String>,
}

impl From<Vehicle> for VehicleJson {
    fn from(of: Vehicle) -> Self {
        let (first, last) = of.span_us.unzip();
        let mut parts: Vec<PartJson> =
            of.parts.iter().map(|(place, part)| PartJson::of(*place, part)).collect();
        let used = |part: &PartJson| part.used_percent.unwrap_or(f32::NEG_INFINITY);
        parts.sort_by(|one, other| used(other).total_cmp(&used(one)));
        Self {
            vehicle: of.name,
            logs: of.logs,
            flights: of.flights,
            flight_s: of.flight_s,
            first_utc: first.map(iso8601),
            last_utc: last.map(iso8601),
            is_of_box: of.is_of_box,
            parts,
        }
    }
}

impl PartJson {
    fn of(place: u8, part: &PartInUse) -> Self {
        let PartInUse { line, limit, first: (first_run, first_flights, first_us), last_us, is_new } = part;
        let left = limit.map(|limit| (limit.limit - limit.run).max(0.0));
        let ran = limit.map_or(0.0, |limit| limit.run);
        // Over the logs; of a single log over the part's life.
        let (recently, flights) = match (ran - first_run, line.figures.flights - first_flights) {
            (recently, flights) if recently > 0.0 && flights > 0.0 => (recently, flights),
            _ => (ran, line.figures.flights),
        };
        let left_flights = left.filter(|_| recently > 0.0 && flights > 0.0);
        let left_flights = left_flights.map(|left| (left * flights / recently).floor());
        let span_us = first_us.zip(*last_us).map_or(0.0, |(first, last)| last.saturating_sub(first) as f64);
        let recently = ran - first_run;
        let due_us = left.zip(*last_us).filter(|_| span_us >= DAY_US && recently > 0.0);
        // Saturates: a hardly used part has a far date.
        let due_us = due_us.map(|(left, last)| last.saturating_add((left * span_us / recently) as u64));
        Self {
            place,
            part: crate::part::name(line.kind, line.number, &line.name),
            name: crate::part::name(line.kind, line.number, ""),
            serial: line.serial.clone(),
            status: line.status,
            used_percent: finite(line.used_percent).filter(|_| limit.is_some()),
            run: limit.map(|limit| limit.run),
            limit: limit.map(|limit| limit.limit),
            left,
            unit: limit.map(|limit| limit.unit),
            hours: limit.map(|limit| limit.how).filter(|how| !how.is_empty()),
            left_flights,
            due_utc: due_us.map(iso8601),
            since_utc: first_us.map(iso8601),
            since_known: *is_new,
            rule: limit.map(|limit| format!("CMP{place}{}", limit.end)),
        }
    }

    fn left_words(&self) -> String {
        let (Some(left), Some(unit)) = (self.left, self.unit) else { return "no limit".to_owned() };
        if left <= 0.0 {
            return "due now".to_owned();
        }
        let mut text = amount(left, unit);
        if let Some(flights) = self.left_flights.filter(|_| unit != "flights") {
            let _ = write!(text, ", {}", count(flights as u64, "flight"));
        }
        if let Some(date) = &self.due_utc {
            let _ = write!(text, ", to {}", day(date));
        }
        text
    }
}

/// `3 flights`, `2.1 h`.
fn amount(value: f64, unit: &str) -> String {
    match unit.strip_suffix('s') {
        Some(one) if value.fract() == 0.0 => count(value as u64, one),
        _ => format!("{} {unit}", tenths(value)),
    }
}

/// A number to a tenth.
fn tenths(value: f64) -> String {
    short((value * 10.0).round() / 10.0)
}

fn day(utc: &str) -> &str {
    utc.get(..10).unwrap_or(utc)
}

fn text(vehicle: &VehicleJson) -> String {
    let span = match (&vehicle.first_utc, &vehicle.last_utc) {
        (Some(first), Some(last)) if day(first) == day(last) => format!(", {}", day(first)),
        (Some(first), Some(last)) => format!(", {} to {}", day(first), day(last)),
        _ => String::new(),
    };
    let time = clock(hums_core::clock::Span::from_micros((vehicle.flight_s * 1e6) as u64));
    let by = if vehicle.is_of_box { " as the box counts" } else { "" };
    let mut text = format!(
        "{}: {}, {}, {time} in the air{by}{span}\n",
        word(&vehicle.vehicle),
        count(vehicle.logs, "log"),
        count(vehicle.flights, "flight"),
    );
    if vehicle.parts.is_empty() {
        let why = "  no part is registered with the box: CMP1_KIND and its limits do that\n";
        text.push_str(if vehicle.is_of_box { why } else { "" });
        return text;
    }
    let columns = [left(8), left(0), left(0), left(0), left(0), left(0), left(0)];
    let mut table = Table::new(2, columns);
    table.heading(["", "used", "part", "serial", "run of limit", "left at this rate", "since"]);
    vehicle.parts.iter().map(row).for_each(|row| table.row(row));
    let _ = write!(text, "{table}");
    let rules = vehicle.parts.iter().filter_map(|part| part.rule.as_deref()).collect::<Vec<_>>().join(", ");
    if !rules.is_empty() {
        let _ = writeln!(text, "  limits by {rules}");
    }
    if let Some(due) = vehicle.parts.iter().find(|part| part.status == "red") {
        let command = format!("hums box replaced {} --serial SERIAL", due.name);
        let _ =
            writeln!(text, "  once replaced or serviced: {command} --link SRC, or --card DIR of the card");
    }
    text
}

fn row(part: &PartJson) -> [String; 7] {
    let status = match part.status {
        "red" => "DUE",
        "yellow" => "soon",
        _ => "ok",
    };
    let used = part.used_percent.map_or_else(String::new, |used| format!("{used:.0} %"));
    let run = match (part.run, part.limit, part.unit) {
        (Some(run), Some(limit), Some(unit)) => {
            format!("{} of {} {}", tenths(run), amount(limit, unit), part.hours.unwrap_or_default())
        }
        _ => String::new(),
    };
    let since = part.since_utc.as_deref().map_or("", day);
    let since = match (since, part.since_known) {
        ("", _) | (_, true) => since.to_owned(),
        (since, false) => format!("before {since}"),
    };
    [
        level(status).to_string(),
        used,
        word(&part.part).into_owned(),
        word(&part.serial).into_owned(),
        run.trim_end().to_owned(),
        part.left_words(),
        since,
    ]
}
