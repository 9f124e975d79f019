//! Flights, as [`crate::check`] finds them, with how high and fast they were.

use hums_core::clock::Instant;
use hums_core::motion::ground_speed_mps;
use serde::Serialize;

use crate::check::flights::Flight as Judged;
use crate::reference::{Quantity, Reference};

/// One flight: from take-off to landing, or to the end of the log.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Flight {
    pub(super) from_s: f64,
    pub(super) to_s: f64,
    /// In the air, without stops on the ground and gaps of the record.
    pub(super) air_s: f64,
    /// It was on the ground before; otherwise it was first received in the air.
    pub(super) took_off: bool,
    pub(super) landed: bool,
    /// Disarmed in the air, which is not a landing.
    pub(super) disarmed_in_air: bool,
    /// Time of the impact that ended it.
    pub(super) impact_s: Option<f64>,
    /// Time at which it was down, if a mishap without an impact ended it.
    pub(super) down_s: Option<f64>,
    /// `None` if unknown.
    pub(super) height_max_m: Option<f32>,
    pub(super) speed_max_m_s: Option<f32>,
    pub(super) percent_from: Option<f32>,
    pub(super) percent_to: Option<f32>,
}

impl Flight {
    /// Take-off, and when it was in the air last.
    pub(super) fn span(&self) -> (Instant, Instant) {
        let instant = |seconds: f64| Instant::from_micros((seconds * 1e6).round() as u64);
        (instant(self.from_s), instant(self.to_s))
    }
}

/// Height, speed and battery use of each flight.
#[derive(Debug, Default)]
pub struct Extents(Vec<Extent>);

#[derive(Clone, Copy, Debug, Default)]
struct Extent {
    height_max_m: Option<f32>,
    speed_max_m_s: Option<f32>,
    percent_from: Option<f32>,
    percent_to: Option<f32>,
}

impl Extents {
    /// Takes the vehicle's new values in this flight.
    pub fn take(&mut self, at: Instant, flight: Option<usize>, reference: &Reference) {
        let Some(index) = flight else { return };
        if index >= self.0.len() {
            self.0.resize(index + 1, Extent::default());
        }
        let Some(extent) = self.0.get_mut(index) else { return };
        let vehicle = reference.vehicle();
        let height_m = vehicle.global.get().map(|global| global.relative_altitude.0);
        let percent = percent(at, reference);
        extent.height_max_m = most(extent.height_max_m, height_m);
        extent.speed_max_m_s = most(extent.speed_max_m_s, ground_speed_mps(at.into(), vehicle));
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
                took_off: flight.took_off,
                landed: flight.landed,
                disarmed_in_air: flight.disarmed_at_m.is_some(),
                impact_s: flight.mishap_s(true),
                down_s: flight.mishap_s(false),
                height_max_m: extent.height_max_m,
                speed_max_m_s: extent.speed_max_m_s,
                percent_from: extent.percent_from,
                percent_to: extent.percent_to,
            }
        };
        judged.iter().enumerate().map(flight).collect()
    }
}

fn most(one: Option<f32>, other: Option<f32>) -> Option<f32> {
    [one, other].into_iter().flatten().reduce(f32::max)
}

fn percent(at: Instant, reference: &Reference) -> Option<f32> {
    Some(reference.value(at, Quantity::BatteryPercent)?.as_f64() as f32)
}
