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
        0 => Observation::Heartbeat(system::heartbeat(payload)?),
        1 => Observation::SystemStatus(system::status(payload)?),
        2 => Observation::SystemTime(system::time(payload)?),
        22 => system::parameter(payload)?,
        24 => Observation::Gnss(motion::gnss(payload)?),
        26 | 27 | 116 | 129 => Observation::Imu(motion::imu(id, payload)?),
        29 | 137 | 143 => Observation::Air(motion::air(id, payload)?),
        30 => Observation::Attitude(motion::attitude(payload)?),
        32 => Observation::LocalPosition(motion::local_position(payload)?),
        33 => Observation::GlobalPosition(motion::global_position(payload)?),
        36 => Observation::Outputs(motion::outputs(payload)),
        42 => Observation::MissionCurrent(read::<ap::MISSION_CURRENT_DATA>(payload, &[4])?.seq),
        46 => Observation::MissionReached(read::<ap::MISSION_ITEM_REACHED_DATA>(payload, &[])?.seq),
        62 => Observation::Wanted(motion::nav_controller_output(payload)?),
        65 => Observation::RadioControl(system::rc(payload)?),
        74 => Observation::Hud(motion::hud(payload)?),
        77 => Observation::CommandAck(system::command_ack(payload)),
        178 => Observation::SecondEstimate(motion::second_estimate(payload)),
        83 => Observation::Wanted(motion::attitude_target(payload)?),
        85 => Observation::ClimbWanted(motion::climb_wanted(payload)?),
        105 => {
            let (imu, air) = motion::highres_imu(payload)?;
            Observation::ImuAndAir(imu, air)
        }
        109 => Observation::TelemetryRadio(system::radio(payload)?),
        124 => Observation::Gnss(motion::gnss2(payload)?),
        125 => Observation::Rails(power::rails(payload)?),
        147 => Observation::Battery(power::battery(payload)?),
        148 => Observation::Identity(system::identity(payload)?),
        193 => Observation::Estimator(motion::ekf_status_report(payload)?),
        225 => Observation::Engine(propulsion::engine(payload)?),
        226 => Observation::SpeedSensors(propulsion::rpm(payload)?),
        230 => Observation::Estimator(motion::estimator_status(payload)?),
        235 => Observation::Failing(system::failing(payload)),
        241 => Observation::Vibration(motion::vibration(payload)?),
        245 => system::landed(payload),
        253 => Observation::Alert(alert_of_text(payload)?),
        264 => system::flight_information(payload)?,
        290 => Observation::Escs(propulsion::esc_info(payload)?),
        291 => Observation::Escs(propulsion::esc_status(payload)?),
        339 => Observation::SpeedSensors(propulsion::raw_rpm(payload)?),
        373 => Observation::Generator(propulsion::generator(payload)?),
        410 => Observation::Alert(system::alert_of_event(payload)?),
        441 => Observation::GnssIntegrity(motion::gnss_integrity(payload)),
        11_030..=11_032 => Observation::Escs(propulsion::esc_telemetry(id, payload)?),
        11_039 => Observation::Processor(system::processor(payload)?),
        _ => return None,
    })
}

#[cfg(test)]
mod tests;
