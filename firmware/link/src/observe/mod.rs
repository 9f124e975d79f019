//! Decoder from frames to observations in SI units. One function per message, with its pitfalls.
//!
//! One generated structure of the `mavlink` crate per message: only used ones are linked. Their decoders reject a message with
//! an unknown enumeration number. A newer sender's HEARTBEAT must not be lost for that, so such fields are set to zero and the
//! rest is read.

mod fields;
mod motion;
mod power;
mod propulsion;
mod system;

use hums_core::observation::{Observation, Source};
use hums_dialect::ardupilotmega as ap;
use hums_dialect::ids;

use crate::frame::{Check, Frame};
use crate::long_text::alert_of_text;
use fields::read;

/// Observation and sender of a frame. `None` for an unused id, an unverified checksum, or the HEARTBEAT of a component that is
/// not a vehicle.
pub fn observe(frame: &Frame<'_>) -> Option<(Source, Observation)> {
    if frame.check() != Check::Verified {
        return None;
    }
    Some((frame.source(), by_id(frame.id(), frame.payload())?))
}

fn by_id(id: u32, payload: &[u8]) -> Option<Observation> {
    Some(match id {
        ids::HEARTBEAT => Observation::Heartbeat(system::heartbeat(payload)?),
        ids::SYS_STATUS => Observation::SystemStatus(system::status(payload)?),
        ids::SYSTEM_TIME => Observation::SystemTime(system::time(payload)?),
        ids::PARAM_VALUE => system::parameter(payload)?,
        ids::GPS_RAW_INT => Observation::Gnss(motion::gnss(payload)?),
        ids::SCALED_IMU | ids::RAW_IMU | ids::SCALED_IMU2 | ids::SCALED_IMU3 => {
            Observation::Imu(motion::imu(id, payload)?)
        }
        ids::SCALED_PRESSURE | ids::SCALED_PRESSURE2 | ids::SCALED_PRESSURE3 => {
            Observation::Air(motion::air(id, payload)?)
        }
        ids::ATTITUDE => Observation::Attitude(motion::attitude(payload)?),
        ids::LOCAL_POSITION_NED => Observation::LocalPosition(motion::local_position(payload)?),
        ids::GLOBAL_POSITION_INT => Observation::GlobalPosition(motion::global_position(payload)?),
        ids::SERVO_OUTPUT_RAW => Observation::Outputs(motion::outputs(payload)),
        ids::MISSION_ITEM_REACHED => {
            Observation::MissionReached(read::<ap::MISSION_ITEM_REACHED_DATA>(payload, &[])?.seq)
        }
        ids::NAV_CONTROLLER_OUTPUT => Observation::AttitudeSetpoint(motion::nav_controller_output(payload)?),
        ids::RC_CHANNELS => Observation::RadioControl(system::rc(payload)?),
        ids::VFR_HUD => Observation::Hud(motion::hud(payload)?),
        ids::COMMAND_ACK => Observation::CommandAck(system::command_ack(payload)),
        ids::AHRS2 => Observation::SecondEstimate(motion::second_estimate(payload)),
        ids::ATTITUDE_TARGET => Observation::AttitudeSetpoint(motion::attitude_target(payload)?),
        ids::POSITION_TARGET_LOCAL_NED => Observation::ClimbWanted(motion::climb_wanted(payload)?),
        ids::HIGHRES_IMU => {
            let (imu, air) = motion::highres_imu(payload)?;
            Observation::ImuAndAir(imu, air)
        }
        ids::RADIO_STATUS => Observation::TelemetryRadio(system::radio(payload)?),
        ids::GPS2_RAW => Observation::Gnss(motion::gnss2(payload)?),
        ids::POWER_STATUS => Observation::Rails(power::rails(payload)?),
        ids::BATTERY_STATUS => Observation::Battery(power::battery(payload)?),
        ids::AUTOPILOT_VERSION => Observation::Identity(system::identity(payload)?),
        ids::EKF_STATUS_REPORT => Observation::Estimator(motion::ekf_status_report(payload)?),
        ids::EFI_STATUS => Observation::Engine(propulsion::engine(payload)?),
        ids::RPM => Observation::SpeedSensors(propulsion::rpm(payload)?),
        ids::ESTIMATOR_STATUS => Observation::Estimator(motion::estimator_status(payload)?),
        ids::HIGH_LATENCY2 => Observation::Failing(system::failing(payload)),
        ids::VIBRATION => Observation::Vibration(motion::vibration(payload)?),
        ids::EXTENDED_SYS_STATE => system::landed(payload),
        ids::STATUSTEXT => Observation::Alert(alert_of_text(payload)?),
        ids::ESC_INFO => Observation::Escs(propulsion::esc_info(payload)?),
        ids::ESC_STATUS => Observation::Escs(propulsion::esc_status(payload)?),
        ids::RAW_RPM => Observation::SpeedSensors(propulsion::raw_rpm(payload)?),
        ids::GENERATOR_STATUS => Observation::Generator(propulsion::generator(payload)?),
        ids::EVENT => Observation::Alert(system::alert_of_event(payload)?),
        ids::GNSS_INTEGRITY => Observation::GnssIntegrity(motion::gnss_integrity(payload)),
        ids::ESC_TELEMETRY_1_TO_4..=ids::ESC_TELEMETRY_9_TO_12 => {
            Observation::Escs(propulsion::esc_telemetry(id, payload)?)
        }
        ids::MCU_STATUS => Observation::Processor(system::processor(payload)?),
        _ => return None,
    })
}

#[cfg(test)]
mod tests;
