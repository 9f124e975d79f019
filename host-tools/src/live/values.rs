//! The latest values as the page takes them: each with its age and whether that is too old.

use hums_core::clock::{Instant, Span};
use hums_core::observation::MOTORS_MAX;
use hums_core::time;
use serde::Serialize;
use serde::ser::{SerializeMap, SerializeTuple, Serializer};

use super::craft::Craft;
use super::latest::{ESC, MOTION, QUANTITIES, SLOW};
use crate::counters::tells_flight;
use crate::mavlink::values::Scalar;
use crate::reference::Quantity;

/// A value, its age in milliseconds, and 1 if stale.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    value: Scalar,
    age_ms: u64,
    stale: bool,
}

impl Shown {
    fn new(now: Instant, at: Instant, value: Scalar, limit: Span) -> Self {
        let age = now.since(at);
        Self { value, age_ms: age.as_millis(), stale: age > limit }
    }
}

impl Serialize for Shown {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(3)?;
        match self.value {
            // As short as it was sent: 15.3, not 15.300000190734863. Infinite values and `NaN` become null.
            Scalar::Single(value) => tuple.serialize_element(&value)?,
            other => tuple.serialize_element(&other.as_f64())?,
        }
        tuple.serialize_element(&self.age_ms)?;
        tuple.serialize_element(&u8::from(self.stale))?;
        tuple.end()
    }
}

/// Takes a value by its name: its time, value and maximum age.
type Put<'a> = dyn FnMut(&'static str, Option<time::Instant>, Option<f32>, Span) + 'a;

/// Everything that is known now, by name.
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

    fn each(&self, mut each: impl FnMut(&'static str, Shown)) {
        let (craft, now) = (self.craft, self.now);
        for (name, quantity, limit) in &QUANTITIES {
            let is_known = *quantity != Quantity::FlightTime || tells_flight(craft.monitor.vehicle());
            if let Some((at, value)) = craft.latest.get(*quantity).filter(|_| is_known) {
                let is_flown = *quantity == Quantity::FlightTime;
                let value = if is_flown { Scalar::Double(craft.flown_s()) } else { value };
                each(name, Shown::new(now, at, value, *limit));
            }
        }
        let mut put = |name, at: Option<time::Instant>, value: Option<f32>, limit| {
            if let (Some(at), Some(value)) = (at, value) {
                each(name, Shown::new(now, Instant::of(at, now), Scalar::Single(value), limit));
            }
        };
        self.motion(&mut put);
        self.condition(&mut put);
        self.power(&mut put);
        self.radio(&mut put);
        self.engine(&mut put);
    }

    /// Attitude, height, and the receiver's position.
    fn motion(&self, put: &mut Put<'_>) {
        let vehicle = self.craft.monitor.vehicle();
        let attitude = &vehicle.attitude;
        if let Some(angles) = attitude.get() {
            for (name, angle) in [("roll", angles.roll), ("pitch", angles.pitch), ("yaw", angles.yaw)] {
                put(name, attitude.at(), Some(angle.0.to_degrees()), MOTION);
            }
        }
        let height = vehicle.global.get().map(|global| global.relative_altitude.0);
        put("height", vehicle.global.at(), height, MOTION);
        let gnss = &vehicle.gnss[0];
        if let Some(fix) = gnss.get() {
            put("fix", gnss.at(), Some(f32::from(fix.fix)), SLOW);
            put("satellites", gnss.at(), fix.satellites.map(f32::from), SLOW);
            put("hdop", gnss.at(), fix.hdop, SLOW);
            put("accuracy", gnss.at(), fix.accuracy.map(|metres| metres.0), SLOW);
        }
    }

    /// Vibration and estimator.
    fn condition(&self, put: &mut Put<'_>) {
        let vehicle = self.craft.monitor.vehicle();
        if let Some(vibration) = vehicle.vibration.get() {
            let names = ["vibration_0", "vibration_1", "vibration_2"];
            for (name, level) in names.into_iter().zip(vibration.levels) {
                put(name, vehicle.vibration.at(), level, SLOW);
            }
            let clips = vibration.clips.iter().fold(0_u32, |sum, clips| sum.saturating_add(*clips));
            put("clips", vehicle.vibration.at(), Some(clips as f32), SLOW);
        }
        if let Some(estimator) = vehicle.estimator.get() {
            let figures = [
                ("ekf_velocity", estimator.velocity),
                ("ekf_horizontal", estimator.position_horizontal),
                ("ekf_vertical", estimator.position_vertical),
                ("ekf_compass", estimator.compass),
            ];
            for (name, figure) in figures {
                put(name, vehicle.estimator.at(), figure, SLOW);
            }
        }
    }

    /// Battery, rails, the autopilot's computer.
    fn power(&self, put: &mut Put<'_>) {
        let vehicle = self.craft.monitor.vehicle();
        let (battery, system) = (&vehicle.batteries[0], &vehicle.system);
        if let Some(amperes) = battery.get().and_then(|battery| battery.current) {
            put("battery_amperes", battery.at(), Some(amperes.0), SLOW);
        } else {
            let amperes = system.get().and_then(|system| system.current).map(|amperes| amperes.0);
            put("battery_amperes", system.at(), amperes, SLOW);
        }
        if let Some(known) = battery.get() {
            put("battery_consumed", battery.at(), known.consumed.map(|charge| charge.0), SLOW);
            put("battery_celsius", battery.at(), known.temperature.map(|celsius| celsius.0), SLOW);
        }
        let load = system.get().and_then(|system| system.load).map(|load| load.0 * 100.0);
        put("load", system.at(), load, SLOW);
        if let Some(rails) = vehicle.rails.get() {
            put("rail_5v", vehicle.rails.at(), rails.vcc.map(|volts| volts.0), SLOW);
            put("rail_servo", vehicle.rails.at(), rails.servo.map(|volts| volts.0), SLOW);
        }
        let processor = vehicle.processor.get().and_then(|processor| processor.temperature);
        put("processor_celsius", vehicle.processor.at(), processor.map(|celsius| celsius.0), SLOW);
    }

    fn radio(&self, put: &mut Put<'_>) {
        let vehicle = self.craft.monitor.vehicle();
        let rssi = vehicle.rc.get().and_then(|rc| rc.rssi).map(f32::from);
        put("rc_rssi", vehicle.rc.at(), rssi, SLOW);
        if let Some(radio) = vehicle.radio.get() {
            put("radio_rssi", vehicle.radio.at(), radio.rssi.map(f32::from), SLOW);
            put("radio_remote_rssi", vehicle.radio.at(), radio.remote_rssi.map(f32::from), SLOW);
            put("radio_noise", vehicle.radio.at(), radio.noise.map(f32::from), SLOW);
        }
    }

    /// A combustion engine, and its speed sensors.
    fn engine(&self, put: &mut Put<'_>) {
        let engine = &self.craft.monitor.vehicle().engine;
        if let Some(known) = engine.get() {
            let figures = [
                ("engine_rpm", known.rpm.map(|rpm| rpm.0)),
                ("engine_load", known.load.map(|load| load.0 * 100.0)),
                ("engine_fuel_flow", known.fuel_flow),
                ("engine_fuel_consumed", known.fuel_consumed),
                ("engine_head_celsius", known.cylinder_head.map(|celsius| celsius.0)),
            ];
            for (name, figure) in figures {
                put(name, engine.at(), figure, SLOW);
            }
        }
        let names = ["speed_sensor_0", "speed_sensor_1"];
        for (sensor, name) in self.craft.speed_sensors.iter().zip(names) {
            if let Some((at, rpm)) = sensor {
                put(name, Some((*at).into()), Some(*rpm), SLOW);
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

/// The motors received so far, by number; a missing one in between is an empty object.
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
                map.serialize_entry(name, &Shown::new(self.now, at, value, SLOW))?;
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
        let shown = |now_ms, value| Shown::new(Instant::from_millis(now_ms), at, value, SLOW);
        let json = |shown: Shown| serde_json::to_string(&shown).expect("JSON");
        assert_eq!(json(shown(1_200, Scalar::Single(15.3))), "[15.3,200,0]");
        assert_eq!(json(shown(7_001, Scalar::Single(f32::NAN))), "[null,6001,1]");
        assert_eq!(json(shown(1_000, Scalar::Double(47.397_922_9))), "[47.3979229,0,0]");
    }
}
