//! `--past`: what is normal for a vehicle, from recordings of its earlier flights.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use hums_core::baseline::{Baselines, FLIGHTS_MIN, Quantity};

use super::judge::{Heard, Limits};
use super::overview;
use crate::source::find::find;
use crate::source::recording::Place;

/// The limits, with what recordings of earlier flights teach of the vehicle; as they are where there are none.
pub(super) fn after(limits: Limits, past: &[PathBuf], system: Option<u8>) -> Result<Limits> {
    if past.is_empty() {
        return Ok(limits);
    }
    let found = find(past, false).context("--past")?.of_system(system)?;
    let baselines = learn(&limits, &found.places)?;
    let flights = quantities().map(|quantity| baselines.get(quantity).flights).max().unwrap_or(0);
    if flights < FLIGHTS_MIN {
        note!(
            "--past: steady flight of {flights} flights was found, and {FLIGHTS_MIN} make a baseline: trends are not judged"
        );
    }
    Ok(limits.after(&baselines))
}

/// What is normal after the flights of these recordings, in their order.
pub fn learn(limits: &Limits, places: &[Place]) -> Result<Baselines> {
    places.iter().try_fold(Baselines::new(), |past, place| {
        let read = overview::judge(place, &limits.clone().after(&past), Heard::Somewhere, false)?;
        Ok(*read.judged.monitor.baselines())
    })
}

fn quantities() -> impl Iterator<Item = Quantity> {
    (0..Quantity::COUNT).filter_map(Quantity::from_index)
}
