//! Flights and their phases, by the rules of the firmware.

use hums_core::flight::ground_speed_mps;
use hums_core::time::{Instant, Span};
use serde::Serialize;

use crate::decode::reference::{Quantity, Reference};

/// Kept one by one at most.
const FLIGHTS_MAX: usize = 500;
const PHASES_MAX: usize = 2_000;
/// A phase that lasts less is part of the one before.
const PHASE_MIN: Span = Span::from_secs(2);

/// One flight: from take-off to landing, or to the end of the log.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Flight {
    from_s: f64,
    to_s: f64,
    /// In the air, without stops on the ground and gaps of the record.
    air_s: f64,
    landed: bool,
    height_max_m: f32,
    speed_max_m_s: f32,
    percent_from: Option<f32>,
    percent_to: Option<f32>,
}

/// A time in one phase.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PhaseSpan {
    phase: &'static str,
    from_s: f64,
    to_s: f64,
}

/// The flights of a log, and the phases of all of it.
#[derive(Debug, Default)]
pub struct Flights {
    list: Vec<Flight>,
    phases: Vec<PhaseSpan>,
    /// The last flight goes on.
    open: bool,
    /// When the vehicle told something last, and whether it was in the air.
    last: Option<(Instant, bool)>,
    /// What the record does not have since then.
    gap: Span,
}

impl Flights {
    /// The flights, in order.
    pub fn all(&self) -> &[Flight] {
        &self.list
    }

    /// The phases, in order.
    pub fn phases(&self) -> &[PhaseSpan] {
        &self.phases
    }

    /// Follows what the vehicle has just told. A flight is what [`hums_core::flight`] calls one: a bounce ends none.
    pub fn follow(&mut self, at: Instant, reference: &Reference) {
        let flight = reference.flight();
        if let Some((before, true)) = self.last {
            let step = at.since(before).as_micros().saturating_sub(self.gap.as_micros());
            self.extend(at, step, reference);
        }
        match (self.open, flight.is_open(), flight.airborne_since()) {
            (false, true, Some(since)) if self.list.len() < FLIGHTS_MAX => {
                self.begin(since, at, reference);
            }
            (true, false, _) => self.close(),
            _ => {}
        }
        (self.last, self.gap) = (Some((at, flight.airborne())), Span::ZERO);
        self.extend_phase(at, reference);
    }

    /// The record has nothing from here to there.
    pub fn gap(&mut self, from: Instant, to: Instant) {
        if self.last.is_some_and(|(last, _)| from >= last) {
            self.gap = self.gap + to.since(from);
        }
    }

    /// The log ends here.
    pub fn end(&mut self, at: Instant, reference: &Reference) {
        self.extend_phase(at, reference);
        if !reference.flight().airborne() {
            self.close();
        }
    }

    fn close(&mut self) {
        if let Some(flight) = self.list.last_mut().filter(|_| self.open) {
            flight.landed = true;
        }
        self.open = false;
    }

    fn begin(&mut self, since: Instant, at: Instant, reference: &Reference) {
        self.open = true;
        self.list.push(Flight {
            from_s: since.as_secs_f64(),
            to_s: at.as_secs_f64(),
            air_s: at.as_secs_f64() - since.as_secs_f64(),
            landed: false,
            height_max_m: 0.0,
            speed_max_m_s: 0.0,
            percent_from: percent(at, reference),
            percent_to: None,
        });
    }

    /// In the air for so many microseconds more, up to now.
    fn extend(&mut self, at: Instant, step_us: u64, reference: &Reference) {
        let vehicle = reference.vehicle();
        let height_m = vehicle.global.get().map(|global| global.relative_altitude.0);
        let speed = ground_speed_mps(at, vehicle);
        let percent = percent(at, reference);
        if let Some(flight) = self.list.last_mut().filter(|_| self.open) {
            flight.to_s = at.as_secs_f64();
            flight.air_s += step_us as f64 / 1e6;
            flight.height_max_m = flight.height_max_m.max(height_m.unwrap_or(0.0));
            flight.speed_max_m_s = flight.speed_max_m_s.max(speed.unwrap_or(0.0));
            flight.percent_to = percent.or(flight.percent_to);
        }
    }

    /// The phase goes on, or another begins; one too short to matter is taken back.
    fn extend_phase(&mut self, at: Instant, reference: &Reference) {
        let phase = reference.flight().phase(at, reference.vehicle()).name();
        let at_s = at.as_secs_f64();
        let full = self.phases.len() >= PHASES_MAX;
        if let Some(last) = self.phases.last_mut() {
            last.to_s = last.to_s.max(at_s);
            if last.phase == phase || full {
                return;
            }
            let short = at_s - last.from_s < f64::from(PHASE_MIN.as_secs_f32());
            if short && self.phases.len() > 1 {
                self.phases.pop();
                if let Some(before) = self.phases.last_mut() {
                    before.to_s = at_s;
                    if before.phase == phase {
                        return;
                    }
                }
            }
        }
        self.phases.push(PhaseSpan { phase, from_s: at_s, to_s: at_s });
    }
}

/// What is left of the battery.
fn percent(at: Instant, reference: &Reference) -> Option<f32> {
    Some(reference.value(at, Quantity::BatteryPercent)?.as_f64() as f32)
}
