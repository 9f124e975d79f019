//! `--past`: baselines from earlier flights.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use hums_blackbox::record::Vehicle;
use hums_core::lifetime::Airframe;

use super::checked::Checked;
use super::judge::{HeardAt, Limits};
use super::judged::Judgement;
use super::overview::{self, Read};
use super::trends::{Baselines, FLIGHTS_MIN};
use crate::names::type_name;
use crate::outcome::usage;
use crate::source::find::find;
use crate::source::recording::{Format, LogPlace};

/// Limits, and a vehicle's earlier flights.
pub(super) struct EarlierFlights {
    limits: Limits,
    /// The vehicle's baselines, if there are earlier flights.
    taught: Option<(Baselines, Option<Vehicle>)>,
}

impl EarlierFlights {
    /// With baselines of earlier flights.
    ///
    /// # Errors
    /// A usage error for different vehicles.
    pub(super) fn of(limits: Limits, past: &[PathBuf], system: Option<u8>) -> Result<Self> {
        if past.is_empty() {
            return Ok(Self { limits, taught: None });
        }
        let found = find(past, false).context("--past")?.of_system(system)?;
        let taught = learnt(&limits, &found.places)?;
        let flights = taught.0.flights();
        if flights < FLIGHTS_MIN {
            note!(
                "--past: {flights} of them have a steady flight in them, and a baseline needs {FLIGHTS_MIN}: trends are not judged"
            );
        }
        Ok(Self { limits, taught: Some(taught) })
    }

    /// `shows`: progress; another vehicle's trends are not judged, with a message.
    pub(super) fn judge(&self, place: &LogPlace, heard: HeardAt, shows: bool) -> Result<Read> {
        let mut read = overview::judge(place, &self.limits, heard, shows)?;
        let Some((baselines, past)) = &self.taught else { return Ok(read) };
        match (past, vehicle(&read.judged, read.format)) {
            (Some(past), Some(own)) if are_two(past, &own) => read.judged.remarks.push(format!(
                "trends are not judged: the flights of --past are of another vehicle ({}; this is {})",
                words(past),
                words(&own)
            )),
            _ => read.judged.judge_trends(&mut baselines.clone()),
        }
        Ok(read)
    }
}

/// Boxes' logs, each judged against earlier ones of its vehicle.
pub(super) struct Series {
    /// Named ones count alone.
    past_is_given: bool,
    vehicles: Vec<(Vehicle, Baselines)>,
}

impl Series {
    pub(super) const fn after(past: &EarlierFlights) -> Self {
        Self { past_is_given: past.taught.is_some(), vehicles: Vec::new() }
    }

    pub(super) fn judge(&mut self, checked: Result<Checked>) -> Result<Checked> {
        let mut checked = checked?;
        let is_of_box = checked.format == Format::Hums && !self.past_is_given;
        let Some(own) = vehicle(&checked.judged, checked.format).filter(|_| is_of_box) else {
            return Ok(checked);
        };
        if !self.vehicles.iter().any(|(vehicle, _)| !are_two(vehicle, &own)) {
            self.vehicles.push((own, Baselines::default()));
        }
        if let Some((vehicle, past)) = self.vehicles.iter_mut().find(|(vehicle, _)| !are_two(vehicle, &own)) {
            learn_uid(vehicle, own);
            checked.judged.judge_trends(past);
        }
        Ok(checked)
    }
}

/// After these recordings, in order.
///
/// # Errors
/// A usage error for different vehicles.
pub fn learn(limits: &Limits, places: &[LogPlace]) -> Result<Baselines> {
    learnt(limits, places).map(|(baselines, _)| baselines)
}

fn learnt(limits: &Limits, places: &[LogPlace]) -> Result<(Baselines, Option<Vehicle>)> {
    let (mut baselines, mut first) = (Baselines::default(), None::<(&str, Vehicle)>);
    for place in places {
        let mut read = overview::judge(place, limits, HeardAt::Somewhere, false)?;
        read.judged.judge_trends(&mut baselines);
        let Some(own) = vehicle(&read.judged, read.format) else { continue };
        let (title, vehicle) = first.get_or_insert((&place.title, own));
        if are_two(vehicle, &own) {
            return Err(usage(format!(
                "--past: {title} is of {}, and {} of {}: name flights of one vehicle",
                words(vehicle),
                place.title,
                words(&own)
            )));
        }
        learn_uid(vehicle, own);
    }
    Ok((baselines, first.map(|(_, vehicle)| vehicle)))
}

/// A DataFlash log lacks the system id.
fn vehicle(judged: &Judgement, format: Format) -> Option<Vehicle> {
    let vehicle = overview::vehicle(&judged.monitor)?;
    let system = if format == Format::DataFlash { 0 } else { vehicle.system };
    Some(Vehicle { system, ..vehicle })
}

/// Certainly two vehicles: another unique id if known, otherwise another system id, or another kind: an autopilot may
/// have been moved.
fn are_two(one: &Vehicle, other: &Vehicle) -> bool {
    let airframe = |of: &Vehicle| Airframe { system: of.system, uid: of.uid };
    let differ = |one: u8, other: u8| one != 0 && other != 0 && one != other;
    airframe(one).differs(airframe(other))
        || differ(one.vehicle_type, other.vehicle_type)
        || differ(one.autopilot, other.autopilot)
}

/// An id in a later recording counts from then on.
const fn learn_uid(vehicle: &mut Vehicle, own: Vehicle) {
    if vehicle.uid == 0 {
        *vehicle = own;
    }
}

fn words(of: &Vehicle) -> String {
    let system = if of.system == 0 { String::new() } else { format!("system {}, ", of.system) };
    let id = if of.uid == 0 { String::new() } else { format!(", uid {:016x}", of.uid) };
    format!("{system}{}{id}", type_name(of.vehicle_type))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_vehicles_are_told_by_what_both_of_them_tell() {
        let quad = Vehicle { system: 1, component: 1, autopilot: 3, vehicle_type: 2, firmware: 0, uid: 7 };
        let with = |change: fn(&mut Vehicle)| {
            let mut other = quad;
            change(&mut other);
            are_two(&quad, &other)
        };
        assert!(!with(|_| {}));
        assert!(with(|other| other.uid = 8));
        assert!(with(|other| other.vehicle_type = 13), "a hexacopter");
        assert!(with(|other| other.autopilot = 12), "PX4");
        assert!(!with(|other| (other.uid, other.vehicle_type, other.autopilot) = (0, 0, 0)), "who knows");
        assert!(with(|other| (other.uid, other.system) = (0, 2)));
        assert!(!with(|other| other.system = 2), "a system id can be set");
    }
}
