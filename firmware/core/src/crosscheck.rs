//! Sensors against each other and against what they imply: the front ends of [`crate::residual`]. An inertial sensor that sends
//! nothing but zeros is not fitted.
//!
//! | sensor | against | module |
//! |---|---|---|
//! | each of a kind | the others of its kind | [`crate::pairs`] |
//! | each | its own last values | [`crate::stuck`] |
//! | compass | yaw of the estimator | [`crate::mag_heading_residual`] |
//! | barometer | height of GNSS, climb | [`crate::baro_gnss`] |
//! | receiver | its own positions; its baseline | [`crate::gnss_velocity_residual`], [`crate::gnss_constellation`] |
//! | estimator | DCM | [`crate::ahrs2_residual`] |
//! | accelerometer, attitude | velocity of the receiver | [`crate::imu_gnss`] |
//! | vibration | its baseline | [`Crosschecks::take_vibration`] |
//! | body rates | their setpoint | [`crate::rate_tracking`] |

use crate::baro_gnss::Heights;
use crate::flight::Flight;
use crate::gates;
use crate::gnss_velocity_residual::GnssVelocity;
use crate::imu_gnss::ImuGnssResidual;
use crate::latest::Reading;
use crate::mag_heading_residual::{self, CompassUse};
use crate::motion::{IDLE_THROTTLE, throttle};
use crate::observation::{Air, AttitudeSetpoint, Gnss, Imu, Observation, Vibration, VibrationScale};
use crate::pairs::{Kind, Pairs};
use crate::rate_tracking::{self, FullThrust, RateSetpoint};
use crate::residual::{Comparison, Residuals};
use crate::stuck::Repeats;
use crate::time::{BootMs, FRESH, Millis, Stamp};
use crate::vehicle::{RECEIVERS_MAX, Vehicle};
use crate::{ahrs2_residual, gnss_constellation};

const NOT_COMPARED: [f32; 3] = [f32::NAN; 3];
/// Between steps.
const EVERY: Millis = Millis::from_millis(100);

state! {
    pub(crate) struct Crosschecks {
        pub(crate) residuals: Residuals,
        pub(crate) pairs: [Pairs; Kind::COUNT] = [Pairs::default(); Kind::COUNT],
        pub(crate) repeats: Repeats,
        pub(crate) velocities: [GnssVelocity; RECEIVERS_MAX],
        pub(crate) imu_gnss: ImuGnssResidual,
        pub(crate) heights: Heights,
        pub(crate) compass_use: CompassUse,
        rate_setpoint: RateSetpoint,
        pub(crate) thrust: FullThrust,
        /// Vibration of the last message, m/s2: a shock is in one, and the lower of two counts.
        vibration: f32,
        /// The first sensor's messages are `HIGHRES_IMU`: of the sensor that PX4 has selected, less the offset of its estimator, which moves
        /// after faults elsewhere. The compasses of the other messages are in axes of their own there.
        selects: bool,
        stepped_at: Stamp,
    }
}

impl Crosschecks {
    fn take(&mut self, at: BootMs, kind: Kind, instance: u8, sample: [f32; 3]) {
        let is_own = match kind {
            Kind::Accelerometer | Kind::Gyro => instance > 0 || !self.selects,
            Kind::Compass => !self.selects,
            Kind::Barometer => true,
        };
        let compared = if is_own { sample } else { NOT_COMPARED };
        self.pairs[kind as usize].take(at, kind, usize::from(instance), compared, self.residuals.gates);
        // A barometer trembles on the ground too: one that freezes there is stuck in the air.
        if kind == Kind::Barometer || self.residuals.gates.are(gates::AIRBORNE) {
            self.repeats.take(at, kind, instance, sample);
        }
    }

    pub(crate) fn observe(&mut self, at: BootMs, vehicle: &Vehicle, observation: &Observation) {
        let Self { residuals, rate_setpoint, .. } = self;
        match observation {
            Observation::Imu(imu) => self.take_imu(at, imu, vehicle),
            Observation::Air(air) => self.take_air(at, air, vehicle),
            Observation::ImuAndAir(imu, air) => {
                // `HIGHRES_IMU`. Of `ArduPilot` it is the first sensor as any.
                self.selects = !vehicle.is_ardupilot();
                self.take_imu(at, imu, vehicle);
                self.take_air(at, air, vehicle);
            }
            Observation::Gnss(gnss) => self.take_gnss(at, gnss, vehicle),
            Observation::Attitude(attitude) => {
                rate_tracking::take_attitude(residuals, at, attitude, rate_setpoint);
            }
            Observation::AttitudeSetpoint(AttitudeSetpoint { rates: Some(rates), .. }) => {
                rate_tracking::take_setpoint(rate_setpoint, at, *rates, vehicle);
            }
            Observation::SecondEstimate(second) => ahrs2_residual::take(residuals, at, second, vehicle),
            Observation::Hud(hud) => self.thrust.take(at, hud, vehicle, residuals.gates.are(gates::SETTLED)),
            Observation::Estimator(estimator) => self.compass_use.take(at, estimator, residuals),
            Observation::Vibration(_) => self.take_vibration(at, vehicle),
            _ => {}
        }
    }

    fn take_imu(&mut self, at: BootMs, imu: &Imu, vehicle: &Vehicle) {
        let force = imu.acceleration.map(|force| force.map(|axis| axis.0));
        let rate = imu.rate.map(|rate| rate.map(|axis| axis.0));
        let field = imu.field.map(|field| field.map(|axis| axis.0));
        // A gyro that stands still may measure zeros, but not beside an accelerometer that does.
        let is_fitted = force != Some([0.0; 3]);
        let field = field.filter(|field| field.iter().any(|axis| axis.abs() > 0.0));
        if let (Some(force), 0, true) = (force, imu.instance, is_fitted) {
            self.imu_gnss.take_force(force);
        }
        if let (Some(field), 0) = (field, imu.instance) {
            mag_heading_residual::take(&mut self.residuals, at, field, vehicle);
        }
        for (kind, sample) in [
            (Kind::Accelerometer, force.filter(|_| is_fitted)),
            (Kind::Gyro, rate.filter(|_| is_fitted)),
            (Kind::Compass, field),
        ] {
            if let Some(sample) = sample {
                self.take(at, kind, imu.instance, sample);
            }
        }
    }

    fn take_air(&mut self, at: BootMs, air: &Air, vehicle: &Vehicle) {
        if let Some(pressure) = air.pressure.filter(|pressure| pressure.0 > 0.0) {
            self.take(at, Kind::Barometer, air.instance, [pressure.0, 0.0, 0.0]);
            if air.instance == 0 {
                self.heights.take_pressure(&mut self.residuals, at, pressure.0, vehicle);
            }
        }
    }

    fn take_gnss(&mut self, at: BootMs, gnss: &Gnss, vehicle: &Vehicle) {
        let airborne = self.residuals.gates.are(gates::AIRBORNE);
        if airborne {
            self.repeats.take_gnss(at, gnss);
        }
        if let Some(velocity) = self.velocities.get_mut(usize::from(gnss.instance)) {
            velocity.take(at, gnss, airborne);
        }
        gnss_constellation::take(&mut self.residuals, at, gnss);
        if gnss.instance == 0 {
            self.heights.take_gnss(&mut self.residuals, at, gnss, vehicle);
            if !self.repeats.repeats_place(0) {
                self.imu_gnss.take_gnss(at, gnss, vehicle, self.residuals.gates);
            }
        }
    }

    fn take_vibration(&mut self, at: BootMs, vehicle: &Vehicle) {
        if let Some(level) = vehicle.vibration.get().and_then(Vibration::acceleration) {
            let lasting = level.min(core::mem::replace(&mut self.vibration, level));
            self.residuals.take(vibration_of(vehicle), at, lasting, 0.0);
        }
    }

    pub(crate) fn begin(&mut self) {
        self.pairs.iter_mut().for_each(Pairs::begin);
        let Self { pairs, selects, residuals: Residuals { gates, .. }, .. } = *self;
        *self = Self { pairs, selects, repeats: self.repeats.begun(), ..Self::default() };
        self.residuals.gates = gates;
    }

    pub(crate) fn step(&mut self, now: BootMs, vehicle: &Vehicle, flight: &Flight) {
        self.residuals.gates.step(now, vehicle, flight);
        let step = self.stepped_at.age(now);
        if !flight.airborne() || step.is_some_and(|step| step < EVERY) {
            return;
        }
        let step_s = step.map_or(0.0, |step| step.min(FRESH).as_secs_f32());
        self.stepped_at = Stamp::at(now);
        self.imu_gnss.step(now, step_s, vehicle);
        // A standing vehicle does not move, whatever its estimator says.
        let idles = throttle(now, vehicle).is_some_and(|throttle| throttle < IDLE_THROTTLE);
        if !(idles && self.residuals.gates.are(gates::HOVERS) && vehicle.inertial.is_level(now)) {
            self.repeats.moved.step(now, step_s, vehicle);
        }
    }

    /// For how long a sensor has repeated one value in flight, s; 0 if it does not.
    pub(crate) fn stuck(&self, now: BootMs, kind: Kind, sensor: u8) -> Option<Reading> {
        let measures = |other: usize| self.pairs[kind as usize].measures(now, other);
        self.repeats.stuck(now, kind, sensor, measures)
    }

    pub(crate) fn vibration_rise(&self, now: BootMs, vehicle: &Vehicle) -> Option<Reading> {
        self.residuals.multiple(now, vibration_of(vehicle))
    }

    /// The vibration that is so many times its baseline, m/s2.
    pub(crate) fn vibration_limit(&self, vehicle: &Vehicle, times: f32) -> Option<f32> {
        self.residuals.limit(vibration_of(vehicle), times)
    }
}

fn vibration_of(vehicle: &Vehicle) -> Comparison {
    match vehicle.vibration.get().map(|vibration| vibration.scale) {
        Some(VibrationScale::Px4Metrics) => Comparison::VibrationPx4,
        _ => Comparison::Vibration,
    }
}
