//! The autopilot itself: identity, arming, mode, landed state, texts.

use hums_core::observation::{
    Autopilot, AutopilotIdentity, CommandAck, Heartbeat, LandedState, Observation, RadioControl, Sensors,
    SpeedSensor, SystemTime, TelemetryRadio, VehicleKind, VtolState,
};
use hums_core::units::Rpm;

use super::state::{MEDIUM_US, Px4, Report, Sample, Status, System, Topic, topic};

const VEHICLE_STATUS: &str = "arming_state nav_state failsafe system_type hil_state onboard_control_sensors_present \
    onboard_control_sensors_enabled onboard_control_sensors_health calibration_enabled \
    nav_state_user_intention";
const ACTUATOR_ARMED: &str = "armed lockdown kill termination manual_lockdown force_failsafe";
const FAILSAFE_FLAGS: &str = "manual_control_signal_lost gcs_connection_lost offboard_control_signal_lost battery_warning \
    battery_low_remaining_time battery_unhealthy geofence_breached mission_failure navigator_failure \
    vtol_fixed_wing_system_failure wind_limit_exceeded flight_time_limit_exceeded attitude_invalid \
    angular_velocity_invalid local_position_invalid global_position_invalid local_position_accuracy_low \
    position_accuracy_low fd_critical_failure fd_motor_failure fd_esc_arming_failure fd_imbalanced_prop";

pub(super) const TOPICS: &[Topic] = &[
    topic("vehicle_status", 1, 0, VEHICLE_STATUS, status),
    topic("actuator_armed", 1, 0, ACTUATOR_ARMED, armed),
    topic("vehicle_control_mode", 1, 0, "flag_control_auto_enabled", |px4, sample| {
        px4.system.auto = sample.fields.flag(0);
    }),
    topic("position_setpoint_triplet", 1, 0, "current.valid current.type", |px4, sample| {
        px4.system.setpoint = sample.fields.byte(1).filter(|_| sample.fields.flag(0));
    }),
    topic("failsafe_flags", 1, 0, FAILSAFE_FLAGS, failsafe_flags),
    topic("vehicle_land_detected", 1, 0, "landed", land_detected),
    topic("input_rc", 1, MEDIUM_US, "rssi channel_count", rc),
    topic("radio_status", 1, 0, "rssi remote_rssi noise remote_noise rxerrors", radio),
    topic("telemetry_status", 4, 0, "rssi remote_rssi noise remote_noise rxerrors type", telemetry),
    topic("mission_result", 1, 0, "seq_reached", mission),
    topic("vehicle_command_ack", 4, 0, "command result", ack),
    topic("event", 1, 0, "id log_levels arguments", event),
    topic("log_message", 1, 0, "severity text", log_message),
    topic("rpm", 2, MEDIUM_US, "rpm_estimate indicated_frequency_rpm", rpm),
];

/// Conditions of `failsafe_flags`, in the order above, for people. Flags of unused modes, and those that only prevent arming,
/// are left out.
const FAILSAFES: &str = "manual control,ground station,offboard control,battery,battery time,battery health,fence,\
    mission,navigator,VTOL system,wind,flight time,attitude,angular velocity,local position,\
    global position,position accuracy,position accuracy,attitude failure,motor failure,ESC,\
    propeller";

/// 2 in all versions; 1 is standby, later disarmed.
const ARMED: u8 = 2;
/// `MAV_STATE`.
const STANDBY: u8 = 3;
const ACTIVE: u8 = 4;
const CRITICAL: u8 = 5;
const EMERGENCY: u8 = 6;
const POWEROFF: u8 = 7;
const TERMINATION: u8 = 8;
const CALIBRATING: u8 = 2;

impl System {
    pub(super) fn armed(&self) -> bool {
        self.status.is_some_and(|status| status.arming == ARMED)
    }

    pub(super) fn sensors(&self) -> Option<Sensors> {
        self.status?.sensors
    }

    pub(super) fn utc(&mut self, utc_us: u64, recorded_us: u64) {
        self.utc_offset_us = utc_us.checked_sub(recorded_us);
    }

    pub(super) fn parameter(&mut self, name: &str, value: f64) {
        match name {
            "MAV_SYS_ID" => self.number = Some(value as u8).filter(|number| *number > 0),
            "MAV_TYPE" => self.type_number = Some(value as u8),
            _ => {}
        }
    }

    fn is_offboard(&self) -> bool {
        const OFFBOARD: u8 = 14;
        self.status.is_some_and(|status| status.nav == OFFBOARD || status.meant == Some(OFFBOARD))
    }

    fn heartbeat(&self) -> Option<Heartbeat> {
        let status = self.status?;
        let type_number =
            Some(status.type_number).filter(|&number| number > 0).or(self.type_number).unwrap_or(0);
        Some(Heartbeat {
            autopilot: Autopilot::Px4,
            autopilot_number: 12,
            kind: kind(type_number),
            type_number,
            armed: status.arming == ARMED,
            state: self.state(status),
            mode: custom_mode(status.nav),
        })
    }

    fn state(&self, status: Status) -> u8 {
        if self.terminated || (self.stopped && !status.hil) || status.nav == 13 {
            return TERMINATION;
        }
        if status.nav == 8 {
            return EMERGENCY;
        }
        if status.calibrating {
            return CALIBRATING;
        }
        match status.arming {
            ARMED if status.failsafe => CRITICAL,
            ARMED => ACTIVE,
            1 => STANDBY,
            4 => POWEROFF,
            _ => 0,
        }
    }

    /// `EXTENDED_SYS_STATE`, as in PX4's stream.
    fn landed(&self) -> Option<LandedState> {
        Some(match (self.landed?, self.setpoint.filter(|_| self.auto)) {
            (true, _) => LandedState::OnGround,
            // `SETPOINT_TYPE_TAKEOFF`, `SETPOINT_TYPE_LAND`.
            (false, Some(3)) => LandedState::TakingOff,
            (false, Some(4)) => LandedState::Landing,
            (false, _) => LandedState::InAir,
        })
    }
}

/// The kinds that `hums_link` makes of `MAV_TYPE`.
fn kind(type_number: u8) -> VehicleKind {
    match type_number {
        2 | 3 | 4 | 13 | 14 | 15 | 29 | 35 => VehicleKind::Rotorcraft,
        1 | 16 | 17 | 28 => VehicleKind::Plane,
        19..=25 => VehicleKind::Vtol,
        10..=12 => VehicleKind::Surface,
        _ => VehicleKind::Other,
    }
}

/// `nav_state`, main and sub mode (`px4_custom_mode.h`), name. Numbers 6 to 9 and 16 are of versions before v1.13 (6 is used
/// again since v1.15).
const MODES: [(u8, u8, u8, &str); 31] = [
    (0, 1, 0, "Manual"),
    (1, 2, 0, "Altitude"),
    (2, 3, 0, "Position"),
    (3, 4, 4, "Mission"),
    (4, 4, 3, "Hold"),
    (5, 4, 5, "Return"),
    (6, 3, 2, "Position Slow"),
    (7, 4, 7, "Return to ground station"),
    (8, 4, 6, "Land (engine failure)"),
    (9, 4, 6, "Land (no GPS)"),
    (10, 5, 0, "Acro"),
    (12, 4, 6, "Descend"),
    (13, 1, 0, "Termination"),
    (14, 6, 0, "Offboard"),
    (15, 7, 0, "Stabilized"),
    (16, 8, 0, "Rattitude"),
    (17, 4, 2, "Takeoff"),
    (18, 4, 6, "Land"),
    (19, 4, 8, "Follow"),
    (20, 4, 9, "Precision Land"),
    (21, 3, 1, "Orbit"),
    (22, 4, 10, "VTOL Takeoff"),
    (23, 4, 11, "External 1"),
    (24, 4, 12, "External 2"),
    (25, 4, 13, "External 3"),
    (26, 4, 14, "External 4"),
    (27, 4, 15, "External 5"),
    (28, 4, 16, "External 6"),
    (29, 4, 17, "External 7"),
    (30, 4, 18, "External 8"),
    (11, 0, 0, "Unused"),
];

fn custom_mode(nav: u8) -> u32 {
    let mode = MODES.iter().find(|(number, ..)| *number == nav);
    mode.map_or(0, |&(_, main, sub, _)| u32::from(main) << 16 | u32::from(sub) << 24)
}

/// The `nav_state` of a mode in `HEARTBEAT.custom_mode`. `PX4` sends manual flight also for a termination, a landing for a
/// descent.
pub fn nav_state(mode: u32) -> Option<u8> {
    let mut navs = MODES.iter().map(|(nav, ..)| *nav).filter(|nav| !matches!(nav, 8 | 9 | 12 | 13));
    navs.find(|nav| mode != 0 && custom_mode(*nav) == mode)
}

fn status(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    let bits = |field| Some(fields.count(field)? as u32);
    let sensors = || Some(Sensors::of(bits(5)?, bits(6)?, bits(7)?));
    let before = px4.system.status;
    let status = Status {
        arming: fields.byte(0).unwrap_or(0),
        nav: fields.byte(1).unwrap_or(0),
        failsafe: fields.flag(2),
        type_number: fields.byte(3).unwrap_or(0),
        hil: fields.flag(4),
        sensors: sensors(),
        calibrating: fields.flag(8),
        meant: fields.byte(9),
    };
    px4.system.status = Some(status);
    px4.failsafes();
    // The rest waits for its turn.
    let now = |status: Status| (status.arming, status.nav, status.failsafe);
    if before.is_none_or(|before| now(before) != now(status)) {
        px4.heartbeat();
    }
}

/// Since v1.14. The conditions also hold without a failsafe: reported only in failsafe.
fn failsafe_flags(px4: &mut Px4, sample: &Sample<'_>) {
    // A low battery alone is a warning.
    const BATTERY: &str = "battery";
    const OFFBOARD: &str = "offboard control";
    const CRITICAL: f64 = 2.0;
    let mut names: Vec<&str> = Vec::new();
    for (field, name) in FAILSAFES.split(',').enumerate() {
        let least = if name == BATTERY { CRITICAL } else { 1.0 };
        let is_set = sample.fields.get(field).is_some_and(|value| value >= least);
        // So on vehicles that no other computer flies.
        let is_meant = name != OFFBOARD || px4.system.is_offboard();
        if is_set && is_meant && !names.contains(&name) {
            names.push(name);
        }
    }
    px4.system.failsafes = names.join(", ");
    px4.failsafes();
}

fn armed(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    // Simulations with hardware lock down too.
    px4.system.stopped = fields.flag(1);
    px4.system.terminated = (2..=5).any(|field| fields.flag(field));
}

fn land_detected(px4: &mut Px4, sample: &Sample<'_>) {
    let before = px4.system.landed;
    px4.system.landed = Some(sample.fields.flag(0));
    if before != px4.system.landed {
        px4.landed();
    }
}

fn rc(px4: &mut Px4, sample: &Sample<'_>) {
    let none = sample.fields.count(1) == Some(0);
    let rssi = if none { Some(0) } else { sample.fields.byte(0).filter(|&rssi| rssi < u8::MAX) };
    px4.observe(Observation::RadioControl(RadioControl { rssi }));
}

/// A telemetry radio, from v1.9 on.
fn radio(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    let byte = |field| fields.byte(field).filter(|&value| value < u8::MAX);
    px4.observe(Observation::TelemetryRadio(TelemetryRadio {
        rssi: byte(0),
        remote_rssi: byte(1),
        noise: byte(2),
        remote_noise: byte(3),
        errors: fields.count(4).unwrap_or(0) as u16,
    }));
}

/// The radio: until v1.8 `telemetry_status`, which links without a radio have too.
fn telemetry(px4: &mut Px4, sample: &Sample<'_>) {
    if sample.fields.byte(0).is_some_and(|rssi| rssi > 0) {
        radio(px4, sample);
    }
}

fn mission(px4: &mut Px4, sample: &Sample<'_>) {
    let reached = sample.fields.get(0).map(|number| number as i64);
    if reached != px4.system.reached {
        px4.system.reached = reached;
        if let Some(reached) = reached.and_then(|reached| u16::try_from(reached).ok()) {
            px4.observe(Observation::MissionReached(reached));
        }
    }
}

fn ack(px4: &mut Px4, sample: &Sample<'_>) {
    let (command, result) = (sample.fields.count(0).unwrap_or(0) as u16, sample.fields.byte(1).unwrap_or(0));
    px4.observe(Observation::CommandAck(CommandAck { command, result, target: None }));
}

/// The lower half is for those outside, as `MAV_SEVERITY`; from 8 on not for people.
fn event(px4: &mut Px4, sample: &Sample<'_>) {
    let severity = sample.fields.byte(1).unwrap_or(0) & 0x0f;
    if let Some(number) = sample.fields.count(0)
        && severity < 8
    {
        let argument = |at| sample.fields.element(2, at).unwrap_or(0.0) as u8;
        let arguments = std::array::from_fn(argument);
        px4.reports.push(Report::Event { number: number as u32, severity, arguments, is_old: sample.is_old });
    }
}

fn log_message(px4: &mut Px4, sample: &Sample<'_>) {
    if let Some(words) = sample.fields.words(1) {
        let severity = sample.fields.byte(0).unwrap_or(6).min(7);
        px4.reports.push(Report::Text { severity, words: words.trim_end().to_owned() });
    }
}

/// By `HEARTBEAT.custom_mode`: main mode in the third byte, sub mode in the fourth. Before v1.13 unchosen states, such as
/// failures, have another mode's number.
pub fn mode_name(mode: u32) -> Option<&'static str> {
    let [_, _, main, sub] = mode.to_le_bytes();
    let flown = MODES.iter().filter(|(nav, ..)| !matches!(nav, 8 | 9 | 11..=13));
    flown.rev().find(|(_, of, part, _)| (*of, *part) == (main, sub)).map(|&(.., name)| name)
}

fn rpm(px4: &mut Px4, sample: &Sample<'_>) {
    let Some(rpm) = sample.fields.finite(0).or_else(|| sample.fields.finite(1)) else { return };
    let sensor = SpeedSensor { index: sample.instance, rpm: Rpm(rpm) };
    px4.observe(Observation::SpeedSensors([Some(sensor), None]));
}

impl Px4 {
    fn heartbeat(&mut self) {
        let Some(heartbeat) = self.system.heartbeat() else { return };
        self.observe(Observation::Heartbeat(heartbeat));
        if self.system.told_mode != Some(heartbeat.mode) {
            self.system.told_mode = Some(heartbeat.mode);
            let nav = self.system.status.map(|status| status.nav);
            let name = MODES.iter().find(|(number, ..)| Some(*number) == nav).map(|&(.., name)| name);
            self.reports.push(Report::Mode { number: heartbeat.mode, name });
        }
        if !self.system.told_identity && self.system.release != 0 {
            self.system.told_identity = true;
            // The log lacks MAVLink's unique id.
            let identity = AutopilotIdentity { firmware: self.system.release, uid: 0 };
            self.observe(Observation::Identity(identity));
        }
    }

    /// The reasons, when they change.
    fn failsafes(&mut self) {
        let in_failsafe = self.system.status.is_some_and(|status| status.failsafe);
        let words = if in_failsafe { self.system.failsafes.as_str() } else { "" };
        if words != self.system.told_failsafes {
            words.clone_into(&mut self.system.told_failsafes);
            self.reports.push(Report::Failsafes(self.system.told_failsafes.clone()));
        }
    }

    fn landed(&mut self) {
        if let Some(landed) = self.system.landed() {
            self.observe(Observation::Landed(landed, VtolState::Unknown));
        }
    }

    /// The messages that MAVLink repeats without a new topic.
    pub(super) fn repeat(&mut self, recorded_us: u64) {
        self.heartbeat();
        self.landed();
        let boot_ms = (recorded_us / 1_000) as u32;
        let utc_micros = self.system.utc_offset_us.map(|offset| offset.saturating_add(recorded_us));
        self.observe(Observation::SystemTime(SystemTime { utc_micros, boot_ms }));
    }
}
