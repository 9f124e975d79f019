//! Estimator and GNSS.

use super::prelude::*;
use crate::gnss_constellation;
use crate::observation::{Estimator, EstimatorScale, Gnss, GnssIntegrity, VehicleKind, VibrationScale};
use crate::pairs::{Kind, SENSORS_MAX};
use crate::residual::Comparison;
use crate::vehicle::RECEIVERS_MAX;

/// Of values that are smoothed and beyond their usual range: three comparisons.
const SMOOTHED: [u16; 2] = [200, 1_000];
/// Four messages of a receiver at 5 Hz, two at 2 Hz. Dilutions of precision leap as satellites come and go, and wait longer.
const RECEIVER_SAYS: [u16; 2] = [600, 1_000];
const MARGIN: f32 = 0.5;

const ESTIMATOR: Check = Check {
    name: "ekf_variance",
    subsystem: Subsystem::Navigation,
    limits: Limits::above(Some(Param::EkfVarWarn), None, 0.05),
    // Two messages at 2 Hz. ArduPilot's failsafe waits for a second, and acts then.
    debounce_ms: [500, 1_000],
    when: CheckPhase::InFlight,
    stale_s: STALE,
    read: |inputs, _| estimator(inputs, EstimatorScale::Variance, largest),
    ..PLAIN
};

const GNSS: Check = Check {
    name: "gps_satellites",
    limits: Limits::below(Some(Param::GpsSatsWarn), None, 0.0),
    debounce_ms: [2_000, 1_000],
    instances: RECEIVERS_MAX as u8,
    of: InstanceKind::Receiver,
    read: |inputs, receiver| {
        let enough = inputs.params.get(Param::GpsSatsWarn) + MARGIN;
        gnss(inputs, receiver, |gnss| {
            let count = gnss.satellites.map(f32::from)?;
            Some(if is_exact(inputs, gnss) { count.max(enough) } else { count })
        })
    },
    ..ESTIMATOR
};

const MISMATCH: Check = Check {
    name: "accel_mismatch",
    unit: Unit::of("m/s2"),
    limits: Limits::above(Some(Param::AccMismWarn), None, 0.2),
    // Never stale: sensors are compared only in conditions where that is valid.
    stale_s: None,
    instances: SENSORS_MAX as u8,
    read: |inputs, sensor| mismatch(inputs, Kind::Accelerometer, sensor),
    ..ESTIMATOR
};

/// A sensor that repeats one value ([`crate::stuck`]). Never stale. A sensor that is not stuck is not thereby good.
const STUCK: Check = Check {
    name: "accel_stuck",
    unit: Unit::of("s"),
    limits: Limits::above(Some(Param::StuckWarn), None, 0.0),
    debounce_ms: [0, 1_000],
    alarm_only: true,
    read: |inputs, sensor| stuck(inputs, Kind::Accelerometer, sensor),
    ..MISMATCH
};

const SECOND: Check = Check {
    name: "ahrs2_tilt",
    role: Role::of(Group::Other, DISTURBANCES | ESTIMATORS),
    unit: Unit::of("deg"),
    limits: Limits::above(Some(Param::Ahrs2TiltWarn), None, 2.0),
    // A check that names the faulty sensor comes first.
    debounce_ms: [1_000, 1_000],
    instances: 1,
    read: |inputs, _| residual(inputs, Comparison::Ahrs2Tilt),
    ..MISMATCH
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Ekf, DISTURBANCES | Group::EkfClimb.bit()), ..ESTIMATOR },
    // ArduPilot's failsafe needs two of compass, velocity and position beyond the limit. Planes have none: they
    // fly on by airspeed.
    row!("ekf_failsafe" ESTIMATOR, above(_ EkfVarCrit 0.05),
    role: Role::of(Group::Ekf, DISTURBANCES | Group::EkfClimb.bit()), read: |inputs, _| {
        let reading = estimator(inputs, EstimatorScale::Variance, second_largest);
        reading.filter(|_| inputs.vehicle.kind() != VehicleKind::Plane)
    }),
    row!("ekf_compass" ESTIMATOR, role: Role::of(Group::Sensor, COMPASS | Group::CompassUse.bit() | TURNS),
        read: |inputs, _| estimator(inputs, EstimatorScale::Variance, |estimator| estimator.compass)),
    row!("ekf_test_ratio" ESTIMATOR, above(EkfRatioWarn EkfRatioCrit 0.05),
        role: Role::of(Group::Ekf, DISTURBANCES | Group::EkfClimb.bit()),
        read: |inputs, _| estimator(inputs, EstimatorScale::TestRatio, largest)),
    // PX4 reports no ratio of a compass that it does not use: see `compass_unused`.
    row!("ekf_mag_ratio" ESTIMATOR, above(EkfRatioWarn EkfRatioCrit 0.05),
        role: Role::of(Group::Sensor, COMPASS | Group::CompassUse.bit() | TURNS), stale_s: None,
        told_after_s: 10, read: |inputs, _| estimator(inputs, EstimatorScale::TestRatio, |estimator| estimator.compass)),
    // A compass in use is not thereby good.
    row!("compass_unused" ESTIMATOR, above(AlertWarn _ 0.05),
        role: Role::of(Group::CompassUse, COMPASS | TURNS), unit: Unit::FLAG, alarm_only: true,
        read: |inputs, _| inputs.derived.crosschecks.compass_use.unused(inputs.now)),
    Check { role: Role::of(Group::AccelMismatch, Group::AccelFault.bit() | VIBRATION), ..MISMATCH },
    row!("gyro_mismatch" MISMATCH, above(GyroMismWarn _ 0.02),
        role: Role::of(Group::GyroMismatch, Group::GyroFault.bit() | VIBRATION), unit: Unit::of("rad/s"),
        debounce_ms: SMOOTHED, read: |inputs, sensor| mismatch(inputs, Kind::Gyro, sensor)),
    // What shakes the accelerometer shakes the gyro.
    row!("gyro_noise" MISMATCH, above(GyroNoiseWarn _ 0.05), role: Role::of(Group::GyroNoise, VIBRATION),
        unit: Unit::of("rad/s"), debounce_ms: [2_000, 0], stale_s: STALE, instances: 1,
        read: |inputs, _| vibration(inputs, VibrationScale::Px4Metrics, |[_, rate, _]| rate)),
    // It goes by the attitude and a receiver too.
    row!("imu_gps" MISMATCH, above(ImuGpsWarn _ 0.3),
        role: Role::of(Group::ImuGnss, WRONG_RECEIVERS | INERTIAL | VIBRATION), instances: 1,
        read: |inputs, _| inputs.derived.crosschecks.imu_gnss.residual(inputs.now)),
    row!("compass_mismatch" MISMATCH, above(MagMismWarn _ 5.0),
        role: Role::of(Group::CompassMismatch, Group::CompassFault.bit()), unit: Unit::of("%"),
        debounce_ms: SMOOTHED,
        read: |inputs, sensor| mismatch(inputs, Kind::Compass, sensor)),
    row!("compass_heading" MISMATCH, above(MagHeadWarn _ 3.0),
        role: Role::of(Group::CompassUse, COMPASS | TURNS), unit: Unit::of("deg"),
        debounce_ms: SMOOTHED, instances: 1,
        read: |inputs, _| residual(inputs, Comparison::MagHeading)),
    row!("baro_mismatch" MISMATCH, above(BaroMismWarn _ 1.0),
        role: Role::of(Group::Sensor, Group::BaroFault.bit()), unit: Unit::of("m"),
        debounce_ms: SMOOTHED,
        read: |inputs, sensor| mismatch(inputs, Kind::Barometer, sensor)),
    row!("baro_height" MISMATCH, above(BaroGpsWarn _ 1.0),
        role: Role::of(Group::Sensor, Group::BaroFault.bit() | RECEIVERS), unit: Unit::of("m"),
        debounce_ms: [1_000, 1_000], instances: 1,
        read: |inputs, _| residual(inputs, Comparison::BaroGnss)),
    row!("baro_noise" MISMATCH, above(BaroNoiseWarn _ 0.5),
        role: Role::of(Group::Sensor, Group::BaroFault.bit() | Group::ImuGnss.bit()), unit: Unit::of("m"),
        instances: 1, read: |inputs, _| residual(inputs, Comparison::BaroNoise)),
    row!("ekf_climb" MISMATCH, above(EkfClimbWarn EkfClimbCrit 1.0),
        role: Role::of(Group::EkfClimb, DISTURBANCES), unit: Unit::of("m/s"), debounce_ms: [500, 500],
        instances: 1, read: |inputs, _| residual(inputs, Comparison::BaroClimb)),
    SECOND,
    row!("ahrs2_height" SECOND, above(Ahrs2HgtWarn Ahrs2HgtCrit 1.0), unit: Unit::of("m"),
        read: |inputs, _| residual(inputs, Comparison::Ahrs2Height)),
    row!("ahrs2_position" SECOND, above(Ahrs2PosWarn _ 2.0), unit: Unit::of("m"),
        read: |inputs, _| residual(inputs, Comparison::Ahrs2Position)),
    Check { role: Role::of(Group::AccelFault, 0), ..STUCK },
    row!("gyro_stuck" STUCK, role: Role::of(Group::GyroFault, 0),
        read: |inputs, sensor| stuck(inputs, Kind::Gyro, sensor)),
    // What changed all compasses is in one message up to 0.2 s before another.
    row!("compass_stuck" STUCK, role: Role::of(Group::CompassFault, 0), debounce_ms: [300, 1_000],
        read: |inputs, sensor| stuck(inputs, Kind::Compass, sensor)),
    row!("baro_stuck" STUCK, role: Role::of(Group::BaroFault, 0),
        read: |inputs, sensor| stuck(inputs, Kind::Barometer, sensor)),
    // The time depends on the vehicle's movement.
    row!("gps_stuck" STUCK, role: Role::of(Group::GnssFrozen, 0), instances: RECEIVERS_MAX as u8,
        read: |inputs, receiver| inputs.derived.crosschecks.repeats.receiver_stuck(inputs.now, receiver)),
    Check { role: Role::of(Group::GnssQuality, Group::GnssLost.bit()), debounce_ms: RECEIVER_SAYS, ..GNSS },
    row!("gps_sats_fall" GNSS, above(GpsSatsFall _ 5.0),
    role: Role::of(Group::SatellitesLost, Group::GnssLost.bit() | Group::GnssQuality.bit()),
    unit: Unit::of("%"), debounce_ms: [1_000, 1_000], stale_s: None, read: |inputs, receiver| {
        let residuals = &inputs.derived.crosschecks.residuals;
        gnss_constellation::satellites_lost(residuals, inputs.now, receiver)
    }),
    // Never stale: only a moving receiver can be judged.
    row!("gps_speed" GNSS, above(GpsSpeedWarn _ 0.2),
    role: Role::of(Group::GnssMotion, Group::GnssFrozen.bit()), unit: Unit::of("m/s"), stale_s: None,
    read: |inputs, receiver| {
        inputs.derived.crosschecks.velocities.get(usize::from(receiver))?.residual(inputs.now)
    }),
    // Two messages at 5 Hz.
    // It goes by the barometer too.
    row!("gps_height" GNSS, above(GpsHeightWarn _ 1.0),
        role: Role::of(Group::GnssMotion, Group::GnssFrozen.bit()), unit: Unit::of("m"),
        debounce_ms: [200, 1_000], stale_s: None, instances: 1, of: InstanceKind::Vehicle,
        read: |inputs, _| inputs.derived.crosschecks.heights.receiver_leapt(inputs.now)),
    // Nobody acts on a few seconds of it.
    row!("gps_hdop" GNSS, above(GpsHdopWarn _ 0.1), role: Role::of(Group::GnssQuality, Group::GnssLost.bit()), told_after_s: 10,
    read: |inputs, receiver| {
        let little = inputs.params.get(Param::GpsHdopWarn) - MARGIN;
        gnss(inputs, receiver, |gnss| {
            gnss.hdop.map(|hdop| if is_exact(inputs, gnss) { hdop.min(little) } else { hdop })
        })
    }),
    row!("gps_hdop_rise" GNSS, above(GpsHdopRise _ 0.1),
    role: Role::of(Group::GnssWord, Group::GnssLost.bit() | Group::GnssQuality.bit() | Group::SatellitesLost.bit()),
    unit: Unit::of("times"), debounce_ms: [1_000, 1_000], stale_s: None, read: |inputs, receiver| {
        gnss_constellation::hdop_rise(&inputs.derived.crosschecks.residuals, inputs.now, receiver)
    }),
    row!("gps_accuracy" GNSS, above(GpsHaccWarn _ 0.1),
        role: Role::of(Group::GnssQuality, Group::GnssLost.bit()), unit: Unit::of("m"),
        debounce_ms: RECEIVER_SAYS,
        read: |inputs, receiver| gnss(inputs, receiver, |gnss| gnss.accuracy.map(|accuracy| accuracy.0))),
    // Two messages without one.
    row!("gps_fix" GNSS, below(_ GpsFixCrit 0.0), role: Role::of(Group::GnssLost, 0), unit: Unit::FLAG,
        debounce_ms: [2_000, 200],
        read: |inputs, receiver| gnss(inputs, receiver, |gnss| Some(f32::from(gnss.fix)))),
    // A receiver that mitigates jamming has a good fix.
    row!("gps_jamming" GNSS, above(_ GpsJamCrit 0.0), role: Role::of(Group::GnssLost, 0),
        unit: Unit::FLAG, when: CheckPhase::Always,
        read: |inputs, receiver| integrity(inputs, receiver, |known| known.jamming)),
    row!("gps_spoofing" GNSS, above(GpsJamWarn GpsJamCrit 0.0), role: Role::of(Group::GnssLost, 0),
        unit: Unit::FLAG, when: CheckPhase::Always,
        read: |inputs, receiver| integrity(inputs, receiver, |known| known.spoofing)),
    alert!(Gyro Navigation, Role::of(Group::GyroFault, 0)),
    alert!(Accelerometer Navigation, Role::of(Group::AccelFault, 0)),
    alert!(Compass Navigation, Role::of(Group::CompassFault, TURNS)),
    alert!(Barometer Navigation, Role::of(Group::BaroFault, 0)),
    alert!(Airspeed Navigation, Role::of(Group::Sensor, 0)),
    Check {
        read: |inputs, _| said(inputs, Cause::Gnss).filter(|_| is_gnss_judged(inputs)),
        ..alert!(Gnss Navigation, Role::of(Group::GnssWord, WRONG_RECEIVERS | INERTIAL | Group::ImuGnss.bit() | VIBRATION))
    },
    alert!(Ranging Navigation, Role::NONE),
    alert!(Terrain Navigation, Role::NONE),
    alert!(Estimator Navigation, Role::of(Group::Ekf, Group::Reboot.bit() | DISTURBANCES | Group::EkfClimb.bit())),
];

fn residual(inputs: &Inputs<'_>, of: Comparison) -> Option<Reading> {
    inputs.derived.crosschecks.residuals.reading(inputs.now, of)
}

fn mismatch(inputs: &Inputs<'_>, kind: Kind, sensor: u8) -> Option<Reading> {
    inputs.derived.crosschecks.pairs[kind as usize].mismatch(inputs.now, kind, sensor.into())
}

fn stuck(inputs: &Inputs<'_>, kind: Kind, sensor: u8) -> Option<Reading> {
    inputs.derived.crosschecks.stuck(inputs.now, kind, sensor)
}

fn estimator(
    inputs: &Inputs<'_>,
    scale: EstimatorScale,
    value: fn(&Estimator) -> Option<f32>,
) -> Option<Reading> {
    inputs.vehicle.estimator.read(|estimator| value(estimator).filter(|_| estimator.scale == scale))
}

fn largest(estimator: &Estimator) -> Option<f32> {
    [estimator.velocity, estimator.position_horizontal, estimator.position_vertical]
        .into_iter()
        .flatten()
        .reduce(f32::max)
}

fn second_largest(estimator: &Estimator) -> Option<f32> {
    let known = [estimator.velocity, estimator.position_horizontal, estimator.compass].into_iter().flatten();
    let known = known.filter(|value| !value.is_nan());
    let fold = |[first, second]: [f32; 2], value: f32| [first.max(value), second.max(first.min(value))];
    let [_, second] = known.fold([f32::NEG_INFINITY; 2], fold);
    Some(second).filter(|second| second.is_finite())
}

/// Before its first fix a vehicle stands, or flies without GNSS.
fn is_gnss_judged(inputs: &Inputs<'_>) -> bool {
    let reports = inputs.vehicle.gnss.iter().any(|gnss| gnss.get().is_some());
    !reports || inputs.derived.had_fix.contains(&true)
}

fn gnss(inputs: &Inputs<'_>, receiver: u8, value: impl FnOnce(&Gnss) -> Option<f32>) -> Option<Reading> {
    let place = usize::from(receiver);
    let had_fix = *inputs.derived.had_fix.get(place)?;
    inputs.vehicle.gnss.get(place)?.read(|gnss| value(gnss).filter(|_| had_fix))
}

/// A receiver with half of the allowed inaccuracy is exact, with however few satellites: their number depends on the systems and bands that it
/// receives.
fn is_exact(inputs: &Inputs<'_>, gnss: &Gnss) -> bool {
    // Without a fix the accuracy is an old one.
    gnss.fix >= 3
        && gnss.accuracy.is_some_and(|accuracy| accuracy.0 <= inputs.params.get(Param::GpsHaccWarn) / 2.0)
}

fn integrity(inputs: &Inputs<'_>, receiver: u8, state: fn(&GnssIntegrity) -> u8) -> Option<Reading> {
    let slot = inputs.vehicle.gnss_integrity.get(usize::from(receiver))?;
    slot.read(|known| Some(f32::from(state(known))).filter(|state| *state > 0.0))
}
