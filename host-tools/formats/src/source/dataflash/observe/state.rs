//! State for later messages: a MAVLink message comes from several of the log's, or from events alone.

use hums_core::clock::{Instant, Span};
use hums_core::observation::{
    Autopilot, AutopilotIdentity, Battery, CELLS_MAX, CellVoltage, Heartbeat, LandedState, Observation,
    Sensors, SystemStatus, VehicleKind, VtolState,
};
use hums_core::units::{Amperes, Fraction, Gauss, Metres, RadiansPerSecond, Volts};

use super::arming::{Arming, Word};
use super::out::Out;
use super::words::{self, Craft, name_and_version};
use crate::source::dataflash::format::Format;
use crate::source::item::FactKind;

/// The log has only changes; `HEARTBEAT` and `SYS_STATUS` come at 1 Hz or faster.
const SAID_EVERY: Span = Span::from_millis(500);
/// Older values are not repeated.
const AGE: Span = Span::from_secs(12);
/// Receivers, batteries and sensors.
pub(super) const INSTANCES: usize = 4;

#[derive(Clone, Copy, Debug)]
pub(super) struct Dated<T>(Option<(Instant, T)>);

impl<T> Default for Dated<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T: Copy> Dated<T> {
    pub(super) fn set(&mut self, at: Instant, value: T) {
        self.0 = Some((at, value));
    }

    pub(super) fn within(&self, now: Instant, age: Span) -> Option<T> {
        self.0.filter(|(at, _)| now.since(*at) <= age).map(|(_, value)| value)
    }
}

/// Body rates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rates {
    /// Setpoints of roll, pitch, yaw.
    pub(super) wanted: [RadiansPerSecond; 3],
    /// Measured roll, pitch, yaw.
    pub(super) flown: [RadiansPerSecond; 3],
}

/// Samples that agree with degrees a second, less those with hundredths.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RateUnit(i8);

impl RateUnit {
    pub(super) fn take(&mut self, logged: f32, gyro_dps: f32) {
        /// Slower turns do not count.
        const TURNS_DPS: f32 = 10.0;
        let ratio = logged / gyro_dps;
        let vote = match (gyro_dps > TURNS_DPS, ratio) {
            (true, 0.3..3.0) => 1,
            (true, 30.0..300.0) => -1,
            _ => 0,
        };
        self.0 = self.0.saturating_add(vote);
    }

    /// Degrees a second.
    pub(super) const fn degrees(self) -> Option<f32> {
        const SURE: i8 = 5;
        match self.0 {
            SURE.. => Some(1.0),
            votes if votes <= -SURE => Some(0.01),
            _ => None,
        }
    }
}

/// The messages that report arming.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum ToldArming {
    /// Nowhere, as far as the file is known.
    #[default]
    Nowhere,
    /// A value in the file's first part; the first message's value.
    First(bool),
    /// Before the last power-on that the file holds.
    Before,
}

/// Found in the first part of a file, so known from the first message on.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::source::dataflash) struct Facts {
    /// Kind of firmware.
    pub(super) craft: Craft,
    /// `FRAME_CLASS`
    pub(super) frame_class: Option<u8>,
    /// Motors by `MOT`, without `FRAME_CLASS`.
    pub(super) motors: Option<u8>,
    /// `Q_ENABLE` or `Q_AVAILABLE`.
    pub(super) quadplane: bool,
    /// `Q_MAV_TYPE`
    pub(super) quadplane_type: u8,
    /// `LOG_DISARMED`.
    pub(super) logs_disarmed: Option<bool>,
    /// `RSSI_TYPE`.
    pub(super) has_rssi: bool,
    /// `BATTn_CAPACITY`, mAh.
    pub(super) capacity_mah: [Option<f32>; INSTANCES],
    /// `AHRS_EKF_TYPE`: 2 or 3; 0 without a filter.
    pub(super) estimator: Option<u8>,
    pub(super) version: u32,
    /// POS is logged.
    pub(super) has_positions: bool,
    pub(super) told_arming: ToldArming,
}

impl Facts {
    /// Degrees a second; `None` for an unknown or development version of the time of the change.
    pub(super) fn rate_unit_deg(&self) -> Option<f32> {
        const DEGREES_SINCE: u32 = 0x0304_0000;
        (self.version > 0 && self.version != DEGREES_SINCE).then_some(if self.version < DEGREES_SINCE {
            0.01
        } else {
            1.0
        })
    }
}

#[derive(Debug, Default)]
pub(in crate::source::dataflash) struct State {
    pub(super) facts: Facts,
    /// Its version is known, from VER or a text.
    pub(super) identified: bool,
    /// Handed on.
    told_version: u32,
    pub(super) arming: Arming,
    pub(super) landed: LandedState,
    pub(super) mode: u32,
    pub(super) failsafes: u64,
    pub(super) load: Dated<f32>,
    pub(super) voltage: Dated<f32>,
    pub(super) current: Dated<f32>,
    pub(super) remaining: Dated<f32>,
    /// `MAV_SYS_STATUS_SENSOR` bits by instance, from the sensors' own flags.
    pub(super) unhealthy: [u32; INSTANCES],
    pub(super) rates: Dated<Rates>,
    /// rad/s; the unit of `RATE` by it.
    pub(super) gyro: Dated<f32>,
    pub(super) rate_unit: RateUnit,
    /// The last one, and when.
    pub(super) shaken: Option<(u8, Instant)>,
    pub(super) has_inertial: bool,
    /// Accuracy by receiver.
    pub(super) accuracy: [Dated<Metres>; INSTANCES],
    /// Fields by compass, until an inertial sensor's observation takes it along.
    pub(super) fields: [Option<[Gauss; 3]>; INSTANCES],
    /// Estimator's north, east, down.
    pub(super) velocity: Dated<[f32; 3]>,
    /// Receiver's, without an estimator's.
    pub(super) receiver_velocity: Dated<[f32; 3]>,
    pub(super) primary_core: u8,
    pub(super) altitude: Dated<f32>,
    pub(super) baro_height: Dated<f32>,
    pub(super) climb: Dated<f32>,
    /// The estimator's, of CTUN.
    pub(super) told_climb: Dated<f32>,
    pub(super) airspeed: Dated<f32>,
    pub(super) ground_speed: Dated<f32>,
    pub(super) heading_deg: Dated<f32>,
    pub(super) first_altitude: Option<f32>,
    /// Height of home.
    pub(super) home_altitude: Option<f32>,
    pub(super) clips: [u32; 3],
    pub(super) cells: [Dated<[Option<CellVoltage>; CELLS_MAX]>; INSTANCES],
    pub(super) messages_lost: Option<u64>,
    /// Bits so far.
    pub(super) internal_errors: u64,
    /// Lacks its last part, of this number.
    pub(in crate::source::dataflash) open_text: Option<(u64, String)>,
    pub(super) utc_said: Option<Instant>,
    armed_at: Option<Instant>,
    rearms: Rearms,
    said_at: Option<Instant>,
    said: Option<Heartbeat>,
    word_said: Option<Word>,
    failsafes_said: u64,
}

/// Longer than the unjudged time after a gap.
const REARMS: Span = Span::from_millis(1_600);

/// A disarming is inserted although armed again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Rearms {
    #[default]
    No,
    Begins,
    /// Since then.
    Since(Instant),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::source::dataflash) struct Standing {
    arming: Arming,
    landed: LandedState,
    failsafes: u64,
}

impl Standing {
    /// Armed here, not there.
    pub(in crate::source::dataflash) fn arms(&self, before: &Self) -> bool {
        self.arming.armed() == Some(true) && before.arming.armed() != Some(true)
    }
}

impl State {
    pub(in crate::source::dataflash) fn new(facts: Facts) -> Self {
        let mut state = Self { facts, ..Self::default() };
        state.begin();
        state
    }

    pub(in crate::source::dataflash) fn facts(&self) -> Facts {
        let told_arming = match (self.facts.told_arming, self.arming.first_told()) {
            (ToldArming::Nowhere, Some(armed)) => ToldArming::First(armed),
            (known, _) => known,
        };
        Facts { told_arming, ..self.facts }
    }

    /// `ArduCopter` until 3.1 was built for each frame, and logs its motors.
    pub(in crate::source::dataflash) fn define(&mut self, format: &Format) {
        if format.name == "MOT" {
            let motors = format.fields.iter().filter(|field| field.name.starts_with("Mot")).count();
            self.facts.motors = u8::try_from(motors).ok();
        }
    }

    pub(in crate::source::dataflash) fn craft(&self) -> Craft {
        self.facts.craft
    }

    /// The firmware is then known.
    pub(in crate::source::dataflash) fn is_firmware(&mut self, words: &str) -> bool {
        let craft = Craft::of_firmware(words);
        self.facts.craft = craft.unwrap_or(self.facts.craft);
        if let Some(version) = version_of(words).filter(|_| craft.is_some()) {
            self.facts.version = version;
        }
        craft.is_some()
    }

    /// Whether motors may turn, as far as is known.
    pub(in crate::source::dataflash) fn is_armed(&self) -> bool {
        self.arming.armed() == Some(true)
    }

    /// Forgets the state of the same vehicle.
    pub(in crate::source::dataflash) fn restart(&mut self) {
        let mut facts = self.facts();
        if facts.told_arming != ToldArming::Nowhere {
            facts.told_arming = ToldArming::Before;
        }
        *self = Self::new(facts);
    }

    pub(in crate::source::dataflash) fn standing(&self) -> Standing {
        Standing { arming: self.arming, landed: self.landed, failsafes: self.failsafes }
    }

    /// Sets the state from [`State::standing`].
    pub(in crate::source::dataflash) fn stand(&mut self, standing: Standing) {
        Standing { arming: self.arming, landed: self.landed, failsafes: self.failsafes } = standing;
    }

    /// Logged only while armed: begins armed if the first message is a disarming. A logger also begins before
    /// arming, and at an attempt to arm that fails (`AP_Logger`: `LOG_DISARMED` 0).
    fn begin(&mut self) {
        if self.facts.logs_disarmed == Some(false) && self.facts.told_arming == ToldArming::First(false) {
            self.arming.begin_armed();
        }
    }

    /// Armed again long after the last event: the disarming was not logged. It counts as disarmed for a
    /// moment.
    pub(super) fn arm_again(&mut self, at: Instant) {
        /// Newer logs report one arming several times.
        const ONE_ARMING: Span = Span::from_secs(2);
        let before = self.armed_at.replace(at);
        if self.is_armed() && before.is_some_and(|before| at.since(before) > ONE_ARMING) {
            self.rearms = Rearms::Begins;
            self.landed = if self.tells_landing() { LandedState::OnGround } else { self.landed };
        }
    }

    /// A copter's take-off is an event: it is on the ground until then.
    pub(super) fn arm(&mut self, armed: bool) {
        let changes = self.arming.armed() != Some(armed);
        self.arming.tell(armed);
        if changes && self.tells_landing() && self.landed != LandedState::InAir {
            self.landed = LandedState::OnGround;
        }
        if !armed {
            // A battery's failsafe lasts until then.
            self.failsafes = 0;
        }
    }

    /// A message reports that it is on the ground.
    pub(super) fn land(&mut self) {
        if self.tells_landing() {
            self.landed = LandedState::OnGround;
        }
    }

    /// A copter's since 3.1 (`DATA_NOT_LANDED`).
    fn tells_landing(&self) -> bool {
        const SINCE: u32 = 0x0301_0000;
        self.facts.craft.tells_landing() && (self.facts.version == 0 || self.facts.version >= SINCE)
    }

    /// Comes when the motors spool up. In modes that climb by themselves `MAV_LANDED_STATE_TAKEOFF` follows,
    /// with an unknown end.
    pub(super) fn leave_ground(&mut self) {
        const AUTO: u32 = 3;
        const GUIDED: u32 = 4;
        let climbs = matches!(self.mode, AUTO | GUIDED);
        self.landed = if climbs { LandedState::TakingOff } else { LandedState::InAir };
    }

    /// Above home.
    pub(super) fn height(&mut self, metres: f32) {
        /// Well above a reported take-off's height.
        const TAKEN_OFF_M: f32 = 3.0;
        if self.landed == LandedState::TakingOff && metres > TAKEN_OFF_M {
            self.landed = LandedState::InAir;
        }
    }

    /// 0 to 1: evidence of arming.
    pub(super) fn throttle(&mut self, at: Instant, throttle: f32) {
        /// A multicopter idles below a tenth, so does an engine.
        const IDLE: f32 = 0.1;
        self.evidence(at, throttle > IDLE);
    }

    /// m/s over ground: a plane this fast flies, whatever its throttle.
    pub(super) fn speed(&mut self, at: Instant, speed_mps: f32) {
        /// As `hums_core::flight` has it.
        const FLYING_MPS: f32 = 8.0;
        /// Gliding against the wind, still not landed.
        const MOVING_MPS: f32 = 2.0;
        let least_mps = if self.arming.armed() == Some(true) { MOVING_MPS } else { FLYING_MPS };
        if self.facts.craft == Craft::Plane {
            self.evidence(at, speed_mps > least_mps);
        }
    }

    fn evidence(&mut self, at: Instant, runs: bool) {
        // Messages decide if every version reports arming, unless only logged while armed.
        if !self.facts.craft.tells_arming() || self.facts.logs_disarmed == Some(false) {
            self.arming.evidence(at, runs);
        }
    }

    /// Heartbeat, status, landed state.
    pub(in crate::source::dataflash) fn repeat(&mut self, now: Instant, out: &mut Out<'_>) {
        if std::mem::replace(&mut self.failsafes_said, self.failsafes) != self.failsafes {
            out.fact(FactKind::Failsafes, &words::failsafes(self.failsafes));
        }
        self.rearms = match self.rearms {
            Rearms::Begins => Rearms::Since(now),
            Rearms::Since(since) if now.since(since) >= REARMS => Rearms::No,
            same => same,
        };
        let Some(heartbeat) = self.heartbeat() else { return };
        let due = self.said_at.is_none_or(|at| now.since(at) >= SAID_EVERY);
        if !due && self.said == Some(heartbeat) {
            return;
        }
        self.said_at = Some(now);
        self.said = Some(heartbeat);
        let word = self.arming.word();
        // Reported later in the file: not unknown until then.
        let known =
            word == Word::Told || (word == Word::Unknown && self.facts.told_arming != ToldArming::Nowhere);
        if (!known || self.word_said.is_some()) && self.word_said.replace(word) != Some(word) {
            out.fact(FactKind::Arming, word.words());
        }
        out.observe(&Observation::Heartbeat(heartbeat));
        let firmware = self.facts.version;
        if std::mem::replace(&mut self.told_version, firmware) != firmware {
            out.observe(&Observation::Identity(AutopilotIdentity { firmware, uid: 0 }));
        }
        if self.landed != LandedState::Unknown {
            out.observe(&Observation::Landed(self.landed, VtolState::Unknown));
        }
        if let Some(status) = self.status(now) {
            out.observe(&Observation::SystemStatus(status));
        }
    }

    fn heartbeat(&self) -> Option<Heartbeat> {
        /// `MAV_AUTOPILOT_ARDUPILOTMEGA`
        const ARDUPILOT: u8 = 3;
        const STANDBY: u8 = 3;
        const ACTIVE: u8 = 4;
        const CRITICAL: u8 = 5;
        let (kind, type_number) = self.kind()?;
        let armed = self.is_armed() && self.rearms == Rearms::No;
        let stands = self.landed == LandedState::OnGround || !armed;
        let state = match (self.failsafes, stands) {
            (1.., _) => CRITICAL,
            (_, true) => STANDBY,
            (_, false) => ACTIVE,
        };
        Some(Heartbeat {
            autopilot: Autopilot::ArduPilot,
            autopilot_number: ARDUPILOT,
            kind,
            type_number,
            armed,
            state,
            mode: self.mode,
        })
    }

    fn kind(&self) -> Option<(VehicleKind, u8)> {
        let Facts { craft, frame_class, motors, quadplane, quadplane_type, .. } = self.facts;
        Some(match craft {
            Craft::Unknown => (VehicleKind::Other, 0),
            Craft::Copter => {
                (VehicleKind::Rotorcraft, frame_class.map_or_else(|| type_with(motors), copter_type))
            }
            Craft::Heli => (VehicleKind::Rotorcraft, 4),
            Craft::Plane if quadplane && quadplane_type > 1 => (VehicleKind::Vtol, quadplane_type),
            // `MAV_TYPE_VTOL_FIXEDROTOR`
            Craft::Plane if quadplane => (VehicleKind::Vtol, 22),
            Craft::Plane => (VehicleKind::Plane, 1),
            Craft::Rover if frame_class == Some(2) => (VehicleKind::Surface, 11),
            Craft::Rover => (VehicleKind::Surface, 10),
            Craft::Sub => (VehicleKind::Surface, 12),
            Craft::Blimp => (VehicleKind::Other, 7),
            Craft::Tracker => return None,
        })
    }

    fn status(&self, now: Instant) -> Option<SystemStatus> {
        let load = self.load.within(now, AGE).map(Fraction);
        let voltage = self.voltage.within(now, AGE).map(Volts);
        let unhealthy = self.unhealthy.iter().fold(0, |all, bits| all | bits);
        if load.is_none() && voltage.is_none() && unhealthy == 0 {
            return None;
        }
        Some(SystemStatus {
            load,
            voltage,
            current: self.current.within(now, AGE).map(Amperes),
            remaining: self.remaining.within(now, AGE).map(Fraction),
            sensors: Some(Sensors::of(u32::MAX, u32::MAX, !unhealthy)),
        })
    }

    /// `bit` of `MAV_SYS_STATUS_SENSOR`.
    pub(super) fn health(&mut self, instance: u8, bit: u32, healthy: Option<f32>) {
        if let (Some(bits), Some(healthy)) = (self.unhealthy.get_mut(usize::from(instance)), healthy) {
            *bits = if healthy == 0.0 { *bits | bit } else { *bits & !bit };
        }
    }

    /// Recent ones.
    pub(super) fn cells_of(&self, now: Instant, id: u8) -> [Option<CellVoltage>; CELLS_MAX] {
        let known = self.cells.get(usize::from(id)).and_then(|cells| cells.within(now, Span::from_secs(3)));
        known.unwrap_or(Battery::default().cells)
    }
}

/// Most have four.
const fn type_with(motors: Option<u8>) -> u8 {
    match motors {
        Some(3) => 15,
        Some(6) => 13,
        Some(8) => 14,
        _ => 2,
    }
}

/// `MAV_TYPE` of a copter's `FRAME_CLASS` (`AP_Motors_Class.h`).
const fn copter_type(frame_class: u8) -> u8 {
    match frame_class {
        // Hexa and Y6.
        2 | 5 => 13,
        3 | 4 => 14,
        // The single, dual and quad helicopters.
        6 | 11 | 13 => 4,
        7 => 15,
        // Single and coaxial copter.
        8 | 9 => 3,
        12 => 29,
        14 => 35,
        _ => 2,
    }
}

/// `ArduCopter V4.6.3 (92b0cd78)`; official if the numbers end it.
pub(super) fn version_of(words: &str) -> Option<u32> {
    /// `FIRMWARE_VERSION_TYPE_OFFICIAL`
    const OFFICIAL: u32 = 255;
    let (_, version) = name_and_version(words)?;
    let number = version.split(' ').next()?;
    let (numbers, official) =
        match number.find(|character: char| !(character.is_ascii_digit() || character == '.')) {
            Some(at) => (number.get(..at)?, 0),
            None => (number, OFFICIAL),
        };
    let mut parts = numbers.split('.').map(|part| part.parse::<u8>().unwrap_or(0));
    let mut next = || u32::from(parts.next().unwrap_or(0));
    Some(next() << 24 | next() << 16 | next() << 8 | official)
}
