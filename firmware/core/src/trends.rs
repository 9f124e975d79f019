//! Trends: quantities of steady flight against the airframe's own past ([`crate::baseline`]).
//!
//! Once a second in steady flight each quantity gives a sample to a mean that looks back over a minute. A sample that is
//! far from that mean counts only as far as it may be believed, so that neither a gust nor garbage moves it much. What
//! the mean is at landing is the flight's figure, from which the baseline learns.
//!
//! The throttle that hovers depends on the air and on the battery's voltage: rotors turn with both of duty and voltage, and their thrust
//! goes with the square of that and with the air's density. Throttle of `ArduPilot` is linear in thrust, that of PX4 in speed (its
//! `THR_MDL_FAC` is 0 by default). So what is compared is the throttle at 3.8 V a cell and at sea level. Where `ArduPilot` compensates the
//! voltage itself (`MOT_BAT_VOLT_MAX`) that is not done twice.
//!
//! A departure counts where it is more than [`SPREADS`] spreads of this airframe's flights ([`crate::baseline`]): one flight in 400 in
//! which nothing changed goes so far either way (Student's t with ten degrees of freedom: 0.25 %).

use crate::baseline::{Baselines, Quantity};
use crate::derived::{Derived, pack_v};
use crate::flight::{Flight, FlightEvent, Phase};
use crate::observation::{Autopilot, MOTORS_MAX, VehicleKind, VibrationScale};
use crate::params::{Param, Params};
use crate::time::{Instant, Span};
use crate::vehicle::{BATTERIES_MAX, Vehicle};

/// Between samples.
const EVERY: Span = Span::from_secs(1);
/// A mean holds from so many samples on.
const SAMPLES_MIN: u16 = 20;
/// And looks back over so many.
const SAMPLES: u16 = 60;
/// A sample moves the mean as if it were no further away than this part of it (and [`Quantity::grain`]).
const BELIEVED: f32 = 0.5;
/// A departure that counts, in spreads.
const SPREADS: f32 = 4.0;
/// What the hover throttle is told for: voltage of a cell; pressure at sea level, hPa.
const CELL_V: f32 = 3.8;
const SEA_LEVEL_HPA: f32 = 1_013.25;
/// The exponent of density over pressure in the standard atmosphere, as a slope: 1 % wrong at 2,000 m.
const DENSITY_SLOPE: f32 = 0.81;
/// A value holds this long.
const FRESH: Span = Span::from_secs(2);

impl Quantity {
    /// What differs by less does not differ: the quantity's own unit. Also the least that a baseline counts as, where
    /// a departure is a part of it.
    const fn grain(self) -> f32 {
        match self {
            Self::Vibration | Self::MotorSpeed(_) => 1.0,
            Self::HoverThrottle => 0.05,
            Self::Resistance(_) => 0.002,
        }
    }

    /// How far flights differ where nothing changed: in its own unit, or as a part of the baseline. Hover throttle: 0.7 % in real flights
    /// of one quadrotor, at one place and day.
    fn prior(self, normal: f32) -> f32 {
        match self {
            Self::Vibration => 0.1 * normal,
            Self::HoverThrottle => 0.007 * normal,
            Self::Resistance(_) => 0.05 * normal,
            Self::MotorSpeed(_) => 1.0,
        }
    }

    /// The limit beyond which a flight teaches nothing.
    const fn warn(self) -> Param {
        match self {
            Self::Vibration => Param::TrdVibeWarn,
            Self::HoverThrottle => Param::TrdThrWarn,
            Self::Resistance(_) => Param::BatResWarn,
            Self::MotorSpeed(_) => Param::TrdEscWarn,
        }
    }

    /// What no vehicle has: garbage.
    fn is_sane(self, value: f32) -> bool {
        match self {
            Self::Vibration => (0.0..=1_000.0).contains(&value),
            Self::HoverThrottle => (0.02..=2.0).contains(&value),
            Self::Resistance(_) => (0.0005..=1.0).contains(&value),
            Self::MotorSpeed(_) => value.abs() <= 100.0,
        }
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Track {
    mean: f32,
    samples: u16,
}

impl Track {
    fn take(&mut self, value: f32, grain: f32) {
        self.samples = (self.samples + 1).min(SAMPLES);
        if self.samples == 1 {
            self.mean = value;
            return;
        }
        let believed = BELIEVED * self.mean.abs() + grain;
        // Not `clamp`: its panic would print floating-point numbers, 12 KB of flash that nothing else takes.
        self.mean += (value - self.mean).max(-believed).min(believed) / f32::from(self.samples);
    }
}

/// All trends.
#[derive(Clone, Copy, Debug)]
pub struct Trends {
    tracks: [Track; Quantity::COUNT],
    sampled_at: Option<Instant>,
}

impl Default for Trends {
    fn default() -> Self {
        Self::new()
    }
}

impl Trends {
    /// Nothing sampled yet.
    pub const fn new() -> Self {
        Self { tracks: [Track { mean: 0.0, samples: 0 }; Quantity::COUNT], sampled_at: None }
    }

    /// A flight begins or ends; `true` where the baselines learned from it.
    pub(crate) fn event(&mut self, event: FlightEvent, params: &Params, baselines: &mut Baselines) -> bool {
        match event {
            FlightEvent::TakeOff | FlightEvent::Resumed => {
                *self = Self::new();
                false
            }
            FlightEvent::Landing => self.learn(params, baselines),
        }
    }

    /// One step, after flight and derived quantities.
    pub(crate) fn step(
        &mut self,
        now: Instant,
        vehicle: &Vehicle,
        flight: &Flight,
        derived: &Derived,
        params: &Params,
    ) {
        if self.sampled_at.is_some_and(|at| now.since(at) < EVERY) || !flight.airborne() {
            return;
        }
        self.sampled_at = Some(now);
        let steady = is_steady(now, vehicle, flight);
        for (quantity, track) in quantities().zip(&mut self.tracks) {
            // The resistance shows under a load that changes; it has a mean of its own.
            let counts = steady || matches!(quantity, Quantity::Resistance(_));
            let value = if counts { sample(now, quantity, vehicle, derived, params) } else { None };
            if let Some(value) = value.filter(|value| quantity.is_sane(*value)) {
                track.take(value, quantity.grain());
            }
        }
    }

    /// The mean of the last minute of steady flight; `None` before there was enough of it.
    pub fn figure(&self, quantity: Quantity) -> Option<f32> {
        self.tracks.get(quantity.index()).filter(|track| track.samples >= SAMPLES_MIN).map(|track| track.mean)
    }

    /// How far a quantity is from its baseline: percent of it above it, of vibration either way; of motor speeds, percent of the mean
    /// speed either way. 0 where that is within [`SPREADS`] of this airframe's flights. `None` without a baseline or without enough
    /// steady flight.
    pub(crate) fn departure(&self, quantity: Quantity, baselines: &Baselines) -> Option<f32> {
        let baseline = baselines.get(quantity);
        let (figure, normal) = (self.figure(quantity)?, baseline.known()?);
        let off = figure - normal;
        if libm::fabsf(off) <= SPREADS * baseline.spread(quantity.prior(normal)) {
            return Some(0.0);
        }
        Some(match quantity {
            Quantity::MotorSpeed(_) => off.abs(),
            Quantity::Vibration => off.abs() / normal.max(quantity.grain()) * 100.0,
            Quantity::HoverThrottle | Quantity::Resistance(_) => off / normal.max(quantity.grain()) * 100.0,
        })
    }

    fn learn(&self, params: &Params, baselines: &mut Baselines) -> bool {
        let mut learned = false;
        for quantity in quantities() {
            let Some(figure) = self.figure(quantity) else { continue };
            let departure = self.departure(quantity, baselines).unwrap_or(0.0);
            if departure < params.get(quantity.warn()) {
                baselines.learn(quantity, figure);
                learned = true;
            }
        }
        learned
    }
}

fn quantities() -> impl Iterator<Item = Quantity> {
    (0..Quantity::COUNT).filter_map(Quantity::from_index)
}

/// Hovering, or cruising on wings, and not leaning.
fn is_steady(now: Instant, vehicle: &Vehicle, flight: &Flight) -> bool {
    let wings = vehicle
        .heartbeat
        .get()
        .is_some_and(|heartbeat| matches!(heartbeat.kind, VehicleKind::Plane | VehicleKind::Vtol));
    let phase = flight.phase(now, vehicle);
    let level = flight.is_steady(now, vehicle);
    level && (phase == Phase::Hover || (wings && phase == Phase::Cruise))
}

fn sample(
    now: Instant,
    quantity: Quantity,
    vehicle: &Vehicle,
    derived: &Derived,
    params: &Params,
) -> Option<f32> {
    match quantity {
        Quantity::Vibration => {
            let vibration = vehicle.vibration.within(now, FRESH)?;
            match vibration.scale {
                VibrationScale::PerAxis => vibration.levels.into_iter().flatten().reduce(f32::max),
                VibrationScale::Px4Metrics => vibration.levels[2],
            }
        }
        Quantity::HoverThrottle => {
            let throttle = vehicle.hud.within(now, FRESH)?.throttle?.0;
            Some(throttle * lift(now, vehicle, derived, params)?)
        }
        Quantity::Resistance(battery) => derived.resistance(usize::from(battery))?.ohm(),
        Quantity::MotorSpeed(motor) => {
            let at = vehicle.motors.get(usize::from(motor))?.moved_at?;
            (now.since(at) <= FRESH).then(|| derived.motor_departure(motor)).flatten()
        }
    }
}

/// What the throttle is multiplied by to be that of [`CELL_V`] at sea level. `None` where the voltage of a cell is not known; 1 on wings.
fn lift(now: Instant, vehicle: &Vehicle, derived: &Derived, params: &Params) -> Option<f32> {
    if vehicle.hovers(now) != Some(true) {
        return Some(1.0);
    }
    let pressure =
        vehicle.air.get().and_then(|air| air.pressure).map_or(SEA_LEVEL_HPA, |pressure| pressure.0);
    let density = 1.0 + DENSITY_SLOPE * (pressure / SEA_LEVEL_HPA - 1.0);
    let volts = match pack_v(vehicle, 0) {
        Some(pack_v) if !derived.cells().is_compensated() => {
            let cells = derived.cell_count(vehicle, 0, params);
            pack_v / (CELL_V * f32::from((cells > 0).then_some(cells)?))
        }
        _ => 1.0,
    };
    let lift = volts * volts * density;
    let linear_in_thrust =
        vehicle.heartbeat.get().is_some_and(|heartbeat| heartbeat.autopilot == Autopilot::ArduPilot);
    Some(if linear_in_thrust { lift } else { libm::sqrtf(lift.max(0.0)) })
}

const _: () = assert!(Quantity::COUNT == 2 + BATTERIES_MAX + MOTORS_MAX);

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
    fn a_departure_is_a_part_of_the_baseline_and_of_motors_percent_points() {
        let (mut trends, mut baselines) = (Trends::new(), Baselines::new());
        for (quantity, normal, figure) in [
            (Quantity::Vibration, 4.0, 6.0),
            (Quantity::HoverThrottle, 0.4, 0.5),
            (Quantity::MotorSpeed(2), -2.0, 5.0),
        ] {
            assert_eq!(trends.departure(quantity, &baselines), None, "nothing to compare with");
            (0..3).for_each(|_| baselines.learn(quantity, normal));
            assert_eq!(trends.departure(quantity, &baselines), None, "nothing to compare");
            (0..SAMPLES).for_each(|_| trends.tracks[quantity.index()].take(figure, 1.0));
        }
        let departures = [Quantity::Vibration, Quantity::HoverThrottle, Quantity::MotorSpeed(2)]
            .map(|quantity| trends.departure(quantity, &baselines).map(libm::roundf));
        assert_eq!(departures, [Some(50.0), Some(25.0), Some(7.0)]);
    }

    #[test]
    fn a_fault_never_becomes_normal() {
        let (mut trends, mut baselines) = (Trends::new(), Baselines::new());
        (0..5).for_each(|_| baselines.learn(Quantity::HoverThrottle, 0.40));
        for figure in [0.41, 0.60] {
            trends.tracks[Quantity::HoverThrottle.index()] = Track { mean: figure, samples: SAMPLES };
            trends.learn(&Params::defaults(), &mut baselines);
        }
        let known = baselines.get(Quantity::HoverThrottle);
        assert_eq!(known.flights, 6, "the first was learned, the second not");
        assert!((known.value - 0.4017).abs() < 0.001, "{known:?}");
    }
}
