//! The plots of the page: which there are, and what they are called.

use hums_core::observation::Autopilot;

/// The plots, in the order of the page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Plot {
    /// Above home, m.
    Height,
    /// Over ground, through the air, by the receiver, m/s.
    Speed,
    /// Upwards, m/s.
    Vertical,
    /// Roll, pitch, degrees.
    Attitude,
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
    /// A line a sensor, 1/min.
    SpeedSensors,
    /// Speed, load, fuel flow, cylinder head.
    Engine,
    /// A line an axis, in the unit of the autopilot.
    Vibration,
    /// A line an accelerometer, counted.
    Clips,
    /// Velocity, horizontal and vertical position, compass: test ratios or variances.
    Estimator,
    /// Satellites and fix type, of two receivers.
    Satellites,
    /// HDOP and accuracy in m, of two receivers.
    Dilution,
    /// RC, radio, its far end, and the noise of both, in their own units.
    Link,
    /// Received, and missing by the count of the sender, 1/s.
    Frames,
    /// Air, inertial sensor, processor, and from the fifth line on the batteries, degC.
    Temperature,
    /// Of the autopilot's processor, %.
    Load,
}

/// Group, title, unit, decimals and the lines' names of a plot.
pub type About = (Plot, &'static str, &'static str, &'static str, u8, fn(u8) -> String);

fn named(names: &[&str], line: u8) -> String {
    names.get(usize::from(line)).map_or_else(|| format!("{}", u16::from(line) + 1), |name| (*name).to_owned())
}

/// The plots, in the order of the page.
pub fn about(autopilot: Autopilot) -> Vec<About> {
    let motor = |line: u8| format!("Motor {}", u16::from(line) + 1);
    let battery =
        |line: u8| if line == 0 { "Battery".into() } else { format!("Battery {}", u16::from(line) + 1) };
    let px4 = autopilot == Autopilot::Px4;
    let axes: fn(u8) -> String = if px4 {
        |line| named(&["Coning", "Gyro, high frequency", "Accelerometer, high frequency"], line)
    } else {
        |line| named(&["Forward", "Right", "Down"], line)
    };
    let (vibration, estimator) = if px4 { ("PX4 metrics", "test ratio") } else { ("m/s\u{b2}", "variance") };
    vec![
        (Plot::Height, "Motion", "Height above home", "m", 2, |_| "Height".into()),
        (Plot::Speed, "Motion", "Speed", "m/s", 2, |line| named(&["Ground", "Air", "GNSS"], line)),
        (Plot::Vertical, "Motion", "Climb rate", "m/s", 2, |_| "Climb".into()),
        (Plot::Attitude, "Motion", "Attitude", "\u{b0}", 1, |line| named(&["Roll", "Pitch"], line)),
        (Plot::PackVolts, "Battery", "Voltage", "V", 3, battery),
        (Plot::CellVolts, "Battery", "Cells", "V", 3, |line| format!("Cell {}", u16::from(line) + 1)),
        (Plot::PackAmperes, "Battery", "Current", "A", 2, battery),
        (Plot::PackPercent, "Battery", "Remaining", "%", 0, battery),
        (Plot::MotorRpm, "Motors", "Speed", "rpm", 0, motor),
        (Plot::MotorAmperes, "Motors", "Current", "A", 2, motor),
        (Plot::MotorVolts, "Motors", "Voltage", "V", 2, motor),
        (Plot::MotorCelsius, "Motors", "ESC temperature", "\u{b0}C", 1, motor),
        (Plot::EscErrors, "Motors", "ESC errors", "count", 0, motor),
        (Plot::SpeedSensors, "Motors", "Speed sensors", "rpm", 0, |line| {
            format!("Sensor {}", u16::from(line) + 1)
        }),
        (Plot::Engine, "Motors", "Engine", "", 1, |line| {
            named(&["Speed (rpm)", "Load (%)", "Fuel flow", "Cylinder head (\u{b0}C)"], line)
        }),
        (Plot::Vibration, "Structure", "Vibration", vibration, 3, axes),
        (Plot::Clips, "Structure", "Clipped samples", "count", 0, |line| {
            format!("Accelerometer {}", u16::from(line) + 1)
        }),
        (Plot::Estimator, "Navigation", "Estimator", estimator, 3, |line| {
            named(&["Velocity", "Horizontal position", "Vertical position", "Compass"], line)
        }),
        (Plot::Satellites, "Navigation", "Satellites and fix", "", 0, |line| {
            named(&["Satellites", "Fix type", "Satellites, 2nd receiver", "Fix type, 2nd receiver"], line)
        }),
        (Plot::Dilution, "Navigation", "GNSS accuracy", "", 2, |line| {
            named(&["HDOP", "Horizontal accuracy (m)", "HDOP, 2nd", "Accuracy, 2nd (m)"], line)
        }),
        (Plot::Link, "Link", "Signal strength", "device units", 0, |line| {
            named(&["RC", "Radio", "Radio, far end", "Noise", "Noise, far end"], line)
        }),
        (Plot::Frames, "Link", "Frames", "per second", 0, |line| {
            named(&["Received", "Missing by the sender's count"], line)
        }),
        (Plot::Temperature, "Computer", "Temperatures", "\u{b0}C", 1, |line| {
            named(
                &[
                    "Air",
                    "Inertial sensor",
                    "Processor",
                    "",
                    "Battery",
                    "Battery 2",
                    "Battery 3",
                    "Battery 4",
                ],
                line,
            )
        }),
        (Plot::Load, "Computer", "Autopilot load", "%", 1, |_| "Load".into()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_that_nothing_has_is_named_all_the_same() {
        for (_, _, title, _, _, name) in about(Autopilot::ArduPilot).into_iter().chain(about(Autopilot::Px4))
        {
            assert!(!name(u8::MAX).is_empty(), "{title}");
        }
    }
}
