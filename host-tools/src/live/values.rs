//! Latest values for the page, with age and staleness.

use std::collections::BTreeMap;

use hums_core::clock::{Instant, Span};
use hums_core::latest::Latest;
use hums_core::observation::MOTORS_MAX;
use hums_core::time;
use hums_core::vehicle::Vehicle;

use super::craft::Craft;
use crate::counters::tells_flight;
use crate::mavlink::values::Scalar;
use crate::reference::Quantity;

/// Several times a second, over a thin radio once.
const MOTION: Span = Span::from_millis(2_500);
/// Other quantities, every two seconds.
const SLOW: Span = Span::from_millis(6_000);

/// Quantities of a vehicle, with the page's names.
const QUANTITIES: [(&str, Quantity, Span); 23] = [
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

/// The page's name, and a motor's quantity.
type MotorValue = (&'static str, fn(usize) -> Quantity);

/// Shown values of an ESC.
const ESC: [MotorValue; 6] = [
    ("rpm", Quantity::EscRpm),
    ("volts", Quantity::EscVoltage),
    ("amperes", Quantity::EscCurrent),
    ("failures", Quantity::EscFailures),
    ("errors", Quantity::EscErrors),
    ("celsius", Quantity::EscTemperature),
];

/// Value, milliseconds of age, 1 if stale.
type Aged = (Scalar, u64, u8);
/// Values by name.
pub type Values = BTreeMap<&'static str, Aged>;

fn aged(now: Instant, at: Instant, value: Scalar, limit: Span) -> Aged {
    let age = now.since(at);
    (value, age.as_millis(), u8::from(age > limit))
}

type Told = (Option<time::BootMs>, Option<f32>);

fn of<T>(message: &Latest<T>, value: impl FnOnce(&T) -> Option<f32>) -> Told {
    (message.at(), message.get().and_then(value))
}

/// Name, maximum age, reader.
type OfVehicle = (&'static str, Span, fn(&Vehicle) -> Told);

/// The page's names, maximum ages, readers.
const OF_VEHICLE: &[OfVehicle] = &[
    ("roll", MOTION, |vehicle| of(&vehicle.attitude, |angles| Some(angles.roll.0.to_degrees()))),
    ("pitch", MOTION, |vehicle| of(&vehicle.attitude, |angles| Some(angles.pitch.0.to_degrees()))),
    ("yaw", MOTION, |vehicle| of(&vehicle.attitude, |angles| Some(angles.yaw.0.to_degrees()))),
    ("height", MOTION, |vehicle| of(&vehicle.global, |global| Some(global.relative_altitude.0))),
    ("fix", SLOW, |vehicle| of(&vehicle.gnss[0], |gnss| Some(gnss.fix.into()))),
    ("satellites", SLOW, |vehicle| of(&vehicle.gnss[0], |gnss| gnss.satellites.map(f32::from))),
    ("hdop", SLOW, |vehicle| of(&vehicle.gnss[0], |gnss| gnss.hdop)),
    ("accuracy", SLOW, |vehicle| of(&vehicle.gnss[0], |gnss| gnss.accuracy.map(|metres| metres.0))),
    ("vibration_0", SLOW, |vehicle| of(&vehicle.vibration, |vibration| vibration.levels[0])),
    ("vibration_1", SLOW, |vehicle| of(&vehicle.vibration, |vibration| vibration.levels[1])),
    ("vibration_2", SLOW, |vehicle| of(&vehicle.vibration, |vibration| vibration.levels[2])),
    ("clips", SLOW, |vehicle| of(&vehicle.vibration, |vibration| Some(clips(vibration.clips)))),
    ("ekf_velocity", SLOW, |vehicle| of(&vehicle.estimator, |estimator| estimator.velocity)),
    ("ekf_horizontal", SLOW, |vehicle| of(&vehicle.estimator, |estimator| estimator.position_horizontal)),
    ("ekf_vertical", SLOW, |vehicle| of(&vehicle.estimator, |estimator| estimator.position_vertical)),
    ("ekf_compass", SLOW, |vehicle| of(&vehicle.estimator, |estimator| estimator.compass)),
    ("battery_amperes", SLOW, amperes),
    ("battery_consumed", SLOW, |vehicle| {
        of(&vehicle.batteries[0], |pack| pack.consumed.map(|charge| charge.0))
    }),
    ("battery_celsius", SLOW, |vehicle| {
        of(&vehicle.batteries[0], |pack| pack.temperature.map(|celsius| celsius.0))
    }),
    ("load", SLOW, |vehicle| of(&vehicle.system, |system| system.load.map(|load| load.0 * 100.0))),
    ("rail_5v", SLOW, |vehicle| of(&vehicle.rails, |rails| rails.vcc.map(|volts| volts.0))),
    ("rail_servo", SLOW, |vehicle| of(&vehicle.rails, |rails| rails.servo.map(|volts| volts.0))),
    ("processor_celsius", SLOW, |vehicle| {
        of(&vehicle.processor, |chip| chip.temperature.map(|celsius| celsius.0))
    }),
    ("rc_rssi", SLOW, |vehicle| of(&vehicle.rc, |rc| rc.rssi.map(f32::from))),
    ("radio_rssi", SLOW, |vehicle| of(&vehicle.radio, |radio| radio.rssi.map(f32::from))),
    ("radio_remote_rssi", SLOW, |vehicle| of(&vehicle.radio, |radio| radio.remote_rssi.map(f32::from))),
    ("radio_noise", SLOW, |vehicle| of(&vehicle.radio, |radio| radio.noise.map(f32::from))),
    ("engine_rpm", SLOW, |vehicle| of(&vehicle.engine, |engine| engine.rpm.map(|rpm| rpm.0))),
    ("engine_load", SLOW, |vehicle| of(&vehicle.engine, |engine| engine.load.map(|load| load.0 * 100.0))),
    ("engine_fuel_flow", SLOW, |vehicle| of(&vehicle.engine, |engine| engine.fuel_flow)),
    ("engine_fuel_consumed", SLOW, |vehicle| of(&vehicle.engine, |engine| engine.fuel_consumed)),
    ("engine_head_celsius", SLOW, |vehicle| {
        of(&vehicle.engine, |engine| engine.cylinder_head.map(|head| head.0))
    }),
];

fn clips(of_each: [u32; 3]) -> f32 {
    of_each.iter().fold(0_u32, |sum, clips| sum.saturating_add(*clips)) as f32
}

/// The current, or that in the autopilot's status.
fn amperes(vehicle: &Vehicle) -> Told {
    let of_battery = of(&vehicle.batteries[0], |pack| pack.current.map(|amperes| amperes.0));
    let of_system = || of(&vehicle.system, |system| system.current.map(|amperes| amperes.0));
    if of_battery.1.is_some() { of_battery } else { of_system() }
}

/// The known values of a vehicle.
pub fn of_vehicle(craft: &Craft, now: Instant) -> Values {
    let vehicle = craft.monitor.vehicle();
    let mut values = Values::new();
    for (name, quantity, limit) in QUANTITIES {
        let is_flown = quantity == Quantity::FlightTime;
        let known = craft.latest.get(&quantity).filter(|_| !is_flown || tells_flight(vehicle));
        if let Some((at, value)) = known {
            let value = if is_flown { Scalar::Double(craft.flown_s()) } else { *value };
            values.insert(name, aged(now, *at, value, limit));
        }
    }
    for (name, limit, value) in OF_VEHICLE {
        if let (Some(at), Some(value)) = value(vehicle) {
            values.insert(name, aged(now, Instant::of(at, now), Scalar::Single(value), *limit));
        }
    }
    for (sensor, name) in craft.speed_sensors.iter().zip(["speed_sensor_0", "speed_sensor_1"]) {
        if let Some((at, rpm)) = sensor {
            values.insert(name, aged(now, *at, Scalar::Single(*rpm), SLOW));
        }
    }
    values
}

/// The motors by number; a missing one has no values.
pub fn of_motors(craft: &Craft, now: Instant) -> Vec<Values> {
    let known = |motor, of: fn(usize) -> Quantity| craft.latest.get(&of(motor));
    let values = |motor| {
        let values = ESC.into_iter().filter_map(|(name, of)| Some((name, known(motor, of)?)));
        values.map(|(name, (at, value))| (name, aged(now, *at, *value, SLOW))).collect()
    };
    let mut motors: Vec<Values> = (0..MOTORS_MAX).map(values).collect();
    let count = motors.iter().rposition(|values| !values.is_empty()).map_or(0, |last| last + 1);
    motors.truncate(count);
    motors
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_as_short_as_it_was_sent_and_says_its_age() {
        let at = Instant::from_millis(1_000);
        let shown = |now_ms, value| aged(Instant::from_millis(now_ms), at, value, SLOW);
        let json = |shown: Aged| serde_json::to_string(&shown).expect("JSON");
        assert_eq!(json(shown(1_200, Scalar::Single(15.3))), "[15.3,200,0]");
        assert_eq!(json(shown(7_001, Scalar::Single(f32::NAN))), "[null,6001,1]");
        assert_eq!(json(shown(1_000, Scalar::Double(47.397_922_9))), "[47.3979229,0,0]");
    }
}
