//! The flights of a recording: from take-off to landing, or to where a mishap ended it.

use hums_core::Monitor;
use hums_core::mishap::{Change, Kind};
use hums_core::monitor::TICK;
use hums_core::time::{Instant, Span};

use super::problem::LISTED_MAX;

/// A flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Take-off.
    pub from: Instant,
    /// When it was in the air last.
    pub to: Instant,
    /// How long it was in the air: without what lies on the ground between, and without the recording's gaps.
    pub air: Span,
    /// It landed.
    pub landed: bool,
    /// It was disarmed in the air, at this height above home, m.
    pub disarmed_at_m: Option<f32>,
}

/// Flights as they come, up to [`LISTED_MAX`].
#[derive(Debug, Default)]
pub(super) struct Flights {
    list: Vec<Flight>,
    /// The last of them goes on.
    open: bool,
    /// The flight that ends next ends by a mishap.
    crashed: bool,
}

impl Flights {
    /// The vehicle took off.
    pub(super) fn take_off(&mut self, now: Instant, from: Instant) {
        self.open = self.list.len() < LISTED_MAX;
        if self.open {
            let air = now.since(from);
            self.list.push(Flight { from, to: now, air, landed: false, disarmed_at_m: None });
        }
    }

    /// A step of the monitor was made.
    pub(super) fn step(&mut self, now: Instant, monitor: &Monitor) {
        if monitor.flight().airborne()
            && let Some(flight) = self.list.last_mut().filter(|_| self.open)
        {
            flight.air = flight.air + TICK.min(now.since(flight.to));
            flight.to = now;
        }
    }

    /// Which of the flights goes on.
    pub(super) fn going_on(&self) -> Option<usize> {
        self.list.len().checked_sub(1).filter(|_| self.open)
    }

    /// The flight is over: it is back on the ground, or disarmed, or a mishap ended it.
    pub(super) fn landing(&mut self) {
        let crashed = std::mem::take(&mut self.crashed);
        if let Some(flight) = self.list.last_mut().filter(|_| self.open) {
            flight.landed = !crashed;
        }
        self.open = false;
    }

    /// It goes on no more, and nobody saw how it ended.
    pub(super) fn break_off(&mut self) {
        (self.open, self.crashed) = (false, false);
    }

    /// Nobody knows whether it was disarmed in the air.
    pub(super) fn forget_disarming(&mut self) {
        for flight in &mut self.list {
            flight.disarmed_at_m = None;
        }
    }

    /// A mishap began or ended.
    pub(super) fn mishap(&mut self, change: Change, monitor: &Monitor) {
        match change {
            Change::Began(Kind::Disarmed) => {
                if let Some(flight) = self.list.last_mut() {
                    flight.disarmed_at_m = Some(f32::from(monitor.mishap().height_m()));
                }
            }
            Change::Down => self.crashed = self.open,
            Change::Began(_) | Change::FliesOn | Change::OnBench(_) => {}
        }
    }

    /// A recording has ended, and perhaps another one begins.
    pub(super) fn end_of_recording(&mut self, monitor: &Monitor) {
        if !monitor.flight().airborne() {
            // On the ground, still armed: what is over is the recording, and the flight too.
            self.landing();
        }
        self.break_off();
    }

    /// All has ended.
    pub(super) fn end(mut self, monitor: &Monitor) -> Vec<Flight> {
        self.end_of_recording(monitor);
        self.list
    }
}
