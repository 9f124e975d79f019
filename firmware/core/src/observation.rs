//! Observations of a vehicle, in one model for PX4 and `ArduPilot`: SI units, `None` where the sender did not know.
//!
//! The link crate makes them from MAVLink messages. It resolves every trap of that format: scales, "unknown" values,
//! extension fields that read as zero. Nothing behind it depends on a value's source, except a few quantities that
//! the two autopilots define differently ([`VibrationScale`], [`EstimatorScale`]).

use core::num::{NonZeroU16, NonZeroU32};

use crate::cause::{Alert, Causes};
use crate::units::{
    AmpereHours, Amperes, Celsius, Fraction, Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2,
    Position, Radians, RadiansPerSecond, Rpm, Volts,
};

/// Motors of one vehicle at most: a dodecacopter.
pub const MOTORS_MAX: usize = 12;
/// Cells of one battery at most: what `BATTERY_STATUS` holds.
pub const CELLS_MAX: usize = 14;
/// Motors in one ESC message.
pub const ESC_GROUP: usize = 4;

/// Our own component id on the vehicle's system: `MAV_COMP_ID_ONBOARD_COMPUTER`.
pub const OUR_COMPONENT: u8 = 191;

/// The sender of a message: MAVLink system and component id.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Source {
    /// System id: the vehicle.
    pub system: u8,
    /// Component id: which part of it.
    pub component: u8,
}

/// The firmware of an autopilot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Autopilot {
    /// `MAV_AUTOPILOT_ARDUPILOTMEGA`
    ArduPilot,
    /// `MAV_AUTOPILOT_PX4`
    Px4,
    /// Some other autopilot.
    #[default]
    Other,
}

/// What kind of vehicle it is, as far as flight detection and limits care.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VehicleKind {
    /// Hovers on rotors.
    Rotorcraft,
    /// Flies on wings.
    Plane,
    /// Both.
    Vtol,
    /// Does not fly: rover, boat, submarine.
    Surface,
    /// Anything else.
    #[default]
    Other,
}

/// A heartbeat of an autopilot (heartbeats of ground stations, gimbals and companions are not observations).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Heartbeat {
    /// Who made the autopilot.
    pub autopilot: Autopilot,
    /// `MAV_AUTOPILOT` as sent.
    pub autopilot_number: u8,
    /// What it flies.
    pub kind: VehicleKind,
    /// `MAV_TYPE` as sent.
    pub type_number: u8,
    /// Motors may turn.
    pub armed: bool,
    /// `MAV_STATE` as sent: 3 standby, 4 active, 5 critical, 6 emergency.
    pub state: u8,
    /// The autopilot's own mode number.
    pub mode: u32,
}

impl Heartbeat {
    /// `MAV_STATE_FLIGHT_TERMINATION`: also what a pilot's kill switch makes of a PX4 that is armed.
    pub const TERMINATED: u8 = 8;
}

state! {
    /// The autopilot's processor and its idea of the (first) battery: `SYS_STATUS`.
    pub struct SystemStatus {
        /// Load of the autopilot's processor.
        pub load: Option<Fraction>,
        /// Battery voltage.
        pub voltage: Option<Volts>,
        /// Battery current; negative charges.
        pub current: Option<Amperes>,
        /// Remaining charge of the battery.
        pub remaining: Option<Fraction>,
        /// Health of the sensors; `None` if it is not reported (a log of PX4 since v1.14).
        pub sensors: Option<Sensors>,
    }

    /// Sensors by their health, as `MAV_SYS_STATUS_SENSOR` bits.
    #[derive(Eq)]
    pub struct Sensors {
        /// Present, enabled and not healthy.
        pub unhealthy: u32,
        /// Enabled, not healthy and not present: PX4 says so of a sensor that it lost, and of one that it never had.
        pub lost: u32,
        /// Present and healthy.
        pub healthy: u32,
    }
}

impl Sensors {
    /// Sensors by the three fields of `SYS_STATUS`.
    pub const fn of(present: u32, enabled: u32, health: u32) -> Self {
        let bad = enabled & !health;
        Self { unhealthy: bad & present, lost: bad & !present, healthy: present & health }
    }
}

state! {
    /// Time: `SYSTEM_TIME`.
    #[derive(Eq)]
    pub struct SystemTime {
        /// UTC in microseconds since 1970, when the autopilot knows it.
        pub utc_micros: Option<u64>,
        /// Milliseconds since the autopilot's boot.
        pub boot_ms: u32,
    }

    /// One GNSS receiver.
    pub struct Gnss {
        /// Receiver, from 0.
        pub instance: u8,
        /// `GPS_FIX_TYPE`: 0 and 1 none, 2 2D, 3 3D, 4 and more better than that.
        pub fix: u8,
        /// Satellites in use.
        pub satellites: Option<u8>,
        /// Horizontal dilution of precision.
        pub hdop: Option<f32>,
        /// Horizontal accuracy (1 sigma).
        pub accuracy: Option<Metres>,
        /// The position, with a fix.
        pub position: Option<Position>,
        /// Above mean sea level.
        pub altitude: Option<Metres>,
        /// Ground speed.
        pub speed: Option<MetresPerSecond>,
        /// The direction of that, from north, clockwise.
        pub course: Option<Radians>,
        /// When that was measured, by the receiver's clock or when the autopilot took it: milliseconds modulo 2^32, from any beginning.
        pub measured_ms: Option<NonZeroU32>,
    }
}

impl Gnss {
    /// Whether the fix is 3D and exact enough to check other sensors against. Reported accuracy and dilution are
    /// within the limits of PX4 (`EKF2_REQ_EPH` 3 m, `EKF2_REQ_PDOP` 2.5).
    pub fn is_exact(&self) -> bool {
        self.fix >= 3
            && self.accuracy.is_none_or(|accuracy| accuracy.0 <= 3.0)
            && self.hdop.is_none_or(|hdop| hdop <= 2.5)
    }
}

state! {
    /// Interference that a GNSS receiver reports.
    pub struct GnssIntegrity {
        /// Receiver, from 0.
        pub instance: u8,
        /// Jamming: 0 unknown, 1 none, 2 mitigated, 3 detected (`GPS_JAMMING_STATE`).
        pub jamming: u8,
        /// Spoofing: 0 unknown, 1 none, 2 mitigated, 3 detected (`GPS_SPOOFING_STATE`).
        pub spoofing: u8,
    }

    /// One inertial sensor, body axes forward, right, down.
    pub struct Imu {
        /// Sensor, from 0.
        pub instance: u8,
        /// Specific force.
        pub acceleration: Option<[MetresPerSecond2; 3]>,
        /// Angular rate.
        pub rate: Option<[RadiansPerSecond; 3]>,
        /// Magnetic field, of the compass of the same number.
        pub field: Option<[Gauss; 3]>,
        /// The sensor's temperature.
        pub temperature: Option<Celsius>,
    }

    /// The air outside.
    pub struct Air {
        /// Barometer, from 0.
        pub instance: u8,
        /// Static pressure.
        pub pressure: Option<Hectopascals>,
        /// The barometer's temperature.
        pub temperature: Option<Celsius>,
    }

    /// Attitude, Tait-Bryan angles.
    pub struct Attitude {
        /// Right wing down is positive.
        pub roll: Radians,
        /// Nose up is positive.
        pub pitch: Radians,
        /// From north, clockwise.
        pub yaw: Radians,
        /// Angular rates about the body's axes, if they are reported.
        pub rates: Option<[RadiansPerSecond; 3]>,
        /// Milliseconds since the autopilot's boot. Every autopilot sends it here; `SYSTEM_TIME` only some do.
        pub boot_ms: Option<u32>,
    }
}

impl Attitude {
    /// The greater one of roll and pitch, without its sign.
    pub(crate) fn lean_rad(&self) -> f32 {
        libm::fabsf(self.roll.0).max(libm::fabsf(self.pitch.0))
    }
}

state! {
    /// What an estimator says that flies beside the one that is used: `ArduPilot`'s DCM where an EKF is used, an EKF where DCM is.
    pub struct SecondEstimate {
        /// Roll, pitch and yaw, as in [`Attitude`].
        pub attitude: Option<[Radians; 3]>,
        /// Where it is.
        pub position: Option<Position>,
        /// Above mean sea level.
        pub altitude: Option<Metres>,
    }

    /// The attitude that the autopilot demands, for its mission, its own loops or the pilot's sticks.
    pub struct AttitudeSetpoint {
        /// Right wing down is positive.
        pub roll: Radians,
        /// Nose up is positive.
        pub pitch: Radians,
        /// The demanded rates, if they are reported.
        pub rates: Option<WantedRates>,
    }
}

/// The rates that the autopilot wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WantedRates {
    /// About roll, pitch and yaw.
    pub about: [RadiansPerSecond; 3],
    /// The demanded attitude, as a quaternion from the demanded body to north, east, down, real part first. It is
    /// present if the rates may be about its axes. `ArduPilot`'s are
    /// (`AC_AttitudeControl::get_attitude_target_ang_vel`); PX4's (`vehicle_rates_setpoint`) are about the body's.
    pub of: Option<[f32; 4]>,
}

impl AttitudeSetpoint {
    /// Of the quaternion of a rotation from north, east, down to the body, its real part first; `None` where it is none.
    pub fn from_quaternion([w, x, y, z]: [f32; 4]) -> Option<Self> {
        let norm = w * w + x * x + y * y + z * z;
        // Zeros come before the first attitude. NaN does not count either.
        if !(0.9..1.1).contains(&norm) {
            return None;
        }
        let roll = libm::atan2f(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
        let pitch = libm::asinf((2.0 * (w * y - z * x)).clamp(-1.0, 1.0));
        Some(Self { roll: Radians(roll), pitch: Radians(pitch), rates: None })
    }
}

state! {
    /// Position and velocity from the local origin, north, east, down.
    pub struct LocalPosition {
        /// From the origin.
        pub position: [Metres; 3],
        /// Over ground.
        pub velocity: [MetresPerSecond; 3],
    }

    /// Outputs to motors and servos: pulses of `SERVO_OUTPUT_RAW`.
    #[derive(Eq)]
    pub struct Outputs {
        /// Which group: 0 the main outputs, 1 the auxiliary ones.
        pub port: u8,
        /// Microseconds, from the first output on; 0 where there is none.
        pub pulses: [u16; MOTORS_MAX],
    }

    /// The fused global position.
    pub struct GlobalPosition {
        /// The position, once the autopilot knows it.
        pub position: Option<Position>,
        /// Above mean sea level.
        pub altitude: Metres,
        /// Above home.
        pub relative_altitude: Metres,
        /// North, east, down.
        pub velocity: [MetresPerSecond; 3],
    }

    /// The values of a pilot's display.
    pub struct Hud {
        /// Through the air.
        pub airspeed: Option<MetresPerSecond>,
        /// Over ground.
        pub groundspeed: Option<MetresPerSecond>,
        /// 0 to 360 degrees, 0 is north.
        pub heading_deg: Option<f32>,
        /// Throttle.
        pub throttle: Option<Fraction>,
        /// Above mean sea level (ArduPilot copters: see its parameters).
        pub altitude: Option<Metres>,
        /// Up is positive.
        pub climb: Option<MetresPerSecond>,
    }

    /// The pilot's radio control.
    pub struct RadioControl {
        /// Signal strength on the device's scale, 0 to 254.
        pub rssi: Option<u8>,
    }

    /// A telemetry radio's own report, in the device's units.
    pub struct TelemetryRadio {
        /// Signal strength here.
        pub rssi: Option<u8>,
        /// Signal strength at the other end.
        pub remote_rssi: Option<u8>,
        /// Noise here.
        pub noise: Option<u8>,
        /// Noise at the other end.
        pub remote_noise: Option<u8>,
        /// Errors since its start.
        pub errors: u16,
    }

    /// The autopilot's rails.
    pub struct Rails {
        /// The 5 V rail.
        pub vcc: Option<Volts>,
        /// The servo rail.
        pub servo: Option<Volts>,
    }

    /// One battery.
    pub struct Battery {
        /// Which one.
        pub id: u8,
        /// Voltage of each cell, if the battery measures them.
        pub cells: [Option<CellVoltage>; CELLS_MAX],
        /// Of the whole battery.
        pub voltage: Option<Volts>,
        /// Negative charges.
        pub current: Option<Amperes>,
        /// Charge taken since the start.
        pub consumed: Option<AmpereHours>,
        /// What is left.
        pub remaining: Option<Fraction>,
        /// Of the battery.
        pub temperature: Option<Celsius>,
        /// `MAV_BATTERY_FAULT` bits.
        pub faults: u32,
        /// Lithium polymer or lithium ion, or unknown: the limits of a cell's voltage are for these.
        pub lithium: bool = true,
        /// What it feeds.
        pub feeds: Feeds = Feeds::Unsaid,
        /// Charge state by the autopilot: `MAV_BATTERY_CHARGE_STATE` (0 not said, 1 ok, 2 low, 3 critical, 4 emergency, 5
        /// failed, 6 unhealthy, 7 charging).
        pub charge: u8,
    }
}

/// The voltage of a cell in whole millivolts, as in messages: two bytes each, for [`CELLS_MAX`] cells of each
/// battery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CellVoltage(NonZeroU16);

impl CellVoltage {
    /// `None` of 0.
    pub fn from_millivolts(millivolts: u16) -> Option<Self> {
        NonZeroU16::new(millivolts).map(Self)
    }

    /// The voltage in volts.
    pub fn volts(self) -> Volts {
        Volts(f32::from(self.0.get()) / 1e3)
    }
}

/// The consumer of a battery: `MAV_BATTERY_FUNCTION`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Feeds {
    /// Not said. Of the autopilot's own and of a battery's component that is the vehicle ([`crate::vehicle`]).
    #[default]
    Unsaid,
    /// Motors or everything: the vehicle comes down without it.
    Vehicle,
    /// Avionics only.
    Avionics,
    /// The payload only.
    Payload,
}

impl Battery {
    /// How many cells report a voltage.
    pub fn cells_reported(&self) -> usize {
        self.cells.iter().flatten().count()
    }
}

/// The scale of an estimator's figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EstimatorScale {
    /// ArduPilot: variances, its failsafe acts at 0.8 on two of them.
    #[default]
    Variance,
    /// PX4: innovation test ratios, a sensor is rejected above 1.
    TestRatio,
}

/// How well the estimator believes its sensors: 0 is perfect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimator {
    /// The meaning of the figures.
    pub scale: EstimatorScale,
    /// Velocity.
    pub velocity: Option<f32>,
    /// Horizontal position.
    pub position_horizontal: Option<f32>,
    /// Vertical position.
    pub position_vertical: Option<f32>,
    /// Compass.
    pub compass: Option<f32>,
    /// `ESTIMATOR_STATUS_FLAGS` or `EKF_STATUS_FLAGS`, whose lower bits agree.
    pub flags: u16,
}

/// The scale of a vibration figure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VibrationScale {
    /// ArduPilot: standard deviation of acceleration a body axis, m/s2.
    #[default]
    PerAxis,
    /// PX4: coning metric, gyro high-frequency metric, accelerometer high-frequency metric.
    Px4Metrics,
}

/// Vibration.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vibration {
    /// The meaning of the levels.
    pub scale: VibrationScale,
    /// Three levels.
    pub levels: [Option<f32>; 3],
    /// Clipped samples of three accelerometers since boot.
    pub clips: [u32; 3],
}

impl Vibration {
    /// The greatest level.
    pub fn highest(&self) -> Option<f32> {
        self.levels.into_iter().flatten().reduce(f32::max)
    }

    /// The level of acceleration, m/s2: of the worst axis, or PX4's metric.
    pub(crate) fn acceleration(&self) -> Option<f32> {
        match self.scale {
            VibrationScale::PerAxis => self.highest(),
            VibrationScale::Px4Metrics => self.levels[2],
        }
    }
}

state! {
    /// One motor's ESC; each message fills what it carries.
    pub struct Esc {
        /// Speed; ArduPilot may send electrical speed where the pole count is not set.
        pub rpm: Option<Rpm>,
        /// At the ESC.
        pub voltage: Option<Volts>,
        /// Of the motor.
        pub current: Option<Amperes>,
        /// Of the ESC.
        pub temperature: Option<Celsius>,
        /// `ESC_FAILURE_FLAGS`.
        pub failures: Option<u16>,
        /// Errors since the ESC's start; may wrap.
        pub errors: Option<u32>,
    }

    /// A group of ESCs: motor `first`, `first + 1`, …
    pub struct EscGroup {
        /// Motor number of the first, from 0.
        pub first: u8,
        /// `None` for a motor that does not exist.
        pub escs: [Option<Esc>; ESC_GROUP],
    }

    /// A combustion engine; `None` where the controller does not measure it.
    pub struct Engine {
        /// Whether the controller reports itself healthy.
        pub healthy: bool,
        /// Crankshaft speed.
        pub rpm: Option<Rpm>,
        /// Engine load.
        pub load: Option<Fraction>,
        /// Fuel taken, in the controller's unit (g or cm3).
        pub fuel_consumed: Option<f32>,
        /// Fuel flow, g/min or cm3/min.
        pub fuel_flow: Option<f32>,
        /// Cylinder head.
        pub cylinder_head: Option<Celsius>,
        /// Exhaust gas.
        pub exhaust: Option<Celsius>,
        /// Fuel pressure.
        pub fuel_pressure: Option<Hectopascals>,
    }

    /// The generator of a hybrid drone: `GENERATOR_STATUS`.
    pub struct Generator {
        /// Whether it reports itself switched off.
        pub is_off: bool,
        /// Speed of the generator or alternator.
        pub speed: Option<Rpm>,
    }

    /// A speed sensor: `RPM` or `RAW_RPM`.
    pub struct SpeedSensor {
        /// Sensor, from 0.
        pub index: u8,
        /// Measured speed of rotation.
        pub rpm: Rpm,
    }
}

/// Whether the vehicle is on the ground: `EXTENDED_SYS_STATE`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LandedState {
    /// The autopilot does not know.
    #[default]
    Unknown,
    /// On the ground.
    OnGround,
    /// In the air.
    InAir,
    /// Taking off.
    TakingOff,
    /// Landing.
    Landing,
}

/// The lift of a VTOL: `MAV_VTOL_STATE` of `EXTENDED_SYS_STATE`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum VtolState {
    /// Not said, or no VTOL.
    #[default]
    Unknown,
    /// On its way from rotors to wings or back.
    Transition,
    /// On rotors.
    Hover,
    /// On wings.
    Forward,
}

state! {
    /// The autopilot's processor.
    pub struct Processor {
        /// Its temperature.
        pub temperature: Option<Celsius>,
    }

    /// The identity of an autopilot: `AUTOPILOT_VERSION`.
    #[derive(Eq)]
    pub struct AutopilotIdentity {
        /// Flight firmware version, major, minor, patch, type from the top byte down.
        pub firmware: u32,
        /// The autopilot's unique id, or its longer one folded to 8 bytes; 0 unknown.
        pub uid: u64,
    }

    /// An answer to a command: `COMMAND_ACK`.
    #[derive(Eq)]
    pub struct CommandAck {
        /// `MAV_CMD`.
        pub command: u16,
        /// `MAV_RESULT`.
        pub result: u8,
        /// Whose command it answers; `None` where the sender does not say (MAVLink 1, old firmware).
        pub target: Option<Source>,
    }
}

impl CommandAck {
    /// `MAV_RESULT_ACCEPTED`
    pub const ACCEPTED: u8 = 0;
    /// `MAV_RESULT_TEMPORARILY_REJECTED`: a later command may be accepted.
    pub const TEMPORARILY_REJECTED: u8 = 1;
    /// `MAV_RESULT_DENIED`
    pub const DENIED: u8 = 2;
    /// `MAV_RESULT_UNSUPPORTED`
    pub const UNSUPPORTED: u8 = 3;
    /// `MAV_RESULT_FAILED`
    pub const FAILED: u8 = 4;
    /// `MAV_RESULT_IN_PROGRESS`: another answer follows.
    pub const IN_PROGRESS: u8 = 5;
}

/// The knowledge in one message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Observation {
    /// `HEARTBEAT` of an autopilot.
    Heartbeat(Heartbeat),
    /// `SYS_STATUS`
    SystemStatus(SystemStatus),
    /// `SYSTEM_TIME`
    SystemTime(SystemTime),
    /// `GPS_RAW_INT`, `GPS2_RAW`
    Gnss(Gnss),
    /// `GNSS_INTEGRITY`
    GnssIntegrity(GnssIntegrity),
    /// `SCALED_IMU*`, `RAW_IMU`, `HIGHRES_IMU`
    Imu(Imu),
    /// A specific force that is greater than the samples that are handed on show: of a log that holds more samples, or more sensors.
    Shock(MetresPerSecond2),
    /// `SCALED_PRESSURE*`, `HIGHRES_IMU`
    Air(Air),
    /// `SERVO_OUTPUT_RAW`
    Outputs(Outputs),
    /// `HIGHRES_IMU`: both at once.
    ImuAndAir(Imu, Air),
    /// `ATTITUDE`
    Attitude(Attitude),
    /// `AHRS2`
    SecondEstimate(SecondEstimate),
    /// `ATTITUDE_TARGET`, `NAV_CONTROLLER_OUTPUT`
    AttitudeSetpoint(AttitudeSetpoint),
    /// `POSITION_TARGET_LOCAL_NED`: the climb that the autopilot wants, up is positive.
    ClimbWanted(MetresPerSecond),
    /// `LOCAL_POSITION_NED`
    LocalPosition(LocalPosition),
    /// `GLOBAL_POSITION_INT`
    GlobalPosition(GlobalPosition),
    /// `VFR_HUD`
    Hud(Hud),
    /// `RC_CHANNELS`
    RadioControl(RadioControl),
    /// `RADIO_STATUS`
    TelemetryRadio(TelemetryRadio),
    /// `POWER_STATUS`
    Rails(Rails),
    /// `BATTERY_STATUS`
    Battery(Battery),
    /// `EKF_STATUS_REPORT`, `ESTIMATOR_STATUS`
    Estimator(Estimator),
    /// `VIBRATION`
    Vibration(Vibration),
    /// `ESC_INFO`, `ESC_STATUS`, `ESC_TELEMETRY_*`
    Escs(EscGroup),
    /// `EFI_STATUS`
    Engine(Engine),
    /// `GENERATOR_STATUS`
    Generator(Generator),
    /// `RPM` (two sensors), `RAW_RPM`
    SpeedSensors([Option<SpeedSensor>; 2]),
    /// `EXTENDED_SYS_STATE`
    Landed(LandedState, VtolState),
    /// `MCU_STATUS`
    Processor(Processor),
    /// `AUTOPILOT_VERSION`
    Identity(AutopilotIdentity),
    /// `MISSION_ITEM_REACHED`
    MissionReached(u16),
    /// `COMMAND_ACK`
    CommandAck(CommandAck),
    /// `STATUSTEXT` or `EVENT` that says that something is wrong.
    Alert(Alert),
    /// The failures in a `HIGH_LATENCY2`.
    Failing(Causes),
    /// `PARAM_VALUE` of a parameter that is in [`crate::battery_cells::KNOWN`], by its place there, and its value.
    Parameter(u8, f32),
}

impl Observation {
    /// Whether another component than the autopilot may send it: such a one may be received while the autopilot is not.
    pub const fn may_be_of_another_component(&self) -> bool {
        matches!(
            self,
            Self::TelemetryRadio(_) | Self::Battery(_) | Self::Escs(_) | Self::Engine(_) | Self::Generator(_)
        )
    }
}
