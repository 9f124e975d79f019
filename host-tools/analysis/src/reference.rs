//! A vehicle's observations as quantities of the reference system. The only mapping, for the line protocol
//! (`influx`) and the four tables (`thesis`).
//!
//! Scales and "unknown" values are the firmware's. ESC values: `ESC_STATUS` and `ESC_INFO` (PX4) or
//! `ESC_TELEMETRY_*` (ArduPilot); battery: `BATTERY_STATUS` or else `SYS_STATUS`. Older than `AGE_MAX`: an
//! empty cell.

use hums_core::clock::Instant;
use hums_core::flight::Flight;
use hums_core::observation::{Esc, Observation, Source};
use hums_core::parameters::Params;
use hums_core::time::{self, Millis};
use hums_core::units::{MetresPerSecond, MetresPerSecond2};
use hums_core::vehicle::{Motor, Vehicle};

use crate::mavlink::values::Scalar;

/// Slow streams: 2 to 5 s.
const AGE_MAX: Millis = Millis::from_secs(10);

/// Motors of the reference system's tables.
pub const MOTORS: usize = 4;

/// One of the reference system's quantities. Motors count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Quantity {
    /// Seconds since take-off, kept after landing; 0 before the first.
    FlightTime,
    /// Percent.
    BatteryPercent,
    /// Battery voltage, V.
    BatteryVolts,
    /// Temperature of the air at its sensor, degC.
    Temperature,
    /// Static pressure, hPa.
    Pressure,
    /// Forward, right or down (0, 1, 2), m/s2.
    Acceleration(usize),
    /// m/s2.
    AccelerationModule,
    /// North, east or down (0, 1, 2), m/s.
    Velocity(usize),
    /// m/s.
    VelocityModule,
    /// Speed over ground by the GNSS receiver, m/s.
    GnssSpeed,
    /// Above mean sea level, m.
    Altitude,
    /// Degrees, north positive.
    Latitude,
    /// Degrees, east positive.
    Longitude,
    /// Through the air, m/s.
    AirSpeed,
    /// Over ground, m/s.
    GroundSpeed,
    /// Degrees from north.
    Heading,
    /// Percent.
    Throttle,
    /// The display's altitude, m.
    HudAltitude,
    /// Upwards, m/s.
    ClimbRate,
    /// Motor speed, 1/min.
    EscRpm(usize),
    /// At an ESC, V.
    EscVoltage(usize),
    /// Motor current, A.
    EscCurrent(usize),
    /// `ESC_FAILURE_FLAGS`
    EscFailures(usize),
    /// Errors that an ESC counted.
    EscErrors(usize),
    /// ESC temperature, degC.
    EscTemperature(usize),
}

const ESC: [fn(usize) -> Quantity; 6] = [
    Quantity::EscRpm,
    Quantity::EscVoltage,
    Quantity::EscCurrent,
    Quantity::EscFailures,
    Quantity::EscErrors,
    Quantity::EscTemperature,
];

impl Quantity {
    /// Field in the measurement `HUMS`; `None` without one.
    pub fn field(self) -> Option<String> {
        let axis = |names: [&str; 3], axis: usize| names.get(axis).map(|name| (*name).to_owned());
        Some(match self {
            Self::FlightTime => "Flight Time".into(),
            Self::BatteryPercent => "Battery (%)".into(),
            Self::BatteryVolts => "Battery (V)".into(),
            Self::Temperature => "Temp".into(),
            Self::Pressure => "Air Pressure".into(),
            Self::Acceleration(at) => return axis(["Front Accel", "Right Accel", "Down Accel"], at),
            Self::AccelerationModule => "Accel Module".into(),
            Self::Velocity(at) => return axis(["North Velocity", "East Velocity", "Down Velocity"], at),
            Self::VelocityModule => "Velocity Module".into(),
            Self::GnssSpeed => "Velocity".into(),
            Self::Altitude => "Altitude".into(),
            Self::Latitude => "Latitude".into(),
            Self::Longitude => "Longitude".into(),
            Self::AirSpeed => "Air Speed (m/s)".into(),
            Self::GroundSpeed => "groundspeed".into(),
            Self::Heading => "heading".into(),
            Self::Throttle => "Throttle (%)".into(),
            Self::HudAltitude => return None,
            Self::ClimbRate => "Climb Rate (m/s)".into(),
            Self::EscRpm(motor) => format!("esc_rpm{motor}"),
            Self::EscVoltage(motor) => format!("esc_voltage{motor}"),
            Self::EscCurrent(motor) => format!("esc_current{motor}"),
            Self::EscFailures(motor) => format!("esc_fail{motor}"),
            Self::EscErrors(motor) => format!("esc{motor}_fails"),
            Self::EscTemperature(motor) => format!("esc_temperature{motor}"),
        })
    }
}

/// Replayed from observations.
#[derive(Clone, Debug, Default)]
pub struct Reference {
    vehicle: Vehicle,
    flight: Flight,
    /// Last complete flight.
    flown: Millis,
    heard: Option<Instant>,
}

impl Reference {
    /// `false` if not the vehicle's.
    pub fn observe(&mut self, at: Instant, source: Source, observation: &Observation) -> bool {
        if !self.vehicle.observe(at.into(), source, observation) {
            return false;
        }
        self.heard = Some(at);
        let at = time::BootMs::from(at);
        let since = self.flight.airborne_since();
        let params = Params::defaults();
        self.flight.observe(at, &self.vehicle, observation, &params);
        self.flight.step(at, &self.vehicle, &params);
        match (since, self.flight.airborne_since()) {
            (Some(since), None) => self.flown = at.since(since),
            (None, Some(_)) => self.flown = Millis::ZERO,
            _ => {}
        }
        true
    }

    /// The vehicle.
    pub const fn vehicle(&self) -> &Vehicle {
        &self.vehicle
    }

    /// Last message.
    pub const fn heard(&self) -> Option<Instant> {
        self.heard
    }

    /// Present value.
    pub fn value(&self, now: Instant, quantity: Quantity) -> Option<Scalar> {
        let now = time::BootMs::from(now);
        let single = |value: f32| Some(Scalar::Single(value));
        let vehicle = &self.vehicle;
        let gnss = || vehicle.gnss.first().and_then(|gnss| gnss.within(now, AGE_MAX));
        let global = || vehicle.global.within(now, AGE_MAX);
        let hud = || vehicle.hud.within(now, AGE_MAX);
        let air = || vehicle.air.within(now, AGE_MAX);
        let position = || gnss().and_then(|gnss| gnss.position).or_else(|| global()?.position);
        let moves = |motor| self.esc(now, motor, |motor| motor.moved_at);
        let state = |motor| self.esc(now, motor, |motor| motor.state_at);
        match quantity {
            Quantity::FlightTime => {
                let flown = self.flight.airborne_since().map_or(self.flown, |since| now.since(since));
                Some(Scalar::Double(flown.as_millis() as f64 / 1e3))
            }
            Quantity::BatteryPercent | Quantity::BatteryVolts => self.battery(now, quantity),
            Quantity::Temperature => single(air()?.temperature?.0),
            Quantity::Pressure => single(air()?.pressure?.0),
            Quantity::Acceleration(axis) => single(self.acceleration(now)?.get(axis)?.0),
            Quantity::AccelerationModule => single(norm(self.acceleration(now)?.map(|part| part.0))),
            Quantity::Velocity(axis) => single(self.velocity(now)?.get(axis)?.0),
            Quantity::VelocityModule => single(norm(self.velocity(now)?.map(|part| part.0))),
            Quantity::GnssSpeed => single(gnss()?.speed?.0),
            Quantity::Altitude => {
                let fused = || global().map(|global| global.altitude);
                single(gnss().and_then(|gnss| gnss.altitude).or_else(fused)?.0)
            }
            Quantity::Latitude => Some(Scalar::Double(position()?.latitude_deg)),
            Quantity::Longitude => Some(Scalar::Double(position()?.longitude_deg)),
            Quantity::AirSpeed => single(hud()?.airspeed?.0),
            Quantity::GroundSpeed => single(hud()?.groundspeed?.0),
            Quantity::Heading => single(hud()?.heading_deg?),
            Quantity::Throttle => single(percent(hud()?.throttle?.0)),
            Quantity::HudAltitude => single(hud()?.altitude?.0),
            Quantity::ClimbRate => single(hud()?.climb?.0),
            Quantity::EscRpm(motor) => single(moves(motor)?.rpm?.0),
            Quantity::EscVoltage(motor) => single(moves(motor)?.voltage?.0),
            Quantity::EscCurrent(motor) => single(moves(motor)?.current?.0),
            Quantity::EscFailures(motor) => Some(Scalar::Unsigned(state(motor)?.failures?.into())),
            Quantity::EscErrors(motor) => Some(Scalar::Unsigned(state(motor)?.errors?.into())),
            Quantity::EscTemperature(motor) => single(state(motor)?.temperature?.0),
        }
    }

    fn acceleration(&self, now: time::BootMs) -> Option<[MetresPerSecond2; 3]> {
        self.vehicle.imu.within(now, AGE_MAX)?.acceleration
    }

    fn velocity(&self, now: time::BootMs) -> Option<[MetresPerSecond; 3]> {
        let local = self.vehicle.local.within(now, AGE_MAX).map(|local| local.velocity);
        local.or_else(|| self.vehicle.global.within(now, AGE_MAX).map(|global| global.velocity))
    }

    fn battery(&self, now: time::BootMs, quantity: Quantity) -> Option<Scalar> {
        let battery = self.vehicle.batteries.first().and_then(|battery| battery.within(now, AGE_MAX));
        let system = || self.vehicle.system.within(now, AGE_MAX);
        if quantity == Quantity::BatteryVolts {
            let volts = battery.and_then(|battery| battery.voltage).or_else(|| system()?.voltage);
            return Some(Scalar::Single(volts?.0));
        }
        let remaining = battery.and_then(|battery| battery.remaining).or_else(|| system()?.remaining);
        Some(Scalar::Single(percent(remaining?.0)))
    }

    fn esc(&self, now: time::BootMs, motor: usize, at: fn(&Motor) -> Option<time::BootMs>) -> Option<&Esc> {
        let motor = self.vehicle.motors.get(motor)?;
        at(motor).filter(|at| now.since(*at) <= AGE_MAX).map(|_| &motor.esc)
    }

    /// New quantities; `Some` motor if all are its.
    pub fn told_by(&self, observation: &Observation) -> Vec<(Option<usize>, Vec<Quantity>)> {
        let one = |quantities: &[Quantity]| vec![(None, quantities.to_vec())];
        let imu = [
            Quantity::Acceleration(0),
            Quantity::Acceleration(1),
            Quantity::Acceleration(2),
            Quantity::AccelerationModule,
        ];
        let air = [Quantity::Temperature, Quantity::Pressure];
        let velocity =
            [Quantity::Velocity(0), Quantity::Velocity(1), Quantity::Velocity(2), Quantity::VelocityModule];
        let position = [Quantity::Altitude, Quantity::Latitude, Quantity::Longitude];
        match observation {
            Observation::Heartbeat(_) => one(&[Quantity::FlightTime]),
            Observation::Battery(battery) if self.is_first(battery.id) => {
                one(&[Quantity::BatteryPercent, Quantity::BatteryVolts])
            }
            Observation::SystemStatus(_) if self.vehicle.batteries[0].get().is_none() => {
                one(&[Quantity::BatteryPercent, Quantity::BatteryVolts])
            }
            Observation::Air(sensor) if sensor.instance == 0 => one(&air),
            Observation::Imu(sensor) if sensor.instance == 0 => one(&imu),
            Observation::ImuAndAir(..) => one(&[&imu[..], &air].concat()),
            Observation::LocalPosition(_) => one(&velocity),
            Observation::GlobalPosition(_) => {
                let mut quantities = Vec::new();
                if self.vehicle.local.get().is_none() {
                    quantities.extend(velocity);
                }
                if self.vehicle.gnss[0].get().is_none() {
                    quantities.extend(position);
                }
                one(&quantities)
            }
            Observation::Gnss(gnss) if gnss.instance == 0 => {
                one(&[&[Quantity::GnssSpeed][..], &position].concat())
            }
            Observation::Hud(_) => one(&[
                Quantity::AirSpeed,
                Quantity::GroundSpeed,
                Quantity::Heading,
                Quantity::Throttle,
                Quantity::ClimbRate,
            ]),
            Observation::Escs(group) => {
                let motors = group.escs.iter().enumerate().filter(|(_, esc)| esc.is_some());
                let motors = motors.map(|(place, _)| usize::from(group.first) + place);
                motors.map(|motor| (Some(motor), ESC.map(|of| of(motor)).to_vec())).collect()
            }
            _ => Vec::new(),
        }
    }

    fn is_first(&self, battery: u8) -> bool {
        self.vehicle.batteries[0].get().is_some_and(|first| first.id == battery)
    }
}

/// Whole, not 92.99999.
fn percent(fraction: f32) -> f32 {
    (fraction * 100.0).round()
}

fn norm([x, y, z]: [f32; 3]) -> f32 {
    (x * x + y * y + z * z).sqrt()
}

#[cfg(test)]
mod tests {
    use hums_core::observation::{Battery, EscGroup, GlobalPosition, Heartbeat, SystemStatus, VehicleKind};
    use hums_core::units::{Fraction, Metres, Rpm, Volts};

    use super::*;

    const AUTOPILOT: Source = Source { system: 1, component: 1 };

    fn known() -> Reference {
        let mut reference = Reference::default();
        let heartbeat = Heartbeat { kind: VehicleKind::Rotorcraft, armed: true, ..Heartbeat::default() };
        assert!(reference.observe(Instant::ZERO, AUTOPILOT, &Observation::Heartbeat(heartbeat)));
        reference
    }

    #[test]
    fn the_status_tells_of_the_battery_where_no_battery_does() {
        let mut reference = known();
        let system = SystemStatus {
            voltage: Some(Volts(15.78)),
            remaining: Some(Fraction(0.93)),
            ..SystemStatus::default()
        };
        let now = Instant::from_millis(5);
        reference.observe(now, AUTOPILOT, &Observation::SystemStatus(system));
        assert_eq!(reference.value(now, Quantity::BatteryVolts), Some(Scalar::Single(15.78)));
        assert_eq!(reference.value(now, Quantity::BatteryPercent), Some(Scalar::Single(93.0)));
        let battery = Battery { voltage: Some(Volts(15.5)), ..Battery::default() };
        reference.observe(now, AUTOPILOT, &Observation::Battery(battery));
        assert_eq!(reference.value(now, Quantity::BatteryVolts), Some(Scalar::Single(15.5)));
        assert!(
            reference.told_by(&Observation::SystemStatus(system)).is_empty(),
            "the battery itself is heard"
        );
    }

    #[test]
    fn an_old_value_is_no_value() {
        let mut reference = known();
        let esc = Esc { rpm: Some(Rpm(4_350.0)), ..Esc::default() };
        let group = EscGroup { first: 0, escs: [Some(esc), None, None, None] };
        reference.observe(Instant::ZERO, AUTOPILOT, &Observation::Escs(group));
        let rpm = |seconds: u64| reference.value(Instant::from_millis(seconds * 1000), Quantity::EscRpm(0));
        assert_eq!((rpm(10), rpm(11)), (Some(Scalar::Single(4_350.0)), None));
        assert_eq!(reference.value(Instant::ZERO, Quantity::EscRpm(1)), None);
    }

    #[test]
    fn flight_time_counts_from_take_off_and_stays_after_landing() {
        let mut reference = known();
        let heights_m = |second: u64| if (10..40).contains(&second) { 20.0 } else { 0.0 };
        let mut times = Vec::new();
        for tick in 0..600 {
            let now = Instant::from_millis(tick * 100);
            let relative_altitude = Metres(heights_m(tick / 10));
            let global = GlobalPosition { relative_altitude, ..GlobalPosition::default() };
            reference.observe(now, AUTOPILOT, &Observation::GlobalPosition(global));
            times.push(reference.value(now, Quantity::FlightTime).map(Scalar::as_f64));
        }
        assert_eq!(times[50], Some(0.0), "on the ground");
        assert_eq!(times[300], Some(20.0), "in the air");
        // After two seconds on the ground.
        assert_eq!(times[599], Some(32.0), "down again");
    }
}
