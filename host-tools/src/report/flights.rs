//! Flights, as [`crate::check`] finds them, with how high and fast they were; and phases, by the rules of the firmware.

use hums_core::motion::ground_speed_mps;
use hums_core::time::{Instant, Span};
use serde::Serialize;

use crate::check::flights::Flight as Judged;
use crate::decode::reference::{Quantity, Reference};

/// Kept one by one at most.
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
    /// Disarmed in the air, which is no landing.
    disarmed_in_air: bool,
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

/// How high and fast the vehicle was in each flight, and what it took of the battery.
#[derive(Debug, Default)]
pub struct Extents(Vec<Extent>);

#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    height_max_m: f32,
    speed_max_m_s: f32,
    percent_from: Option<f32>,
    percent_to: Option<f32>,
}

impl Extents {
    /// The vehicle has just told something, in this flight.
    pub fn take(&mut self, at: Instant, flight: Option<usize>, reference: &Reference) {
        let Some(index) = flight else { return };
        if index >= self.0.len() {
            self.0.resize(index + 1, Extent::default());
        }
        let Some(extent) = self.0.get_mut(index) else { return };
        let vehicle = reference.vehicle();
        let height_m = vehicle.global.get().map(|global| global.relative_altitude.0);
        let percent = percent(at, reference);
        extent.height_max_m = extent.height_max_m.max(height_m.unwrap_or(0.0));
        extent.speed_max_m_s = extent.speed_max_m_s.max(ground_speed_mps(at, vehicle).unwrap_or(0.0));
        extent.percent_from = extent.percent_from.or(percent);
        extent.percent_to = percent.or(extent.percent_to);
    }

    /// The flights that the judge found, with these.
    pub fn flights(&self, judged: &[Judged]) -> Vec<Flight> {
        let flight = |(index, flight): (usize, &Judged)| {
            let extent = self.0.get(index).copied().unwrap_or_default();
            Flight {
                from_s: flight.from.as_secs_f64(),
                to_s: flight.to.as_secs_f64(),
                air_s: flight.air.as_micros() as f64 / 1e6,
                landed: flight.landed,
                disarmed_in_air: flight.disarmed_at_m.is_some(),
                height_max_m: extent.height_max_m,
                speed_max_m_s: extent.speed_max_m_s,
                percent_from: extent.percent_from,
                percent_to: extent.percent_to,
            }
        };
        judged.iter().enumerate().map(flight).collect()
    }
}

/// The phases of a log.
#[derive(Debug, Default)]
pub struct Phases(Vec<PhaseSpan>);

impl Phases {
    /// In order.
    pub fn all(&self) -> &[PhaseSpan] {
        &self.0
    }

    /// The phase goes on, or another begins; one too short to matter is taken back.
    pub fn extend(&mut self, at: Instant, reference: &Reference) {
        let phase = reference.flight().phase(at, reference.vehicle()).name();
        let at_s = at.as_secs_f64();
        let full = self.0.len() >= PHASES_MAX;
        if let Some(last) = self.0.last_mut() {
            last.to_s = last.to_s.max(at_s);
            if last.phase == phase || full {
                return;
            }
            let short = at_s - last.from_s < f64::from(PHASE_MIN.as_secs_f32());
            if short && self.0.len() > 1 {
                self.0.pop();
                if let Some(before) = self.0.last_mut() {
                    before.to_s = at_s;
                    if before.phase == phase {
                        return;
                    }
                }
            }
        }
        self.0.push(PhaseSpan { phase, from_s: at_s, to_s: at_s });
    }
}

/// What is left of the battery.
fn percent(at: Instant, reference: &Reference) -> Option<f32> {
    Some(reference.value(at, Quantity::BatteryPercent)?.as_f64() as f32)
}
