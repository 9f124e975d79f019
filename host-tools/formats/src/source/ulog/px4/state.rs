//! State from topics that other messages need.

use hums_core::clock::Instant;
use hums_core::observation::{Observation, Sensors, Source};
use hums_core::units::{Amperes, Fraction, Gauss, RadiansPerSecond, Volts};

use super::super::fields::Fields;

/// A topic that becomes observations.
#[derive(Debug)]
pub(in crate::source::ulog) struct Topic {
    pub(in crate::source::ulog) name: &'static str,
    /// Number of its instances in use.
    pub(in crate::source::ulog) instances: u8,
    /// The least time between two messages that serve, microseconds.
    pub(in crate::source::ulog) every_us: u64,
    /// The fields that are needed, of all versions, with spaces between.
    pub(in crate::source::ulog) fields: &'static str,
    pub(in crate::source::ulog) take: fn(&mut Px4, &Sample<'_>),
}

/// A row of a table of topics.
pub(super) const fn topic(
    name: &'static str,
    instances: u8,
    every_us: u64,
    fields: &'static str,
    take: fn(&mut Px4, &Sample<'_>),
) -> Topic {
    Topic { name, instances, every_us, fields, take }
}

/// A message of a topic.
#[derive(Clone, Copy, Debug)]
pub(in crate::source::ulog) struct Sample<'a> {
    pub(in crate::source::ulog) at: Instant,
    /// Microseconds since the autopilot's boot.
    pub(in crate::source::ulog) recorded_us: u64,
    /// The value is from before the log, or from long before the latest message.
    pub(in crate::source::ulog) is_old: bool,
    pub(in crate::source::ulog) instance: u8,
    pub(in crate::source::ulog) fields: Fields<'a>,
}

/// Bytes of an event's arguments that are looked at.
pub(in crate::source::ulog) const ARGUMENTS: usize = 8;

/// An output of the mapping.
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
    /// Names of the failsafe's reasons; empty without a failsafe.
    Failsafes(String),
}

/// The least time between two messages of a fast topic: the monitor's own step (`hums_core::monitor::TICK`), and the rate
/// at which the board asks for `HIGHRES_IMU`.
pub(super) const FAST_US: u64 = 50_000;
/// The same for slow values; the board requests them at 1 to 5 a second.
pub(super) const MEDIUM_US: u64 = 100_000;

/// State of the vehicle that other messages need.
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
    /// The vehicle's number, and the autopilot's of its components.
    pub(in crate::source::ulog) fn source(&self) -> Source {
        Source { system: self.system.number.unwrap_or(1), component: 1 }
    }

    pub(super) fn observe(&mut self, observation: Observation) {
        self.reports.push(Report::Observation(observation));
    }
}

/// State of the autopilot itself.
#[derive(Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "flags of several topics, none a state of the others")]
pub(super) struct System {
    /// `MAV_SYS_ID`.
    pub(super) number: Option<u8>,
    /// `MAV_TYPE`, for logs without a type in `vehicle_status`.
    pub(super) type_number: Option<u8>,
    /// `COM_FLIGHT_UUID`
    pub(super) flight: Option<u64>,
    /// The firmware's version, 0 not known.
    pub(super) release: u32,
    pub(super) status: Option<Status>,
    /// `actuator_armed`: the motors are forced off.
    pub(super) stopped: bool,
    pub(super) terminated: bool,
    pub(super) auto: bool,
    pub(super) setpoint: Option<u8>,
    pub(super) landed: Option<bool>,
    pub(super) told_mode: Option<u32>,
    pub(super) told_identity: bool,
    /// The flags of `failsafe_flags` that are set, by name.
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
    pub(super) takeoff_us: Option<u64>,
    pub(super) sensors: Option<Sensors>,
}

/// State of motion.
#[derive(Debug, Default)]
#[expect(clippy::struct_excessive_bools, reason = "which topics a log has, none a state of the others")]
pub(super) struct Motion {
    pub(super) combined: bool,
    /// When a specific force was handed on last, microseconds.
    pub(super) force_us: Option<u64>,
    pub(super) rate: Option<[f32; 3]>,
    /// The body rates that are wanted, about roll and pitch, and when, microseconds.
    pub(super) rates_wanted: Option<(u64, [RadiansPerSecond; 3])>,
    /// Last measurement of each compass, until an inertial sensor's observation takes it along.
    pub(super) fields: [Option<[Gauss; 3]>; 3],
    pub(super) local: Option<Local>,
    pub(super) home: Option<Home>,
    pub(super) pressure_altitude: Option<f32>,
    pub(super) airspeed: Option<f32>,
    pub(super) airspeed_validated: bool,
    pub(super) thrust: [Option<f32>; 2],
    /// Motor outputs, if the log has no thrust setpoint.
    pub(super) motors: Option<f32>,
    /// The log has `estimator_status`.
    pub(super) estimator_status: bool,
    /// `ESTIMATOR_STATUS_FLAGS`, as far as `estimator_status_flags` has them.
    pub(super) estimator_flags: u16,
    /// The estimator that flies.
    pub(super) estimator: u8,
    /// The accelerometer that flies.
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

/// Batteries that serve: as many as PX4 has instances.
pub(super) const BATTERIES_MAX: usize = 4;

/// State of power.
#[derive(Debug, Default)]
pub(super) struct Power {
    pub(super) batteries: [Option<Pack>; BATTERIES_MAX],
    pub(super) load: Option<f32>,
    /// Whether the log has the processor's load, which sets the rate of `SYS_STATUS`.
    pub(super) has_load: bool,
}

/// Values of a battery that `SYS_STATUS` repeats.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pack {
    pub(super) voltage: Option<Volts>,
    pub(super) current: Option<Amperes>,
    pub(super) remaining: Option<Fraction>,
}

/// Receivers that serve.
pub(super) const RECEIVERS_MAX: usize = 2;
/// State of the receivers.
#[derive(Debug, Default)]
pub(super) struct Receivers {
    /// There are messages of the receivers themselves.
    pub(super) sensors: bool,
    /// Time of each one's last message.
    pub(super) heard: [Option<Instant>; RECEIVERS_MAX],
    pub(super) told_utc: bool,
}
