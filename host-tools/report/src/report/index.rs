//! The table of the pages in a folder: vehicle, date, duration and findings.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::page::whole;
use super::replay::Replay;
use super::trend::airframe;
use crate::names::{autopilot_name, type_name};
use crate::plural;
use crate::summary::{JudgedChecks, Overview};
use crate::utc::iso8601;

/// The file of the table.
pub const FILE: &str = "index.html";

/// A page.
#[derive(Debug, Serialize, Deserialize)]
#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
pub struct Row {
    file: String,
    name: String,
    start_utc: Option<String>,
    vehicle: Option<String>,
    airframe: Option<String>,
    duration_s: Option<f64>,
    flights: usize,
    air_s: f64,
    height_max_m: Option<f32>,
    speed_max_m_s: Option<f32>,
    /// Somebody checked the vehicle's health.
    checked: bool,
    critical: usize,
    warning: usize,
    /// Too few checks had something to judge.
    #[serde(default)]
    little: bool,
    #[serde(default)]
    begins_in_air: bool,
    #[serde(default)]
    ends_in_air: bool,
    /// It does not show whether the vehicle flew.
    #[serde(default)]
    flight_unknown: bool,
    /// Why the recording is not whole, as parts of sentences.
    faults: Vec<String>,
}

/// The pages of a folder.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct Pages {
    /// Version of the program that made it.
    pub version: String,
    /// Each with its recording.
    pub pages: Vec<Row>,
    /// Files in which the flights of an airframe are compared, by airframe.
    pub comparisons: Vec<(String, String)>,
}

/// Maximum size of a table: some hundred thousand rows.
const BYTES_MAX: u64 = 64 << 20;

impl Pages {
    /// The pages in a folder's table; `None` without a table of this program.
    pub fn of(folder: &Path) -> Option<Self> {
        let mut text = String::new();
        File::open(folder.join(FILE)).ok()?.take(BYTES_MAX).read_to_string(&mut text).ok()?;
        let (_, data) = text.split_once("<script type=\"application/json\" id=\"data\">")?;
        serde_json::from_str(data.split_once("</script>")?.0).ok()
    }

    /// Whether a page has a row.
    pub fn has(&self, file: &str) -> bool {
        self.pages.iter().any(|row| row.file == file)
    }

    /// Adds the earlier pages that are still in the folder.
    pub fn with(mut self, before: Self, folder: &Path) -> Self {
        let is_there = |file: &str| folder.join(file).is_file();
        for row in before.pages {
            if !self.has(&row.file) && is_there(&row.file) {
                self.pages.push(row);
            }
        }
        for (airframe, file) in before.comparisons {
            if self.comparisons.iter().all(|(_, known)| *known != file) && is_there(&file) {
                self.comparisons.push((airframe, file));
            }
        }
        self
    }

    /// The page of the table.
    pub fn html(self) -> String {
        whole("index", &Self { version: env!("CARGO_PKG_VERSION").to_owned(), ..self }, None)
    }
}

fn faults(log: &Overview) -> Vec<String> {
    let mut faults = log.faults();
    let losses = log.ending.summary.losses;
    if log.format.is_some() && losses > 0 {
        faults.push(format!("{} of loss or noise", plural::count(losses, "place")));
    }
    faults
}

impl Row {
    /// The entry of a page.
    pub fn new(file: String, log: &Overview, replay: &Replay) -> Self {
        let (summary, contents) = (&log.ending.summary, &log.contents);
        let flights = &replay.flights;
        let most =
            |of: fn(&super::flights::Flight) -> Option<f32>| flights.iter().filter_map(of).reduce(f32::max);
        let vehicle = contents.vehicle.as_ref();
        Self {
            file,
            name: log.ending.name.clone(),
            start_utc: summary.first.and_then(|first| log.utc_us(first)).map(iso8601),
            vehicle: vehicle.map(|known| {
                format!("{} {}", autopilot_name(known.autopilot), type_name(known.vehicle_type))
            }),
            airframe: vehicle.map(airframe),
            duration_s: summary
                .first
                .zip(summary.last)
                .map(|(first, last)| last.as_secs_f64() - first.as_secs_f64()),
            flights: flights.len(),
            air_s: flights.iter().map(|flight| flight.air_s).sum(),
            height_max_m: most(|flight| flight.height_max_m),
            speed_max_m_s: most(|flight| flight.speed_max_m_s),
            checked: contents.checked_by() != "nobody" && (vehicle.is_some() || log.format.is_none()),
            critical: replay.found.0,
            warning: replay.found.1,
            little: replay.judged.is_some_and(JudgedChecks::is_little),
            begins_in_air: flights.first().is_some_and(|flight| !flight.took_off),
            ends_in_air: replay.ends_in_air.is_some(),
            flight_unknown: !replay.tells_flight,
            faults: faults(log),
        }
    }
}
