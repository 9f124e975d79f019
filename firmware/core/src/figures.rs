//! Figures of a flight: quantities of steady flight that show wear and load, each as the mean of its last minute.
//!
//! Once a second in steady flight (hover, or cruise on wings; level) each quantity gives a sample. One far from the mean counts
//! only for a part of its distance (`BELIEVED`): a gust or garbage moves the mean little. The mean at landing is the flight's
//! figure. It is recorded with the session's counters; `hums check` compares the figures of flights.
//!
//! Hover throttle depends on air density and on the battery's voltage: rotor speed goes with duty times voltage,
//! thrust with its square and with density. `ArduPilot`'s throttle is linear in thrust, PX4's in speed (`THR_MDL_FAC`
//! is 0 by default). The figure is the throttle at 3.8 V a cell and at sea level. If the autopilot compensates the
//! voltage itself (`MOT_BAT_VOLT_MAX`), the voltage is left out. Hover power is given at sea level: the power for the
//! same lift goes with the inverse root of density.

use crate::battery_charge::Charge;
use crate::derived::{Derived, pack_v};
use crate::flight::{Flight, FlightEvent, Phase};
use crate::health::Inputs;
use crate::observation::MOTORS_MAX;
use crate::parameters::Params;
use crate::power_draw::drawn;
use crate::residual::KNOWN_SAMPLES;
use crate::time::{BootMs, Millis, PAUSE, Stamp};
use crate::trend::Resistance;
use crate::vehicle::{BATTERIES_MAX, Vehicle};

/// Between samples.
const EVERY: Millis = Millis::from_secs(1);
const SAMPLES: u16 = 60;
/// Part of the distance by which a sample moves the mean at most (and [`Quantity::grain`]).
const BELIEVED: f32 = 0.5;
/// Voltage of a cell, and pressure at sea level, hPa, for which hover throttle is given.
const CELL_V: f32 = 3.8;
const SEA_LEVEL_HPA: f32 = 1_013.25;
/// The exponent of density over pressure in the standard atmosphere, as a slope: 1 % wrong at 2,000 m.
const DENSITY_SLOPE: f32 = 0.81;

/// A quantity of steady flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Vibration in steady flight, on the autopilot's own scale.
    Vibration,
    /// Throttle in hover, 0 to 1.
    HoverThrottle,
    /// A battery's internal resistance, ohm, by its place.
    Resistance(u8),
    /// How far a motor's speed is from the mean of the others, percent of it, with its sign.
    MotorSpeed(u8),
    /// Power that hovers, drawn from the batteries, W.
    HoverPower,
    /// How far a motor's output is from the mean of all, percent of it, with its sign.
    MotorOutput(u8),
    /// A battery's charge from full to empty, Ah, by its place.
    Capacity(u8),
}

/// Motors of the largest frame whose outputs are compared.
pub const OUTPUTS_MAX: usize = 6;

impl Quantity {
    /// How many there are.
    pub const COUNT: usize = 3 + 2 * BATTERIES_MAX + MOTORS_MAX + OUTPUTS_MAX;

    /// All of them, by [`Self::index`].
    pub fn all() -> impl Iterator<Item = Self> {
        let each = |count: usize, of: fn(u8) -> Self| (0..count as u8).map(of);
        let first = [Self::Vibration, Self::HoverThrottle].into_iter();
        let with_motors =
            first.chain(each(BATTERIES_MAX, Self::Resistance)).chain(each(MOTORS_MAX, Self::MotorSpeed));
        let with_outputs = with_motors.chain([Self::HoverPower]).chain(each(OUTPUTS_MAX, Self::MotorOutput));
        with_outputs.chain(each(BATTERIES_MAX, Self::Capacity))
    }

    /// The quantity of a place in the record.
    pub fn from_index(index: usize) -> Option<Self> {
        Self::all().nth(index)
    }

    /// Its place in the record, which never changes.
    pub fn index(self) -> usize {
        Self::all().take_while(|before| *before != self).count()
    }

    /// Figures that differ by less are equal, in the quantity's unit.
    pub const fn grain(self) -> f32 {
        match self {
            Self::HoverThrottle | Self::Capacity(_) => 0.05,
            Self::Resistance(_) => 0.002,
            Self::Vibration | Self::HoverPower | Self::MotorSpeed(_) | Self::MotorOutput(_) => 1.0,
        }
    }

    fn is_sane(self, value: f32) -> bool {
        let (least, most) = match self {
            Self::Vibration => (0.0, 1_000.0),
            Self::HoverThrottle => (0.02, 2.0),
            Self::HoverPower => (1.0, 1e6),
            Self::Resistance(_) => (0.0005, 1.0),
            Self::Capacity(_) => (0.05, 10_000.0),
            Self::MotorSpeed(_) | Self::MotorOutput(_) => (-100.0, 100.0),
        };
        (least..=most).contains(&value)
    }
}

state! {
    struct Track {
        mean: f32,
        samples: u16,
    }
}

impl Track {
    fn take(&mut self, value: f32, grain: f32) {
        self.samples = (self.samples + 1).min(SAMPLES);
        if self.samples == 1 {
            self.mean = value;
            return;
        }
        let believed = BELIEVED * self.mean.abs() + grain;
        // Not `clamp`: its panic would print floating-point numbers, 12 KB of flash that is otherwise unused.
        self.mean += (value - self.mean).max(-believed).min(believed) / f32::from(self.samples);
    }
}

state! {
    /// The figures of a flight.
    pub struct Figures {
        tracks: [Track; Quantity::COUNT] = [Track::default(); Quantity::COUNT],
        charged: [Option<Charge>; BATTERIES_MAX] = [None; BATTERIES_MAX],
        sampled_at: Stamp,
    }
}

impl Figures {
    pub(crate) fn step(&mut self, inputs: &Inputs<'_>, event: Option<FlightEvent>) {
        let Inputs { now, vehicle, flight, derived, params, .. } = *inputs;
        match event {
            Some(FlightEvent::TakeOff) => *self = Self { charged: self.charged, ..Self::default() },
            Some(FlightEvent::Resumed) => *self = Self::default(),
            Some(FlightEvent::Landing) | None => {}
        }
        if self.sampled_at.age(now).is_some_and(|age| age < EVERY) {
            return;
        }
        self.sampled_at = Stamp::at(now);
        if flight.stands() {
            for (battery, charged) in (0..).zip(&mut self.charged) {
                *charged = Charge::of(vehicle, derived, params, battery).or(*charged);
            }
        }
        if !flight.airborne() || flight.may_have_landed() {
            return;
        }
        let steady = is_steady(now, vehicle, flight);
        for quantity in Quantity::all() {
            let value = match quantity {
                // The resistance shows under a load that changes, and has a mean of its own; the charge sinks in any flight.
                Quantity::Resistance(battery) => {
                    derived.resistance.get(usize::from(battery)).and_then(Resistance::ohm)
                }
                Quantity::Capacity(battery) => self.capacity_ah(vehicle, derived, params, battery),
                _ if !steady => continue,
                _ => sample(quantity, inputs),
            };
            let track = self.tracks.get_mut(quantity.index());
            if let (Some(value), Some(track)) = (value.filter(|value| quantity.is_sane(*value)), track) {
                track.take(value, quantity.grain());
            }
        }
    }

    fn capacity_ah(&self, vehicle: &Vehicle, derived: &Derived, params: &Params, battery: u8) -> Option<f32> {
        let charged = self.charged.get(usize::from(battery)).copied().flatten()?;
        let now = Charge::of(vehicle, derived, params, battery)?;
        charged.capacity_ah(&now, derived, battery)
    }

    /// The mean of the last minute of steady flight; `None` before there were enough samples.
    pub fn get(&self, quantity: Quantity) -> Option<f32> {
        self.tracks
            .get(quantity.index())
            .filter(|track| track.samples >= KNOWN_SAMPLES.into())
            .map(|track| track.mean)
    }
}

fn is_steady(now: BootMs, vehicle: &Vehicle, flight: &Flight) -> bool {
    let phase = flight.phase(now, vehicle);
    let level = flight.is_steady(now, vehicle);
    level && (phase == Phase::Hover || (vehicle.has_wings() && phase == Phase::Cruise))
}

fn sample(quantity: Quantity, inputs: &Inputs<'_>) -> Option<f32> {
    let Inputs { now, vehicle, derived, .. } = *inputs;
    match quantity {
        Quantity::Vibration => vehicle.vibration.within(now, PAUSE)?.acceleration(),
        Quantity::HoverThrottle => {
            let throttle = vehicle.hud.within(now, PAUSE)?.throttle?.0;
            Some(throttle * lift(inputs)?)
        }
        Quantity::HoverPower => {
            let power_w = drawn(now, vehicle).power_w;
            let hovers = vehicle.hovers(now) == Some(true);
            (hovers && power_w > 0.0).then(|| power_w * libm::sqrtf(density(vehicle)))
        }
        Quantity::MotorSpeed(motor) => {
            let at = vehicle.motors.get(usize::from(motor))?.moved_at?;
            (now.since(at) <= PAUSE).then(|| derived.motors.departure(motor)).flatten()
        }
        Quantity::MotorOutput(motor) => derived.motors.outputs.share(now, vehicle, motor),
        // Not figures of steady flight.
        Quantity::Resistance(_) | Quantity::Capacity(_) => None,
    }
}

fn density(vehicle: &Vehicle) -> f32 {
    let pressure =
        vehicle.air.get().and_then(|air| air.pressure).map_or(SEA_LEVEL_HPA, |pressure| pressure.0);
    (1.0 + DENSITY_SLOPE * (pressure / SEA_LEVEL_HPA - 1.0)).max(0.0)
}

/// The factor that turns the throttle into that at [`CELL_V`] and sea level. `None` if the cell voltage is unknown; 1
/// on wings.
fn lift(inputs: &Inputs<'_>) -> Option<f32> {
    let Inputs { now, vehicle, derived, params, .. } = *inputs;
    if vehicle.hovers(now) != Some(true) {
        return Some(1.0);
    }
    let volts = match pack_v(vehicle, 0) {
        Some(pack_v) if !derived.cells.is_compensated() => {
            let cells = derived.cell_count(vehicle, 0, params);
            pack_v / (CELL_V * f32::from((cells > 0).then_some(cells)?))
        }
        _ => 1.0,
    };
    let lift = volts * volts * density(vehicle);
    Some(if vehicle.is_ardupilot() { lift } else { libm::sqrtf(lift.max(0.0)) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn garbage_moves_a_mean_little_and_a_change_moves_it() {
        let mut track = Track::default();
        (0..60).for_each(|_| track.take(10.0, 1.0));
        track.take(1_000.0, 1.0);
        assert!((track.mean - 10.1).abs() < 0.01, "{track:?}");
        (0..240).for_each(|_| track.take(13.0, 1.0));
        assert!((track.mean - 13.0).abs() < 0.1, "{track:?}");
    }

    #[test]
    fn every_place_is_one_quantitys() {
        for index in 0..Quantity::COUNT {
            assert_eq!(Quantity::from_index(index).map(Quantity::index), Some(index));
        }
        assert_eq!(Quantity::from_index(Quantity::COUNT), None);
    }
}
