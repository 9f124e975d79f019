//! The autopilot itself, its links, its words.

use hums_core::battery_cells;
use hums_core::cause::{Alert, Causes};
use hums_core::observation::{
    Autopilot, AutopilotIdentity, CommandAck, Heartbeat, LandedState, Observation, Processor, RadioControl,
    Sensors, Source, SystemStatus, SystemTime, TelemetryRadio, VehicleKind, VtolState,
};
use hums_core::units::{Celsius, Fraction};
use hums_dialect::ardupilotmega as ap;

use super::fields::{current, percent, read, unix_time, unless, voltage};
use crate::alert;
use crate::packet::Fields;

/// A vehicle is a sender whose autopilot is not INVALID. Some ground stations and companions claim one nevertheless,
/// so types that cannot be vehicles are left out too. Type, autopilot and state are bytes 4, 5 and 7: read as they
/// are, because the list of vehicle types grows every year.
pub(super) fn heartbeat(payload: &[u8]) -> Option<Heartbeat> {
    const AUTOPILOT_INVALID: u8 = 8;
    const ARMED: u8 = 1 << 7;
    let fields = Fields(payload);
    let mode = fields.u32(0);
    let (type_number, autopilot_number, base_mode, state) =
        (fields.u8(4), fields.u8(5), fields.u8(6), fields.u8(7));
    if autopilot_number == AUTOPILOT_INVALID {
        return None;
    }
    // `MAV_TYPE`
    let kind = match type_number {
        // Quadrotor, coaxial, helicopter, and rotors by 6, 8, 3, 12 and 10.
        2 | 3 | 4 | 13 | 14 | 15 | 29 | 35 => VehicleKind::Rotorcraft,
        // Fixed wing, flapping wing, kite, parafoil.
        1 | 16 | 17 | 28 => VehicleKind::Plane,
        19..=25 => VehicleKind::Vtol,
        // Rover, boat, submarine.
        10..=12 => VehicleKind::Surface,
        // Antenna tracker, GCS, companion, gimbal, ADS-B, camera, charging station, FLARM, servo, ODID and so on.
        5 | 6 | 18 | 26 | 27 | 30 | 31 | 32 | 33 | 34 | 36..=42 => return None,
        _ => VehicleKind::Other,
    };
    // `MAV_AUTOPILOT`
    let autopilot = match autopilot_number {
        3 => Autopilot::ArduPilot,
        12 => Autopilot::Px4,
        _ => Autopilot::Other,
    };
    let armed = base_mode & ARMED != 0;
    Some(Heartbeat { autopilot, autopilot_number, kind, type_number, armed, state, mode })
}

pub(super) fn status(payload: &[u8]) -> Option<SystemStatus> {
    let status = read::<ap::SYS_STATUS_DATA>(payload, &[])?;
    let sensors = Sensors::of(
        status.onboard_control_sensors_present.bits(),
        status.onboard_control_sensors_enabled.bits(),
        status.onboard_control_sensors_health.bits(),
    );
    Some(SystemStatus {
        load: (status.load <= 1_000).then(|| Fraction(f32::from(status.load) / 1e3)),
        voltage: voltage(status.voltage_battery),
        current: current(status.current_battery),
        remaining: percent(status.battery_remaining),
        sensors: Some(sensors),
    })
}

pub(super) fn time(payload: &[u8]) -> Option<SystemTime> {
    let time = read::<ap::SYSTEM_TIME_DATA>(payload, &[])?;
    Some(SystemTime { utc_micros: unix_time(time.time_unix_usec), boot_ms: time.time_boot_ms })
}

pub(super) fn rc(payload: &[u8]) -> Option<RadioControl> {
    let rc = read::<ap::RC_CHANNELS_DATA>(payload, &[])?;
    Some(RadioControl { rssi: unless(rc.rssi, u8::MAX) })
}

pub(super) fn radio(payload: &[u8]) -> Option<TelemetryRadio> {
    let radio = read::<ap::RADIO_STATUS_DATA>(payload, &[])?;
    Some(TelemetryRadio {
        rssi: unless(radio.rssi, u8::MAX),
        remote_rssi: unless(radio.remrssi, u8::MAX),
        noise: unless(radio.noise, u8::MAX),
        remote_noise: unless(radio.remnoise, u8::MAX),
        errors: radio.rxerrors,
    })
}

pub(super) fn processor(payload: &[u8]) -> Option<Processor> {
    let mcu = read::<ap::MCU_STATUS_DATA>(payload, &[])?;
    let temperature = (mcu.MCU_temperature != i16::MAX && mcu.MCU_temperature != 0)
        .then(|| Celsius(f32::from(mcu.MCU_temperature) / 100.0));
    Some(Processor { temperature })
}

pub(super) fn identity(payload: &[u8]) -> Option<AutopilotIdentity> {
    let version = read::<ap::AUTOPILOT_VERSION_DATA>(payload, &[])?;
    let uid = if version.uid == 0 { folded(&version.uid2) } else { version.uid };
    Some(AutopilotIdentity { firmware: version.flight_sw_version, uid })
}

/// 18 bytes as one number: `ArduPilot` sends its processor's unique id of 12 bytes in `uid2`, and 0 in `uid`.
fn folded(uid2: &[u8; 18]) -> u64 {
    let word = |bytes: &[u8]| bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte));
    uid2.chunks(8).fold(0, |all, bytes| all ^ word(bytes))
}

pub(super) fn landed(payload: &[u8]) -> Observation {
    // Two bytes, both enumerations: MAV_VTOL_STATE, MAV_LANDED_STATE.
    let vtol = match Fields(payload).u8(0) {
        1 | 2 => VtolState::Transition,
        3 => VtolState::Hover,
        4 => VtolState::Forward,
        _ => VtolState::Unknown,
    };
    let landed = match Fields(payload).u8(1) {
        1 => LandedState::OnGround,
        2 => LandedState::InAir,
        3 => LandedState::TakingOff,
        4 => LandedState::Landing,
        _ => LandedState::Unknown,
    };
    Observation::Landed(landed, vtol)
}

/// A parameter about the batteries' cells. PX4 sends an integer's bits, `ArduPilot` its value: none of these values
/// is as small as a small integer's bits read as a float.
pub(super) fn parameter(payload: &[u8]) -> Option<Observation> {
    let fields = Fields(payload);
    let place = battery_cells::known(fields.text(8, 16)?)?;
    let value = f32::from_bits(fields.u32(0));
    let bits = value.to_bits();
    let value = if (1..1 << 16).contains(&bits) { bits as f32 } else { value };
    Some(Observation::Parameter(place, value))
}

/// `EVENT` of PX4 that says that something is wrong: number, level outside (the low nibble), arguments.
pub(super) fn alert_of_event(payload: &[u8]) -> Option<Alert> {
    const ARGUMENTS: usize = 13;
    let fields = Fields(payload);
    alert::of_event(fields.u32(0), fields.u8(12) & 0xF, payload.get(ARGUMENTS..).unwrap_or_default())
}

/// `HIGH_LATENCY2`: its failure flags.
pub(super) fn failing(payload: &[u8]) -> Causes {
    Causes::of_failure_flags(Fields(payload).u16(22))
}

/// Read as it is: the list of commands grows faster than any definition.
pub(super) fn command_ack(payload: &[u8]) -> CommandAck {
    let fields = Fields(payload);
    let (system, component) = (fields.u8(8), fields.u8(9));
    let target = (system != 0).then_some(Source { system, component });
    CommandAck { command: fields.u16(0), result: fields.u8(2), target }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_unique_id_counts_where_the_short_one_is_zero() {
        let mut payload = [0; 78];
        payload[60..72].copy_from_slice(&[0x29, 0, 0x20, 0, 0x0d, 0x51, 0x33, 0x31, 0x30, 0x36, 0x34, 0x31]);
        let uid = |payload: &[u8]| identity(payload).map(|identity| identity.uid);
        assert_eq!(uid(&payload), Some(0x3133_510d_0020_0029 ^ 0x3134_3630));
        assert_eq!(uid(&payload[..60]), Some(0));
        payload[8] = 7;
        assert_eq!(uid(&payload), Some(7));
    }
}
