//! Motion, and the estimator's confidence.

use hums_core::observation::{
    Air, Attitude, AttitudeSetpoint, Estimator, EstimatorScale, GlobalPosition, Hud, Imu, LocalPosition,
    MOTORS_MAX, Observation, Outputs, Vibration, VibrationScale, WantedRates,
};
use hums_core::units::{
    Celsius, Fraction, GRAVITY, Gauss, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, Position,
    Radians, RadiansPerSecond, norm,
};

use super::state::{FAST_US, Home, Local, MEDIUM_US, Px4, Sample, Topic, topic};

/// Force of a shock: below its lowest limit, above nearly all flights' forces.
const SHOCK_MIN: f32 = 2.0 * GRAVITY;

const VEHICLE_IMU: &str = "delta_velocity delta_velocity_dt delta_angle delta_angle_dt";
const VEHICLE_AIR_DATA: &str = "baro_pressure_pa ambient_temperature baro_temp_celcius baro_alt_meter";
const VEHICLE_LOCAL_POSITION: &str = "x y z vx vy vz z_valid z_global v_z_valid ref_alt heading yaw";
const ESTIMATOR_STATUS: &str = "vel_test_ratio pos_test_ratio hgt_test_ratio hdg_test_ratio mag_test_ratio solution_status_flags \
    vibe";
const ESTIMATOR_INNOVATION_TEST_RATIOS: &str = "gps_hvel gps_vvel ev_hvel ev_vvel aux_hvel gps_hpos ev_hpos gps_vpos ev_vpos rng_vpos baro_vpos \
    mag_field heading";
const ESTIMATOR_STATUS_FLAGS: &str =
    "cs_tilt_align cs_fake_pos cs_constant_pos cs_gnss_fault fs_bad_acc_vertical";
const VEHICLE_IMU_STATUS: &str = "accel_device_id delta_angle_coning_metric gyro_coning_vibration gyro_vibration_metric \
    accel_vibration_metric accel_clipping";

pub(super) const TOPICS: &[Topic] = &[
    // Its handler looks for shocks in all.
    topic("sensor_combined", 1, 0, "accelerometer_m_s2 gyro_rad", imu),
    topic("vehicle_acceleration", 1, 0, "xyz", acceleration),
    topic("vehicle_angular_velocity", 1, FAST_US, "xyz", |px4, sample| {
        px4.motion.rate = sample.fields.vector(0);
    }),
    // Several sensors; the flying one is above.
    topic("vehicle_imu", 3, MEDIUM_US, VEHICLE_IMU, other_imu),
    topic("vehicle_magnetometer", 3, MEDIUM_US, "magnetometer_ga", |px4, sample| {
        if let Some(slot) = px4.motion.fields.get_mut(usize::from(sample.instance)) {
            *slot = sample.fields.vector(0).map(|field| field.map(Gauss));
        }
    }),
    topic("sensor_baro", 3, MEDIUM_US, "pressure", other_air),
    topic("actuator_outputs", 2, MEDIUM_US, "output", outputs),
    topic("vehicle_air_data", 1, MEDIUM_US, VEHICLE_AIR_DATA, air),
    topic("vehicle_attitude", 1, FAST_US, "q rollspeed pitchspeed yawspeed", attitude),
    // Until v1.15 with angles, before v1.6 only angles.
    topic("vehicle_attitude_setpoint", 1, FAST_US, "q_d roll_body pitch_body", attitude_setpoint),
    topic("vehicle_rates_setpoint", 1, FAST_US, "roll pitch yaw", |px4, sample| {
        let rates = [0, 1, 2].map(|axis| sample.fields.finite(axis));
        px4.motion.rates_wanted = match rates {
            [Some(roll), Some(pitch), Some(yaw)] => {
                Some((sample.recorded_us, [roll, pitch, yaw].map(RadiansPerSecond)))
            }
            _ => None,
        };
    }),
    topic("vehicle_local_position", 1, MEDIUM_US, VEHICLE_LOCAL_POSITION, local_position),
    topic("vehicle_local_position_setpoint", 1, MEDIUM_US, "vz", |px4, sample| {
        if let Some(down) = sample.fields.finite(0) {
            px4.observe(Observation::ClimbWanted(MetresPerSecond(-down)));
        }
    }),
    topic("vehicle_global_position", 1, MEDIUM_US, "lat lon alt", global_position),
    topic("home_position", 1, 0, "alt z valid_alt", home),
    topic(
        "airspeed_validated",
        1,
        MEDIUM_US,
        "calibrated_airspeed_m_s equivalent_airspeed_m_s",
        airspeed_validated,
    ),
    topic("airspeed", 1, MEDIUM_US, "indicated_airspeed_m_s", airspeed),
    topic("vehicle_thrust_setpoint", 2, MEDIUM_US, "xyz", |px4, sample| {
        let length = sample.fields.vector::<3>(0).map(|[x, y, z]| (x * x + y * y + z * z).sqrt());
        px4.motion.set_thrust(sample.instance, length);
    }),
    // Until v1.13 throttle is a group's fourth control: of the rotors, and of a VTOL's plane.
    topic("actuator_controls_0", 1, MEDIUM_US, "control", |px4, sample| {
        px4.motion.set_thrust(0, sample.fields.element(0, 3).map(|thrust| thrust as f32));
    }),
    topic("actuator_controls_1", 1, MEDIUM_US, "control", |px4, sample| {
        px4.motion.set_thrust(1, sample.fields.element(0, 3).map(|thrust| thrust as f32));
    }),
    topic("estimator_selector_status", 1, 0, "primary_instance", |px4, sample| {
        px4.motion.estimator = sample.fields.byte(0).unwrap_or(0);
    }),
    topic("estimator_status", 9, MEDIUM_US, ESTIMATOR_STATUS, estimator_status),
    topic("estimator_innovation_test_ratios", 9, MEDIUM_US, ESTIMATOR_INNOVATION_TEST_RATIOS, test_ratios),
    topic("estimator_status_flags", 9, 0, ESTIMATOR_STATUS_FLAGS, estimator_flags),
    // Since v1.13.
    topic("actuator_motors", 1, MEDIUM_US, "control", motors),
    topic("sensor_selection", 1, 0, "accel_device_id", |px4, sample| {
        px4.motion.accelerometer = sample.fields.count(0).filter(|&id| id != 0);
    }),
    topic("vehicle_imu_status", 3, 0, VEHICLE_IMU_STATUS, imu_status),
];

/// A sensor with the compass of the same number, as in MAVLink.
fn inertial(px4: &mut Px4, instance: u8, acceleration: Option<[f32; 3]>, rate: Option<[f32; 3]>) {
    let field = px4.motion.fields.get_mut(usize::from(instance)).and_then(Option::take);
    px4.observe(Observation::Imu(Imu {
        instance,
        acceleration: acceleration.map(|values| values.map(MetresPerSecond2)),
        rate: rate.map(|values| values.map(RadiansPerSecond)),
        field,
        temperature: None,
    }));
}

fn imu(px4: &mut Px4, sample: &Sample<'_>) {
    px4.motion.combined = true;
    if is_due(px4, sample) {
        inertial(px4, 0, sample.fields.vector(0), sample.fields.vector(1));
    }
}

/// Between due messages only a shock is handed on: impacts are short.
fn is_due(px4: &mut Px4, sample: &Sample<'_>) -> bool {
    let now_us = sample.recorded_us;
    let long_ago = |last: u64| now_us < last || now_us - last >= FAST_US;
    if px4.motion.force_us.is_none_or(long_ago) {
        px4.motion.force_us = Some(now_us);
        return true;
    }
    if let Some(force) = sample.fields.vector(0).map(norm::<3>).filter(|force| *force > SHOCK_MIN) {
        px4.observe(Observation::Shock(MetresPerSecond2(force)));
    }
    false
}

fn other_imu(px4: &mut Px4, sample: &Sample<'_>) {
    let over = |delta: usize, dt: usize| {
        let dt_s = sample.fields.finite(dt).map(|us| us / 1e6).filter(|dt_s| *dt_s > 0.0)?;
        Some(sample.fields.vector::<3>(delta)?.map(|axis| axis / dt_s))
    };
    if sample.instance > 0 {
        inertial(px4, sample.instance, over(0, 1), over(2, 3));
    }
}

/// Air data of a second barometer, in hPa until v1.13, in Pa since.
fn other_air(px4: &mut Px4, sample: &Sample<'_>) {
    const HPA_MAX: f32 = 2_000.0;
    let pressure = sample.fields.finite(0).filter(|pressure| *pressure > 0.0);
    let pressure = pressure.map(|it| Hectopascals(if it > HPA_MAX { it / 100.0 } else { it }));
    if sample.instance > 0 {
        px4.observe(Observation::Air(Air { instance: sample.instance, pressure, temperature: None }));
    }
}

fn outputs(px4: &mut Px4, sample: &Sample<'_>) {
    let pulse = |output: usize| sample.fields.element(0, output).map_or(0, |pulse| pulse.round() as u16);
    let pulses = std::array::from_fn::<u16, MOTORS_MAX, _>(pulse);
    px4.observe(Observation::Outputs(Outputs { port: sample.instance, pulses }));
}

/// Acceleration for a log without `sensor_combined`.
fn acceleration(px4: &mut Px4, sample: &Sample<'_>) {
    if !px4.motion.combined && is_due(px4, sample) {
        inertial(px4, 0, sample.fields.vector(0), px4.motion.rate);
    }
}

fn air(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    px4.motion.pressure_altitude = fields.finite(3);
    px4.observe(Observation::Air(Air {
        instance: 0,
        pressure: fields
            .finite(0)
            .filter(|pascals| *pascals > 0.0)
            .map(|pascals| Hectopascals(pascals / 100.0)),
        temperature: fields.finite(1).or_else(|| fields.finite(2)).map(Celsius),
    }));
}

/// Rotation from north, east, down to the body; real part first.
fn attitude(px4: &mut Px4, sample: &Sample<'_>) {
    let Some([w, x, y, z]) = sample.fields.vector::<4>(0) else { return };
    let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
    let pitch = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0).asin();
    let yaw = (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z));
    // Rates: here until v1.9, later in vehicle_angular_velocity. As in PX4's ATTITUDE.
    let rates = match [1, 2, 3].map(|field| sample.fields.finite(field)) {
        [Some(x), Some(y), Some(z)] => Some([x, y, z]),
        _ => px4.motion.rate,
    };
    px4.observe(Observation::Attitude(Attitude {
        roll: Radians(roll),
        pitch: Radians(pitch),
        yaw: Radians(yaw),
        rates: rates.map(|rates| rates.map(RadiansPerSecond)),
        boot_ms: Some((sample.recorded_us / 1_000) as u32),
    }));
}

/// Age of rates beside an attitude setpoint: some modes lack one of the two.
const RATES_AGE_US: u64 = 500_000;

fn attitude_setpoint(px4: &mut Px4, sample: &Sample<'_>) {
    let angles = || {
        let [roll, pitch] = [sample.fields.finite(1)?, sample.fields.finite(2)?].map(Radians);
        Some(AttitudeSetpoint { roll, pitch, rates: None })
    };
    let wanted = sample.fields.vector::<4>(0).and_then(AttitudeSetpoint::from_quaternion).or_else(angles);
    if let Some(wanted) = wanted {
        let fresh = |(us, _): &(u64, _)| sample.recorded_us.abs_diff(*us) <= RATES_AGE_US;
        let rates = px4.motion.rates_wanted.filter(fresh);
        let rates = rates.map(|(_, about)| WantedRates { about, of: None });
        px4.observe(Observation::AttitudeSetpoint(AttitudeSetpoint { rates, ..wanted }));
    }
}

fn local_position(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    let [x, y, z, vx, vy, vz] = [0, 1, 2, 3, 4, 5].map(|field| fields.finite(field));
    let altitude = match (fields.flag(6) && fields.flag(7), z, fields.finite(9)) {
        (true, Some(z), Some(reference)) => Some(reference - z),
        _ => px4.motion.pressure_altitude,
    };
    let velocity = [vx, vy, vz].map(|speed| speed.unwrap_or(0.0));
    px4.motion.local = Some(Local { z: z.filter(|_| fields.flag(6)), velocity, altitude });
    if let (Some(x), Some(y), Some(z), Some(vx), Some(vy), Some(vz)) = (x, y, z, vx, vy, vz) {
        px4.observe(Observation::LocalPosition(LocalPosition {
            position: [x, y, z].map(Metres),
            velocity: [vx, vy, vz].map(MetresPerSecond),
        }));
    }
    let heading = fields.finite(10).or_else(|| fields.finite(11));
    let [thrust, plane] = px4.motion.thrust;
    let throttle = thrust.into_iter().chain(plane).reduce(f32::max).or(px4.motion.motors);
    let armed = px4.system.armed();
    px4.observe(Observation::Hud(Hud {
        airspeed: px4.motion.airspeed.map(MetresPerSecond),
        groundspeed: vx.zip(vy).map(|(x, y)| MetresPerSecond(x.hypot(y))),
        heading_deg: heading.map(|radians| radians.to_degrees().rem_euclid(360.0)),
        throttle: if armed {
            throttle.map(|part| Fraction(part.clamp(0.0, 1.0)))
        } else {
            Some(Fraction(0.0))
        },
        altitude: altitude.map(Metres),
        climb: Some(MetresPerSecond(vz.filter(|_| fields.flag(8)).map_or(0.0, |down| -down))),
    }));
}

/// `GLOBAL_POSITION_INT`: heights are the local position's, if any.
fn global_position(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    let Some(altitude) = fields.finite(2) else { return };
    let local = px4.motion.local.unwrap_or(Local { z: None, velocity: [0.0; 3], altitude: None });
    let altitude = local.altitude.unwrap_or(altitude);
    let relative = match (px4.motion.home, local.z) {
        (Some(Home { z: Some(home), .. }), Some(z)) => home - z,
        (Some(Home { altitude: Some(home), .. }), None) => altitude - home,
        (_, Some(z)) => -z,
        (_, None) => 0.0,
    };
    px4.observe(Observation::GlobalPosition(GlobalPosition {
        position: place(fields.get(0), fields.get(1)),
        altitude: Metres(altitude),
        relative_altitude: Metres(relative),
        velocity: local.velocity.map(MetresPerSecond),
    }));
}

/// Degrees. 0, 0 means unknown.
pub(super) fn place(latitude: Option<f64>, longitude: Option<f64>) -> Option<Position> {
    let (latitude_deg, longitude_deg) = (latitude?, longitude?);
    let valid = (-90.0..=90.0).contains(&latitude_deg) && (-180.0..=180.0).contains(&longitude_deg);
    // MAVLink's resolution is 1e-7 degrees.
    let nowhere = latitude_deg.abs() < 1e-7 && longitude_deg.abs() < 1e-7;
    (valid && !nowhere).then_some(Position { latitude_deg, longitude_deg })
}

fn home(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    let valid = fields.get(2).is_none_or(|flag| flag != 0.0);
    px4.motion.home = valid.then(|| Home { altitude: fields.finite(0), z: fields.finite(1) });
}

fn airspeed_validated(px4: &mut Px4, sample: &Sample<'_>) {
    px4.motion.airspeed_validated = true;
    px4.motion.airspeed = sample.fields.finite(0).or_else(|| sample.fields.finite(1));
}

/// The air speed's topic before v1.10.
fn airspeed(px4: &mut Px4, sample: &Sample<'_>) {
    if !px4.motion.airspeed_validated {
        px4.motion.airspeed = sample.fields.finite(0);
    }
}

/// `ESTIMATOR_STATUS` of the flying estimator. Since v1.16 the compass has the heading's test ratio.
fn estimator_status(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    if sample.instance != px4.motion.estimator {
        return;
    }
    px4.motion.estimator_status = true;
    let ratio = |field| fields.finite(field).filter(|ratio| *ratio >= 0.0);
    px4.observe(Observation::Estimator(Estimator {
        scale: EstimatorScale::TestRatio,
        velocity: ratio(0),
        position_horizontal: ratio(1),
        position_vertical: ratio(2),
        compass: if fields.get(4).is_some() { ratio(4) } else { ratio(3) },
        flags: fields.count(5).unwrap_or(0) as u16,
    }));
    // Before v1.11 the estimator reports vibration, without clipped samples.
    if !px4.motion.imu_status
        && let Some(levels) = fields.vector::<3>(6)
    {
        px4.observe(vibration(levels.map(Some), [0; 3]));
    }
}

/// Without `estimator_status`, by sensor: the largest counts, as in PX4. These are squares (innovation by its limit), those are
/// not.
fn test_ratios(px4: &mut Px4, sample: &Sample<'_>) {
    if sample.instance != px4.motion.estimator || px4.motion.estimator_status {
        return;
    }
    let largest = |fields: std::ops::Range<usize>| {
        let elements =
            fields.flat_map(|field| (0..3).filter_map(move |element| sample.fields.element(field, element)));
        let squares = elements.filter(|square| square.is_finite() && *square >= 0.0);
        squares.reduce(f64::max).map(|square| square.sqrt() as f32)
    };
    px4.observe(Observation::Estimator(Estimator {
        scale: EstimatorScale::TestRatio,
        velocity: largest(0..5),
        position_horizontal: largest(5..7),
        position_vertical: largest(7..11),
        compass: largest(11..13),
        flags: px4.motion.estimator_flags,
    }));
}

/// Flags without `estimator_status`, as far as known.
fn estimator_flags(px4: &mut Px4, sample: &Sample<'_>) {
    const ATTITUDE: u16 = 1;
    const CONST_POS_MODE: u16 = 1 << 7;
    const GPS_GLITCH: u16 = 1 << 10;
    const ACCEL_ERROR: u16 = 1 << 11;
    if sample.instance == px4.motion.estimator {
        let bits = [ATTITUDE, CONST_POS_MODE, CONST_POS_MODE, GPS_GLITCH, ACCEL_ERROR];
        let set = bits.into_iter().enumerate().filter(|(field, _)| sample.fields.flag(*field));
        px4.motion.estimator_flags = set.fold(0, |all, (_, bit)| all | bit);
    }
}

/// NaN or zero: missing or stopped.
fn motors(px4: &mut Px4, sample: &Sample<'_>) {
    let given = (0..12).filter_map(|motor| sample.fields.element(0, motor)).filter(|part| part.is_finite());
    let running: Vec<f64> = given.filter(|part| *part > 0.0).collect();
    let sum: f64 = running.iter().sum();
    px4.motion.motors = Some((sum / running.len().max(1) as f64) as f32);
}

fn vibration(levels: [Option<f32>; 3], clips: [u32; 3]) -> Observation {
    Observation::Vibration(Vibration { scale: VibrationScale::Px4Metrics, levels, clips })
}

fn imu_status(px4: &mut Px4, sample: &Sample<'_>) {
    let fields = &sample.fields;
    px4.motion.imu_status = true;
    if let Some(clips) = px4.motion.clips.get_mut(usize::from(sample.instance)) {
        let sum: f64 = (0..3).filter_map(|axis| fields.element(5, axis)).sum();
        *clips = sum as u32;
    }
    let id = fields.count(0);
    // Without an id the first one flies.
    let flies =
        px4.motion.accelerometer.map_or(sample.instance == 0, |accelerometer| id == Some(accelerometer));
    if flies {
        let level = |field| fields.finite(field).filter(|level| *level >= 0.0);
        let levels = [level(1).or_else(|| level(2)), level(3), level(4)];
        px4.observe(vibration(levels, px4.motion.clips));
    }
}
