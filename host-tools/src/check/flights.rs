//! The flights of a recording: from take-off to landing, or to where it was disarmed in the air.

use hums_core::Monitor;
use hums_core::time::{Instant, Span};

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
    /// When it was in the air last.
    flew_at: Option<Instant>,
    /// When it was disarmed above home right out of the air, and how high.
    disarmed: Option<(Instant, f32)>,
}

impl Flights {
    /// The vehicle took off.
    pub(super) fn take_off(&mut self, now: Instant, from: Instant) {
        if self.list.len() < LISTED_MAX {
            self.list.push(Flight { from, to: now, landed: false, disarmed_at_m: None });
        }
    }

    /// The flight is over: it is back on the ground, or disarmed.
    pub(super) fn landing(&mut self, now: Instant, monitor: &Monitor) {
        self.end_flight(now, true);
        self.disarmed = self.disarmed_at_m(now, monitor).map(|height_m| (now, height_m));
    }

    /// One step of the monitor.
    pub(super) fn step(&mut self, now: Instant, monitor: &Monitor) {
        if monitor.flight().airborne() {
            self.flew_at = Some(now);
        }
        self.watch_fall(now, monitor);
    }

    /// The recording has ended.
    pub(super) fn end(mut self, last: Instant, monitor: &Monitor) -> Vec<Flight> {
        if monitor.flight().airborne() {
            self.end_flight(last, false);
        }
        self.list
    }

    /// The height above home where a flight that ends now was ended by disarming, not well after a landing.
    fn disarmed_at_m(&self, now: Instant, monitor: &Monitor) -> Option<f32> {
        /// Lower is a landing whose last metre the autopilot or its height has missed.
        const LANDING_M: f32 = 3.0;
        /// The autopilot says that it stands when it disarms, and its heartbeat comes at 1 Hz.
        const SINCE_AIR: Span = Span::from_secs(2);
        let flew = self.flew_at.is_some_and(|at| now.since(at) <= SINCE_AIR);
        let disarmed = flew && !monitor.vehicle().armed();
        height_m(monitor).filter(|height_m| disarmed && *height_m > LANDING_M)
    }

    /// What was disarmed above home falls if it was in the air, and stays where it is if it stands on a hill or a roof.
    fn watch_fall(&mut self, now: Instant, monitor: &Monitor) {
        const WATCHED: Span = Span::from_secs(4);
        const FALLEN_M: f32 = 2.0;
        let Some((at, from_m)) = self.disarmed else { return };
        if height_m(monitor).is_some_and(|height_m| height_m < from_m - FALLEN_M) {
            if let Some(flight) = self.list.last_mut() {
                (flight.landed, flight.disarmed_at_m) = (false, Some(from_m));
            }
            self.disarmed = None;
        } else if now.since(at) > WATCHED {
            self.disarmed = None;
        }
    }

    fn end_flight(&mut self, at: Instant, landed: bool) {
        if let Some(flight) =
            self.list.last_mut().filter(|flight| !flight.landed && flight.disarmed_at_m.is_none())
        {
            (flight.to, flight.landed) = (at, landed);
        }
    }
}

/// Height above home, as it was told last.
fn height_m(monitor: &Monitor) -> Option<f32> {
    monitor.vehicle().global.get().map(|position| position.relative_altitude.0)
}
