//! Numbers of `ArduPilot` in words. Sources: `AP_Logger.h` (`LogEvent`, `LogErrorSubsystem`), `mode.h` of `ArduCopter`,
//! `defines.h` of `ArduPlane`, `mode.h` of Rover and `ArduSub`.

use hums_core::cause::{Alert, Cause, Urgency};

/// The log's firmware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::source::dataflash) enum Craft {
    /// Not known yet.
    #[default]
    Unknown,
    /// `ArduCopter`
    Copter,
    /// `ArduCopter` for helicopters.
    Heli,
    /// `ArduPlane`
    Plane,
    /// Rover, boat.
    Rover,
    /// `ArduSub`
    Sub,
    /// Blimp
    Blimp,
    /// No vehicle.
    Tracker,
}

impl Craft {
    /// `ArduCopter V4.6.3 (92b0cd78)`, `APM:Copter V3.3`, `ArduCopter V2.9.1`.
    pub(super) fn of_firmware(words: &str) -> Option<Self> {
        let (name, _) = name_and_version(words)?;
        Some(match name {
            "ArduCopter" | "APM:Copter" | "ArduCopter-heli" => Self::Copter,
            "ArduPlane" | "APM:Plane" => Self::Plane,
            "ArduRover" | "APM:Rover" | "APMrover2" | "Rover" => Self::Rover,
            "ArduSub" | "APM:Sub" => Self::Sub,
            "Blimp" => Self::Blimp,
            "AntennaTracker" | "ArduTracker" => Self::Tracker,
            _ => return None,
        })
    }

    /// Software by `SYSID_SW_TYPE`, before 2019 (`k_software_type`).
    pub(super) const fn of_software(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Plane,
            4 => Self::Tracker,
            10 => Self::Copter,
            20 => Self::Rover,
            40 => Self::Sub,
            _ => return None,
        })
    }

    /// Software by VER's build number (`APM_BUILD_*`).
    pub(super) const fn of_build(number: u8) -> Option<Self> {
        Some(match number {
            1 => Self::Rover,
            2 => Self::Copter,
            3 => Self::Plane,
            4 => Self::Tracker,
            7 => Self::Sub,
            12 => Self::Blimp,
            13 => Self::Heli,
            _ => return None,
        })
    }

    pub(super) const fn tells_landing(self) -> bool {
        matches!(self, Self::Copter | Self::Heli)
    }

    pub(super) const fn tells_arming(self) -> bool {
        matches!(self, Self::Sub)
    }

    fn modes(self) -> impl Iterator<Item = (u32, &'static str)> {
        let firmware = match self {
            Self::Copter | Self::Heli => "copter ",
            Self::Plane => "plane ",
            Self::Rover => "rover ",
            Self::Sub => "sub ",
            _ => "no firmware ",
        };
        MODES.lines().filter_map(move |line| numbered(line.strip_prefix(firmware)?))
    }

    /// A mode's name.
    pub(in crate::source::dataflash) fn mode_name(self, number: u32) -> Option<&'static str> {
        self.modes().find(|(known, _)| *known == number).map(|(_, name)| name)
    }

    pub(super) fn mode_number(self, name: &str) -> Option<u32> {
        let plain = |name: &str| name.chars().filter(char::is_ascii_alphanumeric).collect::<String>();
        let name = plain(name).to_ascii_uppercase();
        self.modes().find(|(_, known)| plain(known) == name).map(|(number, _)| number)
    }
}

/// A mode by number and `MAV_TYPE` (`HEARTBEAT`).
pub fn mode_name(vehicle: u8, number: u32) -> Option<&'static str> {
    let craft = match vehicle {
        // Quadrotor, coaxial, helicopter, hexarotor, octorotor, tricopter, dodecarotor, decarotor.
        2..=4 | 13..=15 | 29 | 35 => Craft::Copter,
        // Fixed wing, VTOLs.
        1 | 19..=25 => Craft::Plane,
        // Ground rover, surface boat.
        10 | 11 => Craft::Rover,
        12 => Craft::Sub,
        _ => return None,
    };
    craft.mode_name(number)
}

/// Name and version, as sent at its start.
pub(in crate::source) fn is_firmware(words: &str) -> bool {
    Craft::of_firmware(words).is_some()
}

/// Rover's has a small v.
pub(super) fn name_and_version(words: &str) -> Option<(&str, &str)> {
    let (name, version) = words.split_once(' ')?;
    Some((name, version.strip_prefix(['V', 'v'])?))
}

/// A line each.
const MODES: &str = include_str!("modes.txt");
const EVENTS: &str = include_str!("events.txt");

/// A line's number and words.
fn numbered(line: &'static str) -> Option<(u32, &'static str)> {
    let (number, words) = line.split_once(' ')?;
    Some((number.parse().ok()?, words))
}

/// Empty if unknown.
pub(super) fn event(number: u8) -> &'static str {
    let event = EVENTS.lines().filter_map(numbered).find(|(known, _)| *known == u32::from(number));
    event.map_or("", |(_, words)| words)
}

/// The code 0 always ends it.
pub(super) fn error(subsystem: u8, code: u8) -> String {
    let name =
        row(subsystem).map_or_else(|| format!("subsystem {subsystem}"), |(_, name, ..)| (*name).to_owned());
    let words = match (subsystem, code) {
        (_, 0) => "resolved",
        (2, 2) => "late frame",
        (11 | 18, 2) => "glitch",
        (12, 1) => "crash",
        (12, 2) => "loss of control",
        (15, 2) => "not released: too low",
        (15, 3) => "not released: landed",
        (16, 2) => "bad variance",
        (18, 3) => "bad depth",
        (_, 4) if matches!(subsystem, 3 | 11 | 18) => "unhealthy",
        (10, mode) => return format!("{name}: change to mode {mode} failed"),
        (24, core) => return format!("{name}: core {core}"),
        (1..=4, 1) => "failed to initialise",
        (_, 1) => "occurred",
        (_, code) => return format!("{name}: code {code}"),
    };
    format!("{name}: {words}")
}

/// The alert of an ERR, or its end (code 0).
pub(super) fn alert(subsystem: u8, code: u8) -> Option<Alert> {
    let cause = row(subsystem)?.2?;
    let urgency = match (subsystem, code) {
        (_, 0) => Urgency::Over,
        (CRASH_CHECK | EKF_FAILSAFE, _) => Urgency::Critical,
        _ => Urgency::Warning,
    };
    Some(Alert { cause, urgency })
}

fn row(subsystem: u8) -> Option<&'static (u8, &'static str, Option<Cause>, bool)> {
    SUBSYSTEMS.iter().find(|(known, ..)| *known == subsystem)
}

/// Number, name, cause of alerts, and whether an error is a failsafe or an emergency. A failsafe lasts until resolved or
/// disarmed. 5, 6, 8, 17, 20, 23 and 31 are also critical in the heartbeat (`Copter::any_failsafe_triggered`).
const SUBSYSTEMS: &[(u8, &str, Option<Cause>, bool)] = &[
    (1, "main", None, false),
    (2, "radio", None, false),
    (3, "compass", Some(Cause::Compass), false),
    (4, "optical flow", Some(Cause::Ranging), false),
    (5, "radio failsafe", Some(Cause::RemoteControl), true),
    (6, "battery failsafe", Some(Cause::Power), true),
    (7, "GPS failsafe", Some(Cause::Gnss), true),
    (8, "ground station failsafe", Some(Cause::GroundStation), true),
    (9, "fence failsafe", Some(Cause::Fence), true),
    (10, "flight mode", None, false),
    (11, "GPS", Some(Cause::Gnss), false),
    (12, "crash check", Some(Cause::Crash), false),
    (13, "flip", None, false),
    (14, "autotune", None, false),
    (15, "parachute", None, false),
    (16, "EKF check", Some(Cause::Estimator), false),
    (17, "EKF failsafe", Some(Cause::Estimator), true),
    (18, "barometer", Some(Cause::Barometer), false),
    (19, "CPU watchdog", Some(Cause::Processor), true),
    (20, "ADS-B failsafe", None, true),
    (21, "terrain", None, false),
    (22, "navigation", None, false),
    (23, "terrain failsafe", Some(Cause::Terrain), true),
    (24, "EKF primary", Some(Cause::Estimator), false),
    (25, "thrust loss", Some(Cause::Propulsion), true),
    (26, "sensor failsafe", Some(Cause::Other), true),
    (27, "leak failsafe", Some(Cause::Other), true),
    (28, "pilot input", None, false),
    (29, "vibration failsafe", Some(Cause::Vibration), true),
    (30, "internal error", Some(Cause::Processor), true),
    (31, "dead reckoning failsafe", Some(Cause::Estimator), true),
];

/// Stops the motors at once: no lasting state.
pub(super) const CRASH_CHECK: u8 = 12;

/// The estimator failed in flight.
const EKF_FAILSAFE: u8 = 17;

pub(super) fn is_failsafe(subsystem: u8) -> bool {
    row(subsystem).is_some_and(|(.., is_failsafe)| *is_failsafe)
}

/// Empty if unknown.
pub(super) fn subsystem(number: u8) -> &'static str {
    row(number).map_or("", |(_, name, ..)| name)
}

pub(super) fn failsafes(bits: u64) -> String {
    let named = SUBSYSTEMS.iter().filter(|(subsystem, ..)| bits & (1 << subsystem) != 0);
    named.map(|(_, name, ..)| *name).collect::<Vec<_>>().join(", ")
}
