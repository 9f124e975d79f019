//! Flights, to a landing or a mishap.

use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::mishap::{MishapChange, MishapKind};
use hums_onboard::monitoring::TICK;

use super::clock::SETTLE;
use super::problem::LISTED_MAX;
use crate::source::told::Finding;

/// A flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flight {
    /// Take-off.
    pub from: Instant,
    /// Last time in the air.
    pub to: Instant,
    /// Time in the air, without stops and gaps.
    pub air: Span,
    /// Seen on the ground before; otherwise the start is unknown.
    pub took_off: bool,
    /// It landed.
    pub landed: bool,
    /// m above home, if disarmed in the air.
    pub disarmed_at_m: Option<f32>,
    /// Mishap, if any.
    pub mishap: Option<Mishap>,
}

/// How it ended a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mishap {
    /// First hit, or when down.
    pub at: Instant,
    /// It hit something.
    pub is_impact: bool,
    /// Last reception, for a radio gap.
    pub unheard_from: Option<Instant>,
}

/// Flights as they come, up to [`LISTED_MAX`].
#[derive(Debug, Default)]
pub(super) struct Flights {
    list: Vec<Flight>,
    /// The last goes on.
    open: bool,
    /// The next end is a mishap.
    crashed: bool,
    /// Silence; not seen to fly since.
    unseen: bool,
    silence: Option<Silence>,
    landing: Span,
    stepped_at: Option<Instant>,
}

#[derive(Clone, Copy, Debug)]
struct Silence {
    to: Instant,
    air: Span,
    /// Received again.
    heard_since: Option<Instant>,
}

/// Between steps, also after a gap ([`SETTLE`]); longer silences are left out.
const STEP_MAX: Span = Span::from_millis(SETTLE.as_millis() + 2 * TICK.as_millis());
/// Delay of an impact's finding: the vehicle must lie still.
const FOUND_LATE: Span = Span::from_secs(5);
const SILENT: Span = Span::from_secs(5);
/// A vehicle in the air this long is still on its flight: longer than a landing takes to be seen.
const STILL_FLIES: Span = Span::from_secs(3);

impl Flight {
    /// Seconds; with an impact, or without.
    pub fn mishap_s(&self, is_impact: bool) -> Option<f64> {
        self.mishap.filter(|mishap| mishap.is_impact == is_impact).map(|mishap| mishap.at.as_secs_f64())
    }

    /// Last reception before a radio gap's mishap.
    pub fn unheard_s(&self) -> Option<f64> {
        Some(self.mishap?.unheard_from?.as_secs_f64())
    }

    /// Moves the flight's impact to the box's finding: one report.
    pub(super) fn was_hit<'a>(&mut self, mut found: impl Iterator<Item = &'a Finding>) {
        if let Some(Mishap { at, is_impact: true, .. }) = &mut self.mishap
            && let Some(finding) =
                found.find(|finding| finding.at >= *at && finding.at.since(*at) <= FOUND_LATE)
        {
            *at = finding.at;
        }
    }
}

pub(super) fn begin_in_air(flights: &[Flight]) -> bool {
    flights.first().is_some_and(|flight| !flight.took_off)
}

/// A disarmed vehicle counts while it may fall.
pub(super) fn is_in_air(monitor: &Monitor) -> bool {
    let falls = || monitor.flight().is_open() && monitor.flight().is_unloaded();
    (monitor.flight().airborne() && monitor.vehicle().armed()) || monitor.flight().is_watched() || falls()
}

impl Flights {
    pub(super) fn take_off(&mut self, now: Instant, from: Instant, took_off: bool) {
        self.open = self.list.len() < LISTED_MAX;
        if self.open {
            let air = now.since(from);
            self.list.push(Flight {
                from,
                to: now,
                air,
                took_off,
                landed: false,
                disarmed_at_m: None,
                mishap: None,
            });
        }
    }

    /// `steps`: monitor's time; silence since the last heartbeat. It is flight once the vehicle is received and still
    /// flies.
    pub(super) fn step(&mut self, now: Instant, steps: Instant, since_heard: Span, monitor: &Monitor) {
        let passed = self.stepped_at.replace(steps).map_or(Span::ZERO, |before| steps.since(before));
        let Some(flight) = self.list.last_mut().filter(|_| self.open) else { return };
        if since_heard > SILENT {
            let heard_at = Instant::from_micros(now.as_micros().saturating_sub(since_heard.as_micros()));
            let over = flight.to.since(heard_at.max(flight.from)).min(flight.air);
            let [to, air] =
                [flight.to.as_micros(), flight.air.as_micros()].map(|us| us.saturating_sub(over.as_micros()));
            let new =
                Silence { to: Instant::from_micros(to), air: Span::from_micros(air), heard_since: None };
            self.silence.get_or_insert(new).heard_since = None;
        } else if let Some(silence) = &mut self.silence {
            let heard_since = *silence.heard_since.get_or_insert(now);
            let flies = monitor.flight().airborne() && monitor.vehicle().armed();
            if flies && now.since(heard_since) >= STILL_FLIES {
                self.silence = None;
            }
        }
        if monitor.flight().airborne() {
            let passed = if passed > STEP_MAX { TICK } else { passed };
            self.landing = self.landing + passed;
            if !monitor.flight().may_have_landed() {
                flight.air = flight.air + self.landing.min(now.since(flight.to));
                (flight.to, self.landing) = (now, Span::ZERO);
            }
        } else {
            self.landing = Span::ZERO;
        }
    }

    fn close(&mut self) {
        if let (Some(flight), Some(silence)) =
            (self.list.last_mut().filter(|_| self.open), self.silence.take())
        {
            (flight.to, flight.air) = (silence.to, silence.air);
        }
        (self.open, self.unseen, self.silence, self.landing) = (false, false, None, Span::ZERO);
    }

    /// Index.
    pub(super) fn going_on(&self) -> Option<usize> {
        self.list.len().checked_sub(1).filter(|_| self.open)
    }

    pub(super) fn landing(&mut self) {
        let crashed = std::mem::take(&mut self.crashed);
        if let Some(flight) = self.list.last_mut().filter(|_| self.open) {
            flight.landed = !crashed && !self.unseen;
        }
        self.close();
    }

    pub(super) fn forget_disarming(&mut self) {
        for flight in &mut self.list {
            flight.disarmed_at_m = None;
        }
    }

    /// The landing is unknown until it flies on.
    pub(super) fn silent(&mut self, is_unseen: bool) {
        self.unseen = self.open && is_unseen;
    }

    /// Began or ended.
    pub(super) fn mishap(
        &mut self,
        change: MishapChange,
        now: Instant,
        hit_at: Option<Instant>,
        monitor: &Monitor,
    ) {
        match change {
            MishapChange::Began(MishapKind::Disarmed) => {
                if let Some(flight) = self.list.last_mut().filter(|_| self.open) {
                    flight.disarmed_at_m = Some(f32::from(monitor.flight().height_m()));
                }
            }
            MishapChange::Down => {
                self.crashed = self.open;
                if let Some(flight) = self.list.last_mut().filter(|_| self.open) {
                    let (at, is_impact) = (hit_at.unwrap_or(now), hit_at.is_some());
                    flight.mishap = Some(Mishap { at, is_impact, unheard_from: None });
                }
            }
            // It was caught in time.
            MishapChange::FliesOn => {
                if let Some(flight) = self.list.last_mut().filter(|_| self.open) {
                    flight.disarmed_at_m = None;
                }
            }
            MishapChange::Began(_) | MishapChange::FliesAgain | MishapChange::OnBench(_) => {}
        }
    }

    /// A mishap in the silence since then: no landing.
    pub(super) fn came_down(&mut self, at: Instant, is_impact: bool, from: Instant) {
        self.close();
        if let Some(flight) = self.list.last_mut() {
            flight.landed = false;
            flight.mishap = Some(Mishap { at, is_impact, unheard_from: Some(from) });
        }
    }

    /// Another may begin.
    pub(super) fn end_of_recording(&mut self, monitor: &Monitor) {
        if !is_in_air(monitor) {
            // Still armed on the ground: the flight ends.
            self.landing();
        }
        self.break_off();
    }

    pub(super) fn break_off(&mut self) {
        self.close();
        self.crashed = false;
    }

    pub(super) fn end(mut self, monitor: &Monitor) -> Vec<Flight> {
        self.end_of_recording(monitor);
        // May go on after the recording.
        for flight in self.list.iter_mut().filter(|flight| flight.disarmed_at_m.is_some()) {
            flight.landed = false;
        }
        self.list
    }
}

#[cfg(test)]
mod tests {
    use hums_core::health::Level;

    use super::super::problem::tests::change;
    use super::*;

    #[test]
    fn an_impact_that_ended_a_flight_has_the_time_of_its_finding() {
        let at = Instant::from_millis(67_100);
        let mut flight = Flight {
            from: Instant::ZERO,
            to: at,
            air: Span::ZERO,
            took_off: true,
            landed: false,
            disarmed_at_m: None,
            mishap: Some(Mishap { at, is_impact: true, unheard_from: None }),
        };
        let found = [60, 80, 69, 70].map(|at_s| change(at_s, Level::Critical, 9.9));
        flight.was_hit(found[..2].iter());
        assert_eq!(flight.mishap.map(|mishap| mishap.at), Some(at), "long before and long after");
        flight.was_hit(found.iter());
        assert_eq!(flight.mishap.map(|mishap| mishap.at), Some(Instant::from_millis(69_000)));
    }
}
