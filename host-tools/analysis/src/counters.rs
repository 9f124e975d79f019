//! Usage counters for people: titles, units, motors and ranges apart.

use std::collections::BTreeMap;

use hums_core::figures::Quantity;
use hums_core::usage::UsageCounter;
use hums_core::vehicle::Vehicle;
use serde::Serialize;

use crate::names::{CounterName, counter_meaning, counter_name};

/// All counters of a session.
#[derive(Debug, Default, Serialize)]
pub struct Counters {
    /// Those of the vehicle.
    pub plain: Vec<Counter>,
    /// By motor.
    pub motors: Vec<Motor>,
    /// By quantity.
    pub ranges: Vec<Ranges>,
    /// A remark on the counters.
    pub remark: Option<&'static str>,
}

/// A counter of the vehicle.
#[derive(Debug, Serialize)]
pub struct Counter {
    /// For people.
    pub title: String,
    /// Empty for a count.
    pub unit: &'static str,
    decimals: u8,
    /// In this session.
    pub session: f64,
    /// In the airframe's life.
    pub life: Option<f64>,
}

/// Seconds and turns.
#[derive(Debug, Default, Serialize)]
pub struct Motor {
    /// From 0.
    pub number: u8,
    /// How long it turned in this session, s.
    pub run_time_s: Option<f64>,
    /// How often it turned in this session.
    pub revolutions: Option<f64>,
    /// How long in its life, s.
    pub life_run_time_s: Option<f64>,
    /// How often in its life.
    pub life_revolutions: Option<f64>,
}

/// Time in ranges.
#[derive(Debug, Serialize)]
pub struct Ranges {
    /// The quantity's name.
    pub title: &'static str,
    /// The unit of the ranges' ends.
    pub unit: &'static str,
    /// Its ranges.
    pub bands: Vec<Band>,
}

/// A range: from, to (`null` if open), seconds in it.
pub type Band = (Option<f32>, Option<f32>, f64);

/// A message of the vehicle has the quantity: otherwise zero means unknown. Motors, ranges and the past never show a
/// zero.
pub fn is_told(name: &str, vehicle: &Vehicle) -> bool {
    use UsageCounter as U;
    let Some(counter) = UsageCounter::ALL.iter().find(|counter| counter.name() == name) else { return true };
    let moves = tells_flight(vehicle);
    match counter {
        U::Powered | U::Armed | U::AutopilotReboots | U::Mishaps => true,
        U::LoadFactorMax
        | U::LoadCycles0
        | U::LoadCycles1
        | U::LoadCycles2
        | U::LoadCycles3
        | U::LoadCycles4
        | U::LoadCycles5
        | U::LoadCycles6 => vehicle.imu.get().is_some(),
        U::Charge | U::Energy | U::CurrentMax | U::VoltageMin | U::BatteryCycles => {
            vehicle.system.get().is_some() || vehicle.batteries.iter().any(|battery| battery.get().is_some())
        }
        U::VibrationMax => vehicle.vibration.get().is_some(),
        _ => moves,
    }
}

/// Whether any message shows if the vehicle flies.
pub fn tells_flight(vehicle: &Vehicle) -> bool {
    let Vehicle { landed, global, local, hud, .. } = vehicle;
    landed.get().is_some() || global.get().is_some() || local.get().is_some() || hud.get().is_some()
}

/// Title, unit, decimals.
pub const fn about(counter: UsageCounter) -> (&'static str, &'static str, u8) {
    use UsageCounter as U;
    match counter {
        U::Powered => ("Powered", "s", 0),
        U::Armed => ("Armed", "s", 0),
        U::Flight => ("In the air", "s", 0),
        U::Flights => ("Flights", "", 0),
        U::Landings => ("Landings", "", 0),
        U::Distance => ("Distance over ground", "m", 0),
        U::HeightMax => ("Greatest height", "m", 1),
        U::SpeedMax => ("Greatest ground speed", "m/s", 2),
        U::LoadFactorMax => ("Greatest load factor", "g", 2),
        U::Charge => ("Charge taken", "Ah", 3),
        U::Energy => ("Energy taken", "Wh", 2),
        U::CurrentMax => ("Highest current", "A", 2),
        U::VoltageMin => ("Lowest battery voltage", "V", 2),
        U::VibrationMax => ("Highest vibration", "m/s\u{b2}", 2),
        U::AutopilotReboots => ("Restarts of the autopilot", "", 0),
        U::HardLandings => ("Hard landings", "", 0),
        U::TouchdownMax => ("Fastest touchdown", "m/s", 2),
        U::BatteryCycles => ("Battery cycles", "", 2),
        U::Ground => ("On the ground", "s", 0),
        U::TakeOff => ("Taking off", "s", 0),
        U::Hover => ("Hovering", "s", 0),
        U::Climb => ("Climbing", "s", 0),
        U::Cruise => ("Cruising", "s", 0),
        U::Descent => ("Descending", "s", 0),
        U::Landing => ("Landing", "s", 0),
        U::LoadCycles0 => ("Load cycles from 0.25 g", "", 1),
        U::LoadCycles1 => ("Load cycles from 0.5 g", "", 1),
        U::LoadCycles2 => ("Load cycles from 1 g", "", 1),
        U::LoadCycles3 => ("Load cycles from 1.5 g", "", 1),
        U::LoadCycles4 => ("Load cycles from 2 g", "", 1),
        U::LoadCycles5 => ("Load cycles from 3 g", "", 1),
        U::LoadCycles6 => ("Load cycles from 4 g", "", 1),
        U::Mishaps => ("Flights that a mishap ended", "", 0),
    }
}

fn of_vehicle(name: &str) -> (String, &'static str, u8) {
    let known = UsageCounter::ALL.iter().find(|counter| counter.name() == name);
    let (title, unit, decimals) = known.map_or((name, "", 2), |counter| about(*counter));
    (title.to_owned(), unit, decimals)
}

/// Title, unit and decimals of a figure of steady flight.
pub fn of_figure(quantity: Quantity) -> (String, &'static str, u8) {
    match quantity {
        Quantity::Vibration => ("Vibration in steady flight".to_owned(), "m/s\u{b2}", 2),
        Quantity::HoverThrottle => ("Hover throttle".to_owned(), "", 3),
        Quantity::Resistance(battery) => {
            (format!("Resistance of battery {}", u16::from(battery) + 1), "\u{3a9}", 4)
        }
        Quantity::MotorSpeed(motor) => {
            (format!("Speed of motor {} against the others", u16::from(motor) + 1), "%", 1)
        }
        Quantity::HoverPower => ("Hover power".to_owned(), "W", 0),
        Quantity::MotorOutput(motor) => {
            (format!("Output of motor {} against the mean", u16::from(motor) + 1), "%", 1)
        }
        Quantity::Capacity(battery) => (format!("Capacity of battery {}", u16::from(battery) + 1), "Ah", 1),
    }
}

const FLIGHTS: &str = UsageCounter::Flights.name();
const BEGUN_BEFORE: &str = "it was in the air at its start: that flight is counted in the log before";

/// Groups counters by meaning; unknown ones keep their names.
pub fn of(session: &BTreeMap<String, f64>, life: &BTreeMap<String, f64>) -> Counters {
    let mut all = Counters::default();
    let number = |counter: UsageCounter| session.get(counter.name()).copied().unwrap_or(0.0);
    let ended = number(UsageCounter::Landings) + number(UsageCounter::Mishaps);
    all.remark = (ended > number(UsageCounter::Flights)).then_some(BEGUN_BEFORE);
    for number in 0..=u8::MAX {
        let name = counter_name(number);
        let Some(&value) = session.get(&name) else { continue };
        let lived = life.get(&name).copied();
        let (title, unit, decimals) = match counter_meaning(number) {
            // One landing: no contradiction.
            Some(CounterName::Vehicle(FLIGHTS)) if all.remark.is_some() => ("Take-offs".to_owned(), "", 0),
            Some(CounterName::Vehicle(name)) => of_vehicle(name),
            Some(CounterName::Figure(quantity)) => of_figure(quantity),
            Some(CounterName::Motor(what, motor)) => {
                all.motor(what == "run_time_s", motor, value, lived);
                continue;
            }
            Some(CounterName::Exposure(quantity, from, to)) => {
                let unit = match quantity.unit() {
                    "degc" => "\u{b0}C",
                    "m_s2" => "m/s\u{b2}",
                    "a" => "A",
                    other => other,
                };
                let ends = [from, to].map(|end| end.is_finite().then_some(end));
                all.range(quantity.name(), unit, (ends[0], ends[1], value));
                continue;
            }
            None => (name, "", 2),
        };
        all.plain.push(Counter { title, unit, decimals, session: value, life: lived });
    }
    all.motors.sort_by_key(|motor| motor.number);
    all
}

impl Counters {
    fn motor(&mut self, is_time: bool, number: u8, value: f64, life: Option<f64>) {
        let known = self.motors.iter().position(|motor| motor.number == number);
        let place = known.unwrap_or_else(|| {
            self.motors.push(Motor { number, ..Motor::default() });
            self.motors.len() - 1
        });
        if let Some(motor) = self.motors.get_mut(place) {
            if is_time {
                (motor.run_time_s, motor.life_run_time_s) = (Some(value), life);
            } else {
                (motor.revolutions, motor.life_revolutions) = (Some(value), life);
            }
        }
    }

    fn range(&mut self, title: &'static str, unit: &'static str, band: Band) {
        match self.ranges.last_mut().filter(|ranges| ranges.title == title) {
            Some(ranges) => ranges.bands.push(band),
            None => self.ranges.push(Ranges { title, unit, bands: vec![band] }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_counter_has_its_place_and_its_unit() {
        let session: BTreeMap<String, f64> =
            (0..=u8::MAX).map(|number| (counter_name(number), f64::from(number))).collect();
        let all = of(&session, &BTreeMap::from([("motor2_run_time_s".to_owned(), 5.0)]));
        assert_eq!((all.motors.len(), all.ranges.len()), (12, 5));
        assert_eq!((all.motors[2].run_time_s, all.motors[2].life_run_time_s), (Some(102.0), Some(5.0)));
        let first = &all.ranges[0].bands[0];
        assert!(first.0.is_none() && first.1.is_some(), "{first:?}");
        let shown =
            all.plain.len() + 2 * 12 + all.ranges.iter().map(|ranges| ranges.bands.len()).sum::<usize>();
        assert_eq!(shown, session.len());
        let charge = all.plain.iter().find(|plain| plain.title == "Charge taken").expect("it is");
        assert_eq!(charge.unit, "Ah");
    }

    #[test]
    fn a_session_that_begins_in_the_air_has_a_landing_and_no_take_off() {
        let of = |flights: f64| {
            let counted = [("flights", flights), ("landings", 1.0)];
            let session = counted.map(|(name, value)| (name.to_owned(), value)).into();
            let all = of(&session, &BTreeMap::new());
            (all.plain[0].title.clone(), all.remark)
        };
        assert_eq!(of(1.0), ("Flights".to_owned(), None));
        assert_eq!(of(0.0), ("Take-offs".to_owned(), Some(BEGUN_BEFORE)));
    }
}
