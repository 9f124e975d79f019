//! Position, motion and the estimator's accuracy.

use core::num::NonZeroU32;
use hums_dialect::ids;

use hums_core::observation::{
    Air, Attitude, AttitudeSetpoint, Estimator, EstimatorScale, GlobalPosition, Gnss, GnssIntegrity, Hud,
    Imu, LocalPosition, MOTORS_MAX, Outputs, SecondEstimate, Vibration, VibrationScale, WantedRates,
};
use hums_core::units::{
    Celsius, Fraction, Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Position, Radians,
    RadiansPerSecond,
};
use hums_dialect::ardupilotmega as ap;

use super::fields::{read, unless};
use crate::packet::Fields;

const GRAVITY: f32 = hums_core::units::GRAVITY;
/// A fix with a position: `GPS_FIX_TYPE_2D_FIX`.
const FIX_2D: u8 = 2;

/// All three, or none: half a vector is of no use.
fn vector(values: [f32; 3]) -> Option<[f32; 3]> {
    values.iter().all(|value| value.is_finite()).then_some(values)
}

/// Degrees x 1e7. Receivers without a position send 0, 0, where no vehicle flies.
fn position(latitude: i32, longitude: i32) -> Option<Position> {
    let valid = (-900_000_000..=900_000_000).contains(&latitude)
        && (-1_800_000_000..=1_800_000_000).contains(&longitude);
    (valid && (latitude, longitude) != (0, 0)).then(|| Position {
        latitude_deg: f64::from(latitude) / 1e7,
        longitude_deg: f64::from(longitude) / 1e7,
    })
}

/// Dilution x 100: 65535 is unknown, and no geometry has 0.
fn dilution(hundredths: u16) -> Option<f32> {
    (hundredths != 0 && hundredths != u16::MAX).then(|| f32::from(hundredths) / 100.0)
}

/// Millimetres in an extension field: 0 is unknown.
fn error(millimetres: u32) -> Option<Metres> {
    (millimetres != 0 && millimetres != u32::MAX).then(|| Metres(millimetres as f32 / 1e3))
}

fn speed(centimetres: u16) -> Option<MetresPerSecond> {
    unless(centimetres, u16::MAX).map(|speed| MetresPerSecond(f32::from(speed) / 100.0))
}

/// Hundredths of a degree: 65535 is unknown.
fn course(hundredths: u16) -> Option<Radians> {
    unless(hundredths, u16::MAX).map(|course| Radians((f32::from(course) / 100.0).to_radians()))
}

/// Modulo 2^32; 0 means unknown.
const fn milliseconds(us: u64) -> Option<NonZeroU32> {
    NonZeroU32::new((us / 1_000) as u32)
}

/// The messages of both receivers have fields of the same names; the fix is at byte `$fix`.
macro_rules! gnss {
    ($name:ident, $message:ty, $instance:literal, $fix:literal) => {
        pub(super) fn $name(payload: &[u8]) -> Option<Gnss> {
            let gps = read::<$message>(payload, &[$fix])?;
            let fix = Fields(payload).u8($fix);
            let has_position = fix >= FIX_2D;
            Some(Gnss {
                instance: $instance,
                fix,
                satellites: unless(gps.satellites_visible, u8::MAX),
                hdop: dilution(gps.eph),
                accuracy: error(gps.h_acc),
                speed: speed(gps.vel),
                course: course(gps.cog),
                measured_ms: milliseconds(gps.time_usec),
                position: position(gps.lat, gps.lon).filter(|_| has_position),
                altitude: has_position.then(|| Metres(gps.alt as f32 / 1e3)),
            })
        }
    };
}
gnss!(gnss, ap::GPS_RAW_INT_DATA, 0, 28);
gnss!(gnss2, ap::GPS2_RAW_DATA, 1, 32);

/// `GNSS_INTEGRITY` is not in the typed dialect: number of the receiver at byte 8, jamming at 10, spoofing at 11.
pub(super) fn gnss_integrity(payload: &[u8]) -> GnssIntegrity {
    // 0 is unknown; a state that is newer than our list is unknown too.
    let known = |state: u8| if state <= 3 { state } else { 0 };
    GnssIntegrity {
        instance: Fields(payload).u8(8),
        jamming: known(Fields(payload).u8(10)),
        spoofing: known(Fields(payload).u8(11)),
    }
}

/// A missing compass measures zeros.
fn field(gauss: [f32; 3]) -> Option<[Gauss; 3]> {
    vector(gauss).filter(|gauss| gauss.iter().any(|axis| axis.abs() > 0.0)).map(|gauss| gauss.map(Gauss))
}

/// Milli-g, mrad/s and mG, also in ArduPilot's `RAW_IMU`, in spite of its name.
fn scaled(
    instance: u8,
    acceleration: [i16; 3],
    rotation: [i16; 3],
    magnetic: [i16; 3],
    temperature: i16,
) -> Imu {
    Imu {
        instance,
        acceleration: Some(acceleration.map(|milli_g| MetresPerSecond2(f32::from(milli_g) * GRAVITY / 1e3))),
        rate: Some(rotation.map(|milli| RadiansPerSecond(f32::from(milli) / 1e3))),
        field: field(magnetic.map(|milli| f32::from(milli) / 1e3)),
        temperature: unless(temperature, 0).map(|hundredths| Celsius(f32::from(hundredths) / 100.0)),
    }
}

pub(super) fn imu(id: u32, payload: &[u8]) -> Option<Imu> {
    if id == ids::RAW_IMU {
        let imu = read::<ap::RAW_IMU_DATA>(payload, &[])?;
        let rotation = [imu.xgyro, imu.ygyro, imu.zgyro];
        let magnetic = [imu.xmag, imu.ymag, imu.zmag];
        return Some(scaled(imu.id, [imu.xacc, imu.yacc, imu.zacc], rotation, magnetic, imu.temperature));
    }
    // The second and the third have the fields of the first.
    let imu = read::<ap::SCALED_IMU_DATA>(payload, &[])?;
    let instance = match id {
        ids::SCALED_IMU => 0,
        ids::SCALED_IMU2 => 1,
        _ => 2,
    };
    let rotation = [imu.xgyro, imu.ygyro, imu.zgyro];
    let magnetic = [imu.xmag, imu.ymag, imu.zmag];
    Some(scaled(instance, [imu.xacc, imu.yacc, imu.zacc], rotation, magnetic, imu.temperature))
}

/// Only fields in `fields_updated` are new; the rest repeats an older sample.
pub(super) fn highres_imu(payload: &[u8]) -> Option<(Imu, Air)> {
    let imu = read::<ap::HIGHRES_IMU_DATA>(payload, &[])?;
    let updated = imu.fields_updated.bits();
    let all = |bits: u16| updated & bits == bits;
    let acceleration = vector([imu.xacc, imu.yacc, imu.zacc]).filter(|_| all(0b111));
    let rate = vector([imu.xgyro, imu.ygyro, imu.zgyro]).filter(|_| all(0b11_1000));
    let field = field([imu.xmag, imu.ymag, imu.zmag]).filter(|_| all(0b1_1100_0000));
    let temperature = Celsius(imu.temperature).finite().filter(|_| all(1 << 12));
    let pressure = Hectopascals(imu.abs_pressure).finite().filter(|_| all(1 << 9));
    let sensor = Imu {
        instance: imu.id,
        acceleration: acceleration.map(|values| values.map(MetresPerSecond2)),
        rate: rate.map(|values| values.map(RadiansPerSecond)),
        field,
        temperature,
    };
    Some((sensor, Air { instance: imu.id, pressure, temperature }))
}

pub(super) fn air(id: u32, payload: &[u8]) -> Option<Air> {
    let pressure = read::<ap::SCALED_PRESSURE_DATA>(payload, &[])?;
    let instance = match id {
        ids::SCALED_PRESSURE => 0,
        ids::SCALED_PRESSURE2 => 1,
        _ => 2,
    };
    Some(Air {
        instance,
        pressure: Hectopascals(pressure.press_abs).finite().filter(|pressure| pressure.0 > 0.0),
        temperature: Some(Celsius(f32::from(pressure.temperature) / 100.0)),
    })
}

/// Eight outputs in the message of old, the others in its extension; 65535 is none.
pub(super) fn outputs(payload: &[u8]) -> Outputs {
    const EXTENSION: usize = 21;
    let pulse = |output: usize| {
        let at = if output < 8 { 4 + 2 * output } else { EXTENSION + 2 * (output - 8) };
        unless(Fields(payload).u16(at), u16::MAX).unwrap_or(0)
    };
    Outputs { port: Fields(payload).u8(20), pulses: core::array::from_fn::<u16, MOTORS_MAX, _>(pulse) }
}

pub(super) fn attitude(payload: &[u8]) -> Option<Attitude> {
    let attitude = read::<ap::ATTITUDE_DATA>(payload, &[])?;
    let [roll, pitch, yaw] = vector([attitude.roll, attitude.pitch, attitude.yaw])?.map(Radians);
    let rates = vector([attitude.rollspeed, attitude.pitchspeed, attitude.yawspeed]);
    let rates = rates.map(|rates| rates.map(RadiansPerSecond));
    Some(Attitude { roll, pitch, yaw, rates, boot_ms: Some(attitude.time_boot_ms) })
}

/// `AHRS2`: zeros are unknown values.
pub(super) fn second_estimate(payload: &[u8]) -> SecondEstimate {
    let angles = vector([0, 4, 8].map(|at| float(payload, at)));
    let angles = angles.filter(|angles| angles.iter().any(|angle| angle.abs() > 0.0));
    let [latitude, longitude] = [16, 20].map(|at| Fields(payload).u32(at).cast_signed());
    let position = position(latitude, longitude);
    SecondEstimate {
        attitude: angles.map(|angles| angles.map(Radians)),
        position,
        altitude: Metres(float(payload, 12)).finite().filter(|_| position.is_some()),
    }
}

/// `ArduPilot`: whole degrees in old versions.
pub(super) fn nav_controller_output(payload: &[u8]) -> Option<AttitudeSetpoint> {
    let [roll, pitch] = [0, 4].map(|at| Radians(float(payload, at).to_radians()));
    (roll.0.is_finite() && pitch.0.is_finite()).then_some(AttitudeSetpoint { roll, pitch, rates: None })
}

/// `type_mask` names the ignored rates: roll 1, pitch 2, yaw 4.
pub(super) fn attitude_target(payload: &[u8]) -> Option<AttitudeSetpoint> {
    const RATES: u8 = 7;
    let of = [4, 8, 12, 16].map(|at| float(payload, at));
    let about = vector([20, 24, 28].map(|at| float(payload, at)));
    let about = about.filter(|_| Fields(payload).u8(36) & RATES == 0);
    let rates = about.map(|about| WantedRates { about: about.map(RadiansPerSecond), of: Some(of) });
    Some(AttitudeSetpoint { rates, ..AttitudeSetpoint::from_quaternion(of)? })
}

/// `POSITION_TARGET_LOCAL_NED`: `type_mask` 32 means that the vertical speed is ignored.
pub(super) fn climb_wanted(payload: &[u8]) -> Option<MetresPerSecond> {
    const NO_VZ: u16 = 32;
    let down = float(payload, 24);
    (Fields(payload).u16(48) & NO_VZ == 0 && down.is_finite()).then_some(MetresPerSecond(-down))
}

fn float(payload: &[u8], at: usize) -> f32 {
    f32::from_bits(Fields(payload).u32(at))
}

pub(super) fn local_position(payload: &[u8]) -> Option<LocalPosition> {
    let local = read::<ap::LOCAL_POSITION_NED_DATA>(payload, &[])?;
    Some(LocalPosition {
        position: vector([local.x, local.y, local.z])?.map(Metres),
        velocity: vector([local.vx, local.vy, local.vz])?.map(MetresPerSecond),
    })
}

pub(super) fn global_position(payload: &[u8]) -> Option<GlobalPosition> {
    let global = read::<ap::GLOBAL_POSITION_INT_DATA>(payload, &[])?;
    Some(GlobalPosition {
        position: position(global.lat, global.lon),
        altitude: Metres(global.alt as f32 / 1e3),
        relative_altitude: Metres(global.relative_alt as f32 / 1e3),
        velocity: [global.vx, global.vy, global.vz].map(|speed| MetresPerSecond(f32::from(speed) / 100.0)),
    })
}

pub(super) fn hud(payload: &[u8]) -> Option<Hud> {
    let hud = read::<ap::VFR_HUD_DATA>(payload, &[])?;
    Some(Hud {
        airspeed: MetresPerSecond(hud.airspeed).finite(),
        groundspeed: MetresPerSecond(hud.groundspeed).finite(),
        heading_deg: (0..=360).contains(&hud.heading).then(|| f32::from(hud.heading)),
        throttle: (hud.throttle <= 100).then(|| Fraction(f32::from(hud.throttle) / 100.0)),
        altitude: Metres(hud.alt).finite(),
        climb: MetresPerSecond(hud.climb).finite(),
    })
}

fn ratio(value: f32) -> Option<f32> {
    (value.is_finite() && value >= 0.0).then_some(value)
}

/// ArduPilot. Before the filter runs it sends zeros; these are not variances.
pub(super) fn ekf_status_report(payload: &[u8]) -> Option<Estimator> {
    const UNINITIALISED: u16 = 1_024;
    let ekf = read::<ap::EKF_STATUS_REPORT_DATA>(payload, &[])?;
    let flags = ekf.flags.bits();
    let known = |value: f32| ratio(value).filter(|_| flags != 0 && flags & UNINITIALISED == 0);
    Some(Estimator {
        scale: EstimatorScale::Variance,
        velocity: known(ekf.velocity_variance),
        position_horizontal: known(ekf.pos_horiz_variance),
        position_vertical: known(ekf.pos_vert_variance),
        compass: known(ekf.compass_variance),
        flags,
    })
}

/// PX4: NaN where the filter does not use the sensor.
pub(super) fn estimator_status(payload: &[u8]) -> Option<Estimator> {
    let estimator = read::<ap::ESTIMATOR_STATUS_DATA>(payload, &[])?;
    Some(Estimator {
        scale: EstimatorScale::TestRatio,
        velocity: ratio(estimator.vel_ratio),
        position_horizontal: ratio(estimator.pos_horiz_ratio),
        position_vertical: ratio(estimator.pos_vert_ratio),
        compass: ratio(estimator.mag_ratio),
        flags: estimator.flags.bits(),
    })
}

/// The scale is the sender's: see `Vehicle`, which knows whose message it is.
pub(super) fn vibration(payload: &[u8]) -> Option<Vibration> {
    let vibration = read::<ap::VIBRATION_DATA>(payload, &[])?;
    Some(Vibration {
        scale: VibrationScale::default(),
        levels: [vibration.vibration_x, vibration.vibration_y, vibration.vibration_z].map(ratio),
        clips: [vibration.clipping_0, vibration.clipping_1, vibration.clipping_2],
    })
}
