//! What the page draws over time.

use crate::decode::reference::Quantity;
use crate::series;

/// What is drawn over time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Plot {
    /// Seconds in the air.
    FlightTime,
    /// V
    BatteryVolts,
    /// A
    BatteryAmperes,
    /// %
    BatteryPercent,
    /// Of the air, degC.
    Temperature,
    /// Static, hPa.
    Pressure,
    /// A line a motor, 1/min.
    EscRpm,
    /// A line a motor, A.
    EscAmperes,
    /// A line a motor, V.
    EscVolts,
    /// A line an ESC, degC.
    EscCelsius,
    /// Above mean sea level, m.
    Altitude,
    /// North, east, down, m/s.
    Velocity,
    /// Over ground, through the air, m/s.
    Speed,
    /// Upwards, m/s.
    Climb,
    /// The length of the specific force, m/s2.
    AccelModule,
    /// A line an axis, in the unit of the autopilot.
    Vibration,
    /// Velocity, horizontal position, vertical position, compass: test ratios or variances.
    Estimator,
    /// In use by the first receiver.
    Satellites,
    /// Of the vehicle's frames, %.
    Loss,
}

impl Plot {
    /// What the page calls it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FlightTime => "flight_time",
            Self::BatteryVolts => "battery_volts",
            Self::BatteryAmperes => "battery_amperes",
            Self::BatteryPercent => "battery_percent",
            Self::Temperature => "temperature",
            Self::Pressure => "pressure",
            Self::EscRpm => "esc_rpm",
            Self::EscAmperes => "esc_amperes",
            Self::EscVolts => "esc_volts",
            Self::EscCelsius => "esc_celsius",
            Self::Altitude => "altitude",
            Self::Velocity => "velocity",
            Self::Speed => "speed",
            Self::Climb => "climb",
            Self::AccelModule => "accel_module",
            Self::Vibration => "vibration",
            Self::Estimator => "estimator",
            Self::Satellites => "satellites",
            Self::Loss => "loss",
        }
    }
}

/// One line of a plot.
pub type Line = series::Line<Plot>;

/// Where a quantity is drawn; `None` where it is only shown as a number.
pub fn line_of(quantity: Quantity) -> Option<Line> {
    Some(match quantity {
        Quantity::FlightTime => (Plot::FlightTime, 0),
        Quantity::BatteryPercent => (Plot::BatteryPercent, 0),
        Quantity::BatteryVolts => (Plot::BatteryVolts, 0),
        Quantity::Temperature => (Plot::Temperature, 0),
        Quantity::Pressure => (Plot::Pressure, 0),
        Quantity::AccelerationModule => (Plot::AccelModule, 0),
        Quantity::Velocity(axis) => (Plot::Velocity, axis as u8),
        Quantity::Altitude => (Plot::Altitude, 0),
        Quantity::GroundSpeed => (Plot::Speed, 0),
        Quantity::AirSpeed => (Plot::Speed, 1),
        Quantity::ClimbRate => (Plot::Climb, 0),
        Quantity::EscRpm(motor) => (Plot::EscRpm, motor as u8),
        Quantity::EscVoltage(motor) => (Plot::EscVolts, motor as u8),
        Quantity::EscCurrent(motor) => (Plot::EscAmperes, motor as u8),
        _ => return None,
    })
}
