//! Flights side by side: their figures, findings and parameters in columns, and their values in the same
//! plots, from take-off on.

use std::collections::BTreeMap;

use anyhow::Result;
use serde::Serialize;

use super::flights::Flight;
use super::page::whole;
use super::replay::Replay;
use super::tiles::Tiles;
use super::trend::airframe;
use crate::check;
use crate::names::{autopilot_name, type_name};
use crate::page::history::{HistoryPart, TrackPoint};
use crate::page::merged::{self, merged, places};
use crate::page::note::Note;
use crate::source::recording::LogPlace;
use crate::summary::Overview;
use crate::utc::iso8601;

const FLIGHTS_MAX: usize = 11;
const FINDINGS_MAX: usize = 100;

/// A recording that may be compared.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'a> {
    /// Its place.
    pub place: &'a LogPlace,
    /// The file of its page beside this one.
    pub page: Option<&'a str>,
}

struct Recorded<'a> {
    candidate: Candidate<'a>,
    overview: Overview,
    replay: Replay,
}

#[derive(Serialize)]
struct Data {
    version: &'static str,
    flight: HistoryPart,
    /// The newest first.
    flights: Vec<FlightJson>,
    /// Parameters that differ, and each flight's values; `null` without one.
    parameters: Vec<(String, Vec<Option<f64>>)>,
}

#[derive(Serialize)]
struct FlightJson {
    name: String,
    page: Option<String>,
    start_utc: Option<String>,
    vehicle: Option<String>,
    airframe: Option<String>,
    #[serde(flatten)]
    flight: Flight,
    /// Seconds since its take-off, level, words; warning and worse.
    findings: Vec<(f64, &'static str, String)>,
    findings_count: usize,
    /// From its take-off on.
    track: Vec<TrackPoint>,
}

/// A page of the last flights in recordings, in order; `None` for fewer than two.
pub fn html(recordings: &[Candidate<'_>], tiles: Option<&Tiles>) -> Result<Option<String>> {
    let (mut recorded, mut count) = (Vec::new(), 0);
    for &candidate in recordings.iter().rev() {
        if count >= FLIGHTS_MAX {
            break;
        }
        let overview = check::overview(candidate.place)?;
        let replay = Replay::of(candidate.place, &overview)?;
        count += replay.flights.len();
        recorded.push(Recorded { candidate, overview, replay });
    }
    let flights =
        recorded.iter().flat_map(|one| one.replay.flights.iter().enumerate().rev().map(move |of| (one, of)));
    let flights: Vec<(&Recorded<'_>, (usize, &Flight))> = flights.take(FLIGHTS_MAX).collect();
    if flights.len() < 2 {
        return Ok(None);
    }
    let names: Vec<String> = flights.iter().map(|(one, (index, _))| one.name(*index)).collect();
    let drawn: Vec<merged::MergedFlight<'_>> = flights
        .iter()
        .zip(&names)
        .map(|((one, (_, flight)), name)| merged::MergedFlight {
            name,
            history: &one.replay.history,
            span: flight.span(),
        })
        .collect();
    let json = flights.iter().zip(&drawn).map(|((one, (_, flight)), drawn)| one.json(flight, drawn));
    let data = Data {
        version: env!("CARGO_PKG_VERSION"),
        flight: merged(&drawn),
        flights: json.collect(),
        parameters: differing(&flights.iter().map(|(one, _)| &one.replay).collect::<Vec<_>>()),
    };
    Ok(Some(whole("compare", &data, tiles)))
}

impl Recorded<'_> {
    fn name(&self, index: usize) -> String {
        let name = &self.overview.ending.name;
        if self.replay.flights.len() > 1 { format!("{name}, flight {}", index + 1) } else { name.clone() }
    }

    fn json(&self, flight: &Flight, drawn: &merged::MergedFlight<'_>) -> FlightJson {
        let (from, to) = flight.span();
        let contents = &self.overview.contents;
        let is_of_it = |at| at >= from && at <= to;
        let worries = contents.findings.iter().filter(|finding| is_of_it(finding.at) && finding.is_bad());
        let findings: Vec<_> = worries
            .map(|finding| {
                (
                    finding.at.as_secs_f64() - from.as_secs_f64(),
                    finding.level.name(),
                    Note::found(finding, None).words,
                )
            })
            .collect();
        let vehicle = contents.vehicle.as_ref();
        FlightJson {
            name: drawn.name.to_owned(),
            page: self.candidate.page.map(str::to_owned),
            start_utc: self.overview.utc_us(from).map(iso8601),
            vehicle: vehicle.map(|known| {
                format!("{} {}", autopilot_name(known.autopilot), type_name(known.vehicle_type))
            }),
            airframe: vehicle.map(airframe),
            flight: *flight,
            findings_count: findings.len(),
            findings: findings.into_iter().take(FINDINGS_MAX).collect(),
            track: places(drawn),
        }
    }
}

fn differing(replays: &[&Replay]) -> Vec<(String, Vec<Option<f64>>)> {
    let mut all: BTreeMap<&str, Vec<Option<f64>>> = BTreeMap::new();
    for (place, replay) in replays.iter().enumerate() {
        for (name, value) in replay.history.last_parameters() {
            let values = all.entry(name).or_insert_with(|| vec![None; replays.len()]);
            if let Some(known) = values.get_mut(place) {
                *known = Some(value);
            }
        }
    }
    let differ = |values: &[Option<f64>]| {
        let mut told = values.iter().flatten();
        // A parameter is of single precision on the wire.
        let first = told.next().map(|first| *first as f32);
        told.any(|value| Some((*value as f32).to_bits()) != first.map(f32::to_bits))
    };
    all.into_iter()
        .filter(|(_, values)| differ(values))
        .map(|(name, values)| (name.to_owned(), values))
        .collect()
}
