//! The fleet by its table `sessions`: vehicles, parts that are due, worst findings, and vehicles that differ from the others.
//!
//! Vehicles of one autopilot and type are compared by each figure of steady flight. A vehicle's figure is the median of its
//! sessions. It is an outlier if its modified z-score is above 3.5: 0.6745 |x - median| / MAD, with the median of the
//! vehicles, and MAD the median of their distances from it (Iglewicz and Hoaglin 1993, in the NIST/SEMATECH e-Handbook of
//! Statistical Methods, 1.3.5.17). Distances below the figure's grain count as none ([`Quantity::grain`]).

use std::cmp::Reverse;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, Result};
use hums_analysis::check::problem::side;
use hums_analysis::counters::of_figure;
use hums_analysis::states::{ShownValue, shown};
use hums_core::figures::Quantity;
use hums_core::health::Side;
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::{Field, Row};
use parquet::schema::types::Type;
use serde::{Deserialize, Serialize};

use super::transaction;
use super::{EXTENSION, SESSIONS, folders, names};
use crate::names::{CounterName, check_name, counter_meaning, counter_name, unit_name};

/// Vehicles of a kind at least: the median of fewer says little.
const VEHICLES_MIN: usize = 5;
const SCORE_MAX: f64 = 3.5;
/// The normal distribution's quartile, which makes MAD comparable with a standard deviation.
const QUARTILE: f64 = 0.6745;
/// Findings of a page at most: vehicles and checks.
const FINDINGS_MAX: usize = 2_000;
const COLUMNS: &str = "vehicle session utc end_utc autopilot type firmware flights flight_time_s criticals warnings problems parts";

/// A fleet, for its page.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Overview {
    /// Rows of the table.
    pub sessions: u64,
    /// Sessions whose flights another recorder of the vehicle has too: they are summed once.
    pub overlapping: u64,
    /// In the order of their names.
    pub vehicles: Vec<Vehicle>,
    /// Parts that are due or soon due by their vehicle's last session, most used first.
    pub due: Vec<DuePart>,
    /// Worst first.
    pub findings: Vec<VehicleProblem>,
    /// Findings that a page has no room for.
    pub findings_left_out: usize,
    /// Farthest first.
    pub outliers: Vec<Outlier>,
    /// Vehicles of kinds that are too few to compare.
    pub not_compared: usize,
}

/// A vehicle with the sums of its sessions.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Vehicle {
    /// Its name.
    pub vehicle: String,
    /// Autopilot and type.
    pub kind: String,
    /// Of its last session.
    pub firmware: String,
    /// Their number.
    pub sessions: u64,
    /// Their number.
    pub flights: f64,
    /// Seconds in the air.
    pub flight_s: f64,
    /// First and last day, UTC; empty if unknown.
    pub days: (String, String),
    /// Critical problems.
    pub critical: f64,
    /// Problems with a warning.
    pub warning: f64,
}

/// A part, as in the table's JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DuePart {
    #[serde(default)]
    vehicle: String,
    part: String,
    serial: String,
    status: String,
    used_percent: Option<f64>,
    limit: Option<String>,
}

/// A problem, as in the table's JSON.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Problem {
    level: String,
    check: String,
    instance: u8,
    /// The name of a state, which has neither value nor limit for people.
    #[serde(skip_deserializing)]
    state: Option<&'static str>,
    value: Option<f32>,
    limit: Option<f32>,
    unit: String,
}

/// A problem of a vehicle in all of its sessions, with the worst value of the worst level.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VehicleProblem {
    vehicle: String,
    sessions: u64,
    session: String,
    day: String,
    /// Higher is worse; `None` without a value.
    #[serde(skip)]
    badness: Option<f32>,
    #[serde(skip)]
    at: Option<f64>,
    #[serde(flatten)]
    problem: Problem,
}

/// A figure that differs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Outlier {
    vehicle: String,
    kind: String,
    figure: String,
    value: f64,
    median: f64,
    unit: &'static str,
    decimals: u8,
    score: f64,
    vehicles: usize,
}

#[derive(Default)]
struct Gathered {
    vehicle: Vehicle,
    flown: Vec<Flown>,
    last: Option<f64>,
    last_parts: Option<f64>,
    due: Vec<DuePart>,
    findings: BTreeMap<(String, u8), VehicleProblem>,
    figures: BTreeMap<usize, Vec<f64>>,
}

/// The flights of a session, with the times of its first and last entry.
struct Flown {
    from_us: f64,
    to_us: f64,
    flights: f64,
    flight_s: f64,
}

impl Flown {
    /// Whether they share more than half of the shorter one. Clocks differ, so sessions in a row may share a little.
    fn is_same_time(&self, other: &Self) -> bool {
        let shared = self.to_us.min(other.to_us) - self.from_us.max(other.from_us);
        2.0 * shared > (self.to_us - self.from_us).min(other.to_us - other.from_us)
    }
}

/// The sessions of a vehicle to sum: of those of the same time the one with more time in the air.
fn once(mut flown: Vec<Flown>) -> Vec<Flown> {
    flown.sort_by(|one, other| one.from_us.total_cmp(&other.from_us));
    let mut kept: Vec<Flown> = Vec::new();
    for next in flown {
        match kept.last_mut().filter(|last| last.is_same_time(&next)) {
            Some(last) if next.flight_s > last.flight_s => *last = next,
            Some(_) => {}
            None => kept.push(next),
        }
    }
    kept
}

/// Medians of a vehicle, by the number of the figure.
type Medians = BTreeMap<usize, f64>;

fn figures() -> Vec<(String, Quantity)> {
    let figure = |number| match counter_meaning(number) {
        // A motor differs from its neighbours, not from other vehicles.
        Some(CounterName::Figure(Quantity::MotorSpeed(_) | Quantity::MotorOutput(_))) | None => None,
        Some(CounterName::Figure(quantity)) => Some((counter_name(number), quantity)),
        Some(_) => None,
    };
    (0..=u8::MAX).filter_map(figure).collect()
}

/// Whether a folder has the tables of a fleet. A copy may lack the folder of this program.
pub fn is_fleet(folder: &Path) -> bool {
    folders(&folder.join(SESSIONS)).is_ok_and(|dates| dates.iter().any(|date| date.starts_with("date=")))
}

/// Reads the table `sessions` of a folder.
///
/// # Errors
/// A file of it cannot be read.
pub fn read(root: &Path) -> Result<Overview> {
    transaction::recover(root)?;
    let figures = figures();
    let mut vehicles: BTreeMap<String, Gathered> = BTreeMap::new();
    let table = root.join(SESSIONS);
    for date in folders(&table)? {
        for bucket in folders(&table.join(&date))? {
            let folder = table.join(&date).join(bucket);
            let day = date.strip_prefix("date=").filter(|day| *day != super::NO_DATE).unwrap_or_default();
            for name in names(&folder)?.iter().filter(|name| name.ends_with(EXTENSION)) {
                let path = folder.join(name);
                read_file(&path, &figures, |row| {
                    let name = text(&row, "vehicle").unwrap_or("unknown").to_owned();
                    vehicles.entry(name).or_default().add(&row, day, &figures);
                })
                .with_context(|| format!("{}: cannot be read as a table", path.display()))?;
            }
        }
    }
    Ok(Overview::of(vehicles, &figures))
}

type Cells = BTreeMap<String, Field>;

fn read_file(path: &Path, figures: &[(String, Quantity)], mut take: impl FnMut(Cells)) -> Result<()> {
    let reader = SerializedFileReader::new(File::open(path)?)?;
    let schema = reader.metadata().file_metadata().schema();
    let is_wanted = |field: &&Arc<Type>| {
        COLUMNS.split(' ').any(|name| name == field.name())
            || figures.iter().any(|(name, _)| name == field.name())
    };
    let fields = schema.get_fields().iter().filter(is_wanted).cloned().collect();
    let projection = Type::group_type_builder(schema.name()).with_fields(fields).build()?;
    for row in reader.get_row_iter(Some(projection))? {
        let row: Row = row?;
        take(row.get_column_iter().map(|(name, field)| (name.clone(), field.clone())).collect());
    }
    Ok(())
}

fn text<'a>(row: &'a Cells, name: &str) -> Option<&'a str> {
    match row.get(name)? {
        Field::Str(text) => Some(text),
        _ => None,
    }
}

fn number(row: &Cells, name: &str) -> Option<f64> {
    match row.get(name)? {
        Field::Double(value) => Some(*value),
        Field::Float(value) => Some(f64::from(*value)),
        Field::ULong(value) => Some(*value as f64),
        Field::Long(value) | Field::TimestampMicros(value) => Some(*value as f64),
        _ => None,
    }
    .filter(|value| value.is_finite())
}

fn list<T: for<'a> Deserialize<'a>>(row: &Cells, name: &str) -> Vec<T> {
    text(row, name).and_then(|text| serde_json::from_str(text).ok()).unwrap_or_default()
}

impl Gathered {
    fn add(&mut self, row: &Cells, day: &str, figures: &[(String, Quantity)]) {
        let sum = |name| number(row, name).unwrap_or(0.0);
        let said = |name| text(row, name).unwrap_or_default().to_owned();
        let at = number(row, "utc");
        let vehicle = &mut self.vehicle;
        vehicle.sessions += 1;
        vehicle.critical += sum("criticals");
        vehicle.warning += sum("warnings");
        let (first, last) = &mut vehicle.days;
        if !day.is_empty() && (first.is_empty() || day < first.as_str()) {
            day.clone_into(first);
        }
        if day > last.as_str() {
            day.clone_into(last);
        }
        let name = said("vehicle");
        let (flights, flight_s) = (sum("flights"), sum("flight_time_s"));
        // Vehicles without an id may share a name.
        let is_named = !name.starts_with("system-") && name != "unknown";
        if let Some((from_us, to_us)) = at.zip(number(row, "end_utc")).filter(|_| is_named) {
            self.flown.push(Flown { from_us, to_us, flights, flight_s });
        } else {
            vehicle.flights += flights;
            vehicle.flight_s += flight_s;
        }
        if vehicle.vehicle.is_empty() || at >= self.last {
            self.last = at;
            vehicle.vehicle.clone_from(&name);
            let kind = format!("{} {}", said("autopilot"), said("type"));
            kind.trim().clone_into(&mut vehicle.kind);
            vehicle.firmware = said("firmware");
        }
        let parts: Vec<DuePart> = list(row, "parts");
        if !parts.is_empty() && at >= self.last_parts {
            self.last_parts = at;
            let due = parts.into_iter().filter(|part| part.status != "green");
            self.due = due.map(|part| DuePart { vehicle: name.clone(), ..part }).collect();
        }
        self.add_problems(row, day, at);
        for (index, (name, _)) in figures.iter().enumerate() {
            if let Some(value) = number(row, name) {
                self.figures.entry(index).or_default().push(value);
            }
        }
    }

    fn add_problems(&mut self, row: &Cells, day: &str, at: Option<f64>) {
        let said = |name| text(row, name).unwrap_or_default().to_owned();
        let mut counted = BTreeSet::new();
        for problem in list::<Problem>(row, "problems") {
            if !matches!(problem.level.as_str(), "critical" | "warning") {
                continue;
            }
            let key = (problem.check.clone(), problem.instance);
            let check = check_name(&problem.check, &[problem.instance]);
            let unit = unit_name(&problem.unit).to_owned();
            let number = |number: Option<f32>| number.unwrap_or(f32::NAN);
            let sign = if side(&problem.check) == Side::Below { -1.0 } else { 1.0 };
            let badness = problem.value.map(|value| sign * value);
            let (state, value, limit) =
                match shown(&problem.check, number(problem.value), number(problem.limit)) {
                    ShownValue::State(state) => (state, None, None),
                    ShownValue::Quantity(value, limit) => (None, value, limit),
                };
            let problem = Problem { check, state, value, limit, unit, ..problem };
            let (vehicle, session, day) = (said("vehicle"), said("session"), day.to_owned());
            let found = VehicleProblem { vehicle, sessions: 0, session, day, badness, at, problem };
            let known = self.findings.entry(key.clone()).or_insert_with(|| found.clone());
            if found.is_worse(known) {
                *known = VehicleProblem { sessions: known.sessions, ..found };
            }
            known.sessions += u64::from(counted.insert(key));
        }
    }
}

impl VehicleProblem {
    fn is_critical(&self) -> bool {
        self.problem.level == "critical"
    }

    /// Of two equal ones the later.
    fn is_worse(&self, other: &Self) -> bool {
        (self.is_critical(), self.badness, self.at) >= (other.is_critical(), other.badness, other.at)
    }
}

impl Overview {
    fn of(vehicles: BTreeMap<String, Gathered>, figures: &[(String, Quantity)]) -> Self {
        let mut fleet = Self::default();
        let mut kinds: BTreeMap<String, Vec<(String, Medians)>> = BTreeMap::new();
        for (name, gathered) in vehicles {
            let Gathered { mut vehicle, flown, due, findings, figures, .. } = gathered;
            fleet.overlapping += flown.len() as u64;
            for flown in once(flown) {
                fleet.overlapping -= 1;
                vehicle.flights += flown.flights;
                vehicle.flight_s += flown.flight_s;
            }
            let medians =
                figures.into_iter().map(|(index, mut values)| (index, median(&mut values))).collect();
            kinds.entry(vehicle.kind.clone()).or_default().push((name, medians));
            fleet.sessions += vehicle.sessions;
            fleet.vehicles.push(vehicle);
            fleet.due.extend(due);
            fleet.findings.extend(findings.into_values());
        }
        let used = |part: &DuePart| part.used_percent.unwrap_or(0.0);
        fleet.due.sort_by(|one, other| used(other).total_cmp(&used(one)));
        fleet.findings.sort_by_key(|found| (!found.is_critical(), Reverse(found.sessions)));
        fleet.findings_left_out = fleet.findings.len().saturating_sub(FINDINGS_MAX);
        fleet.findings.truncate(FINDINGS_MAX);
        for (kind, vehicles) in kinds {
            if vehicles.len() < VEHICLES_MIN {
                fleet.not_compared += vehicles.len();
                continue;
            }
            for (index, (_, quantity)) in figures.iter().enumerate() {
                let values = vehicles.iter().filter_map(|(name, values)| Some((name, *values.get(&index)?)));
                fleet.outliers.extend(outliers(&kind, *quantity, &values.collect::<Vec<_>>()));
            }
        }
        fleet.outliers.sort_by(|one, other| other.score.total_cmp(&one.score));
        fleet
    }
}

/// Of an even number of values the mean of both in the middle; 0 without any.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    let at = |index: usize| values.get(index).copied().unwrap_or(0.0);
    f64::midpoint(at(values.len().saturating_sub(1) / 2), at(values.len() / 2))
}

fn outliers(kind: &str, quantity: Quantity, values: &[(&String, f64)]) -> Vec<Outlier> {
    if values.len() < VEHICLES_MIN {
        return Vec::new();
    }
    let middle = median(&mut values.iter().map(|(_, value)| *value).collect::<Vec<_>>());
    let mad = median(&mut values.iter().map(|(_, value)| (value - middle).abs()).collect::<Vec<_>>());
    let mad = mad.max(f64::from(quantity.grain()) * QUARTILE);
    let (figure, unit, decimals) = of_figure(quantity);
    let outlier = |(vehicle, value): &(&String, f64)| {
        let score = QUARTILE * (value - middle).abs() / mad;
        (score > SCORE_MAX).then(|| Outlier {
            vehicle: (*vehicle).clone(),
            kind: kind.to_owned(),
            figure: figure.clone(),
            value: *value,
            median: middle,
            unit,
            decimals,
            score,
            vehicles: values.len(),
        })
    };
    values.iter().filter_map(outlier).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(vehicle: &str, session: u64, vibration: f64) -> Cells {
        let problems = r#"[{"level":"warning","check":"cell_voltage","instance":0,"times":1,"at_s":3.0,"value":3.4,"limit":3.5,"unit":"V"},
            {"level":"ok","check":"hover_power","instance":0,"times":0,"at_s":0.0,"value":null,"limit":null,"unit":""}]"#;
        let parts = r#"[{"part":"motor 1","serial":"m1","status":"red","used_percent":104.5,"limit":"100 h","flight_s":1.0,"flights":1.0,"cycles":0.0},
            {"part":"frame","serial":"","status":"green","used_percent":null,"limit":null,"flight_s":1.0,"flights":1.0,"cycles":0.0}]"#;
        let text = |text: &str| Field::Str(text.to_owned());
        [
            ("vehicle", text(vehicle)),
            ("session", text(&format!("s{session:08x}"))),
            ("utc", Field::TimestampMicros(session as i64)),
            ("autopilot", text("PX4")),
            ("type", text("quadrotor")),
            ("firmware", text(&format!("1.{session}"))),
            ("flights", Field::Double(2.0)),
            ("flight_time_s", Field::Double(600.0)),
            ("criticals", Field::ULong(0)),
            ("warnings", Field::ULong(1)),
            ("problems", text(&problems.replace("3.4", &format!("3.{session}")))),
            ("parts", text(if session == 1 { parts } else { "[]" })),
            ("steady_vibration_m_s2", Field::Double(vibration)),
        ]
        .map(|(name, field)| (name.to_owned(), field))
        .into()
    }

    #[test]
    fn a_flight_of_two_recorders_is_summed_once_and_a_state_has_its_name() {
        let figures = figures();
        let sum = |name: &str, sessions: &[(i64, i64, f64)]| {
            let mut gathered = Gathered::default();
            for (from, to, flight_s) in sessions {
                let mut row = row(name, 1, 10.0);
                row.insert("utc".to_owned(), Field::TimestampMicros(*from));
                row.insert("end_utc".to_owned(), Field::TimestampMicros(*to));
                row.insert("flight_time_s".to_owned(), Field::Double(*flight_s));
                gathered.add(&row, "2026-05-01", &figures);
            }
            let fleet = Overview::of([(name.to_owned(), gathered)].into(), &figures);
            (fleet.vehicles[0].flights, fleet.vehicles[0].flight_s, fleet.overlapping)
        };
        // A box at each power-on, a ground station over two of them; the last two share a little, as clocks differ.
        let sessions = [(0, 100, 60.0), (150, 250, 70.0), (5, 255, 125.0), (252, 400, 80.0)];
        assert_eq!(sum("uid-1", &sessions), (4.0, 205.0, 2));
        assert_eq!(sum("system-1-quadrotor-PX4-logs", &sessions), (8.0, 335.0, 0));
        // Times that cannot be share nothing.
        assert_eq!(sum("uid-1", &[(0, 0, 1.0), (5, 5, 1.0), (0, i64::MAX, 1.0)]), (6.0, 3.0, 0));

        let mut gathered = Gathered::default();
        let problems = r#"[{"level":"critical","check":"autopilot_state","instance":0,"value":5.0,"limit":4.5,"unit":"flag"}]"#;
        let row: Cells = [("problems".to_owned(), Field::Str(problems.to_owned()))].into();
        gathered.add(&row, "", &figures);
        let problem = &gathered.findings.values().next().expect("a finding").problem;
        assert_eq!((problem.state, problem.value, problem.limit), (Some("critical"), None, None));
    }

    fn fleet(vibrations: &[f64]) -> Overview {
        let (figures, mut vehicles) = (figures(), BTreeMap::<String, Gathered>::new());
        for (number, vibration) in vibrations.iter().enumerate() {
            for session in [2, 1, 3] {
                let name = format!("uid-{number}");
                let row = row(&name, session, *vibration);
                vehicles.entry(name).or_default().add(&row, &format!("2026-05-0{session}"), &figures);
            }
        }
        Overview::of(vehicles, &figures)
    }

    #[test]
    fn a_vehicle_that_shakes_more_than_the_others_is_an_outlier() {
        let found = fleet(&[10.0, 12.0, 11.0, 9.0, 10.5, 11.5, 40.0]);
        let [outlier] = found.outliers.as_slice() else { panic!("{:?}", found.outliers) };
        assert_eq!((outlier.vehicle.as_str(), outlier.vehicles), ("uid-6", 7));
        // The median is 11, MAD is 1.
        assert!(
            (outlier.median - 11.0).abs() < 1e-9 && (outlier.score - 0.6745 * 29.0).abs() < 1e-6,
            "{outlier:?}"
        );
        // Equal vehicles: a difference within the grain is none.
        assert!(fleet(&[10.0, 10.0, 10.0, 10.0, 10.9]).outliers.is_empty());
        assert_eq!(fleet(&[10.0, 10.0, 10.0, 10.0, 20.0]).outliers.len(), 1);
        let few = fleet(&[10.0, 10.0, 40.0]);
        assert_eq!((few.outliers.len(), few.not_compared), (0, 3));
    }

    #[test]
    fn sessions_of_a_vehicle_are_summed_and_the_last_one_tells_its_firmware_and_parts() {
        let found = fleet(&[10.0, 10.0]);
        assert_eq!((found.sessions, found.vehicles.len()), (6, 2));
        let vehicle = &found.vehicles[0];
        assert_eq!((vehicle.flights, vehicle.flight_s, vehicle.warning), (6.0, 1800.0, 3.0));
        assert_eq!((vehicle.firmware.as_str(), vehicle.kind.as_str()), ("1.3", "PX4 quadrotor"));
        assert_eq!(vehicle.days, ("2026-05-01".to_owned(), "2026-05-03".to_owned()));
        assert_eq!((found.due.len(), found.due[0].part.as_str()), (2, "motor 1"));
        let finding = &found.findings[0];
        assert_eq!((found.findings.len(), finding.sessions, finding.day.as_str()), (2, 3, "2026-05-01"));
        assert!(!finding.is_critical() && finding.problem.check == "battery 1 cell low", "{finding:?}");
    }
}
