//! Estimator and GNSS.

use super::check::{Check, Debounce, InstanceOf, Limits, Unit, When};
use super::common::{PLAIN, STALE, alert, vibration};
use super::finding::Subsystem;
use super::inputs::Inputs;
use super::suppression::{
    COMPASS, DISTURBANCES, ESTIMATORS, Group, INERTIAL, RECEIVERS, Role, TURNS, VIBRATION, WRONG_RECEIVERS,
};
use crate::cause::Cause;
use crate::gnss_constellation;
use crate::latest::Reading;
use crate::observation::{Estimator, EstimatorScale, Gnss, GnssIntegrity, VehicleKind, VibrationScale};
use crate::pairs::{Kind, SENSORS_MAX};
use crate::params::Param;
use crate::residual::Comparison;
use crate::vehicle::RECEIVERS_MAX;

/// Of values that are smoothed and beyond their usual range: three comparisons.
const SMOOTHED: Debounce = Debounce::millis(200);
/// Four messages of a receiver at 5 Hz, two at 2 Hz. Dilutions of precision leap as satellites come and go, and wait longer.
const RECEIVER_SAYS: Debounce = Debounce::millis(600);
/// Hysteresis of these checks.
const MARGIN: f32 = 0.5;

const ESTIMATOR: Check = Check {
    name: "ekf_variance",
    subsystem: Subsystem::Navigation,
    limits: Limits::above(Some(Param::EkfVarWarn), None, 0.05),
    // Two messages at 2 Hz. ArduPilot's failsafe waits for a second, and acts then.
    debounce: [Debounce::millis(500), Debounce::secs(1)],
    when: When::InFlight,
    stale_s: STALE,
    read: |inputs, _| estimator(inputs, EstimatorScale::Variance, largest),
    ..PLAIN
};

const GNSS: Check = Check {
    name: "gps_satellites",
    limits: Limits::below(Some(Param::GpsSatsWarn), None, 0.0),
    debounce: [Debounce::secs(2), Debounce::secs(1)],
    instances: RECEIVERS_MAX as u8,
    of: InstanceOf::Receiver,
    read: |inputs, receiver| {
        let enough = inputs.params.get(Param::GpsSatsWarn) + MARGIN;
        gnss(inputs, receiver, |gnss| {
            let count = gnss.satellites.map(f32::from)?;
            Some(if is_exact(inputs, gnss) { count.max(enough) } else { count })
        })
    },
    ..ESTIMATOR
};

/// Two sensors of a kind against each other ([`crate::crosscheck`]).
const MISMATCH: Check = Check {
    name: "accel_mismatch",
    unit: Unit::of("m/s2"),
    limits: Limits::above(Some(Param::AccMismWarn), None, 0.2),
    // Never stale: sensors are compared only in conditions where that is valid.
    stale_s: None,
    instances: SENSORS_MAX as u8,
    of: InstanceOf::Pair,
    read: |inputs, sensor| mismatch(inputs, Kind::Accelerometer, sensor),
    ..ESTIMATOR
};

/// A sensor that repeats one value ([`crate::stuck`]). Never stale. A sensor that is not stuck is not thereby good.
const STUCK: Check = Check {
    name: "accel_stuck",
    unit: Unit::of("s"),
    limits: Limits::above(Some(Param::StuckWarn), None, 0.0),
    debounce: [Debounce::NONE, Debounce::secs(1)],
    alarm_only: true,
    of: InstanceOf::Sensor,
    read: |inputs, sensor| stuck(inputs, Kind::Accelerometer, sensor),
    ..MISMATCH
};

/// The estimator that flies against the second one (`ahrs2_residual`).
const SECOND: Check = Check {
    name: "ahrs2_tilt",
    role: Role::of(Group::Other, DISTURBANCES | ESTIMATORS),
    unit: Unit::of("deg"),
    limits: Limits::above(Some(Param::Ahrs2TiltWarn), None, 2.0),
    // A check that names the faulty sensor comes first.
    debounce: [Debounce::secs(1); 2],
    instances: 1,
    of: InstanceOf::Vehicle,
    read: |inputs, _| residual(inputs, Comparison::Ahrs2Tilt),
    ..MISMATCH
};

pub(super) const CHECKS: &[Check] = &[
    Check { role: Role::of(Group::Ekf, DISTURBANCES | Group::EkfClimb.bit()), ..ESTIMATOR },
    Check {
        // ArduPilot's failsafe needs two of compass, velocity and position beyond the limit. Planes have none: they
        // fly on by airspeed.
        name: "ekf_failsafe",
        role: Role::of(Group::Ekf, DISTURBANCES | Group::EkfClimb.bit()),
        limits: Limits::above(None, Some(Param::EkfVarCrit), 0.05),
        read: |inputs, _| {
            let reading = estimator(inputs, EstimatorScale::Variance, second_largest);
            reading.filter(|_| inputs.vehicle.kind() != VehicleKind::Plane)
        },
        ..ESTIMATOR
    },
    Check {
        name: "ekf_compass",
        role: Role::of(Group::Sensor, COMPASS | Group::CompassUse.bit() | TURNS),
        read: |inputs, _| estimator(inputs, EstimatorScale::Variance, |estimator| estimator.compass),
        ..ESTIMATOR
    },
    Check {
        name: "ekf_test_ratio",
        role: Role::of(Group::Ekf, DISTURBANCES | Group::EkfClimb.bit()),
        limits: Limits::above(Some(Param::EkfRatioWarn), Some(Param::EkfRatioCrit), 0.05),
        read: |inputs, _| estimator(inputs, EstimatorScale::TestRatio, largest),
        ..ESTIMATOR
    },
    Check {
        name: "ekf_mag_ratio",
        role: Role::of(Group::Sensor, COMPASS | Group::CompassUse.bit() | TURNS),
        limits: Limits::above(Some(Param::EkfRatioWarn), Some(Param::EkfRatioCrit), 0.05),
        read: |inputs, _| estimator(inputs, EstimatorScale::TestRatio, |estimator| estimator.compass),
        // PX4 reports no ratio of a compass that it does not use: see `compass_unused`.
        stale_s: None,
        ..ESTIMATOR
    },
    Check {
        name: "compass_unused",
        role: Role::of(Group::CompassUse, COMPASS | TURNS),
        unit: Unit::FLAG,
        limits: Limits::above(Some(Param::AlertWarn), None, 0.05),
        // A compass in use is not thereby good.
        alarm_only: true,
        read: |inputs, _| inputs.derived.crosschecks.compass_use.unused(inputs.now),
        ..ESTIMATOR
    },
    Check { role: Role::of(Group::AccelMismatch, Group::AccelFault.bit() | VIBRATION), ..MISMATCH },
    Check {
        name: "gyro_mismatch",
        role: Role::of(Group::GyroMismatch, Group::GyroFault.bit() | VIBRATION),
        unit: Unit::of("rad/s"),
        limits: Limits::above(Some(Param::GyroMismWarn), None, 0.02),
        debounce: [SMOOTHED, Debounce::secs(1)],
        read: |inputs, sensor| mismatch(inputs, Kind::Gyro, sensor),
        ..MISMATCH
    },
    Check {
        name: "gyro_noise",
        role: Role::of(Group::GyroNoise, 0),
        unit: Unit::of("rad/s"),
        limits: Limits::above(Some(Param::GyroNoiseWarn), None, 0.05),
        instances: 1,
        stale_s: STALE,
        of: InstanceOf::Vehicle,
        read: |inputs, _| vibration(inputs, VibrationScale::Px4Metrics, |[_, rate, _]| rate),
        ..MISMATCH
    },
    Check {
        name: "imu_gps",
        role: Role::of(Group::ImuGnss, WRONG_RECEIVERS | INERTIAL | VIBRATION),
        limits: Limits::above(Some(Param::ImuGpsWarn), None, 0.3),
        instances: 1,
        // It goes by the attitude and a receiver too.
        of: InstanceOf::Vehicle,
        read: |inputs, _| inputs.derived.crosschecks.imu_gnss.residual(inputs.now),
        ..MISMATCH
    },
    Check {
        name: "compass_mismatch",
        role: Role::of(Group::CompassMismatch, Group::CompassFault.bit()),
        unit: Unit::of("%"),
        limits: Limits::above(Some(Param::MagMismWarn), None, 5.0),
        debounce: [SMOOTHED, Debounce::secs(1)],
        read: |inputs, sensor| mismatch(inputs, Kind::Compass, sensor),
        ..MISMATCH
    },
    Check {
        name: "compass_heading",
        role: Role::of(Group::CompassUse, COMPASS | TURNS),
        unit: Unit::of("deg"),
        limits: Limits::above(Some(Param::MagHeadWarn), None, 3.0),
        debounce: [SMOOTHED, Debounce::secs(1)],
        instances: 1,
        of: InstanceOf::Vehicle,
        read: |inputs, _| residual(inputs, Comparison::MagHeading),
        ..MISMATCH
    },
    Check {
        name: "baro_mismatch",
        role: Role::of(Group::Sensor, Group::BaroFault.bit()),
        unit: Unit::of("m"),
        limits: Limits::above(Some(Param::BaroMismWarn), None, 1.0),
        debounce: [SMOOTHED, Debounce::secs(1)],
        read: |inputs, sensor| mismatch(inputs, Kind::Barometer, sensor),
        ..MISMATCH
    },
    Check {
        name: "baro_height",
        role: Role::of(Group::Sensor, Group::BaroFault.bit() | RECEIVERS),
        unit: Unit::of("m"),
        limits: Limits::above(Some(Param::BaroGpsWarn), None, 1.0),
        debounce: [Debounce::secs(1); 2],
        instances: 1,
        of: InstanceOf::Sensor,
        read: |inputs, _| residual(inputs, Comparison::BaroGnss),
        ..MISMATCH
    },
    Check {
        name: "baro_noise",
        role: Role::of(Group::Sensor, Group::BaroFault.bit() | Group::ImuGnss.bit()),
        unit: Unit::of("m"),
        limits: Limits::above(Some(Param::BaroNoiseWarn), None, 0.5),
        instances: 1,
        of: InstanceOf::Sensor,
        read: |inputs, _| residual(inputs, Comparison::BaroNoise),
        ..MISMATCH
    },
    Check {
        name: "ekf_climb",
        role: Role::of(Group::EkfClimb, DISTURBANCES),
        unit: Unit::of("m/s"),
        limits: Limits::above(Some(Param::EkfClimbWarn), Some(Param::EkfClimbCrit), 1.0),
        debounce: [Debounce::millis(500); 2],
        instances: 1,
        of: InstanceOf::Sensor,
        read: |inputs, _| residual(inputs, Comparison::BaroClimb),
        ..MISMATCH
    },
    SECOND,
    Check {
        name: "ahrs2_height",
        unit: Unit::of("m"),
        limits: Limits::above(Some(Param::Ahrs2HgtWarn), Some(Param::Ahrs2HgtCrit), 1.0),
        read: |inputs, _| residual(inputs, Comparison::Ahrs2Height),
        ..SECOND
    },
    Check {
        name: "ahrs2_position",
        unit: Unit::of("m"),
        limits: Limits::above(Some(Param::Ahrs2PosWarn), None, 2.0),
        read: |inputs, _| residual(inputs, Comparison::Ahrs2Position),
        ..SECOND
    },
    Check { role: Role::of(Group::AccelFault, 0), ..STUCK },
    Check {
        name: "gyro_stuck",
        role: Role::of(Group::GyroFault, 0),
        read: |inputs, sensor| stuck(inputs, Kind::Gyro, sensor),
        ..STUCK
    },
    Check {
        name: "compass_stuck",
        role: Role::of(Group::CompassFault, 0),
        // What changed all compasses is in one message up to 0.2 s before another.
        debounce: [Debounce::millis(300), Debounce::secs(1)],
        read: |inputs, sensor| stuck(inputs, Kind::Compass, sensor),
        ..STUCK
    },
    Check {
        name: "baro_stuck",
        role: Role::of(Group::BaroFault, 0),
        read: |inputs, sensor| stuck(inputs, Kind::Barometer, sensor),
        ..STUCK
    },
    Check {
        name: "gps_stuck",
        role: Role::of(Group::GnssFrozen, 0),
        instances: RECEIVERS_MAX as u8,
        // It goes by how far the vehicle moved.
        of: InstanceOf::Vehicle,
        read: |inputs, receiver| inputs.derived.crosschecks.repeats.receiver_stuck(inputs.now, receiver),
        ..STUCK
    },
    Check {
        role: Role::of(Group::GnssQuality, Group::GnssLost.bit()),
        debounce: [RECEIVER_SAYS, Debounce::secs(1)],
        ..GNSS
    },
    Check {
        name: "gps_sats_fall",
        role: Role::of(Group::SatellitesLost, Group::GnssLost.bit() | Group::GnssQuality.bit()),
        unit: Unit::of("%"),
        stale_s: None,
        limits: Limits::above(Some(Param::GpsSatsFall), None, 5.0),
        debounce: [Debounce::secs(1); 2],
        read: |inputs, receiver| {
            let residuals = &inputs.derived.crosschecks.residuals;
            gnss_constellation::satellites_lost(residuals, inputs.now, receiver)
        },
        ..GNSS
    },
    Check {
        name: "gps_speed",
        role: Role::of(Group::GnssMotion, Group::GnssFrozen.bit()),
        unit: Unit::of("m/s"),
        // Never stale: only a moving receiver can be judged.
        stale_s: None,
        limits: Limits::above(Some(Param::GpsSpeedWarn), None, 0.2),
        read: |inputs, receiver| {
            inputs.derived.crosschecks.velocities.get(usize::from(receiver))?.residual(inputs.now)
        },
        ..GNSS
    },
    Check {
        name: "gps_height",
        role: Role::of(Group::GnssMotion, Group::GnssFrozen.bit()),
        unit: Unit::of("m"),
        stale_s: None,
        limits: Limits::above(Some(Param::GpsHeightWarn), None, 1.0),
        // Two messages at 5 Hz.
        debounce: [Debounce::millis(200), Debounce::secs(1)],
        instances: 1,
        // It goes by the barometer too.
        of: InstanceOf::Vehicle,
        read: |inputs, _| inputs.derived.crosschecks.heights.receiver_leapt(inputs.now),
        ..GNSS
    },
    Check {
        name: "gps_hdop",
        role: Role::of(Group::GnssQuality, Group::GnssLost.bit()),
        limits: Limits::above(Some(Param::GpsHdopWarn), None, 0.1),
        read: |inputs, receiver| {
            let little = inputs.params.get(Param::GpsHdopWarn) - MARGIN;
            gnss(inputs, receiver, |gnss| {
                gnss.hdop.map(|hdop| if is_exact(inputs, gnss) { hdop.min(little) } else { hdop })
            })
        },
        ..GNSS
    },
    Check {
        name: "gps_hdop_rise",
        role: Role::of(
            Group::GnssWord,
            Group::GnssLost.bit() | Group::GnssQuality.bit() | Group::SatellitesLost.bit(),
        ),
        unit: Unit::of("times"),
        stale_s: None,
        limits: Limits::above(Some(Param::GpsHdopRise), None, 0.1),
        debounce: [Debounce::secs(1); 2],
        read: |inputs, receiver| {
            gnss_constellation::hdop_rise(&inputs.derived.crosschecks.residuals, inputs.now, receiver)
        },
        ..GNSS
    },
    Check {
        name: "gps_accuracy",
        role: Role::of(Group::GnssQuality, Group::GnssLost.bit()),
        unit: Unit::of("m"),
        limits: Limits::above(Some(Param::GpsHaccWarn), None, 0.1),
        debounce: [RECEIVER_SAYS, Debounce::secs(1)],
        read: |inputs, receiver| gnss(inputs, receiver, |gnss| gnss.accuracy.map(|accuracy| accuracy.0)),
        ..GNSS
    },
    Check {
        name: "gps_fix",
        role: Role::of(Group::GnssLost, 0),
        unit: Unit::FLAG,
        limits: Limits::below(None, Some(Param::GpsFixCrit), 0.0),
        // Two messages without one.
        debounce: [Debounce::secs(2), Debounce::millis(200)],
        read: |inputs, receiver| gnss(inputs, receiver, |gnss| Some(f32::from(gnss.fix))),
        ..GNSS
    },
    Check {
        name: "gps_jamming",
        role: Role::of(Group::GnssLost, 0),
        unit: Unit::FLAG,
        limits: Limits::above(Some(Param::GpsJamWarn), Some(Param::GpsJamCrit), 0.0),
        when: When::Always,
        read: |inputs, receiver| integrity(inputs, receiver, |known| known.jamming),
        ..GNSS
    },
    Check {
        name: "gps_spoofing",
        role: Role::of(Group::GnssLost, 0),
        unit: Unit::FLAG,
        limits: Limits::above(Some(Param::GpsJamWarn), Some(Param::GpsJamCrit), 0.0),
        when: When::Always,
        read: |inputs, receiver| integrity(inputs, receiver, |known| known.spoofing),
        ..GNSS
    },
    alert::<{ Cause::Gyro as usize }>(Subsystem::Navigation, Role::of(Group::GyroFault, 0)),
    alert::<{ Cause::Accelerometer as usize }>(Subsystem::Navigation, Role::of(Group::AccelFault, 0)),
    alert::<{ Cause::Compass as usize }>(Subsystem::Navigation, Role::of(Group::CompassFault, TURNS)),
    alert::<{ Cause::Barometer as usize }>(Subsystem::Navigation, Role::of(Group::BaroFault, 0)),
    alert::<{ Cause::Airspeed as usize }>(Subsystem::Navigation, Role::of(Group::Sensor, 0)),
    alert::<{ Cause::Gnss as usize }>(
        Subsystem::Navigation,
        Role::of(Group::GnssWord, WRONG_RECEIVERS | INERTIAL | Group::ImuGnss.bit() | VIBRATION),
    ),
    alert::<{ Cause::Ranging as usize }>(Subsystem::Navigation, Role::NONE),
    alert::<{ Cause::Terrain as usize }>(Subsystem::Navigation, Role::NONE),
    alert::<{ Cause::Estimator as usize }>(
        Subsystem::Navigation,
        Role::of(Group::Ekf, Group::Reboot.bit() | DISTURBANCES | Group::EkfClimb.bit()),
    ),
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

/// The compass has a check of its own, which names it.
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

/// A second receiver that never had a fix is not fitted; it says nothing.
fn gnss(inputs: &Inputs<'_>, receiver: u8, value: impl FnOnce(&Gnss) -> Option<f32>) -> Option<Reading> {
    let slot = inputs.vehicle.gnss.get(usize::from(receiver))?;
    slot.read(|gnss| value(gnss).filter(|_| inputs.derived.had_fix(receiver)))
}

/// A receiver with half of the allowed inaccuracy is exact, with however few satellites: their number depends on the systems and bands that it
/// receives.
fn is_exact(inputs: &Inputs<'_>, gnss: &Gnss) -> bool {
    // Without a fix the accuracy is an old one.
    gnss.fix >= 3
        && gnss.accuracy.is_some_and(|accuracy| accuracy.0 <= inputs.params.get(Param::GpsHaccWarn) / 2.0)
}

/// A state of a receiver; 0 is unknown.
fn integrity(inputs: &Inputs<'_>, receiver: u8, state: fn(&GnssIntegrity) -> u8) -> Option<Reading> {
    let slot = inputs.vehicle.gnss_integrity.get(usize::from(receiver))?;
    slot.read(|known| Some(f32::from(state(known))).filter(|state| *state > 0.0))
}
