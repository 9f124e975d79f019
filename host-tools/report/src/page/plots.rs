//! The plots over time: their names, lines, units and limits.
//!
//! A plot has one unit, and a line one source: two sensors are two lines.

use hums_core::observation::{Autopilot, CELLS_MAX};
use hums_core::parameters::{Param, Params};

/// The plots, in the order of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Plot {
    /// Above home, and the setpoint above the autopilot's local origin, m.
    Height,
    /// Above mean sea level by the first receiver, by the estimator, and the setpoint, m.
    Altitude,
    /// Over ground, through the air, by the receiver, m/s.
    Speed,
    /// Upwards, and the setpoint, m/s.
    Vertical,
    /// North, east, down, and the setpoint, m/s.
    Velocity,
    /// Roll, pitch, and those that the autopilot wants, degrees.
    Attitude,
    /// From north, clockwise, and the setpoints of attitude control and of navigation, degrees.
    Heading,
    /// About the body's axes, and the setpoint, degrees a second.
    Rates,
    /// Over ground, as the autopilot estimates it, m/s.
    Wind,
    /// Direction of origin, degrees from north, clockwise.
    WindFrom,
    /// A line a channel of radio control, microseconds.
    Sticks,
    /// A line a battery, V.
    PackVolts,
    /// A line a cell: [`CELLS_MAX`] for each battery, V.
    CellVolts,
    /// A line a battery, A.
    PackAmperes,
    /// A line a battery, %.
    PackPercent,
    /// A line a battery, degC.
    PackCelsius,
    /// The autopilot's supply of 5 V, V.
    Rail,
    /// The rail of the servos, V.
    ServoRail,
    /// A line a motor, 1/min.
    MotorRpm,
    /// A line a motor, A.
    MotorAmperes,
    /// A line a motor, V.
    MotorVolts,
    /// A line an ESC, degC.
    MotorCelsius,
    /// A line an ESC, counted.
    EscErrors,
    /// A line an output of the autopilot, microseconds; the second port's after those of the first.
    Outputs,
    /// A line a sensor, 1/min.
    SpeedSensors,
    /// 1/min.
    EngineRpm,
    /// %
    EngineLoad,
    /// In the unit of the engine's controller.
    EngineFuelFlow,
    /// Temperature of the cylinder head, degC.
    EngineCelsius,
    /// A line an axis, in the unit of the autopilot.
    Vibration,
    /// A line an accelerometer, counted.
    Clips,
    /// The length of the specific force of the first inertial sensor, m/s2.
    Acceleration,
    /// Velocity, horizontal and vertical position, compass: test ratios or variances.
    Estimator,
    /// A line a receiver.
    Satellites,
    /// `GPS_FIX_TYPE`, a line a receiver.
    Fix,
    /// A line a receiver.
    Hdop,
    /// A line a receiver, m.
    Accuracy,
    /// RC, radio, its far end, and the noise of both, in their own units.
    Link,
    /// Received, and missing by the count of the sender, 1/s.
    Frames,
    /// Barometer, inertial sensor, processor, and the air in the inertial sensor's message, degC.
    Temperature,
    /// Static, of the first barometer, and as the inertial sensor's message has it, hPa.
    Pressure,
    /// Load of the autopilot's processor, %.
    Load,
}

/// Properties of a plot for the page.
#[derive(Clone, Copy, Debug)]
pub struct PlotProperties {
    /// The section of the page.
    pub group: &'static str,
    /// Its name.
    pub title: &'static str,
    /// The unit of all its lines; empty for a plain number.
    pub unit: &'static str,
    /// Digits behind the point.
    pub decimals: u8,
    /// The name of a line.
    pub name: fn(u8) -> String,
}

fn named(names: &[&str], line: u8) -> String {
    names.get(usize::from(line)).map_or_else(|| format!("{}", u16::from(line) + 1), |name| (*name).to_owned())
}

/// `Motor 1` of the line 0.
fn numbered(name: &str, line: u8) -> String {
    format!("{name} {}", u16::from(line) + 1)
}

fn motor(line: u8) -> String {
    numbered("Motor", line)
}

fn battery(line: u8) -> String {
    numbered("Battery", line)
}

fn cell(line: u8) -> String {
    let (pack, cell) = (line / CELLS_MAX as u8, line % CELLS_MAX as u8);
    if pack == 0 { numbered("Cell", cell) } else { format!("{}, cell {}", battery(pack), cell + 1) }
}

fn velocity(line: u8) -> String {
    named(&["North", "East", "Down", "North, wanted", "East, wanted", "Down, wanted"], line)
}

fn attitude(line: u8) -> String {
    named(&["Roll", "Pitch", "Roll, wanted", "Pitch, wanted", "Roll, AHRS2", "Pitch, AHRS2"], line)
}

fn heading(line: u8) -> String {
    named(&["Heading", "Wanted by attitude control", "Wanted by navigation", "AHRS2"], line)
}

fn rates(line: u8) -> String {
    named(&["Roll", "Pitch", "Yaw", "Roll, wanted", "Pitch, wanted", "Yaw, wanted"], line)
}

fn receiver(line: u8) -> String {
    numbered("Receiver", line)
}

/// The properties of a plot, for this autopilot.
pub fn about(plot: Plot, autopilot: Autopilot) -> PlotProperties {
    let px4 = autopilot == Autopilot::Px4;
    let axes: fn(u8) -> String = if px4 {
        |line| named(&["Coning", "Gyro, high frequency", "Accelerometer, high frequency", LIMIT], line)
    } else {
        |line| named(&["Forward", "Right", "Down", LIMIT], line)
    };
    let (vibration, estimator) = if px4 { ("PX4 metrics", "test ratio") } else { ("m/s\u{b2}", "variance") };
    let (group, title, unit, decimals, name): (_, _, _, _, fn(u8) -> String) = match plot {
        Plot::Height => ("Motion", "Height above home", "m", 2, |line| {
            named(&["Height", "Wanted, above the origin"], line)
        }),
        Plot::Altitude => ("Motion", "Altitude above sea level", "m", 1, |line| {
            named(&["GPS", "EKF", "Wanted", "AHRS2"], line)
        }),
        Plot::Speed => ("Motion", "Speed", "m/s", 2, |line| named(&["Ground", "Air", "GPS"], line)),
        Plot::Vertical => ("Motion", "Climb rate", "m/s", 2, |line| named(&["Climb", "Climb, wanted"], line)),
        Plot::Velocity => ("Motion", "Velocity north, east, down", "m/s", 2, velocity),
        Plot::Attitude => ("Motion", "Attitude", "\u{b0}", 1, attitude),
        Plot::Heading => ("Motion", "Heading", "\u{b0}", 0, heading),
        Plot::Rates => ("Motion", "Body rates", "\u{b0}/s", 1, rates),
        Plot::Wind => ("Motion", "Wind", "m/s", 1, |_| "Wind".into()),
        Plot::WindFrom => ("Motion", "Wind comes from", "\u{b0}", 0, |_| "From".into()),
        Plot::Sticks => ("Motion", "Radio control", "\u{b5}s", 0, |line| numbered("Channel", line)),
        Plot::PackVolts => ("Battery", "Voltage", "V", 3, battery),
        Plot::CellVolts => ("Battery", "Cells", "V", 3, cell),
        Plot::PackAmperes => ("Battery", "Current", "A", 2, battery),
        Plot::PackPercent => ("Battery", "Remaining", "%", 0, battery),
        Plot::PackCelsius => ("Battery", "Battery temperature", "\u{b0}C", 1, battery),
        Plot::Rail => ("Battery", "5 V supply", "V", 3, |_| "5 V".into()),
        Plot::ServoRail => ("Battery", "Servo rail", "V", 3, |_| "Servos".into()),
        Plot::MotorRpm => ("Motors", "Motor speed", "rpm", 0, motor),
        Plot::MotorAmperes => ("Motors", "ESC currents", "A", 2, motor),
        Plot::MotorVolts => ("Motors", "ESC voltages", "V", 2, motor),
        Plot::MotorCelsius => ("Motors", "ESC temperature", "\u{b0}C", 1, motor),
        Plot::EscErrors => ("Motors", "ESC errors", "count", 0, motor),
        Plot::Outputs => ("Motors", "Outputs", "\u{b5}s", 0, |line| numbered("Output", line)),
        Plot::SpeedSensors => ("Motors", "Speed sensors", "rpm", 0, |line| numbered("Sensor", line)),
        Plot::EngineRpm => ("Engine", "Engine speed", "rpm", 0, |_| "Speed".into()),
        Plot::EngineLoad => ("Engine", "Engine load", "%", 1, |_| "Load".into()),
        Plot::EngineFuelFlow => ("Engine", "Fuel flow", "cm\u{b3}/min", 2, |_| "Fuel flow".into()),
        Plot::EngineCelsius => ("Engine", "Cylinder head", "\u{b0}C", 1, |_| "Cylinder head".into()),
        Plot::Vibration => ("Structure", "Vibration", vibration, 3, axes),
        Plot::Clips => ("Structure", "Clipped samples", "count", 0, |line| numbered("Accelerometer", line)),
        Plot::Acceleration => ("Structure", "Acceleration", "m/s\u{b2}", 2, |_| "Total".into()),
        Plot::Estimator => ("Navigation", "EKF", estimator, 3, |line| {
            named(&["Velocity", "Horizontal position", "Vertical position", "Compass"], line)
        }),
        Plot::Satellites => ("Navigation", "Satellites", "count", 0, receiver),
        Plot::Fix => ("Navigation", "GPS fix", "type: 2 is 2D, 3 is 3D, more is better", 0, receiver),
        Plot::Hdop => ("Navigation", "HDOP", "1 is good", 2, receiver),
        Plot::Accuracy => ("Navigation", "Horizontal accuracy", "m", 2, receiver),
        Plot::Link => ("Link", "Signal strength", "device units", 0, |line| {
            named(&["RC", "Radio", "Radio, far end", "Noise", "Noise, far end"], line)
        }),
        Plot::Frames => {
            ("Link", "Frames", "1/s", 0, |line| named(&["Received", "Missing by the sender's count"], line))
        }
        Plot::Temperature => ("Computer", "Temperatures", "\u{b0}C", 1, |line| {
            named(&["Barometer", "Inertial sensor", "Processor", "Air, by HIGHRES_IMU"], line)
        }),
        Plot::Pressure => {
            ("Computer", "Air pressure", "hPa", 1, |line| named(&["Barometer", "Air, by HIGHRES_IMU"], line))
        }
        Plot::Load => ("Computer", "Processor load", "%", 1, |_| "Load".into()),
    };
    PlotProperties { group, title, unit, decimals, name }
}

/// The line of vibration without an axis: the limit above which it counts as risen.
pub(super) const RISE: u8 = 3;
const LIMIT: &str = "Limit of the rise";

/// A warning limit and a critical limit, if any.
pub type Limits = [Option<f32>; 2];

/// The limits of every line of a plot; of both sides, if there are two. If the second is the lower one,
/// values below are bad.
pub fn limits(plot: Plot, autopilot: Autopilot, params: &Params, cells: u8) -> Vec<Limits> {
    let px4 = autopilot == Autopilot::Px4;
    let both = |warning, critical| [Some(params.get(warning)), Some(params.get(critical))];
    let warning = |param| [Some(params.get(param)), None];
    let pair = match plot {
        Plot::CellVolts => both(Param::CellVoltWarn, Param::CellVoltCrit),
        // A cell's limits, if only the pack is reported.
        Plot::PackVolts if cells > 0 => both(Param::CellVoltWarn, Param::CellVoltCrit)
            .map(|volts| volts.map(|volts| volts * f32::from(cells))),
        Plot::PackPercent => both(Param::BatRemWarn, Param::BatRemCrit),
        Plot::PackCelsius => both(Param::BatTempWarn, Param::BatTempCrit),
        Plot::Rail => {
            return vec![both(Param::RailLowWarn, Param::RailLowCrit), warning(Param::RailHighWarn)];
        }
        Plot::MotorCelsius => both(Param::EscTempWarn, Param::EscTempCrit),
        Plot::EngineCelsius => both(Param::EngChtWarn, Param::EngChtCrit),
        Plot::Vibration if px4 => both(Param::VibePx4Warn, Param::VibePx4Crit),
        Plot::Vibration => both(Param::VibeWarn, Param::VibeCrit),
        Plot::Acceleration => {
            // The check is of multiples of gravity.
            let limits = both(Param::LoadFacWarn, Param::LoadFacCrit);
            return vec![limits.map(|limit| limit.map(|load_g| load_g * GRAVITY_M_S2))];
        }
        Plot::Attitude => {
            let limits = both(Param::TiltWarn, Param::TiltCrit);
            return vec![limits, limits.map(|limit| limit.map(|tilt_deg| -tilt_deg))];
        }
        Plot::Estimator if px4 => both(Param::EkfRatioWarn, Param::EkfRatioCrit),
        Plot::Estimator => both(Param::EkfVarWarn, Param::EkfVarCrit),
        Plot::Satellites => warning(Param::GpsSatsWarn),
        Plot::Fix => [None, Some(params.get(Param::GpsFixCrit))],
        Plot::Hdop => warning(Param::GpsHdopWarn),
        Plot::Accuracy => warning(Param::GpsHaccWarn),
        Plot::Load => both(Param::CpuLoadWarn, Param::CpuLoadCrit),
        _ => return Vec::new(),
    };
    vec![pair]
}

/// Standard gravity, ISO 80000-3.
const GRAVITY_M_S2: f32 = 9.806_65;

/// One line of a plot.
pub type Line = crate::series::Line<Plot>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_nothing_has_is_named_all_the_same() {
        for autopilot in [Autopilot::ArduPilot, Autopilot::Px4] {
            for plot in [Plot::Speed, Plot::Vibration, Plot::Temperature, Plot::Link, Plot::Sticks] {
                assert!(!(about(plot, autopilot).name)(u8::MAX).is_empty(), "{plot:?}");
            }
        }
    }
}
