//! Sensors of one kind against each other, the estimator's word on its compass, and vibration against its own usual level.
//!
//! Sensors of a kind are compared sample by sample ([`crate::pairs`]), where the vehicle turns little: forces on rotors, because on wings a
//! vehicle is carried by more than its weight for as long as it turns. VTOLs are left out. Vibration is judged on rotors away from the
//! ground, however fast. An inertial sensor that says nothing but zeros is not fitted.
//!
//! Each sensor by itself: whether it is stuck ([`crate::stuck`]); the first barometer against the height of GPS ([`crate::heights`]); a
//! receiver's velocity against the way between its positions ([`crate::travel`]), and its satellites against their usual number
//! ([`crate::geometry`]). The estimator that flies against the second one: [`crate::second`].
//! Accelerometers, and the attitude that gyros make, against the receiver's velocity: [`crate::imu_gnss`].

use crate::flight::Flight;
use crate::geometry::Geometry;
use crate::heading::Heading;
use crate::heights::Heights;
use crate::imu_gnss::ImuGnssResidual;
use crate::latest::Reading;
use crate::motion::{climb_mps, ground_speed_mps, throttle};
use crate::observation::{Air, Estimator, Gnss, Imu, SecondEstimate, VehicleKind};
use crate::pairs::{Kind, Pairs, SENSORS_MAX};
use crate::second::Second;
use crate::shaking::Shaking;
use crate::steady::{TURNED, is_clear};
use crate::stuck::Stuck;
use crate::time::{Instant, Span, Stamp};
use crate::travel::Travel;
use crate::vehicle::{RECEIVERS_MAX, Vehicle};

/// A sample that is not compared: it is apart from none.
const NOT_COMPARED: [f32; 3] = [f32::NAN; 3];
/// What a vehicle turns in so many milliseconds is no difference, however fast it turns.
const AT_ONCE_MS: u8 = 5;
/// Between steps.
const EVERY: Span = Span::from_millis(100);
/// Of what is integrated: a longer pause of the steps is none.
const STEP_MAX: Span = Span::from_secs(1);
/// An attitude that was not heard for longer tells of no turn.
const HOLE: Span = Span::from_secs(2);
/// What moves by so much changes the values of its sensors: m up or down and over ground, rad about any axis.
const CLIMBED_M: f32 = 0.3;
const TRAVELLED_M: f32 = 0.5;
const TURNED_RAD: f32 = 0.02;
/// So many times as far a vehicle must have turned where all of its compasses repeat their values at once: an estimator's yaw drifts by 0.02
/// rad in 3 s while a vehicle holds still, and a compass's digit of a milligauss may hide its noise.
const ALL_REPEAT_TIMES: f32 = 10.0;
/// Less is no move, m/s and rad: an estimator trembles and has offsets where a simulator without noise hangs still, and the last digits
/// of its sensors do not change.
const HANGS_MPS: f32 = 0.3;
const TREMBLES_RAD: f32 = 0.01;
/// With less no rotors carry anything.
const IDLE_THROTTLE: f32 = 0.1;
/// How far the vehicle has moved in this flight, to and fro.
#[derive(Clone, Copy, Debug)]
struct Moved {
    climbed_m: f32,
    travelled_m: f32,
    turned_rad: f32,
    /// The attitude when a turn was counted last, rad; none since a hole.
    attitude: Option<[f32; 3]>,
}

impl Moved {
    const NONE: Self = Self { climbed_m: 0.0, travelled_m: 0.0, turned_rad: 0.0, attitude: None };

    fn step(&mut self, now: Instant, step_s: f32, vehicle: &Vehicle) {
        let climb_mps = climb_mps(now, vehicle).map_or(0.0, libm::fabsf);
        self.climbed_m += if climb_mps > HANGS_MPS { climb_mps * step_s } else { 0.0 };
        self.travelled_m += ground_speed_mps(now, vehicle).map_or(0.0, |speed| speed * step_s);
        let attitude = vehicle.attitude.within(now, HOLE);
        let attitude = attitude.map(|told| [told.roll.0, told.pitch.0, told.yaw.0]);
        let (Some(now), Some(before)) = (attitude, self.attitude) else {
            // How it turned meanwhile, its sensors did not see either.
            self.attitude = attitude;
            return;
        };
        // Round north it jumps once a turn, which is a turn anyway.
        let apart = |(axis, before): (f32, f32)| {
            let apart = libm::fabsf(axis - before);
            libm::fminf(apart, libm::fabsf(core::f32::consts::TAU - apart))
        };
        let turned_rad: f32 = now.into_iter().zip(before).map(apart).sum();
        if turned_rad >= TREMBLES_RAD {
            (self.turned_rad, self.attitude) = (self.turned_rad + turned_rad, Some(now));
        }
    }
}

/// The memory of all comparisons.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crosschecks {
    pairs: [Pairs; Kind::COUNT],
    stuck: [[Stuck; SENSORS_MAX]; Kind::COUNT],
    receivers: [Stuck; RECEIVERS_MAX],
    travels: [Travel; RECEIVERS_MAX],
    geometries: [Geometry; RECEIVERS_MAX],
    second: Second,
    imu_gnss: ImuGnssResidual,
    moved: Moved,
    heights: Heights,
    /// The first sensor's messages are `HIGHRES_IMU`: of the sensor that PX4 has selected, without what its estimator takes for an
    /// offset of it, which moves after faults elsewhere. The compasses of the other messages are in axes of their own there.
    selects: bool,
    /// Within how many milliseconds samples of a kind are of one moment, as it flies now; 0 where they are not compared.
    moments_ms: [u8; Kind::COUNT],
    stepped_at: Stamp,
    heading: Heading,
    shaking: Shaking,
}

impl Crosschecks {
    /// Nothing seen yet.
    pub(crate) const fn new() -> Self {
        Self {
            pairs: [Pairs::NEW; Kind::COUNT],
            stuck: [[Stuck::NEW; SENSORS_MAX]; Kind::COUNT],
            receivers: [Stuck::NEW; RECEIVERS_MAX],
            travels: [Travel::NEW; RECEIVERS_MAX],
            geometries: [Geometry::NEW; RECEIVERS_MAX],
            second: Second::NEW,
            imu_gnss: ImuGnssResidual::NEW,
            moved: Moved::NONE,
            heights: Heights::new(),
            selects: false,
            moments_ms: [0; Kind::COUNT],
            stepped_at: Stamp::NONE,
            heading: Heading::NEW,
            shaking: Shaking::NEW,
        }
    }

    /// Takes a sample of a sensor, and how far the vehicle has moved, while it flies.
    fn take(&mut self, at: Instant, kind: Kind, instance: u8, sample: [f32; 3], moved: Option<f32>) {
        let (place, sensor) = (kind as usize, usize::from(instance));
        let is_own = match kind {
            Kind::Accelerometer | Kind::Gyro => instance > 0 || !self.selects,
            Kind::Compass => !self.selects,
            Kind::Barometer => true,
        };
        let compared = if is_own { sample } else { NOT_COMPARED };
        self.pairs[place].take(at, kind, sensor, compared, self.moments_ms[place]);
        if let (Some(moved), Some(stuck)) = (moved, self.stuck[place].get_mut(sensor)) {
            stuck.take(at, sample.map(f32::to_bits), moved);
        }
    }

    /// `HIGHRES_IMU` comes. Of `ArduPilot` it is the first sensor as any.
    pub(crate) fn select(&mut self, vehicle: &Vehicle) {
        self.selects = !vehicle.is_ardupilot();
    }

    pub(crate) fn take_imu(&mut self, at: Instant, imu: &Imu, vehicle: &Vehicle, flight: &Flight) {
        let force = imu.acceleration.map(|force| force.map(|axis| axis.0));
        let rate = imu.rate.map(|rate| rate.map(|axis| axis.0));
        let field = imu.field.map(|field| field.map(|axis| axis.0));
        let turned = flight.airborne().then_some(self.moved.turned_rad);
        // A gyro that stands still may measure zeros, but not beside an accelerometer that does.
        let is_fitted = force != Some([0.0; 3]);
        let field = field.filter(|field| field.iter().any(|axis| axis.abs() > 0.0));
        if let (Some(force), 0, true) = (force, imu.instance, is_fitted) {
            self.imu_gnss.take_force(force);
        }
        if let (Some(field), 0) = (field, imu.instance) {
            self.heading.take(at, field, vehicle, flight);
        }
        for (kind, sample) in [
            (Kind::Accelerometer, force.filter(|_| is_fitted)),
            (Kind::Gyro, rate.filter(|_| is_fitted)),
            (Kind::Compass, field),
        ] {
            if let Some(sample) = sample {
                self.take(at, kind, imu.instance, sample, turned);
            }
        }
    }

    pub(crate) fn take_air(&mut self, at: Instant, air: &Air, vehicle: &Vehicle, flight: &Flight) {
        let pressure = air.pressure.filter(|pressure| pressure.0 > 0.0);
        if let Some(pressure) = pressure {
            // A barometer trembles on the ground too: one that freezes there is stuck in the air.
            let climbed = Some(self.moved.climbed_m);
            self.take(at, Kind::Barometer, air.instance, [pressure.0, 0.0, 0.0], climbed);
            if air.instance == 0 {
                self.heights.take_pressure(at, pressure, vehicle, flight);
            }
        }
    }

    pub(crate) fn take_gnss(&mut self, at: Instant, gnss: &Gnss, vehicle: &Vehicle, flight: &Flight) {
        let travelled_m = self.moved.travelled_m;
        let place = gnss.position.filter(|_| gnss.fix >= 3 && flight.airborne());
        let altitude = gnss.altitude.map_or(0.0, |altitude| altitude.0).to_bits();
        let speed = gnss.speed.map_or(0.0, |speed| speed.0).to_bits();
        if let (Some(place), Some(stuck)) = (place, self.receivers.get_mut(usize::from(gnss.instance))) {
            let words = |degrees: f64| [degrees.to_bits() as u32, (degrees.to_bits() >> 32) as u32];
            let place = words(place.latitude_deg).into_iter().chain(words(place.longitude_deg));
            stuck.take(at, place.chain([altitude, speed]), travelled_m);
        }
        if let Some(travel) = self.travels.get_mut(usize::from(gnss.instance)) {
            travel.take(gnss, flight.airborne());
        }
        if let Some(geometry) =
            self.geometries.get_mut(usize::from(gnss.instance)).filter(|_| flight.airborne())
        {
            geometry.take(at, gnss);
        }
        if gnss.instance == 0 {
            self.heights.take_gnss(at, gnss, vehicle, flight);
            if !self.receivers[0].repeats() {
                self.imu_gnss.take_gnss(at, gnss, vehicle, flight);
            }
        }
    }

    pub(crate) fn take_second(
        &mut self,
        at: Instant,
        second: &SecondEstimate,
        vehicle: &Vehicle,
        flight: &Flight,
    ) {
        self.second.take(at, second, vehicle, flight);
    }

    pub(crate) fn take_estimator(&mut self, at: Instant, estimator: &Estimator, flight: &Flight) {
        self.heading.take_estimator(at, estimator, flight);
    }

    pub(crate) fn take_vibration(&mut self, at: Instant, vehicle: &Vehicle, flight: &Flight) {
        self.shaking.take(at, vehicle, flight);
    }

    /// A flight begins: nothing is usual yet.
    pub(crate) fn begin(&mut self) {
        self.pairs.iter_mut().for_each(Pairs::begin);
        let mut stuck = [[Stuck::NEW; SENSORS_MAX]; Kind::COUNT];
        stuck[Kind::Barometer as usize] = self.stuck[Kind::Barometer as usize].map(Stuck::begun);
        *self = Self { pairs: self.pairs, selects: self.selects, stuck, ..Self::new() };
    }

    /// One step, at least every 50 ms.
    pub(crate) fn step(&mut self, now: Instant, vehicle: &Vehicle, flight: &Flight) {
        let step = self.stepped_at.age(now);
        if !flight.airborne() {
            self.moments_ms = [0; Kind::COUNT];
            return;
        }
        if step.is_some_and(|step| step < EVERY) {
            return;
        }
        let step_s = step.map_or(0.0, |step| step.min(STEP_MAX).as_secs_f32());
        self.stepped_at = Stamp::at(now);
        self.imu_gnss.step(now, step_s, vehicle);
        // What stands does not move, whatever an estimator makes of the touch-down.
        let idles = throttle(now, vehicle).is_some_and(|throttle| throttle < IDLE_THROTTLE);
        if !(idles && vehicle.hovers(now) == Some(true) && vehicle.inertial.is_level(now)) {
            self.moved.step(now, step_s, vehicle);
        }
        let (turns_little, on_rotors) =
            (vehicle.inertial.turns_little(now, TURNED), vehicle.kind() == VehicleKind::Rotorcraft);
        let flies = flight.is_settled(now) && (on_rotors || vehicle.kind() == VehicleKind::Plane);
        let judged = [
            // On wings a vehicle is carried by more than its weight for as long as it turns, and legs that touch shake one more than the other.
            on_rotors && is_clear(now, vehicle),
            true,
            true,
            true,
        ];
        for ((kind, moment_ms), judged) in Kind::ALL.into_iter().zip(&mut self.moments_ms).zip(judged) {
            *moment_ms = match (flies && judged, turns_little) {
                (true, true) => kind.one_moment_ms(),
                // Gyros that are noisy turn fast by themselves.
                (true, false) if kind == Kind::Gyro => AT_ONCE_MS,
                _ => 0,
            };
        }
    }

    /// Sensors up to the last one of any kind that has measured.
    pub(crate) fn sensors_known(&self) -> u8 {
        let measured = |sensor: usize| self.pairs.iter().any(|pairs| pairs.has_measured(sensor));
        (0..SENSORS_MAX).rev().find(|sensor| measured(*sensor)).map_or(0, |last| last as u8 + 1)
    }

    /// Whether any two were compared in this flight.
    pub(crate) fn are_compared(&self) -> bool {
        self.pairs.iter().any(Pairs::are_compared)
    }

    /// How far a sensor is apart from all others of its kind, beyond what is usual; of two, for the second one.
    pub(crate) fn mismatch(&self, now: Instant, kind: Kind, sensor: u8) -> Option<Reading> {
        self.pairs[kind as usize].mismatch(now, sensor.into())
    }

    /// For how long a sensor has repeated one value in flight, s; 0 where it does not.
    pub(crate) fn stuck(&self, now: Instant, kind: Kind, sensor: u8) -> Option<Reading> {
        let (moved, least) = match kind {
            Kind::Barometer => (self.moved.climbed_m, CLIMBED_M),
            Kind::Accelerometer | Kind::Gyro | Kind::Compass => (self.moved.turned_rad, TURNED_RAD),
        };
        let stuck = self.stuck[kind as usize].get(usize::from(sensor))?;
        let times = match kind {
            // Where the accelerometer repeats its values too, a simulator without noise hovers.
            Kind::Barometer if stuck.fell_silent() && !self.stuck[0][0].repeats() => 0.0,
            Kind::Compass if self.all_repeat(now, kind, sensor) => ALL_REPEAT_TIMES,
            _ => 1.0,
        };
        stuck.lasts(now, moved, least * times)
    }

    /// Whether there are others of a sensor's kind, and none of them changed while it repeated its value.
    fn all_repeat(&self, now: Instant, kind: Kind, sensor: u8) -> bool {
        let (pairs, all) = (&self.pairs[kind as usize], &self.stuck[kind as usize]);
        let is_other = |(place, other): &(usize, &Stuck)| {
            *place != usize::from(sensor) && pairs.measures(now, *place) && other.is_known()
        };
        let mut others = all.iter().enumerate().filter(is_other).peekable();
        let stuck = all.get(usize::from(sensor));
        others.peek().is_some()
            && !others.any(|(_, other)| stuck.is_some_and(|stuck| other.changed_during(stuck)))
    }

    /// The same of a receiver.
    pub(crate) fn receiver_stuck(&self, now: Instant, receiver: u8) -> Option<Reading> {
        self.receivers.get(usize::from(receiver))?.lasts(now, self.moved.travelled_m, TRAVELLED_M)
    }

    /// The first compass's heading against the estimator's.
    pub(crate) const fn heading(&self) -> &Heading {
        &self.heading
    }

    /// How far a receiver's velocity is from that of its positions, m/s.
    pub(crate) fn speed_apart(&self, receiver: u8) -> Option<f32> {
        self.travels.get(usize::from(receiver))?.speed_apart()
    }

    /// A receiver's satellites and dilution of precision against what is usual.
    pub(crate) fn geometry(&self, receiver: u8) -> Option<&Geometry> {
        self.geometries.get(usize::from(receiver))
    }

    /// The estimator that flies against the second one.
    pub(crate) const fn second(&self) -> &Second {
        &self.second
    }

    /// The first inertial sensor against the first receiver.
    pub(crate) const fn imu_gnss(&self) -> &ImuGnssResidual {
        &self.imu_gnss
    }

    /// The barometer against GPS, and its noise.
    pub(crate) const fn heights(&self) -> &Heights {
        &self.heights
    }

    /// Vibration against what is usual in this flight.
    pub(crate) const fn shaking(&self) -> &Shaking {
        &self.shaking
    }
}
