//! Quantities of the reference system: names, maximum ages, last values.

use hums_core::clock::{Instant, Span};
use hums_core::observation::MOTORS_MAX;

use crate::mavlink::values::Scalar;
use crate::reference::Quantity;

/// Several times a second, over a thin radio once.
pub const MOTION: Span = Span::from_millis(2_500);
/// Other quantities, every two seconds.
pub const SLOW: Span = Span::from_millis(6_000);

/// Quantities of a vehicle, with the page's names.
pub const QUANTITIES: [(&str, Quantity, Span); 23] = [
    ("flight_time", Quantity::FlightTime, SLOW),
    ("battery_percent", Quantity::BatteryPercent, SLOW),
    ("battery_volts", Quantity::BatteryVolts, SLOW),
    ("temperature", Quantity::Temperature, SLOW),
    ("pressure", Quantity::Pressure, SLOW),
    ("accel_front", Quantity::Acceleration(0), MOTION),
    ("accel_right", Quantity::Acceleration(1), MOTION),
    ("accel_down", Quantity::Acceleration(2), MOTION),
    ("accel_module", Quantity::AccelerationModule, MOTION),
    ("velocity_north", Quantity::Velocity(0), MOTION),
    ("velocity_east", Quantity::Velocity(1), MOTION),
    ("velocity_down", Quantity::Velocity(2), MOTION),
    ("velocity_module", Quantity::VelocityModule, MOTION),
    ("gnss_speed", Quantity::GnssSpeed, MOTION),
    ("altitude", Quantity::Altitude, MOTION),
    ("latitude", Quantity::Latitude, MOTION),
    ("longitude", Quantity::Longitude, MOTION),
    ("airspeed", Quantity::AirSpeed, MOTION),
    ("groundspeed", Quantity::GroundSpeed, MOTION),
    ("heading", Quantity::Heading, MOTION),
    ("throttle", Quantity::Throttle, MOTION),
    ("hud_altitude", Quantity::HudAltitude, MOTION),
    ("climb", Quantity::ClimbRate, MOTION),
];
const PLACES: usize = QUANTITIES.len() + 6 * MOTORS_MAX;

/// Time and last value of each quantity.
#[derive(Clone, Debug)]
pub struct Latest([Option<(Instant, Scalar)>; PLACES]);

impl Default for Latest {
    fn default() -> Self {
        Self([None; PLACES])
    }
}

/// The page's name, and a motor's quantity.
pub type MotorValue = (&'static str, fn(usize) -> Quantity);

/// Shown values of an ESC.
pub const ESC: [MotorValue; 6] = [
    ("rpm", Quantity::EscRpm),
    ("volts", Quantity::EscVoltage),
    ("amperes", Quantity::EscCurrent),
    ("failures", Quantity::EscFailures),
    ("errors", Quantity::EscErrors),
    ("celsius", Quantity::EscTemperature),
];

fn place(quantity: Quantity) -> Option<usize> {
    let motors = QUANTITIES.len();
    Some(match quantity {
        Quantity::EscRpm(motor) => motors + motor,
        Quantity::EscVoltage(motor) => motors + MOTORS_MAX + motor,
        Quantity::EscCurrent(motor) => motors + 2 * MOTORS_MAX + motor,
        Quantity::EscFailures(motor) => motors + 3 * MOTORS_MAX + motor,
        Quantity::EscErrors(motor) => motors + 4 * MOTORS_MAX + motor,
        Quantity::EscTemperature(motor) => motors + 5 * MOTORS_MAX + motor,
        other => QUANTITIES.iter().position(|(_, of, _)| *of == other)?,
    })
}

impl Latest {
    /// Stores a reported value.
    pub fn set(&mut self, at: Instant, quantity: Quantity, value: Scalar) {
        if let Some(slot) = place(quantity).and_then(|place| self.0.get_mut(place)) {
            *slot = Some((at, value));
        }
    }

    /// Time and last value of a quantity.
    pub fn get(&self, quantity: Quantity) -> Option<(Instant, Scalar)> {
        *self.0.get(place(quantity)?)?
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_quantity_has_a_place_of_its_own() {
        let mut places: Vec<usize> = QUANTITIES.iter().filter_map(|(_, of, _)| place(*of)).collect();
        for motor in 0..MOTORS_MAX {
            places.extend(ESC.iter().filter_map(|(_, of)| place(of(motor))));
        }
        places.sort_unstable();
        let count = places.len();
        places.dedup();
        assert_eq!(places.len(), count);
        assert!(places.iter().all(|place| *place < PLACES));
    }
}
