//! State for other messages.

use hums_core::clock::Instant;
use hums_core::observation::{Observation, Sensors, Source};
use hums_core::units::{Amperes, Fraction, Gauss, RadiansPerSecond, Volts};

use super::super::fields::Fields;

#[derive(Debug)]
pub(in crate::source::ulog) struct Topic {
    pub(in crate::source::ulog) name: &'static str,
    /// Instances in use.
    pub(in crate::source::ulog) instances: u8,
    /// Least microseconds between two messages.
    pub(in crate::source::ulog) every_us: u64,
    pub(in crate::source::ulog) fields: &'static str,
    pub(in crate::source::ulog) take: fn(&mut Px4, &Sample<'_>),
}

pub(super) const fn topic(
    name: &'static str,
    instances: u8,
    every_us: u64,
    fields: &'static str,
    take: fn(&mut Px4, &Sample<'_>),
) -> Topic {
    Topic { name, instances, every_us, fields, take }
}

#[derive(Clone, Copy, Debug)]
pub(in crate::source::ulog) struct Sample<'a> {
    pub(in crate::source::ulog) at: Instant,
    /// Microseconds since the autopilot's boot.
    pub(in crate::source::ulog) recorded_us: u64,
    /// A value from before the log, or long before the latest message.
    pub(in crate::source::ulog) is_old: bool,
    pub(in crate::source::ulog) instance: u8,
    pub(in crate::source::ulog) fields: Fields<'a>,
}

pub(in crate::source::ulog) const ARGUMENTS: usize = 8;

#[derive(Clone, Debug, PartialEq)]
pub(in crate::source::ulog) enum Report {
    Observation(Observation),
    Text {
        severity: u8,
        words: String,
    },
    Event {
        number: u32,
        severity: u8,
        arguments: [u8; ARGUMENTS],
        is_old: bool,
    },
    Mode {
        number: u32,
        name: Option<&'static str>,
    },
    Utc {
        utc_us: u64,
        recorded_us: u64,
    },
    /// Reasons; empty without a failsafe.
    Failsafes(String),
}

/// Interval of a fast topic: the monitor's step (`hums_core::monitor::TICK`), and the board's rate of `HIGHRES_IMU`.
pub(super) const FAST_US: u64 = 50_000;
/// Interval of slow values; the board requests 1 to 5 a second.
pub(super) const MEDIUM_US: u64 = 100_000;

#[derive(Debug, Default)]
pub(in crate::source::ulog) struct Px4 {
    /// Outputs of the last messages, to be handed on.
    pub(in crate::source::ulog) reports: Vec<Report>,
    pub(super) system: System,
    pub(super) motion: Motion,
    pub(super) power: Power,
    pub(super) receivers: Receivers,
    pub(super) repeated_us: Option<u64>,
}

impl Px4 {
    pub(in crate::source::ulog) fn source(&self) -> Source {
        Source { system: self.system.number.unwrap_or(1), component: 1 }
    }

    pub(super) fn observe(&mut self, observation: Observation) {
        self.reports.push(Report::Observation(observation));
    }
}

#[derive(Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "flags of several topics, none a state of the others")]
pub(super) struct System {
    /// `MAV_SYS_ID`.
    pub(super) number: Option<u8>,
    pub(super) type_number: Option<u8>,
    /// 0 unknown.
    pub(super) release: u32,
    pub(super) status: Option<Status>,
    /// `actuator_armed`: motors are forced off.
    pub(super) stopped: bool,
    pub(super) terminated: bool,
    pub(super) auto: bool,
    pub(super) setpoint: Option<u8>,
    pub(super) landed: Option<bool>,
    pub(super) told_mode: Option<u32>,
    pub(super) told_identity: bool,
    pub(super) failsafes: String,
    pub(super) told_failsafes: String,
    pub(super) reached: Option<i64>,
    /// UTC less the time since boot, from a receiver.
    pub(super) utc_offset_us: Option<u64>,
}

/// `vehicle_status`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Status {
    pub(super) arming: u8,
    pub(super) nav: u8,
    /// The mode requested by the pilot, since v1.14.
    pub(super) meant: Option<u8>,
    pub(super) failsafe: bool,
    pub(super) type_number: u8,
    pub(super) hil: bool,
    pub(super) calibrating: bool,
    pub(super) sensors: Option<Sensors>,
}

/// State of motion.
#[derive(Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "which topics a log has, none a state of the others")]
pub(super) struct Motion {
    pub(super) combined: bool,
    /// Last handed on, microseconds.
    pub(super) force_us: Option<u64>,
    pub(super) rate: Option<[f32; 3]>,
    /// Setpoints of roll and pitch, and when, microseconds.
    pub(super) rates_wanted: Option<(u64, [RadiansPerSecond; 3])>,
    /// Fields by compass, until an inertial sensor's observation takes it along.
    pub(super) fields: [Option<[Gauss; 3]>; 3],
    pub(super) local: Option<Local>,
    pub(super) home: Option<Home>,
    pub(super) pressure_altitude: Option<f32>,
    pub(super) airspeed: Option<f32>,
    pub(super) airspeed_validated: bool,
    pub(super) thrust: [Option<f32>; 2],
    pub(super) motors: Option<f32>,
    pub(super) estimator_status: bool,
    /// Flags as far as `estimator_status_flags` has them.
    pub(super) estimator_flags: u16,
    pub(super) estimator: u8,
    pub(super) accelerometer: Option<u64>,
    pub(super) clips: [u32; 3],
    pub(super) imu_status: bool,
}

impl Motion {
    pub(super) fn set_thrust(&mut self, group: u8, thrust: Option<f32>) {
        if let Some(place) = self.thrust.get_mut(usize::from(group)) {
            *place = thrust.filter(|thrust| thrust.is_finite());
        }
    }
}

/// `vehicle_local_position`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    pub(super) z: Option<f32>,
    pub(super) velocity: [f32; 3],
    /// Above mean sea level.
    pub(super) altitude: Option<f32>,
}

/// `home_position`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Home {
    pub(super) altitude: Option<f32>,
    pub(super) z: Option<f32>,
}

/// PX4's instances.
pub(super) const BATTERIES_MAX: usize = 4;

/// State of power.
#[derive(Debug, Default)]
pub(super) struct Power {
    pub(super) batteries: [Option<Pack>; BATTERIES_MAX],
    pub(super) load: Option<f32>,
    /// The processor's load sets the rate of `SYS_STATUS`.
    pub(super) has_load: bool,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Pack {
    pub(super) voltage: Option<Volts>,
    pub(super) current: Option<Amperes>,
    pub(super) remaining: Option<Fraction>,
}

/// Receivers that serve.
pub(super) const RECEIVERS_MAX: usize = 2;
#[derive(Debug, Default)]
pub(super) struct Receivers {
    /// Messages of the receivers themselves.
    pub(super) sensors: bool,
    /// Time of each one's last message.
    pub(super) heard: [Option<Instant>; RECEIVERS_MAX],
    pub(super) told_utc: bool,
}
