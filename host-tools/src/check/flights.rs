//! The flights of a recording: from take-off to landing, or to where a mishap ended it.

use hums_core::Monitor;
use hums_core::mishap::{Change, Kind};
use hums_core::time::Instant;

use super::problem::LISTED_MAX;

/// A flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Take-off.
    pub from: Instant,
    /// Landing, or the recording's end.
    pub to: Instant,
    /// It landed.
    pub landed: bool,
    /// It was disarmed in the air, at this height above home, m.
    pub disarmed_at_m: Option<f32>,
}

/// Flights as they come, up to [`LISTED_MAX`].
#[derive(Debug, Default)]
pub(super) struct Flights {
    list: Vec<Flight>,
    /// The flight that ends next ends by a mishap.
    crashed: bool,
}

impl Flights {
    /// The vehicle took off.
    pub(super) fn take_off(&mut self, now: Instant, from: Instant) {
        if self.list.len() < LISTED_MAX {
            self.list.push(Flight { from, to: now, landed: false, disarmed_at_m: None });
        }
    }

    /// The flight is over: it is back on the ground, or disarmed, or a mishap ended it.
    pub(super) fn landing(&mut self, now: Instant) {
        let crashed = std::mem::take(&mut self.crashed);
        self.end_flight(now, !crashed);
    }

    /// A mishap began or ended.
    pub(super) fn mishap(&mut self, change: Change, monitor: &Monitor) {
        match change {
            Change::Began(Kind::Disarmed) => {
                if let Some(flight) = self.list.last_mut() {
                    flight.disarmed_at_m = Some(f32::from(monitor.mishap().height_m()));
                }
            }
            Change::Down => self.crashed = true,
            Change::Began(_) | Change::FliesOn | Change::OnBench(_) => {}
        }
    }

    /// The recording has ended.
    pub(super) fn end(mut self, last: Instant, monitor: &Monitor) -> Vec<Flight> {
        if monitor.flight().airborne() {
            self.end_flight(last, false);
        }
        self.list
    }

    fn end_flight(&mut self, at: Instant, landed: bool) {
        if let Some(flight) = self.list.last_mut().filter(|flight| !flight.landed) {
            (flight.to, flight.landed) = (at, landed);
        }
    }
}
