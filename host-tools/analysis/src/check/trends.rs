//! Trends: a flight's figures ([`hums_core::figures`]) against the vehicle's earlier flights.
//!
//! The first [`FLIGHTS_MIN`] flights make a baseline; each later one moves it by a tenth of the difference. Beyond the
//! warning's limit it does not, so a fault never becomes normal.
//!
//! A baseline has mean and spread. A departure counts if only one unchanged flight in `TRD_FALSE` departs further, by Student's
//! t distribution. Figures are normal with unknown mean and spread (conjugate prior; Gelman et al., Bayesian Data Analysis, 3.2
//! and 3.3). The likelihood ratio test of a changed mean has a settable rate of false alarms (Lehmann and Romano, Testing
//! Statistical Hypotheses, 5.2).
//!
//! # Heavier, or less thrust
//! A heavier vehicle asks all its rotors for more thrust T, and these take power as T^1.5 (actuator disk; Leishman, Principles
//! of Helicopter Aerodynamics, 2.4). A shorter blade, a weak motor or ESC raises throttle for the same thrust, and not power.
//! So the logarithm of power is compared with that of the thrust at this throttle: from `WEIGHT_EXPONENT` times on, half way
//! between both, the cause is weight. Real propellers cut by 10 to 25 mm have 0.5 to 1.1.
//!
//! # Better than before
//! Wear never improves hover or battery: a flight better beyond its reach begins a new baseline, because a part was changed.

use hums_blackbox::Record;
use hums_blackbox::record::RecordReason;
use hums_core::Monitor;
use hums_core::clock::Instant;
use hums_core::component::ComponentKind;
use hums_core::figures::Quantity;
use hums_core::health::{Level, Subsystem};
use hums_core::observation::Autopilot;
use hums_core::parameters::{Param, Params};
use hums_onboard::monitoring::PARTS_CHANGED;

use super::problem::Problem;
use crate::source::told::Finding;

/// Flights that make a baseline; before, nothing is compared.
pub const FLIGHTS_MIN: u16 = 3;
const WEIGHT: f32 = 0.1;
/// Remembered flights.
const REMEMBERED: u16 = 10;
const PRIOR_FLIGHTS: f32 = 8.0;
/// See above.
const WEIGHT_EXPONENT: f32 = 1.25;

/// A motor, or less thrust, takes more throttle and power.
pub(super) fn because(effect: &Problem, others: &[Problem]) -> Option<String> {
    let causes: &[&str] = match effect.check.as_str() {
        "throttle_trend" => &["motor_trend"],
        "power_trend" => &["motor_trend", "throttle_trend"],
        _ => &[],
    };
    let is_cause =
        |cause: &&&str| others.iter().any(|of| of.check == **cause && of.level as u8 >= effect.level as u8);
    causes.iter().find(is_cause).map(|cause| (*cause).to_owned())
}

pub(super) fn is_change(record: &Record<'_>) -> bool {
    match record {
        Record::Component(part) => part.why == RecordReason::Replaced && part.kind != ComponentKind::Card,
        Record::Event(event) => event.text.starts_with(PARTS_CHANGED),
        _ => false,
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Bad {
    Up,
    Down,
    Either,
}

struct Terms {
    check: &'static str,
    part: u8,
    subsystem: Subsystem,
    bad: Bad,
    /// Percents of the others: a departure is a difference.
    is_share: bool,
    /// Of unchanged flights: a part of the baseline, of a share in percents. Hover figures are from real flights of one
    /// quadrotor, at one place and day.
    prior: f32,
    /// A flight beyond this limit teaches nothing.
    warn: Param,
    critical: Param,
}

fn terms(quantity: Quantity) -> Terms {
    use Param as P;
    use Subsystem::{Power, Propulsion, Structure};
    let (check, subsystem, bad, prior, (warn, critical)) = match quantity {
        Quantity::Vibration => {
            ("vibration_trend", Structure, Bad::Either, 0.1, (P::TrdVibeWarn, P::TrdVibeCrit))
        }
        Quantity::HoverThrottle => {
            ("throttle_trend", Propulsion, Bad::Up, 0.007, (P::TrdThrWarn, P::TrdThrCrit))
        }
        Quantity::HoverPower => ("power_trend", Propulsion, Bad::Up, 0.0125, (P::TrdThrWarn, P::TrdThrCrit)),
        Quantity::Resistance(_) => ("batt_resistance", Power, Bad::Up, 0.05, (P::BatResWarn, P::BatResCrit)),
        Quantity::Capacity(_) => ("batt_capacity", Power, Bad::Down, 0.08, (P::TrdCapWarn, P::TrdCapCrit)),
        Quantity::MotorSpeed(_) => {
            ("motor_trend", Propulsion, Bad::Either, 1.0, (P::TrdEscWarn, P::TrdEscCrit))
        }
        Quantity::MotorOutput(_) => {
            ("motor_trend", Propulsion, Bad::Either, 2.5, (P::TrdEscWarn, P::TrdEscCrit))
        }
    };
    let (part, is_share) = match quantity {
        Quantity::MotorSpeed(motor) | Quantity::MotorOutput(motor) => (motor, true),
        Quantity::Resistance(battery) | Quantity::Capacity(battery) => (battery, false),
        Quantity::Vibration | Quantity::HoverThrottle | Quantity::HoverPower => (0, false),
    };
    Terms { check, part, subsystem, bad, is_share, prior, warn, critical }
}

/// An event of a recording's trends, in order.
#[derive(Clone, Debug)]
pub enum Episode {
    /// A flight.
    Flown(Box<FlightFigures>),
    /// Earlier flights are no measure.
    Changed,
}

/// Figures of a flight.
#[derive(Clone, Debug)]
pub struct FlightFigures {
    /// Landing, or the recording's end.
    at: Instant,
    landed: bool,
    figures: [Option<f32>; Quantity::COUNT],
    /// Throttle is thrust, not its root.
    is_linear_in_thrust: bool,
}

impl FlightFigures {
    /// A flight at the landing or the recording's end.
    pub fn of(at: Instant, landed: bool, monitor: &Monitor) -> Self {
        let autopilot = monitor.vehicle().heartbeat.get().map(|heartbeat| heartbeat.autopilot);
        let mut figures = [None; Quantity::COUNT];
        for (figure, quantity) in figures.iter_mut().zip(Quantity::all()) {
            *figure = monitor.figures().get(quantity);
        }
        Self { at, landed, figures, is_linear_in_thrust: autopilot == Some(Autopilot::ArduPilot) }
    }

    fn figure(&self, quantity: Quantity) -> Option<f32> {
        self.figures.get(quantity.index()).copied().flatten()
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Baseline {
    /// In the quantity's unit.
    value: f32,
    /// Mean square distance.
    variance: f32,
    /// Holds from [`FLIGHTS_MIN`] on.
    flights: u16,
}

impl Baseline {
    fn learn(&mut self, figure: f32) {
        let weight = (1.0 / (f32::from(self.flights) + 1.0)).max(WEIGHT);
        let off = figure - self.value;
        // Mean and variance with weights: D. H. D. West, Communications of the ACM 22, 1979.
        self.variance =
            if self.flights == 0 { 0.0 } else { (1.0 - weight) * (self.variance + weight * off * off) };
        self.value += weight * off;
        self.flights = self.flights.saturating_add(1);
    }

    /// Spread of an unchanged flight; `prior`: usual spread.
    fn spread(&self, prior: f32) -> f32 {
        let flights = f32::from(self.flights.clamp(1, REMEMBERED));
        let squares = PRIOR_FLIGHTS * prior * prior + flights * self.variance;
        (squares / (PRIOR_FLIGHTS + flights) * (1.0 + 1.0 / flights)).sqrt()
    }

    /// Either way, exceeded by one unchanged flight in `rarely`.
    fn reach(&self, prior: f32, rarely: f32) -> f32 {
        let flights = f32::from(self.flights.clamp(1, REMEMBERED));
        self.spread(prior) * student_t(rarely, PRIOR_FLIGHTS + flights - 1.0)
    }
}

/// Student's t of these degrees of freedom (8 and more), exceeded either way once in `rarely`. 26.2.23 and 26.7.5 of Abramowitz
/// and Stegun, Handbook of Mathematical Functions. Within 1 % for one in 20 to one in 100,000.
fn student_t(rarely: f32, degrees: f32) -> f32 {
    let root = (2.0 * (2.0 * rarely).ln()).sqrt();
    let above = 2.515_517 + root * (0.802_853 + root * 0.010_328);
    let below = 1.0 + root * (1.432_788 + root * (0.189_269 + root * 0.001_308));
    let normal = root - above / below;
    let square = normal * normal;
    let terms = [
        (1.0 + square) / 4.0,
        (3.0 + square * (16.0 + square * 5.0)) / 96.0,
        (-15.0 + square * (17.0 + square * (19.0 + square * 3.0))) / 384.0,
        (-945.0 + square * (-1_920.0 + square * (1_482.0 + square * (776.0 + square * 79.0)))) / 92_160.0,
    ];
    let more = terms.iter().rev().fold(0.0, |sum, term| (sum + term) / degrees);
    normal * (1.0 + more)
}

/// A vehicle's normal figures.
#[derive(Clone, Debug, PartialEq)]
pub struct Baselines([Baseline; Quantity::COUNT]);

impl Default for Baselines {
    fn default() -> Self {
        Self([Baseline::default(); Quantity::COUNT])
    }
}

impl Baselines {
    /// The most flights that any baseline was learned from.
    pub fn flights(&self) -> u16 {
        self.0.iter().map(|baseline| baseline.flights).max().unwrap_or(0)
    }

    /// The normal figure, once enough flights made it.
    pub fn known(&self, quantity: Quantity) -> Option<f32> {
        let Baseline { value, flights, .. } = self.0[quantity.index()];
        (flights >= FLIGHTS_MIN).then_some(value)
    }

    fn off(&self, quantity: Quantity, flown: &FlightFigures) -> Option<f32> {
        Some(flown.figure(quantity)? - self.known(quantity)?)
    }

    /// Rare among unchanged flights.
    fn exceeds(&self, quantity: Quantity, off: f32, params: &Params) -> bool {
        let (baseline, Terms { is_share, prior, .. }) = (self.0[quantity.index()], terms(quantity));
        let prior = if is_share { prior } else { prior * baseline.value };
        off.abs() > baseline.reach(prior, params.get(Param::TrdFalse))
    }

    /// The bad way, percent of the baseline; a motor's share: of the others. 0 within an unchanged flight's reach. `None`
    /// without a baseline or a figure.
    fn departure(&self, quantity: Quantity, flown: &FlightFigures, params: &Params) -> Option<f32> {
        let off = self.off(quantity, flown)?;
        let Terms { bad, is_share, .. } = terms(quantity);
        let is_bad = match bad {
            Bad::Up => off > 0.0,
            Bad::Down => off < 0.0,
            Bad::Either => true,
        };
        if !is_bad || !self.exceeds(quantity, off, params) {
            return Some(0.0);
        }
        let whole = if is_share { 100.0 } else { self.0[quantity.index()].value.max(quantity.grain()) };
        Some(off.abs() / whole * 100.0)
    }

    /// Percent; 0 if it is not, or has less thrust. `None` if unknown.
    fn heavier(&self, flown: &FlightFigures, params: &Params) -> Option<f32> {
        let throttle = self.departure(Quantity::HoverThrottle, flown, params)?;
        let ratio =
            |of: Quantity| Some(1.0 + self.off(of, flown)? / self.0[of.index()].value.max(of.grain()));
        let (thrust, power) = (ratio(Quantity::HoverThrottle)?, ratio(Quantity::HoverPower)?);
        let thrust = if flown.is_linear_in_thrust { thrust } else { thrust * thrust };
        let is_weight = power.ln() >= WEIGHT_EXPONENT * thrust.ln();
        Some(if throttle > 0.0 && is_weight { (thrust - 1.0) * 100.0 } else { 0.0 })
    }

    /// Nothing beyond the warning's limit; anew after an improvement.
    fn learn(&mut self, flown: &FlightFigures, params: &Params) {
        let before = self.clone();
        for quantity in Quantity::all() {
            let Some(figure) = flown.figure(quantity) else { continue };
            let departure = before.departure(quantity, flown, params).unwrap_or(0.0);
            let Terms { bad, warn, .. } = terms(quantity);
            if departure >= params.get(warn) {
                continue;
            }
            let baseline = &mut self.0[quantity.index()];
            let off = before.off(quantity, flown);
            let is_better = bad != Bad::Either && departure.to_bits() == 0.0_f32.to_bits();
            if is_better && off.is_some_and(|off| before.exceeds(quantity, off, params)) {
                *baseline = Baseline::default();
            }
            baseline.learn(figure);
        }
    }

    fn departures(&self, flown: &FlightFigures, params: &Params) -> Vec<(Terms, f32)> {
        let heavier = self.heavier(flown, params);
        let mut all: Vec<(Terms, f32)> = Vec::new();
        for quantity in Quantity::all() {
            let Some(departure) = self.departure(quantity, flown, params) else { continue };
            let terms = terms(quantity);
            let takes_more = matches!(quantity, Quantity::HoverThrottle | Quantity::HoverPower);
            let is_weight = takes_more && heavier.is_some_and(|percent| percent > 0.0);
            // Only if no ESC reports the speed.
            let is_told = all.iter().any(|(known, _)| (known.check, known.part) == (terms.check, terms.part));
            if !is_told {
                all.push((terms, if is_weight { 0.0 } else { departure }));
            }
        }
        all.extend(
            heavier
                .map(|percent| (Terms { check: "weight_trend", ..terms(Quantity::HoverThrottle) }, percent)),
        );
        all
    }

    /// Findings, and the checks with a figure; then learns.
    pub fn judge(&mut self, flown: &FlightFigures, params: &Params) -> (Vec<Finding>, Vec<&'static str>) {
        let departures = self.departures(flown, params);
        let judged = departures.iter().map(|(terms, _)| terms.check).collect();
        let found = departures.into_iter().filter_map(|(terms, value)| {
            let (warn, critical) = (params.get(terms.warn), params.get(terms.critical));
            let (level, limit) = match () {
                () if value > critical && terms.check != "weight_trend" => (Level::Critical, critical),
                () if value > warn => (Level::Warning, warn),
                () => return None,
            };
            Some(Finding {
                at: flown.at,
                subsystem: terms.subsystem,
                check: terms.check.to_owned(),
                instance: terms.part,
                level,
                previous: Level::Ok,
                value,
                worst: None,
                limit,
                unit: "%".to_owned(),
            })
        });
        let found = found.collect();
        if flown.landed {
            self.learn(flown, params);
        }
        (found, judged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn learnt(flights: u16, normal: &[(Quantity, f32)]) -> Baselines {
        let mut baselines = Baselines::default();
        for (quantity, normal) in normal {
            (0..flights).for_each(|_| baselines.0[quantity.index()].learn(*normal));
        }
        baselines
    }

    fn flown(is_linear_in_thrust: bool, known: &[(Quantity, f32)]) -> FlightFigures {
        let mut figures = [None; Quantity::COUNT];
        for (quantity, figure) in known {
            figures[quantity.index()] = Some(*figure);
        }
        FlightFigures { at: Instant::ZERO, landed: true, figures, is_linear_in_thrust }
    }

    /// Five flights at 0.4 throttle and 160 W, then one.
    fn hovered(throttle: f32, power_w: f32, is_linear_in_thrust: bool) -> (FlightFigures, Baselines) {
        let quantities = [Quantity::HoverThrottle, Quantity::HoverPower];
        let past = learnt(5, &[(quantities[0], 0.4), (quantities[1], 160.0)]);
        (flown(is_linear_in_thrust, &[(quantities[0], throttle), (quantities[1], power_w)]), past)
    }

    #[test]
    fn three_flights_make_a_baseline_and_later_ones_move_it_slowly() {
        let (of, mut baselines) = (Quantity::Vibration, Baselines::default());
        for (figure, known) in [(9.0, None), (10.0, None), (11.0, Some(10.0))] {
            baselines.0[of.index()].learn(figure);
            assert_eq!(baselines.known(of), known);
        }
        baselines.0[of.index()].flights = 100;
        baselines.0[of.index()].learn(20.0);
        assert_eq!(baselines.known(of), Some(11.0));
    }

    #[test]
    fn the_spread_comes_from_the_prior_and_then_from_the_flights() {
        let mut baseline = Baseline::default();
        (0..3).for_each(|_| baseline.learn(10.0));
        let few = baseline.spread(1.0);
        (0..200).for_each(|flight| baseline.learn(if flight % 2 == 0 { 13.0 } else { 7.0 }));
        let wide = baseline.spread(1.0);
        (0..200).for_each(|_| baseline.learn(10.0));
        let narrow = baseline.spread(1.0);
        for (spread, range) in [(few, 0.8..1.2), (wide, 1.8..2.8), (narrow, 0.5..0.8)] {
            assert!(range.contains(&spread), "{spread}, not {range:?}");
        }
    }

    #[test]
    fn one_flight_in_as_many_as_are_asked_for_goes_beyond() {
        // Two-sided points, by integration.
        for (rarely, degrees, known) in [
            (20.0, 10.0, 2.228),
            (100.0, 10.0, 3.169),
            (1_000.0, 10.0, 4.587),
            (1_000.0, 17.0, 3.965),
            (100_000.0, 17.0, 6.184),
        ] {
            let told = student_t(rarely, degrees);
            assert!((told / known - 1.0).abs() < 0.01, "{told} for {known}");
        }
        let mut params = Params::defaults();
        let (flight, past) = hovered(0.4 * 1.035, 160.0, true);
        let departure = |params: &Params| past.departure(Quantity::HoverThrottle, &flight, params);
        assert!(departure(&params).is_some_and(|percent| percent > 3.0));
        params.set("TRD_FALSE", 100_000.0).expect("in range");
        assert_eq!(departure(&params), Some(0.0));
    }

    #[test]
    fn a_departure_is_a_part_of_the_baseline_and_of_motors_percent_points() {
        let params = Params::defaults();
        let capacity = Quantity::Capacity(0);
        for (quantity, normal, figure, departure) in [
            (Quantity::Vibration, 4.0, 6.0, 50.0),
            (Quantity::HoverThrottle, 0.4, 0.5, 25.0),
            (Quantity::MotorSpeed(2), -2.0, 5.0, 7.0),
            (capacity, 5.0, 5.2, 0.0),
            (capacity, 5.0, 9.0, 0.0),
            (capacity, 5.0, 2.5, 50.0),
        ] {
            let (flight, past) = (flown(true, &[(quantity, figure)]), learnt(3, &[(quantity, normal)]));
            let told = past.departure(quantity, &flight, &params).map(f32::round);
            assert_eq!(told, Some(departure), "{quantity:?} {figure}");
            assert_eq!(Baselines::default().departure(quantity, &flight, &params), None);
            assert_eq!(past.departure(quantity, &flown(true, &[]), &params), None);
        }
    }

    #[test]
    fn a_heavier_vehicle_is_told_from_one_with_less_thrust() {
        // A tenth more weight: throttle linear in thrust or by its root, power by its 1.5th power.
        let power_w = 160.0 * 1.1_f32.powf(1.5);
        let mut cases = vec![
            (0.44, power_w, true, 10.0),
            (0.4 * 1.1_f32.sqrt(), power_w, false, 10.0),
            (0.40, 160.0, true, 0.0),
            (0.36, 140.0, true, 0.0),
        ];
        // Real propellers cut by 25, 20 and 10 mm.
        let cut = [(1.10, 1.06), (1.20, 1.18), (1.17, 1.18)];
        cases.extend(cut.map(|(throttle, power)| (0.4 * throttle, 160.0 * power, true, 0.0)));
        for (throttle, power_w, is_linear, percent) in cases {
            let (flight, past) = hovered(throttle, power_w, is_linear);
            let told = past.heavier(&flight, &Params::defaults()).map(f32::round);
            assert_eq!(told, Some(percent), "{throttle} {power_w} {is_linear}");
        }
        let (_, past) = hovered(0.4, 160.0, true);
        let unknown = flown(true, &[(Quantity::HoverThrottle, 0.44)]);
        assert_eq!(past.heavier(&unknown, &Params::defaults()), None, "nobody knows its power");
    }

    #[test]
    fn a_fault_teaches_nothing_and_a_better_part_begins_anew() {
        for (throttle, power_w, flights) in [
            (0.41, 160.0, (6, 6)),
            (0.60, 160.0, (5, 6)),
            // New propellers, or less to carry; and more power.
            (0.36, 190.0, (1, 5)),
            (0.398, 161.0, (6, 6)),
        ] {
            let (flight, mut past) = hovered(throttle, power_w, true);
            past.judge(&flight, &Params::defaults());
            let of = |quantity: Quantity| past.0[quantity.index()].flights;
            assert_eq!((of(Quantity::HoverThrottle), of(Quantity::HoverPower)), flights, "{throttle}");
        }
    }
}
