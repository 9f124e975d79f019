//! Trends: quantities of steady flight against the airframe's own past ([`crate::baseline`]).
//!
//! Once a second in steady flight each quantity gives a sample to a mean that looks back over a minute. A sample that is
//! far from that mean counts only as far as it may be believed, so that neither a gust nor garbage moves it much. What
//! the mean is at landing is the flight's figure, from which the baseline learns.
//!
//! The throttle that hovers depends on the air and on the battery's voltage: rotors turn with both of duty and voltage, and their thrust
//! goes with the square of that and with the air's density. Throttle of `ArduPilot` is linear in thrust, that of PX4 in speed (its
//! `THR_MDL_FAC` is 0 by default). So what is compared is the throttle at 3.8 V a cell and at sea level. Where the autopilot compensates
//! the voltage itself (`MOT_BAT_VOLT_MAX`) that is not done twice. Power is compared at sea level: what lifts
//! the same in thinner air takes the root of the densities more.
//!
//! A departure counts where one flight in `TRD_FALSE` in which nothing changed goes so far ([`Baseline::reach`]).
//!
//! # Heavier, or less thrust
//! A heavier vehicle asks all its rotors for more thrust T, and these take power as T^1.5 (actuator disk; Leishman, Principles of Helicopter
//! Aerodynamics, 2.4). A propeller that lost a part of its blades, a weak motor or ESC is given more throttle for the same thrust; the
//! power does not rise with it so. So where throttle rose, the logarithm of the power is held against that of the thrust that the
//! throttle stands for: from [`WEIGHT_EXPONENT`] times on, half way between both, it is the weight. Propellers of one real
//! quadrotor that were cut by 10 to 25 mm have 0.5 to 1.1 there.
//!
//! # What becomes better
//! Nothing that wears or breaks makes a vehicle hover with less, or a battery resist less and hold more. Where a flight is better than its past
//! beyond what was to be expected, something was changed, and a new baseline begins with it.

use crate::baseline::{Baseline, Baselines, OUTPUTS_MAX, Quantity};
use crate::charge::Charge;
use crate::derived::{Derived, pack_v};
use crate::flight::{Flight, FlightEvent, Phase};
use crate::observation::{Autopilot, MOTORS_MAX, VehicleKind, VibrationScale};
use crate::params::{Param, Params};
use crate::power_draw::drawn;
use crate::time::{Instant, Span};
use crate::trend::Resistance;
use crate::vehicle::{BATTERIES_MAX, Vehicle};

/// Between samples.
const EVERY: Span = Span::from_secs(1);
/// A mean holds from so many samples on.
const SAMPLES_MIN: u16 = 20;
/// And looks back over so many.
const SAMPLES: u16 = 60;
/// A sample moves the mean as if it were no further away than this part of it (and [`Quantity::grain`]).
const BELIEVED: f32 = 0.5;
/// See above.
const WEIGHT_EXPONENT: f32 = 1.25;
/// What the hover throttle is told for: voltage of a cell; pressure at sea level, hPa.
const CELL_V: f32 = 3.8;
const SEA_LEVEL_HPA: f32 = 1_013.25;
/// The exponent of density over pressure in the standard atmosphere, as a slope: 1 % wrong at 2,000 m.
const DENSITY_SLOPE: f32 = 0.81;
/// A value holds this long.
const FRESH: Span = Span::from_secs(2);

/// Which way a quantity goes when something is wrong.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Bad {
    Up,
    Down,
    Either,
}

/// How a quantity is compared.
struct Terms {
    bad: Bad,
    /// It is percents of the others: a departure is a difference, and not a part of the baseline.
    is_share: bool,
    /// What differs by less does not differ, in the quantity's unit; the least that a baseline counts as.
    grain: f32,
    /// How far flights differ where nothing changed: as a part of the baseline, of a share in percents. Hover throttle, power and
    /// outputs as in real flights of one quadrotor, at one place and day.
    prior: f32,
    /// A flight beyond this limit teaches nothing.
    warn: Param,
    /// No vehicle has more or less.
    sane: (f32, f32),
}

impl Quantity {
    const fn terms(self) -> Terms {
        let (bad, grain, prior, warn, sane) = match self {
            Self::Vibration => (Bad::Either, 1.0, 0.1, Param::TrdVibeWarn, (0.0, 1_000.0)),
            Self::HoverThrottle => (Bad::Up, 0.05, 0.007, Param::TrdThrWarn, (0.02, 2.0)),
            Self::HoverPower => (Bad::Up, 1.0, 0.0125, Param::TrdThrWarn, (1.0, 1e6)),
            Self::Resistance(_) => (Bad::Up, 0.002, 0.05, Param::BatResWarn, (0.0005, 1.0)),
            Self::Capacity(_) => (Bad::Down, 0.05, 0.08, Param::TrdCapWarn, (0.05, 10_000.0)),
            Self::MotorSpeed(_) => (Bad::Either, 1.0, 1.0, Param::TrdEscWarn, (-100.0, 100.0)),
            Self::MotorOutput(_) => (Bad::Either, 1.0, 2.5, Param::TrdEscWarn, (-100.0, 100.0)),
        };
        let is_share = matches!(self, Self::MotorSpeed(_) | Self::MotorOutput(_));
        Terms { bad, is_share, grain, prior, warn, sane }
    }

    const fn grain(self) -> f32 {
        self.terms().grain
    }

    fn is_sane(self, value: f32) -> bool {
        let (least, most) = self.terms().sane;
        (least..=most).contains(&value)
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
    /// What the batteries had before the take-off.
    charged: [Option<Charge>; BATTERIES_MAX],
    sampled_at: Option<Instant>,
    /// The throttle stands for thrust, and not for its root.
    linear_in_thrust: bool,
}

impl Default for Trends {
    fn default() -> Self {
        Self::new()
    }
}

impl Trends {
    /// Nothing sampled yet.
    pub const fn new() -> Self {
        Self {
            tracks: [Track { mean: 0.0, samples: 0 }; Quantity::COUNT],
            charged: [None; BATTERIES_MAX],
            sampled_at: None,
            linear_in_thrust: false,
        }
    }

    /// A flight begins or ends; `true` where the baselines learned from it.
    pub(crate) fn event(&mut self, event: FlightEvent, params: &Params, baselines: &mut Baselines) -> bool {
        match event {
            FlightEvent::TakeOff => {
                *self = Self { charged: self.charged, ..Self::new() };
                false
            }
            FlightEvent::Resumed => {
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
        if self.sampled_at.is_some_and(|at| now.since(at) < EVERY) {
            return;
        }
        self.sampled_at = Some(now);
        if flight.stands() {
            for (battery, charged) in (0..).zip(&mut self.charged) {
                *charged = Charge::of(vehicle, derived, params, battery).or(*charged);
            }
        }
        if !flight.airborne() {
            return;
        }
        self.linear_in_thrust = is_linear_in_thrust(vehicle);
        let steady = is_steady(now, vehicle, flight);
        for quantity in quantities() {
            let value = match quantity {
                // The resistance shows under a load that changes, and has a mean of its own; the charge sinks in any flight.
                Quantity::Resistance(battery) => {
                    derived.resistance(usize::from(battery)).and_then(Resistance::ohm)
                }
                Quantity::Capacity(battery) => self.capacity_ah(vehicle, derived, params, battery),
                _ if !steady => continue,
                _ => sample(now, quantity, vehicle, derived, params),
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

    /// The mean of the last minute of steady flight; `None` before there was enough of it.
    pub fn figure(&self, quantity: Quantity) -> Option<f32> {
        self.tracks.get(quantity.index()).filter(|track| track.samples >= SAMPLES_MIN).map(|track| track.mean)
    }

    /// How far a quantity is from its baseline, the way that is bad: percent of it; of a motor against the others, percent of these. 0 where
    /// a flight in which nothing changed may go so far. `None` without a baseline or without enough steady flight.
    pub(crate) fn departure(
        &self,
        quantity: Quantity,
        baselines: &Baselines,
        params: &Params,
    ) -> Option<f32> {
        let (baseline, off) = self.off(quantity, baselines)?;
        let Terms { bad, is_share, grain, .. } = quantity.terms();
        let bad = match bad {
            Bad::Up => off,
            Bad::Down => -off,
            Bad::Either => off.abs(),
        };
        if !exceeds(quantity, &baseline, off, params) || bad <= 0.0 {
            return Some(0.0);
        }
        let whole = if is_share { 100.0 } else { baseline.value.max(grain) };
        Some(bad / whole * 100.0)
    }

    /// How much heavier the vehicle hovers than before, percent; 0 where it is not, or where it has less thrust. `None` where that is
    /// not known.
    pub(crate) fn heavier(&self, baselines: &Baselines, params: &Params) -> Option<f32> {
        let throttle = self.departure(Quantity::HoverThrottle, baselines, params)?;
        let ratio = |quantity| {
            let (baseline, off) = self.off(quantity, baselines)?;
            Some(1.0 + off / baseline.value.max(quantity.grain()))
        };
        let (thrust, power) = (ratio(Quantity::HoverThrottle)?, ratio(Quantity::HoverPower)?);
        let thrust = if self.linear_in_thrust { thrust } else { thrust * thrust };
        let is_weight = libm::logf(power) >= WEIGHT_EXPONENT * libm::logf(thrust);
        Some(if throttle > 0.0 && is_weight { (thrust - 1.0) * 100.0 } else { 0.0 })
    }

    /// A quantity's baseline, and how far the flight is from it.
    fn off(&self, quantity: Quantity, baselines: &Baselines) -> Option<(Baseline, f32)> {
        let baseline = baselines.get(quantity);
        Some((baseline, self.figure(quantity)? - baseline.known()?))
    }

    fn learn(&self, params: &Params, baselines: &mut Baselines) -> bool {
        let mut learned = false;
        for quantity in quantities() {
            let Some(figure) = self.figure(quantity) else { continue };
            let departure = self.departure(quantity, baselines, params).unwrap_or(0.0);
            let Terms { bad, warn, .. } = quantity.terms();
            if departure >= params.get(warn) {
                continue;
            }
            let changed = |(baseline, off): (Baseline, f32)| {
                bad != Bad::Either && departure == 0.0 && exceeds(quantity, &baseline, off, params)
            };
            if self.off(quantity, baselines).is_some_and(changed) {
                baselines.forget(quantity);
            }
            baselines.learn(quantity, figure);
            learned = true;
        }
        learned
    }
}

/// Whether a flight in which nothing changed does not go so far.
fn exceeds(quantity: Quantity, baseline: &Baseline, off: f32, params: &Params) -> bool {
    let Terms { is_share, prior, .. } = quantity.terms();
    let prior = if is_share { prior } else { prior * baseline.value };
    off.abs() > baseline.reach(prior, params.get(Param::TrdFalse))
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

/// What a quantity is in steady flight.
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
        Quantity::HoverPower => {
            let power_w = drawn(now, vehicle).power_w;
            let hovers = vehicle.hovers(now) == Some(true);
            (hovers && power_w > 0.0).then(|| power_w * libm::sqrtf(density(vehicle)))
        }
        Quantity::MotorSpeed(motor) => {
            let at = vehicle.motors.get(usize::from(motor))?.moved_at?;
            (now.since(at) <= FRESH).then(|| derived.motors().departure(motor)).flatten()
        }
        Quantity::MotorOutput(motor) => derived.outputs().share(now, vehicle, motor),
        // They are no figures of steady flight.
        Quantity::Resistance(_) | Quantity::Capacity(_) => None,
    }
}

fn is_linear_in_thrust(vehicle: &Vehicle) -> bool {
    vehicle.heartbeat.get().is_some_and(|heartbeat| heartbeat.autopilot == Autopilot::ArduPilot)
}

/// The air's density as a part of that at sea level.
fn density(vehicle: &Vehicle) -> f32 {
    let pressure =
        vehicle.air.get().and_then(|air| air.pressure).map_or(SEA_LEVEL_HPA, |pressure| pressure.0);
    (1.0 + DENSITY_SLOPE * (pressure / SEA_LEVEL_HPA - 1.0)).max(0.0)
}

/// What the throttle is multiplied by to be that of [`CELL_V`] at sea level. `None` where the voltage of a cell is not known; 1 on wings.
fn lift(now: Instant, vehicle: &Vehicle, derived: &Derived, params: &Params) -> Option<f32> {
    if vehicle.hovers(now) != Some(true) {
        return Some(1.0);
    }
    let volts = match pack_v(vehicle, 0) {
        Some(pack_v) if !derived.cells().is_compensated() => {
            let cells = derived.cell_count(vehicle, 0, params);
            pack_v / (CELL_V * f32::from((cells > 0).then_some(cells)?))
        }
        _ => 1.0,
    };
    let lift = volts * volts * density(vehicle);
    Some(if is_linear_in_thrust(vehicle) { lift } else { libm::sqrtf(lift.max(0.0)) })
}

const _: () = assert!(Quantity::COUNT == 3 + 2 * BATTERIES_MAX + MOTORS_MAX + OUTPUTS_MAX);

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
        let (mut trends, mut baselines, params) = (Trends::new(), Baselines::new(), Params::defaults());
        for (quantity, normal, figure) in [
            (Quantity::Vibration, 4.0, 6.0),
            (Quantity::HoverThrottle, 0.4, 0.5),
            (Quantity::MotorSpeed(2), -2.0, 5.0),
        ] {
            assert_eq!(trends.departure(quantity, &baselines, &params), None, "nothing to compare with");
            (0..3).for_each(|_| baselines.learn(quantity, normal));
            assert_eq!(trends.departure(quantity, &baselines, &params), None, "nothing to compare");
            (0..SAMPLES).for_each(|_| trends.tracks[quantity.index()].take(figure, 1.0));
        }
        let departures = [Quantity::Vibration, Quantity::HoverThrottle, Quantity::MotorSpeed(2)]
            .map(|quantity| trends.departure(quantity, &baselines, &params).map(libm::roundf));
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

    /// A flight's figures against a past of `flights` at 0.4 of throttle and 160 W.
    fn hovered(throttle: f32, power_w: f32, linear_in_thrust: bool) -> (Trends, Baselines) {
        let (mut trends, mut baselines) = (Trends { linear_in_thrust, ..Trends::new() }, Baselines::new());
        for (quantity, normal, figure) in
            [(Quantity::HoverThrottle, 0.4, throttle), (Quantity::HoverPower, 160.0, power_w)]
        {
            (0..5).for_each(|_| baselines.learn(quantity, normal));
            trends.tracks[quantity.index()] = Track { mean: figure, samples: SAMPLES };
        }
        (trends, baselines)
    }

    #[test]
    fn a_heavier_vehicle_is_told_from_one_with_less_thrust() {
        let params = Params::defaults();
        let heavier = |throttle, power_w, linear_in_thrust| {
            let (trends, baselines) = hovered(throttle, power_w, linear_in_thrust);
            trends.heavier(&baselines, &params).map(libm::roundf)
        };
        // A tenth more weight: throttle by as much where it is linear in thrust, by its root elsewhere, and power by its 1.5th power.
        let power_w = 160.0 * 1.1_f32.powf(1.5);
        assert_eq!(heavier(0.44, power_w, true), Some(10.0));
        assert_eq!(heavier(0.4 * 1.1_f32.sqrt(), power_w, false), Some(10.0));
        // Propellers of a real quadrotor cut by 25, 20 and 10 mm.
        for (throttle, power) in [(1.10, 1.06), (1.20, 1.18), (1.17, 1.18)] {
            assert_eq!(heavier(0.4 * throttle, 160.0 * power, true), Some(0.0), "{throttle}");
        }
        assert_eq!(heavier(0.40, 160.0, true), Some(0.0));
        assert_eq!(heavier(0.36, 140.0, true), Some(0.0), "lighter");
        let (mut trends, baselines) = hovered(0.44, power_w, true);
        trends.tracks[Quantity::HoverPower.index()] = Track::default();
        assert_eq!(trends.heavier(&baselines, &params), None, "nobody knows its power");
    }

    #[test]
    fn what_becomes_better_begins_a_new_baseline_and_what_becomes_worse_teaches_nothing() {
        let (trends, mut baselines) = hovered(0.36, 190.0, true);
        trends.learn(&Params::defaults(), &mut baselines);
        let flights = |quantity| baselines.get(quantity).flights;
        assert_eq!(flights(Quantity::HoverThrottle), 1, "new propellers, or less to carry");
        assert_eq!(flights(Quantity::HoverPower), 5);
        // Within what flights differ by, it goes on.
        let (trends, mut baselines) = hovered(0.398, 161.0, true);
        trends.learn(&Params::defaults(), &mut baselines);
        assert_eq!(baselines.get(Quantity::HoverThrottle).flights, 6);
    }

    #[test]
    fn a_departure_counts_as_often_as_is_asked_for() {
        let mut params = Params::defaults();
        let (trends, baselines) = hovered(0.4 * 1.035, 160.0, true);
        let departure = |params: &Params| trends.departure(Quantity::HoverThrottle, &baselines, params);
        assert!(departure(&params).is_some_and(|percent| percent > 3.0));
        params.set("TRD_FALSE", 100_000.0).expect("in range");
        assert_eq!(departure(&params), Some(0.0));
    }

    #[test]
    fn a_battery_that_holds_less_is_worse() {
        let (mut trends, mut baselines, params) = (Trends::new(), Baselines::new(), Params::defaults());
        let capacity = Quantity::Capacity(0);
        (0..10).for_each(|_| baselines.learn(capacity, 5.0));
        for (figure, known) in [(5.2, Some(0.0)), (9.0, Some(0.0)), (2.5, Some(50.0))] {
            trends.tracks[capacity.index()] = Track { mean: figure, samples: SAMPLES };
            assert_eq!(trends.departure(capacity, &baselines, &params), known);
        }
    }
}
