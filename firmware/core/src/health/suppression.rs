//! Suppression: one cause makes one finding. The alarm of one check may explain that of another.
//!
//! A failed motor tips the vehicle over, and a receiver without a fix makes the estimator doubt. So each check has a
//! [`Role`]: its group, and the groups that explain it. An alarm explains another one if it is as bad or worse, began
//! within [`NEAR`] of it, and is of the same motor, battery or receiver. Such a finding names its cause, is recorded like any
//! other, and not sent to the ground. A rise of the level is an onset too.
//!
//! A mishap explains only an alarm that begins with it or after it: an earlier one may be its cause.

use super::check::{Check, InstanceKind};
use super::finding::{Level, Subsystem};
use super::tables::{check_of, slot_of};
use crate::time::{BootMs, Millis};

/// The longest time between the onsets of a cause and its effect: the longest debounce of an effect is 10 s, and values are smoothed.
const NEAR: Millis = Millis::from_secs(12);
/// An alarm that begins this long before a mishap begins with it: both are found at a step, and by samples.
const WITH_MISHAP: Millis = Millis::from_millis(200);

/// Checks that explain the same other checks. A group explains later groups only, so nothing explains itself by way of others. Of several
/// causes the first in this order is named.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub(super) enum Group {
    Silence,
    /// Frames are lost on the autopilot's port.
    FramesLost,
    /// The autopilot restarted.
    Reboot,
    Battery,
    BatteryState,
    /// Another cause of an autopilot's failsafe.
    FailsafeCause,
    /// ESC telemetry. It is a wire: it explains no attitude, no mishap and no act of the autopilot.
    EscTelemetry,
    /// A motor takes no current, or stands.
    MotorLoss,
    /// A motor's output or speed is not like the others'.
    MotorOutput,
    /// A failure of the drive that an ESC or the autopilot reports.
    Drive,
    /// Nothing is recorded.
    Recording,
    /// A receiver has no position, or a false one.
    GnssLost,
    /// A receiver repeats one position.
    GnssFrozen,
    /// A receiver's velocity or height is wrong.
    GnssMotion,
    /// A receiver has few satellites, or is inaccurate.
    GnssQuality,
    /// A receiver has fewer satellites than before.
    SatellitesLost,
    /// The vehicle shakes beyond its limits.
    Vibration,
    /// It shakes more than before, or clips.
    Shaking,
    /// An accelerometer failed.
    AccelFault,
    /// A gyro failed.
    GyroFault,
    /// Two accelerometers differ.
    AccelMismatch,
    /// Two gyros differ.
    GyroMismatch,
    /// The measured force is not the change of velocity.
    ImuGnss,
    /// The autopilot's word on a receiver. Inertial sensors disturb its innovations as well.
    GnssWord,
    /// The autopilot's word on vibration, by the same innovations.
    VibrationWord,
    /// A gyro is noisy. It turns no vehicle over.
    GyroNoise,
    /// A compass failed.
    CompassFault,
    /// Two compasses differ.
    CompassMismatch,
    /// The estimator does not use a compass, or has another heading.
    CompassUse,
    /// A barometer failed.
    BaroFault,
    /// Any other word on a single sensor.
    Sensor,
    RollRate,
    PitchRate,
    /// The estimator's climb is wrong. Height control follows it.
    EkfClimb,
    Ekf,
    /// A failsafe acts.
    Failsafe,
    /// Explains no other check.
    Other,
}

impl Group {
    pub(super) const fn bit(self) -> u64 {
        1 << self as u8
    }
}

pub(super) const DRIVE: u64 = Group::MotorLoss.bit() | Group::MotorOutput.bit() | Group::Drive.bit();
pub(super) const RATES: u64 = Group::RollRate.bit() | Group::PitchRate.bit();
/// A receiver that is wrong, and not only less exact.
pub(super) const WRONG_RECEIVERS: u64 =
    Group::GnssLost.bit() | Group::GnssFrozen.bit() | Group::GnssMotion.bit();
pub(super) const RECEIVERS: u64 =
    WRONG_RECEIVERS | Group::GnssQuality.bit() | Group::SatellitesLost.bit() | Group::GnssWord.bit();
pub(super) const VIBRATION: u64 = Group::Vibration.bit() | Group::Shaking.bit();
pub(super) const SHAKING: u64 = VIBRATION | Group::VibrationWord.bit();
/// Accelerometers and gyros.
pub(super) const INERTIAL: u64 =
    Group::AccelFault.bit() | Group::GyroFault.bit() | Group::AccelMismatch.bit() | Group::GyroMismatch.bit();
/// Control follows the attitude, and the attitude follows these.
pub(super) const GYROS: u64 = Group::GyroFault.bit() | Group::GyroMismatch.bit() | Group::ImuGnss.bit();
/// The heading follows these.
pub(super) const TURNS: u64 = GYROS | Group::GyroNoise.bit();
pub(super) const COMPASS: u64 = Group::CompassFault.bit() | Group::CompassMismatch.bit();
pub(super) const SENSORS: u64 =
    INERTIAL | TURNS | COMPASS | Group::CompassUse.bit() | Group::BaroFault.bit() | Group::Sensor.bit();
pub(super) const DISTURBANCES: u64 = RECEIVERS | SENSORS | SHAKING;
pub(super) const ESTIMATORS: u64 = Group::EkfClimb.bit() | Group::Ekf.bit();
/// Made of several sensors.
const DERIVED: u64 = ESTIMATORS
    | Group::ImuGnss.bit()
    | Group::GnssWord.bit()
    | Group::VibrationWord.bit()
    | Group::CompassUse.bit()
    | Group::Failsafe.bit();
/// An autopilot has a failsafe for these.
pub(super) const FAILSAFES: u64 = Group::Silence.bit()
    | Group::Battery.bit()
    | Group::BatteryState.bit()
    | Group::FailsafeCause.bit()
    | DRIVE
    | RECEIVERS
    | SENSORS
    | ESTIMATORS;

/// The place of a check among causes: its group in the first byte, and a bit for each group that explains it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Role(u64);

impl Role {
    const SETS: u32 = 56;
    /// It explains nothing, and nothing but a mishap or a silent link explains it.
    pub const NONE: Self = Self::of(Group::Other, 0);

    pub(super) const fn of(group: Group, explained_by: u64) -> Self {
        assert!(explained_by < group.bit(), "a check is explained by groups before its own");
        Self(explained_by | (group as u64) << Self::SETS)
    }

    const fn explained_by(self) -> u64 {
        self.0 & ((1 << Self::SETS) - 1)
    }

    /// Whether its value is made of several sensors: the check of the one that is wrong may come later.
    pub const fn is_derived(self) -> bool {
        self.is_of(DERIVED)
    }

    const fn number(self) -> u8 {
        (self.0 >> Self::SETS) as u8
    }

    pub(super) const fn is_of(self, groups: u64) -> bool {
        groups >> self.number() & 1 != 0
    }
}

const _: () = assert!((Group::Other as u32) < Role::SETS);

pub(super) const fn is_of_drive(check: &Check) -> bool {
    check.role.is_of(DRIVE | Group::EscTelemetry.bit())
}

/// Whether a mishap explains the alarms of a subsystem.
pub const fn is_of_mishap(part: Subsystem) -> bool {
    matches!(
        part,
        Subsystem::Propulsion
            | Subsystem::Structure
            | Subsystem::Navigation
            | Subsystem::Computer
            | Subsystem::Attitude
    )
}

/// Whether an alarm since a time begins with a mishap or after it.
pub fn is_with_mishap(since: BootMs, mishap_since: BootMs) -> bool {
    mishap_since.since(since) <= WITH_MISHAP
}

/// Whether an alarm of one check may explain one of another.
pub const fn explains(cause: &Check, effect: &Check) -> bool {
    effect.role.explained_by() >> cause.role.number() & 1 != 0
}

/// An alarm of a check.
#[derive(Clone, Copy, Debug)]
pub struct Alarm {
    /// Its onset: when it began, or rose to its level.
    pub since: BootMs,
    /// Its level.
    pub level: Level,
    /// The check.
    pub check: &'static Check,
    /// Which one, where there are several.
    pub instance: u8,
    pub(super) slot: u16,
}

impl Alarm {
    /// An alarm by its check's name; `None` if the name is unknown.
    pub fn of(check: &str, instance: u8, level: Level, since: BootMs) -> Option<Self> {
        Self::at(slot_of(check, instance)?, level, since)
    }

    pub(super) fn at(slot: u16, level: Level, since: BootMs) -> Option<Self> {
        let (check, instance) = check_of(slot)?;
        Some(Self { since, level, check, instance, slot })
    }

    fn may_concern(&self, other: &Self) -> bool {
        let of = self.check.of;
        of == InstanceKind::Vehicle || of != other.check.of || self.instance == other.instance
    }

    fn explains(&self, effect: &Self) -> bool {
        let (before, after) = (effect.since.since(self.since), self.since.since(effect.since));
        match effect.level {
            Level::Ok | Level::Advisory => false,
            Level::Stale => self.check.role.is_of(Group::Silence.bit()) && after <= NEAR,
            level if (self.level as u8) < level as u8 => false,
            _ if self.check.subsystem == Subsystem::Mishap => {
                is_of_mishap(effect.check.subsystem) && is_with_mishap(effect.since, self.since)
            }
            _ => {
                let is_near = before <= NEAR && after <= NEAR;
                is_near && explains(self.check, effect.check) && self.may_concern(effect)
            }
        }
    }
}

/// The cause of an alarm or of a lack of data: the first mishap, or else the first alarm by group and table.
pub fn root_cause(effect: &Alarm, alarms: impl Iterator<Item = Alarm>) -> Option<Alarm> {
    let order = |alarm: &Alarm| match alarm.check.subsystem {
        Subsystem::Mishap => (false, alarm.since.as_millis(), alarm.slot),
        _ => (true, alarm.check.role.number().into(), alarm.slot),
    };
    alarms.filter(|cause| cause.explains(effect)).min_by_key(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::health::checks;

    /// An alarm at a second. A level is `w`arning, `c`ritical or `s`tale; a name may end in the number of a part: `motor_loss.3`.
    fn alarm(text: &str) -> Alarm {
        let (name, rest) = text.split_once(' ').unwrap();
        let (level, since) = rest.split_at(1);
        let level = match level {
            "w" => Level::Warning,
            "c" => Level::Critical,
            _ => Level::Stale,
        };
        let (name, instance) = name.split_once('.').unwrap_or((name, "0"));
        let since = BootMs::from_millis(100_000 + (since.parse::<f32>().unwrap() * 1e3) as u64);
        Alarm::of(name, instance.parse().unwrap(), level, since).unwrap_or_else(|| panic!("{text}"))
    }

    #[test]
    fn each_alarm_has_the_cause_that_stands_before_it() {
        for (effect, alarms, cause) in [
            ("ekf_alert w0", "gnss_alert w0, imu_gps w0", "imu_gps"),
            ("ekf_alert w0", "gnss_alert w0, imu_gps w0, gps_stuck w0", "gps_stuck"),
            ("ekf_alert w0", "compass_alert w0, gyro_mismatch w0", "gyro_mismatch"),
            ("roll w0", "gyro_mismatch w0, motor_loss c0", "motor_loss"),
            ("roll w0", "roll_rate w0, gyro_stuck w0", "gyro_stuck"),
            ("gnss_alert w0", "imu_gps w0, gps_stuck w0", "gps_stuck"),
            ("gnss_alert w0", "gps_speed w0", "gps_speed"),
            ("gps_speed w0", "gnss_alert w0", ""),
            ("vibration_alert w0", "imu_gps w0", "imu_gps"),
            ("imu_gps w0", "vibration_alert w0", ""),
            ("imu_gps w0", "vibration w0", "vibration"),
            ("gnss_alert w0", "accel_alert w0", "accel_alert"),
            ("gnss_alert w0", "gyro_stuck w0", "gyro_stuck"),
            ("gnss_alert w0", "vibration w0", "vibration"),
            ("autopilot_alert w0", "gps_fix c0, vibration w0, heartbeat w0", ""),
            // As bad or worse.
            ("ekf_failsafe c0", "gps_fix c0, vibration w0", "gps_fix"),
            ("gyro_noise w0", "vibration_px4 w0", "vibration_px4"),
            ("vibration_px4 w0", "gyro_noise w0", ""),
            ("accel_mismatch w0", "vibration w0", "vibration"),
            ("accel_mismatch c0", "vibration w0", ""),
            ("failsafe_alert c0", "gps_fix c0, vibration w0", "gps_fix"),
            ("cell_voltage s0", "gps_fix c0, heartbeat w0", "heartbeat"),
            ("cell_voltage s90", "heartbeat c0", "heartbeat"),
            ("cell_voltage c0", "heartbeat c0", ""),
            ("card_stall w0", "recording c0", "recording"),
            ("record_lost w0", "recording c0", "recording"),
            ("motor_output.2 c0", "motor_loss.2 c0", "motor_loss"),
            ("motor_output.3 c0", "motor_loss.2 c0", ""),
            ("motor_output.0 c0", "motor_loss.1 c0", ""),
            ("roll c0", "motor_loss.3 c0", "motor_loss"),
            ("roll c0", "pitch_rate c0", ""),
            ("ekf_failsafe c0", "gps_fix c0, overturned c0", "overturned"),
            ("load_factor w0", "gps_fix c0, overturned c0", "overturned"),
            ("load_factor w90", "overturned c0", "overturned"),
            ("cell_voltage w0", "gps_fix c0, overturned c0", ""),
            ("impact c0", "gps_fix c0, overturned c0", ""),
            ("motor_loss c0", "sinking c0.2, gps_fix c3", "sinking"),
            ("motor_loss c0", "sinking c0.4, gps_fix c3", ""),
            ("ekf_failsafe c0", "sinking c0.4, gps_fix c3", "gps_fix"),
        ] {
            let alarms = alarms.split(", ").map(alarm);
            let is = root_cause(&alarm(effect), alarms).map_or("", |cause| cause.check.name);
            assert_eq!(is, cause, "{effect}");
        }
        for effect in ["roll", "pitch", "roll_rate", "pitch_rate", "attitude_alert", "compass_alert"] {
            for gyro in ["gyro_stuck", "gyro_alert", "gyro_mismatch", "imu_gps"] {
                let [gyro, effect] = [gyro, effect].map(|name| alarm(&format!("{name} w0")));
                assert!(root_cause(&effect, core::iter::once(gyro)).is_some(), "{}", effect.check.name);
            }
        }
    }

    #[test]
    fn a_standing_alarm_explains_only_what_begins_near_its_onset() {
        let mut pairs = 0;
        for cause in checks() {
            for effect in checks().filter(|effect| explains(cause, effect)) {
                for (at_s, is_explained) in
                    [(0, false), (27, false), (28, true), (40, true), (52, true), (53, false), (90, false)]
                {
                    let cause = alarm(&format!("{} c40", cause.name));
                    let effect = alarm(&format!("{} w{at_s}", effect.name));
                    assert_eq!(
                        root_cause(&effect, core::iter::once(cause)).is_some(),
                        is_explained,
                        "{effect:?}"
                    );
                }
                pairs += 1;
            }
        }
        assert!(pairs > 500, "{pairs}");
    }

    #[test]
    fn a_wire_explains_no_attitude_no_mishap_and_no_act_of_the_autopilot() {
        let wire = check_of(slot_of("esc_silent", 0).unwrap()).unwrap().0;
        for check in checks().filter(|check| explains(wire, check)) {
            assert!(!matches!(check.subsystem, Subsystem::Attitude | Subsystem::Mishap), "{}", check.name);
            assert!(!check.role.is_of(Group::Failsafe.bit()) && check.name != "autopilot_state");
        }
    }
}
