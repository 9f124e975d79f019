//! What is normal for this airframe: baselines that outlive power, learned from steady flight, slowly.
//!
//! A flight makes one figure of each quantity: the mean of samples once a second in steady flight, in which no sample
//! weighs more than its closeness to the others deserves. At landing that figure moves the baseline: the first
//! [`FLIGHTS_MIN`] flights make it, each later one moves it by a tenth of the difference at most, and one that is
//! beyond the limit of a warning does not move it at all, so that a fault never becomes normal.
//!
//! With the mean goes the spread of the flights' figures. What a next flight's figure may be follows from both and from what is known
//! of such quantities before ([`Baseline::spread`]): Student's t distribution (normal figures of unknown mean and spread, the spread with
//! a conjugate prior; Gelman et al., Bayesian Data Analysis, 3.2 and 3.3). The test of one figure against it is the likelihood ratio
//! test for a changed mean (Lehmann and Romano, Testing Statistical Hypotheses, 5.2), so its rate of false words can be set
//! ([`Baseline::reach`]).

use crate::bytes::{Fields, Item, Unreadable, fields};
use crate::half;
use crate::observation::MOTORS_MAX;
use crate::vehicle::BATTERIES_MAX;

/// Flights that make a baseline; before, nothing is compared.
pub const FLIGHTS_MIN: u16 = 3;
/// Weight of a flight in a baseline that stands.
const WEIGHT: f32 = 0.1;
/// As many flights as a baseline remembers.
const REMEMBERED: u16 = 10;
/// What is known before of a quantity's spread counts as so many flights.
const PRIOR_FLIGHTS: f32 = 8.0;

/// A quantity that has a baseline.
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

/// Motors of the largest frame whose outputs have a past.
pub const OUTPUTS_MAX: usize = 6;
/// Quantities that versions before 3 of the stored form have.
const FIRST: usize = 2 + BATTERIES_MAX + MOTORS_MAX;

impl Quantity {
    /// How many there are.
    pub const COUNT: usize = FIRST + 1 + OUTPUTS_MAX + BATTERIES_MAX;

    /// The quantity of a place in the stored form.
    pub const fn from_index(index: usize) -> Option<Self> {
        const MOTORS: usize = 2 + BATTERIES_MAX;
        const OUTPUTS: usize = FIRST + 1;
        const CAPACITIES: usize = OUTPUTS + OUTPUTS_MAX;
        match index {
            0 => Some(Self::Vibration),
            1 => Some(Self::HoverThrottle),
            2..MOTORS => Some(Self::Resistance(index as u8 - 2)),
            MOTORS..FIRST => Some(Self::MotorSpeed((index - MOTORS) as u8)),
            FIRST => Some(Self::HoverPower),
            OUTPUTS..CAPACITIES => Some(Self::MotorOutput((index - OUTPUTS) as u8)),
            CAPACITIES..Self::COUNT => Some(Self::Capacity((index - CAPACITIES) as u8)),
            _ => None,
        }
    }

    /// Its place in the stored form.
    pub const fn index(self) -> usize {
        match self {
            Self::Vibration => 0,
            Self::HoverThrottle => 1,
            Self::Resistance(battery) => 2 + battery as usize,
            Self::MotorSpeed(motor) => 2 + BATTERIES_MAX + motor as usize,
            Self::HoverPower => FIRST,
            Self::MotorOutput(motor) => FIRST + 1 + motor as usize,
            Self::Capacity(battery) => FIRST + 1 + OUTPUTS_MAX + battery as usize,
        }
    }
}

/// What is normal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Baseline {
    /// In the quantity's unit.
    pub value: f32,
    /// Root of the mean square distance of the flights' figures from it, in half precision.
    spread: u16,
    /// Flights that it was learned from; it holds from [`FLIGHTS_MIN`] on.
    pub flights: u16,
}

impl Baseline {
    /// Nothing learned.
    pub const NONE: Self = Self { value: 0.0, spread: 0, flights: 0 };

    /// The baseline, once enough flights made it.
    pub fn known(&self) -> Option<f32> {
        (self.flights >= FLIGHTS_MIN).then_some(self.value)
    }

    /// Learns from a flight's figure.
    pub fn learn(&mut self, figure: f32) {
        if !figure.is_finite() {
            return;
        }
        let weight = (1.0 / (f32::from(self.flights) + 1.0)).max(WEIGHT);
        let off = figure - self.value;
        // Mean and variance with weights: D. H. D. West, Communications of the ACM 22, 1979.
        let variance =
            if self.flights == 0 { 0.0 } else { (1.0 - weight) * (self.variance() + weight * off * off) };
        self.spread = half::to_bits(libm::sqrtf(variance));
        self.value += weight * off;
        self.flights = self.flights.saturating_add(1);
    }

    /// Mean square distance of the flights' figures from the value.
    fn variance(&self) -> f32 {
        let spread = half::from_bits(self.spread);
        spread * spread
    }

    /// How far the next flight's figure is from the baseline on the average, where nothing changed; `prior` is the spread that such a
    /// quantity has as a rule.
    pub fn spread(&self, prior: f32) -> f32 {
        let flights = f32::from(self.flights.clamp(1, REMEMBERED));
        let squares = PRIOR_FLIGHTS * prior * prior + flights * self.variance();
        libm::sqrtf(squares / (PRIOR_FLIGHTS + flights) * (1.0 + 1.0 / flights))
    }

    /// How far a figure may be from the baseline, either way, so that where nothing changed one flight in `rarely` goes further.
    pub fn reach(&self, prior: f32, rarely: f32) -> f32 {
        let flights = f32::from(self.flights.clamp(1, REMEMBERED));
        self.spread(prior) * student_t(rarely, PRIOR_FLIGHTS + flights - 1.0)
    }
}

/// What a Student's t of so many degrees of freedom (8 and more) exceeds, either way, once in `rarely`: the normal quantile by 26.2.23 and its
/// expansion by 26.7.5 of Abramowitz and Stegun, Handbook of Mathematical Functions; within 1 % for one in 20 to one in 100,000.
fn student_t(rarely: f32, degrees: f32) -> f32 {
    let root = libm::sqrtf(2.0 * libm::logf(2.0 * rarely));
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

/// All baselines of an airframe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Baselines([Baseline; Quantity::COUNT]);

impl Default for Baselines {
    fn default() -> Self {
        Self::new()
    }
}

impl Baselines {
    /// Nothing learned.
    pub const fn new() -> Self {
        Self([Baseline::NONE; Quantity::COUNT])
    }

    /// What is normal for a quantity.
    pub fn get(&self, quantity: Quantity) -> Baseline {
        self.0.get(quantity.index()).copied().unwrap_or(Baseline::NONE)
    }

    /// Learns from a flight's figure.
    pub fn learn(&mut self, quantity: Quantity, figure: f32) {
        if let Some(baseline) = self.0.get_mut(quantity.index()) {
            baseline.learn(figure);
        }
    }

    /// Forgets what was normal: the part is another one.
    pub fn forget(&mut self, quantity: Quantity) {
        if let Some(baseline) = self.0.get_mut(quantity.index()) {
            *baseline = Baseline::NONE;
        }
    }
}

/// Version; value, variance and flights of each quantity by [`Quantity::index`]; version 2 lacks the last ones. Version 1 had no
/// variances.
impl Item for Baselines {
    const VERSION: u8 = 3;
    const OLDEST: u8 = 2;
    const BYTES: usize = 1 + Quantity::COUNT * 10;
    const EMPTY: Self = Self::new();

    fn fields(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        for baseline in &mut self.0 {
            let mut variance = baseline.variance();
            fields!(fields: baseline.value, variance, baseline.flights);
            baseline.spread = half::to_bits(libm::sqrtf(variance));
            // The root of a negative number is none.
            if !(baseline.value.is_finite() && baseline.variance().is_finite()) {
                *baseline = Baseline::NONE;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_is_one_quantitys() {
        for index in 0..Quantity::COUNT {
            assert_eq!(Quantity::from_index(index).map(Quantity::index), Some(index));
        }
        assert_eq!(Quantity::from_index(Quantity::COUNT), None);
    }

    #[test]
    fn three_flights_make_a_baseline_and_later_ones_move_it_slowly() {
        let mut baseline = Baseline::NONE;
        for (figure, known) in [(9.0, None), (10.0, None), (11.0, Some(10.0))] {
            baseline.learn(figure);
            assert_eq!(baseline.known(), known);
        }
        baseline.flights = 100;
        baseline.learn(20.0);
        assert_eq!(baseline.known(), Some(11.0));
        baseline.learn(f32::NAN);
        assert_eq!(baseline.known(), Some(11.0));
    }

    #[test]
    fn the_spread_comes_from_what_is_known_before_and_then_from_the_flights() {
        let mut baseline = Baseline::NONE;
        (0..3).for_each(|_| baseline.learn(10.0));
        let few = baseline.spread(1.0);
        assert!((0.8..1.2).contains(&few), "{few}");
        for flight in 0..200 {
            baseline.learn(if flight % 2 == 0 { 13.0 } else { 7.0 });
        }
        let wide = baseline.spread(1.0);
        assert!((1.8..2.8).contains(&wide), "{wide}");
        (0..200).for_each(|_| baseline.learn(10.0));
        let narrow = baseline.spread(1.0);
        assert!((0.5..0.8).contains(&narrow), "{narrow}");
    }

    #[test]
    fn one_flight_in_as_many_as_are_asked_for_goes_beyond() {
        // Two-sided points of Student's t, by integration of its density.
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
        let mut baseline = Baseline::NONE;
        (0..3).for_each(|_| baseline.learn(10.0));
        assert!(baseline.reach(0.1, 1_000.0) > baseline.reach(0.1, 100.0));
    }

    #[test]
    fn baselines_of_before_there_were_power_and_outputs_are_read() {
        let mut known = Baselines::new();
        known.learn(Quantity::HoverThrottle, 0.4);
        let mut stored = [0; Baselines::BYTES];
        known.encode(&mut stored);
        stored[0] = 2;
        assert_eq!(Baselines::decode(&stored[..=10 * FIRST]), Ok(known));
    }

    #[test]
    fn baselines_read_back_and_garbage_is_nothing_learned() {
        let mut baselines = Baselines::new();
        for motor in 0..MOTORS_MAX as u8 {
            (0..=motor).for_each(|_| baselines.learn(Quantity::MotorSpeed(motor), -f32::from(motor)));
        }
        let mut stored = [0; Baselines::BYTES];
        baselines.encode(&mut stored);
        assert_eq!(Baselines::decode(&stored), Ok(baselines));
        assert_eq!(Baselines::decode(&[0xFF; Baselines::BYTES]), Ok(Baselines::new()));
        stored[0] = 1;
        assert_eq!(Baselines::decode(&stored), Err(Unreadable), "a version without spreads");
        assert_eq!(Baselines::decode(&stored[1..]), Err(Unreadable));
    }
}
