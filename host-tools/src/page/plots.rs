//! What is drawn over time: which plots there are, what they and their lines are called, their units and limits.
//!
//! A plot has one unit, and a line one source: two sensors are two lines.

use hums_core::observation::Autopilot;
use hums_core::params::{Param, Params};

/// The plots, in the order of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Plot {
    /// Above home, m.
    Height,
    /// Above mean sea level by the first receiver, or the estimator where there is none, m.
    Altitude,
    /// Over ground, through the air, by the receiver, m/s.
    Speed,
    /// Upwards, m/s.
    Vertical,
    /// North, east, down, m/s.
    Velocity,
    /// Roll, pitch, and those that the autopilot wants, degrees.
    Attitude,
    /// A line a channel of radio control, microseconds.
    Sticks,
    /// A line a battery, V.
    PackVolts,
    /// A line a cell of the first battery, V.
    CellVolts,
    /// A line a battery, A.
    PackAmperes,
    /// A line a battery, %.
    PackPercent,
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
    /// Of the cylinder head, degC.
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
    /// Barometer, inertial sensor, processor, and from the fifth line on the batteries, degC.
    Temperature,
    /// Static, of the first barometer, hPa.
    Pressure,
    /// Of the autopilot's processor, %.
    Load,
}

/// What the page needs to know of a plot.
#[derive(Clone, Copy, Debug)]
pub struct About {
    /// The section of the page.
    pub group: &'static str,
    /// What it is called.
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

fn receiver(line: u8) -> String {
    numbered("Receiver", line)
}

/// What a plot is called, as this autopilot has it.
pub fn about(plot: Plot, autopilot: Autopilot) -> About {
    let px4 = autopilot == Autopilot::Px4;
    let axes: fn(u8) -> String = if px4 {
        |line| named(&["Coning", "Gyro, high frequency", "Accelerometer, high frequency"], line)
    } else {
        |line| named(&["Forward", "Right", "Down"], line)
    };
    let (vibration, estimator) = if px4 { ("PX4 metrics", "test ratio") } else { ("m/s\u{b2}", "variance") };
    let (group, title, unit, decimals, name): (_, _, _, _, fn(u8) -> String) = match plot {
        Plot::Height => ("Motion", "Height above home", "m", 2, |_| "Height".into()),
        Plot::Altitude => ("Motion", "Altitude above sea level", "m", 1, |_| "Altitude".into()),
        Plot::Speed => ("Motion", "Speed", "m/s", 2, |line| named(&["Ground", "Air", "GNSS"], line)),
        Plot::Vertical => ("Motion", "Climb rate", "m/s", 2, |_| "Climb".into()),
        Plot::Velocity => {
            ("Motion", "NED velocity", "m/s", 2, |line| named(&["North", "East", "Down"], line))
        }
        Plot::Attitude => ("Motion", "Attitude", "\u{b0}", 1, |line| {
            named(&["Roll", "Pitch", "Roll, wanted", "Pitch, wanted"], line)
        }),
        Plot::Sticks => ("Motion", "Radio control", "\u{b5}s", 0, |line| numbered("Channel", line)),
        Plot::PackVolts => ("Battery", "Voltage", "V", 3, battery),
        Plot::CellVolts => ("Battery", "Cells of battery 1", "V", 3, |line| numbered("Cell", line)),
        Plot::PackAmperes => ("Battery", "Current", "A", 2, battery),
        Plot::PackPercent => ("Battery", "Remaining", "%", 0, battery),
        Plot::MotorRpm => ("Motors", "Motor speed", "rpm", 0, motor),
        Plot::MotorAmperes => ("Motors", "ESC currents", "A", 2, motor),
        Plot::MotorVolts => ("Motors", "ESC voltages", "V", 2, motor),
        Plot::MotorCelsius => ("Motors", "ESC temperature", "\u{b0}C", 1, motor),
        Plot::EscErrors => ("Motors", "ESC errors", "count", 0, motor),
        Plot::Outputs => ("Motors", "Outputs", "\u{b5}s", 0, |line| numbered("Output", line)),
        Plot::SpeedSensors => ("Motors", "Speed sensors", "rpm", 0, |line| numbered("Sensor", line)),
        Plot::EngineRpm => ("Engine", "Engine speed", "rpm", 0, |_| "Speed".into()),
        Plot::EngineLoad => ("Engine", "Engine load", "%", 1, |_| "Load".into()),
        Plot::EngineFuelFlow => ("Engine", "Fuel flow", "", 2, |_| "Fuel flow".into()),
        Plot::EngineCelsius => ("Engine", "Cylinder head", "\u{b0}C", 1, |_| "Cylinder head".into()),
        Plot::Vibration => ("Structure", "Vibration", vibration, 3, axes),
        Plot::Clips => ("Structure", "Clipped samples", "count", 0, |line| numbered("Accelerometer", line)),
        Plot::Acceleration => ("Structure", "Acceleration", "m/s\u{b2}", 2, |_| "Module".into()),
        Plot::Estimator => ("Navigation", "Estimator", estimator, 3, |line| {
            named(&["Velocity", "Horizontal position", "Vertical position", "Compass"], line)
        }),
        Plot::Satellites => ("Navigation", "Satellites", "count", 0, receiver),
        Plot::Fix => ("Navigation", "Fix type", "2 2D, 3 3D, 4 DGPS, 5 and 6 RTK", 0, receiver),
        Plot::Hdop => ("Navigation", "HDOP", "", 2, receiver),
        Plot::Accuracy => ("Navigation", "Horizontal accuracy", "m", 2, receiver),
        Plot::Link => ("Link", "Signal strength", "device units", 0, |line| {
            named(&["RC", "Radio", "Radio, far end", "Noise", "Noise, far end"], line)
        }),
        Plot::Frames => {
            ("Link", "Frames", "1/s", 0, |line| named(&["Received", "Missing by the sender's count"], line))
        }
        Plot::Temperature => ("Computer", "Temperatures", "\u{b0}C", 1, |line| match line.checked_sub(4) {
            Some(battery) => numbered("Battery", battery),
            None => named(&["Barometer", "Inertial sensor", "Processor"], line),
        }),
        Plot::Pressure => ("Computer", "Air pressure", "hPa", 1, |_| "Pressure".into()),
        Plot::Load => ("Computer", "Autopilot load", "%", 1, |_| "Load".into()),
    };
    About { group, title, unit, decimals, name }
}

/// The limits of warning and of critical that hold for every line of a plot. Where the second is the lower one, what is below
/// is bad.
pub fn limits(plot: Plot, autopilot: Autopilot, params: &Params) -> Option<[f32; 2]> {
    let px4 = autopilot == Autopilot::Px4;
    let (warning, critical) = match plot {
        Plot::CellVolts => (Param::CellVoltWarn, Param::CellVoltCrit),
        Plot::PackPercent => (Param::BatRemWarn, Param::BatRemCrit),
        Plot::MotorCelsius => (Param::EscTempWarn, Param::EscTempCrit),
        Plot::EngineCelsius => (Param::EngChtWarn, Param::EngChtCrit),
        Plot::Vibration if px4 => (Param::VibePx4Warn, Param::VibePx4Crit),
        Plot::Vibration => (Param::VibeWarn, Param::VibeCrit),
        Plot::Estimator if px4 => (Param::EkfRatioWarn, Param::EkfRatioCrit),
        Plot::Estimator => (Param::EkfVarWarn, Param::EkfVarCrit),
        Plot::Satellites => (Param::GpsSatsWarn, Param::GpsSatsWarn),
        Plot::Hdop => (Param::GpsHdopWarn, Param::GpsHdopWarn),
        Plot::Accuracy => (Param::GpsHaccWarn, Param::GpsHaccWarn),
        Plot::Load => (Param::CpuLoadWarn, Param::CpuLoadCrit),
        _ => return None,
    };
    Some([params.get(warning), params.get(critical)])
}

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
