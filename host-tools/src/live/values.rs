//! Latest values for the page, with age and staleness.

use hums_core::clock::{Instant, Span};
use hums_core::latest::Latest;
use hums_core::observation::MOTORS_MAX;
use hums_core::time;
use hums_core::vehicle::Vehicle;
use serde::Serialize;
use serde::ser::{SerializeMap, SerializeTuple, Serializer};

use super::craft::Craft;
use super::latest::{ESC, MOTION, QUANTITIES, SLOW};
use crate::counters::tells_flight;
use crate::mavlink::values::Scalar;
use crate::reference::Quantity;

/// Value, milliseconds of age, 1 if stale.
#[derive(Clone, Copy, Debug)]
pub struct PageValue {
    value: Scalar,
    age_ms: u64,
    stale: bool,
}

impl PageValue {
    fn new(now: Instant, at: Instant, value: Scalar, limit: Span) -> Self {
        let age = now.since(at);
        Self { value, age_ms: age.as_millis(), stale: age > limit }
    }
}

impl Serialize for PageValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(3)?;
        match self.value {
            // 15.3, not 15.300000190734863. Infinite values and `NaN` become null.
            Scalar::Single(value) => tuple.serialize_element(&value)?,
            other => tuple.serialize_element(&other.as_f64())?,
        }
        tuple.serialize_element(&self.age_ms)?;
        tuple.serialize_element(&u8::from(self.stale))?;
        tuple.end()
    }
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

/// Known values by name.
#[derive(Debug)]
pub struct Values<'a> {
    craft: &'a Craft,
    now: Instant,
}

impl<'a> Values<'a> {
    /// The values of a vehicle.
    pub fn of(craft: &'a Craft, now: Instant) -> Self {
        Self { craft, now }
    }

    fn each(&self, mut each: impl FnMut(&'static str, PageValue)) {
        let (craft, now) = (self.craft, self.now);
        let vehicle = craft.monitor.vehicle();
        for (name, quantity, limit) in &QUANTITIES {
            let is_known = *quantity != Quantity::FlightTime || tells_flight(vehicle);
            if let Some((at, value)) = craft.latest.get(*quantity).filter(|_| is_known) {
                let is_flown = *quantity == Quantity::FlightTime;
                let value = if is_flown { Scalar::Double(craft.flown_s()) } else { value };
                each(name, PageValue::new(now, at, value, *limit));
            }
        }
        for (name, limit, value) in OF_VEHICLE {
            if let (Some(at), Some(value)) = value(vehicle) {
                each(name, PageValue::new(now, Instant::of(at, now), Scalar::Single(value), *limit));
            }
        }
        for (sensor, name) in craft.speed_sensors.iter().zip(["speed_sensor_0", "speed_sensor_1"]) {
            if let Some((at, rpm)) = sensor {
                each(name, PageValue::new(now, *at, Scalar::Single(*rpm), SLOW));
            }
        }
    }
}

impl Serialize for Values<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        let mut result = Ok(());
        self.each(|name, shown| {
            if result.is_ok() {
                result = map.serialize_entry(name, &shown);
            }
        });
        result?;
        map.end()
    }
}

/// Motors by number; a missing one is an empty object.
#[derive(Debug)]
pub struct Motors<'a>(pub Values<'a>);

impl Serialize for Motors<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Values { craft, now } = self.0;
        let heard = |motor: usize| ESC.iter().any(|(_, of)| craft.latest.get(of(motor)).is_some());
        let count = (0..MOTORS_MAX).rev().find(|motor| heard(*motor)).map_or(0, |last| last + 1);
        serializer.collect_seq((0..count).map(|number| Motor { craft, now, number }))
    }
}

struct Motor<'a> {
    craft: &'a Craft,
    now: Instant,
    number: usize,
}

impl Serialize for Motor<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (name, of) in ESC {
            if let Some((at, value)) = self.craft.latest.get(of(self.number)) {
                map.serialize_entry(name, &PageValue::new(self.now, at, value, SLOW))?;
            }
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_is_as_short_as_it_was_sent_and_says_its_age() {
        let at = Instant::from_millis(1_000);
        let shown = |now_ms, value| PageValue::new(Instant::from_millis(now_ms), at, value, SLOW);
        let json = |shown: PageValue| serde_json::to_string(&shown).expect("JSON");
        assert_eq!(json(shown(1_200, Scalar::Single(15.3))), "[15.3,200,0]");
        assert_eq!(json(shown(7_001, Scalar::Single(f32::NAN))), "[null,6001,1]");
        assert_eq!(json(shown(1_000, Scalar::Double(47.397_922_9))), "[47.3979229,0,0]");
    }
}
