//! Flights in GUTMA's "UAV/Operator Flight logging Exchange Protocol", version 1.0.0: a JSON file for each flight.

use std::io::Write as _;
use std::path::Path;

use anyhow::Result;
use hums_core::clock::Instant;
use serde_json::{Value, json};

use super::{Book, LogbookEntry, hours};
use crate::files::{Inputs, Output, make_directory, make_parent, says_directory, settle};
use crate::identity::Preview;
use crate::outcome::usage;
use crate::utc::iso8601;

/// Reports flights without the time of day, which have no place in this format.
pub(super) fn write(book: &Book, path: &Path, inputs: &Inputs) -> Result<()> {
    let mut flights = Vec::new();
    for entry in book.values().flat_map(|aircraft| &aircraft.entries) {
        let Some(known) = &entry.known else { continue };
        if !entry.is_flight() {
            continue;
        }
        match exchange(entry, known) {
            Some(flight) => flights.push((entry.key.as_str(), flight)),
            None => note!("{}: no UTC is known, which GUTMA's JSON needs; left out", entry.key),
        }
    }
    if says_directory(path) {
        make_directory(path)?;
        for (key, flight) in &flights {
            one(flight, &path.join(format!("{key}.json")), inputs)?;
        }
        return Ok(());
    }
    let [(_, flight)] = flights.as_slice() else {
        return Err(usage(format!(
            "-o {}: GUTMA's JSON has one flight, and here are {}; name a folder: {}/",
            path.display(),
            flights.len(),
            path.with_extension("").display()
        )));
    };
    one(flight, path, inputs)
}

fn one(flight: &Value, path: &Path, inputs: &Inputs) -> Result<()> {
    inputs.refuse(path)?;
    make_parent(path)?;
    let mut output = Output::create(path, inputs)?;
    settle(writeln!(output, "{flight:#}"), path)?;
    output.finish()
}

fn exchange(entry: &LogbookEntry, known: &Preview) -> Option<Value> {
    let (from, to) = entry.span?;
    let epochs = &known.identity.epochs;
    let start_us = epochs.utc_us(from)?;
    let about = &known.about;
    let Way { features, items, events } = way(entry, known, (from, to), start_us);
    let overview = &about.overview;
    let serial = known.identity.vehicle.strip_prefix("uid-").unwrap_or_default();
    let by_hand = |name: &str| entry.by_hand.get(name).cloned().unwrap_or_default();
    let end_us = overview.ending.summary.last.and_then(|last| epochs.utc_us(last)).unwrap_or(start_us);
    Some(json!({"exchange": {
        "exchange_type": "flight_logging",
        "message": {
            "message_type": "flight_logging_submission",
            "flight_data": {
                "aircraft": {
                    "manufacturer": "", "model": entry.kind, "name": by_hand("aircraft_details"),
                    "serial_number": serial, "firmware_version": entry.firmware, "hardware_version": "",
                },
                "gcs": {"manufacturer": "", "model": "", "version": ""},
                "payload": [],
                "operation": [{
                    "mission": by_hand("activity"), "operation_id": entry.key, "operator": "", "utm_provider": "",
                    "contact": by_hand("pilot"),
                }],
                "remarks": {
                    "defects": entry.defects, "incident": entry.incident, "duration": hours(entry.duration_s),
                },
            },
            "flight_logging_geojson": {
                "flight_path": {"type": "FeatureCollection", "features": features},
                "altitude_system": "amsl",
                "logging_start_dtg": milliseconds(start_us),
                "tick_increment_modulo": "1",
                "tick_increment_seconds": "1",
                "uom_system": "Metric",
            },
            "flight_logging": {
                "flight_logging_keys": ["timestamp", "gps_lon", "gps_lat", "gps_altitude", "speed"],
                "flight_logging_items": items,
                "events": events,
                "altitude_system": "amsl",
                "logging_start_dtg": milliseconds(start_us),
            },
            "file": {
                "logging_type": "GUTMA_DX_JSON", "filename": entry.key, "creation_dtg": milliseconds(end_us),
                "version": "1.0.0",
            },
        },
    }}))
}

struct Way {
    features: Vec<Value>,
    items: Vec<Value>,
    events: Vec<Value>,
}

fn way(entry: &LogbookEntry, known: &Preview, (from, to): (Instant, Instant), start_us: u64) -> Way {
    let (about, epochs) = (&known.about, &known.identity.epochs);
    let points = about.track.points();
    let speeds = about.speeds.points();
    let begin = points.partition_point(|point| point.at < from).saturating_sub(1);
    let (mut features, mut items) = (Vec::new(), Vec::new());
    for (point, speed) in points.iter().zip(speeds).skip(begin).take_while(|(point, _)| point.at <= to) {
        let Some(utc_us) = epochs.utc_us(point.at) else { continue };
        let (altitude, speed) = (rounded(point.height_m, 2), rounded(speed.height_m, 2));
        let place = [point.longitude_deg, point.latitude_deg].map(|axis| (axis * 1e8).round() / 1e8);
        features.push(json!({
            "type": "Feature",
            "properties": {"time": milliseconds(utc_us), "altitude": altitude, "groundspeed": speed, "ground_speed": speed},
            "geometry": {"type": "Point", "coordinates": place},
        }));
        let seconds = (utc_us.saturating_sub(start_us) / 1000) as f64 / 1000.0;
        items.push(json!([seconds, place[0], place[1], altitude, speed]));
    }
    let mark = |feature: Option<&mut Value>, info: &str| {
        if let Some(properties) = feature.and_then(|feature| feature.get_mut("properties")) {
            properties["event_type"] = json!("CONTROLER_EVENT");
            properties["event_info"] = json!(info);
        }
    };
    mark(features.first_mut(), "TAKE-OFF");
    let mut events =
        vec![json!({"event_type": "CONTROLER_EVENT", "event_info": "TAKE-OFF", "event_timestamp": "0.000"})];
    if entry.landing.is_some() {
        mark(features.last_mut(), "LANDING");
        let seconds = format!("{:.3}", entry.duration_s);
        events.push(
            json!({"event_type": "CONTROLER_EVENT", "event_info": "LANDING", "event_timestamp": seconds}),
        );
    }
    Way { features, items, events }
}

fn milliseconds(utc_us: u64) -> String {
    let text = iso8601(utc_us / 1000 * 1000);
    let (second, fraction) =
        text.trim_end_matches('Z').split_once('.').unwrap_or((text.trim_end_matches('Z'), ""));
    format!("{second}.{fraction:0<3.3}Z")
}

fn rounded(value: Option<f32>, decimals: i32) -> f64 {
    let unit = 10_f64.powi(decimals);
    (f64::from(value.unwrap_or(0.0)) * unit).round() / unit
}
