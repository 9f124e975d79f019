//! Numbers of `ArduPilot` in words: vehicles, modes, events, errors. Sources: `AP_Logger.h` (`LogEvent`,
//! `LogErrorSubsystem`), `mode.h` of `ArduCopter`, `defines.h` of `ArduPlane`, `mode.h` of Rover and `ArduSub`.

use hums_core::cause::{Alert, Cause, Urgency};

/// Which firmware wrote the log.
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
    /// Antenna tracker: no vehicle.
    Tracker,
}

impl Craft {
    /// By the name of the firmware: `ArduCopter V4.6.3 (92b0cd78)`, `APM:Copter V3.3`, `ArduCopter V2.9.1`.
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

    /// By the parameter `SYSID_SW_TYPE`, which versions of before 2019 have (`k_software_type`).
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

    /// By the number of the build in VER (`APM_BUILD_*`).
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

    /// Whether events report take-off and landing.
    pub(super) const fn tells_landing(self) -> bool {
        matches!(self, Self::Copter | Self::Heli)
    }

    /// Whether every version reports arming.
    pub(super) const fn tells_arming(self) -> bool {
        matches!(self, Self::Sub)
    }

    /// The names of its modes.
    const fn modes(self) -> &'static [(u32, &'static str)] {
        match self {
            Self::Copter | Self::Heli => COPTER_MODES,
            Self::Plane => PLANE_MODES,
            Self::Rover => ROVER_MODES,
            Self::Sub => SUB_MODES,
            _ => &[],
        }
    }

    /// A mode's name.
    pub(in crate::source::dataflash) fn mode_name(self, number: u32) -> Option<&'static str> {
        self.modes().iter().find(|(known, _)| *known == number).map(|(_, name)| *name)
    }

    /// A mode's number by the name that text logs have.
    pub(super) fn mode_number(self, name: &str) -> Option<u32> {
        let plain = |name: &str| name.chars().filter(char::is_ascii_alphanumeric).collect::<String>();
        let name = plain(name).to_ascii_uppercase();
        self.modes().iter().find(|(_, known)| plain(known) == name).map(|(number, _)| *number)
    }
}

/// The name of a mode, by its number and the `MAV_TYPE` of the vehicle (`HEARTBEAT`).
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

/// Whether a text is the name and version of an `ArduPilot` firmware, as at its start.
pub(in crate::source) fn is_firmware(words: &str) -> bool {
    Craft::of_firmware(words).is_some()
}

/// The name and the version of a firmware; Rover's had a small v.
pub(super) fn name_and_version(words: &str) -> Option<(&str, &str)> {
    let (name, version) = words.split_once(' ')?;
    Some((name, version.strip_prefix(['V', 'v'])?))
}

const COPTER_MODES: &[(u32, &str)] = &[
    (0, "STABILIZE"),
    (1, "ACRO"),
    (2, "ALT_HOLD"),
    (3, "AUTO"),
    (4, "GUIDED"),
    (5, "LOITER"),
    (6, "RTL"),
    (7, "CIRCLE"),
    (8, "POSITION"),
    (9, "LAND"),
    (10, "OF_LOITER"),
    (11, "DRIFT"),
    (13, "SPORT"),
    (14, "FLIP"),
    (15, "AUTOTUNE"),
    (16, "POSHOLD"),
    (17, "BRAKE"),
    (18, "THROW"),
    (19, "AVOID_ADSB"),
    (20, "GUIDED_NOGPS"),
    (21, "SMART_RTL"),
    (22, "FLOWHOLD"),
    (23, "FOLLOW"),
    (24, "ZIGZAG"),
    (25, "SYSTEMID"),
    (26, "AUTOROTATE"),
    (27, "AUTO_RTL"),
    (28, "TURTLE"),
];

const PLANE_MODES: &[(u32, &str)] = &[
    (0, "MANUAL"),
    (1, "CIRCLE"),
    (2, "STABILIZE"),
    (3, "TRAINING"),
    (4, "ACRO"),
    (5, "FBWA"),
    (6, "FBWB"),
    (7, "CRUISE"),
    (8, "AUTOTUNE"),
    (10, "AUTO"),
    (11, "RTL"),
    (12, "LOITER"),
    (13, "TAKEOFF"),
    (14, "AVOID_ADSB"),
    (15, "GUIDED"),
    (16, "INITIALISING"),
    (17, "QSTABILIZE"),
    (18, "QHOVER"),
    (19, "QLOITER"),
    (20, "QLAND"),
    (21, "QRTL"),
    (22, "QAUTOTUNE"),
    (23, "QACRO"),
    (24, "THERMAL"),
    (25, "LOITER_ALT_QLAND"),
    (26, "AUTOLAND"),
];

const ROVER_MODES: &[(u32, &str)] = &[
    (0, "MANUAL"),
    (1, "ACRO"),
    (2, "LEARNING"),
    (3, "STEERING"),
    (4, "HOLD"),
    (5, "LOITER"),
    (6, "FOLLOW"),
    (7, "SIMPLE"),
    (8, "DOCK"),
    (9, "CIRCLE"),
    (10, "AUTO"),
    (11, "RTL"),
    (12, "SMART_RTL"),
    (15, "GUIDED"),
    (16, "INITIALISING"),
];

const SUB_MODES: &[(u32, &str)] = &[
    (0, "STABILIZE"),
    (1, "ACRO"),
    (2, "ALT_HOLD"),
    (3, "AUTO"),
    (4, "GUIDED"),
    (7, "CIRCLE"),
    (9, "SURFACE"),
    (16, "POSHOLD"),
    (19, "MANUAL"),
    (20, "MOTOR_DETECT"),
    (21, "SURFTRAK"),
];

/// The text of an EV; empty for an unknown number.
pub(super) fn event(number: u8) -> &'static str {
    EVENTS.iter().find(|(known, _)| *known == number).map_or("", |(_, words)| words)
}

const EVENTS: &[(u8, &str)] = &[
    (7, "state of the autopilot"),
    (10, "armed"),
    (11, "disarmed"),
    (15, "automatic take-off allowed"),
    (16, "take-off"),
    (17, "landing is likely complete"),
    (18, "landed"),
    (19, "GPS lost"),
    (21, "flip begins"),
    (22, "flip ends"),
    (25, "home set"),
    (26, "simple mode on"),
    (27, "simple mode off"),
    (28, "left the ground"),
    (29, "super simple mode on"),
    (30, "autotune begins"),
    (31, "autotune off"),
    (32, "autotune begins again"),
    (33, "autotune succeeded"),
    (34, "autotune failed"),
    (35, "autotune reached its limit"),
    (36, "pilot tests the gains of autotune"),
    (37, "gains of autotune saved"),
    (38, "trim saved"),
    (39, "waypoint added"),
    (41, "fence on"),
    (42, "fence off"),
    (43, "acro trainer off"),
    (44, "acro trainer levels"),
    (45, "acro trainer limits"),
    (46, "gripper grabs"),
    (47, "gripper releases"),
    (49, "parachute off"),
    (50, "parachute on"),
    (51, "parachute released"),
    (52, "landing gear down"),
    (53, "landing gear up"),
    (54, "motors stopped in emergency"),
    (55, "emergency stop of the motors ended"),
    (56, "motor interlock off"),
    (57, "motor interlock on"),
    (58, "rotor at speed"),
    (59, "rotor below its critical speed"),
    (60, "EKF altitude reset"),
    (61, "landing cancelled by the pilot"),
    (62, "EKF yaw reset"),
    (63, "ADS-B avoidance on"),
    (64, "ADS-B avoidance off"),
    (65, "proximity avoidance on"),
    (66, "proximity avoidance off"),
    (67, "another GPS is the first"),
    (71, "zigzag: A stored"),
    (72, "zigzag: B stored"),
    (73, "landing place moved by the pilot"),
    (74, "standby on"),
    (75, "standby off"),
    (80, "fence: altitude on"),
    (163, "surfaced"),
    (164, "dived"),
    (165, "on the bottom"),
    (166, "off the bottom"),
];

/// The subsystem of an ERR, and the meaning of its code; the code 0 is always the end of it.
pub(super) fn error(subsystem: u8, code: u8) -> String {
    let name = SUBSYSTEMS.iter().find(|(known, _)| *known == subsystem).map(|(_, name)| *name);
    let name = name.map_or_else(|| format!("subsystem {subsystem}"), str::to_owned);
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
    let (cause, urgency) = match subsystem {
        3 => (Cause::Compass, Urgency::Warning),
        4 => (Cause::Ranging, Urgency::Warning),
        5 => (Cause::RemoteControl, Urgency::Warning),
        6 => (Cause::Power, Urgency::Warning),
        7 | 11 => (Cause::Gnss, Urgency::Warning),
        8 => (Cause::GroundStation, Urgency::Warning),
        9 => (Cause::Fence, Urgency::Warning),
        CRASH_CHECK => (Cause::Crash, Urgency::Critical),
        16 | 24 | 31 => (Cause::Estimator, Urgency::Warning),
        17 => (Cause::Estimator, Urgency::Critical),
        18 => (Cause::Barometer, Urgency::Warning),
        19 | 30 => (Cause::Processor, Urgency::Warning),
        23 => (Cause::Terrain, Urgency::Warning),
        25 => (Cause::Propulsion, Urgency::Warning),
        26 | 27 => (Cause::Other, Urgency::Warning),
        29 => (Cause::Vibration, Urgency::Warning),
        _ => return None,
    };
    Some(Alert { cause, urgency: if code == 0 { Urgency::Over } else { urgency } })
}

const SUBSYSTEMS: &[(u8, &str)] = &[
    (1, "main"),
    (2, "radio"),
    (3, "compass"),
    (4, "optical flow"),
    (5, "radio failsafe"),
    (6, "battery failsafe"),
    (7, "GPS failsafe"),
    (8, "ground station failsafe"),
    (9, "fence failsafe"),
    (10, "flight mode"),
    (11, "GPS"),
    (12, "crash check"),
    (13, "flip"),
    (14, "autotune"),
    (15, "parachute"),
    (16, "EKF check"),
    (17, "EKF failsafe"),
    (18, "barometer"),
    (19, "CPU watchdog"),
    (20, "ADS-B failsafe"),
    (21, "terrain"),
    (22, "navigation"),
    (23, "terrain failsafe"),
    (24, "EKF primary"),
    (25, "thrust loss"),
    (26, "sensor failsafe"),
    (27, "leak failsafe"),
    (28, "pilot input"),
    (29, "vibration failsafe"),
    (30, "internal error"),
    (31, "dead reckoning failsafe"),
];

/// The subsystem of ERR that stops the motors at once, and so is not a lasting state.
pub(super) const CRASH_CHECK: u8 = 12;

/// Whether a subsystem of ERR is a failsafe or an emergency, which lasts until it is resolved or the vehicle
/// is disarmed. For 5, 6, 8, 17, 20, 23 and 31 the autopilot also reports a critical state in its heartbeat
/// (`Copter::any_failsafe_triggered`). The heartbeat does not show the others (GPS failsafe of before 3.3,
/// fence, CPU, thrust loss, sensors and leak of `ArduSub`, vibration, internal error).
pub(super) const fn is_failsafe(subsystem: u8) -> bool {
    matches!(subsystem, 5..=9 | 17 | 19 | 20 | 23 | 25..=27 | 29..=31)
}

/// A subsystem's name; empty if unknown.
pub(super) fn subsystem(number: u8) -> &'static str {
    SUBSYSTEMS.iter().find(|(known, _)| *known == number).map_or("", |(_, name)| name)
}

/// The failsafes of these bits, by their names.
pub(super) fn failsafes(bits: u64) -> String {
    let is_set = |subsystem: u8| bits & (1 << subsystem) != 0;
    let named = SUBSYSTEMS.iter().filter(|(subsystem, _)| is_set(*subsystem));
    named.map(|(_, name)| *name).collect::<Vec<_>>().join(", ")
}
