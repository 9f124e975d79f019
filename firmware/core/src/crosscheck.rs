//! Sensors of one kind against each other, the estimator's word on its compass, and vibration against its own usual level.
//!
//! How far two sensors are apart is a figure with a usual level in each flight ([`crate::departure`]): calibration, mounting and
//! currents make one, and it is no fault. What comes to it in flight is. Of three sensors the one is told that is apart from both
//! others; of two nobody knows which of them is wrong, and the second one is told.
//!
//! Accelerometers and gyros are not mounted at the same place and not sampled at the same moment, so that turns and a VTOL's transition set
//! them apart: they are compared where multicopters hover; and smoothed for longer where the vehicle has turned little for [`CALM`], forces on
//! rotors, rates on wings and of helicopters. Vibration is judged on rotors away from the ground, however fast. An inertial sensor that says
//! nothing but zeros is not fitted.
//!
//! Each sensor by itself: whether it is stuck ([`crate::stuck`]); the first barometer against the height of GPS ([`crate::heights`]); a
//! receiver's velocity against the way between its positions ([`crate::travel`]), and its satellites against their usual number
//! ([`crate::geometry`]). The estimator that flies against the second one: [`crate::second`].
//! Accelerometers, and the attitude that gyros make, against the receiver's velocity: [`crate::imu_gnss`].

use crate::departure::Departure;
use crate::flight::Flight;
use crate::geometry::Geometry;
use crate::heights::{Heights, SCALE_HEIGHT_M};
use crate::imu_gnss::ImuGnssResidual;
use crate::latest::Reading;
use crate::motion::{climb_mps, ground_speed_mps, throttle};
use crate::observation::{
    Air, Estimator, EstimatorScale, Gnss, Imu, SecondEstimate, VehicleKind, VibrationScale,
};
use crate::second::Second;
use crate::steady::{TURNED, hovers, is_clear};
use crate::stuck::Stuck;
use crate::time::{Instant, Span, Stamp};
use crate::travel::Travel;
use crate::units::{RadiansPerSecond, norm};
use crate::vehicle::{RECEIVERS_MAX, Vehicle};

/// Sensors of one kind that are compared.
pub(crate) const SENSORS_MAX: usize = 3;
/// Pairs of them.
const PAIRS: [(usize, usize); SENSORS_MAX] = [(0, 1), (0, 2), (1, 2)];
/// Between comparisons.
const EVERY: Span = Span::from_millis(100);
/// Older samples are not compared, and older comparisons say nothing.
const FRESH: Span = Span::from_secs(1);
/// Time constant of the samples of what turns little and does not hover: sensors are not sampled at the same moment.
const ROUGH_S: f32 = 2.0;
/// What does not hover is compared once it has turned little for so long.
const CALM: Span = Span::from_secs(3);
/// No sensor measures so much, in any of the units.
const GARBAGE: f32 = 1e6;
/// Ratios that the estimator told of its compass in flight, before their end says that it does not use it any more: at 1 Hz or more.
const RATIOS_KNOWN: u8 = 20;
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
/// Vibration comes at 1 Hz or faster; what comes after a longer pause is not of the same hover.
const VIBRATION_PAUSE: Span = Span::from_secs(3);
/// Of the lower of two messages: a shock is in one.
const VIBRATION_SMOOTHING_S: f32 = 0.25;
/// Vibration that rises by less did not rise: per axis, and PX4's metric, m/s2.
const GRAIN_PER_AXIS: f32 = 2.5;
const GRAIN_PX4: f32 = 1.0;

/// The compass's heading is compared with an attitude that is so old at most, and turns slower about each axis, rad/s: the two are not of one
/// moment. Beyond half of the default limit, degrees, nothing is learnt.
const ATTITUDE_AGE: Span = Span::from_millis(200);
const HEADS_RAD_S: f32 = 0.2;
const HEADING_SMOOTHING_S: f32 = 0.5;
/// Samples that come sooner are passed over: angles are dear.
const HEADING_EVERY: Span = Span::from_millis(80);
const HEADING_HOLD_DEG: f32 = 6.0;
/// What a compass that is not used has moved away at least, where something is wrong with it.
const HEADING_MOVES_DEG: f32 = 2.0;

/// A kind of sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Accelerometers: apart in m/s2.
    Accelerometer,
    /// Gyros: apart in rad/s.
    Gyro,
    /// Compasses: apart in percent of the field, by direction and length.
    Compass,
    /// Barometers: apart in metres of height.
    Barometer,
}

impl Kind {
    const ALL: [Self; 4] = [Self::Accelerometer, Self::Gyro, Self::Compass, Self::Barometer];

    /// Further beyond their usual range they teach nothing: half of the default limits.
    const fn hold(self) -> f32 {
        match self {
            Self::Accelerometer => 0.5,
            Self::Gyro => 0.05,
            Self::Compass => 20.0,
            Self::Barometer => 4.0,
        }
    }

    /// Time constant of the samples, and of how far they are apart. Motors shake accelerometers more than they turn gyros.
    const fn smoothing_s(self) -> f32 {
        match self {
            Self::Gyro => 0.25,
            Self::Accelerometer | Self::Compass | Self::Barometer => 0.5,
        }
    }

    fn apart(self, one: [f32; 3], other: [f32; 3]) -> f32 {
        let [x, y, z] = [0, 1, 2].map(|axis| one[axis] - other[axis]);
        match self {
            Self::Accelerometer | Self::Gyro => norm([x, y, z]),
            Self::Compass => norm([x, y, z]) / (norm(one) + norm(other)) * 200.0,
            Self::Barometer => libm::fabsf(x) / one[0].max(other[0]) * SCALE_HEIGHT_M,
        }
    }
}

/// The smoothed samples of one sensor, and whether they are always the same.
#[derive(Clone, Copy, Debug)]
struct Sensor {
    at: Stamp,
    smooth: [f32; 3],
    stuck: Stuck,
}

impl Sensor {
    const NEW: Self = Self { at: Stamp::NONE, smooth: [0.0; 3], stuck: Stuck::NEW };

    fn take(&mut self, at: Instant, sample: [f32; 3], smoothing_s: f32, moved: Option<f32>) {
        if !sample.iter().all(|axis| axis.abs() <= GARBAGE) {
            return;
        }
        if let Some(moved) = moved {
            self.stuck.take(at, sample.map(f32::to_bits), moved);
        }
        let step_s = self.at.age(at).map_or(f32::INFINITY, Span::as_secs_f32);
        let weight = if step_s < 1.0 { step_s / (smoothing_s + step_s) } else { 1.0 };
        for (smooth, axis) in self.smooth.iter_mut().zip(sample) {
            *smooth += weight * (axis - *smooth);
        }
        self.at = Stamp::at(at);
    }

    /// Its samples, smoothed, while they are fresh.
    fn fresh(&self, now: Instant) -> Option<[f32; 3]> {
        self.at.age(now).filter(|age| *age <= FRESH).map(|_| self.smooth)
    }
}

/// How far the vehicle has moved in this flight, to and fro.
#[derive(Clone, Copy, Debug)]
struct Moved {
    climbed_m: f32,
    travelled_m: f32,
    turned_rad: f32,
    /// The attitude when a turn was counted last, rad.
    attitude: [f32; 3],
}

impl Moved {
    const NONE: Self = Self { climbed_m: 0.0, travelled_m: 0.0, turned_rad: 0.0, attitude: [0.0; 3] };

    fn step(&mut self, now: Instant, step_s: f32, vehicle: &Vehicle) {
        let climb_mps = climb_mps(now, vehicle).map_or(0.0, libm::fabsf);
        self.climbed_m += if climb_mps > HANGS_MPS { climb_mps * step_s } else { 0.0 };
        self.travelled_m += ground_speed_mps(now, vehicle).map_or(0.0, |speed| speed * step_s);
        if let Some(told) = vehicle.attitude.get() {
            let attitude = [told.roll.0, told.pitch.0, told.yaw.0];
            // Round north it jumps once a turn, which is a turn anyway.
            let apart = |(axis, before): (f32, f32)| libm::fabsf(axis - before).min(core::f32::consts::PI);
            let turned_rad: f32 = attitude.into_iter().zip(self.attitude).map(apart).sum();
            if turned_rad >= TREMBLES_RAD {
                (self.turned_rad, self.attitude) = (self.turned_rad + turned_rad, attitude);
            }
        }
    }
}

/// The memory of all comparisons.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crosschecks {
    sensors: [[Sensor; SENSORS_MAX]; Kind::ALL.len()],
    pairs: [[Departure; SENSORS_MAX]; Kind::ALL.len()],
    receivers: [Stuck; RECEIVERS_MAX],
    travels: [Travel; RECEIVERS_MAX],
    geometries: [Geometry; RECEIVERS_MAX],
    second: Second,
    imu_gnss: ImuGnssResidual,
    moved: Moved,
    heights: Heights,
    /// When sensors of a kind were compared last, and when that was tried.
    compared_at: [Stamp; Kind::ALL.len()],
    stepped_at: Stamp,
    /// The estimator's heading less that of the first compass, degrees.
    heading: Departure,
    heading_at: Stamp,
    vibration: Departure,
    vibration_at: Stamp,
    /// The last message's, m/s2.
    vibration_before: f32,
    vibration_grain: f32,
    /// Ratios of the compass that the estimator told in this flight, and whether the last one was none.
    ratios: u8,
    unused: (Stamp, bool),
    /// It is compared where it does not hover: forces and rates.
    rough: [bool; 2],
}

impl Crosschecks {
    /// Nothing seen yet.
    pub(crate) const fn new() -> Self {
        Self {
            sensors: [[Sensor::NEW; SENSORS_MAX]; Kind::ALL.len()],
            pairs: [[Departure::NEW; SENSORS_MAX]; Kind::ALL.len()],
            receivers: [Stuck::NEW; RECEIVERS_MAX],
            travels: [Travel::NEW; RECEIVERS_MAX],
            geometries: [Geometry::NEW; RECEIVERS_MAX],
            second: Second::NEW,
            imu_gnss: ImuGnssResidual::NEW,
            moved: Moved::NONE,
            heights: Heights::new(),
            compared_at: [Stamp::NONE; Kind::ALL.len()],
            stepped_at: Stamp::NONE,
            heading: Departure::NEW,
            heading_at: Stamp::NONE,
            vibration: Departure::NEW,
            vibration_at: Stamp::NONE,
            vibration_before: 0.0,
            vibration_grain: 0.0,
            ratios: 0,
            unused: (Stamp::NONE, false),
            rough: [false; 2],
        }
    }

    fn sensor(&mut self, kind: Kind, instance: u8) -> Option<&mut Sensor> {
        self.sensors[kind as usize].get_mut(usize::from(instance))
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
            self.take_heading(at, field, vehicle, flight);
        }
        for (kind, sample, is_rough) in [
            (Kind::Accelerometer, force.filter(|_| is_fitted), self.rough[0]),
            (Kind::Gyro, rate.filter(|_| is_fitted), self.rough[1]),
            (Kind::Compass, field, false),
        ] {
            if let (Some(sample), Some(sensor)) = (sample, self.sensor(kind, imu.instance)) {
                sensor.take(at, sample, if is_rough { ROUGH_S } else { kind.smoothing_s() }, turned);
            }
        }
    }

    /// The field by the attitude's roll and pitch, and how far its heading is from the attitude's: it includes the declination, which is
    /// usual.
    fn take_heading(&mut self, at: Instant, [x, y, z]: [f32; 3], vehicle: &Vehicle, flight: &Flight) {
        let judged = self.heading_at.age(at).is_none_or(|age| age >= HEADING_EVERY)
            && matches!(vehicle.kind(), VehicleKind::Rotorcraft | VehicleKind::Plane)
            && flight.is_settled(at)
            && is_clear(at, vehicle);
        let Some(attitude) = vehicle.attitude.within(at, ATTITUDE_AGE).filter(|_| judged) else { return };
        let turns = |rates: [RadiansPerSecond; 3]| rates.iter().any(|rate| rate.0.abs() > HEADS_RAD_S);
        if attitude.rates.is_none_or(turns) {
            return;
        }
        let (sin_roll, cos_roll) = (libm::sinf(attitude.roll.0), libm::cosf(attitude.roll.0));
        let across = y * cos_roll - z * sin_roll;
        let down = y * sin_roll + z * cos_roll;
        let ahead = x * libm::cosf(attitude.pitch.0) + down * libm::sinf(attitude.pitch.0);
        let off_deg = (attitude.yaw.0 - libm::atan2f(-across, ahead)).to_degrees();
        // The short way round from what it was.
        let before_deg = self.heading.figure();
        let turned_deg = off_deg - before_deg;
        let figure_deg = before_deg + turned_deg - 360.0 * libm::roundf(turned_deg / 360.0);
        let step_s = self.heading_at.age(at).filter(|step| *step <= FRESH).map_or(0.0, Span::as_secs_f32);
        self.heading_at = Stamp::at(at);
        self.heading.follow(figure_deg, step_s, HEADING_SMOOTHING_S);
        if self.heading.beyond_either_way().is_none_or(|beyond_deg| beyond_deg <= HEADING_HOLD_DEG) {
            self.heading.learn(step_s);
        }
    }

    pub(crate) fn take_air(&mut self, at: Instant, air: &Air, vehicle: &Vehicle, flight: &Flight) {
        let pressure = air.pressure.filter(|pressure| pressure.0 > 0.0);
        let climbed = flight.airborne().then_some(self.moved.climbed_m);
        if let (Some(pressure), Some(sensor)) = (pressure, self.sensor(Kind::Barometer, air.instance)) {
            sensor.take(at, [pressure.0, 0.0, 0.0], Kind::Barometer.smoothing_s(), climbed);
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

    /// PX4 tells no ratio of what it does not fuse.
    pub(crate) fn take_estimator(&mut self, at: Instant, estimator: &Estimator, flight: &Flight) {
        if estimator.scale != EstimatorScale::TestRatio || !flight.airborne() {
            return;
        }
        self.ratios = self.ratios.saturating_add(u8::from(estimator.compass.is_some()));
        // An estimator that tells nothing at all says nothing about its compass.
        let tells = estimator.velocity.is_some() || estimator.position_horizontal.is_some();
        if tells && self.ratios >= RATIOS_KNOWN {
            // It pauses the use of a sound one too, for half a minute at a time (in 7 of 20 healthy flights of PX4's simulator).
            let moved =
                self.heading.beyond_either_way().is_some_and(|beyond_deg| beyond_deg > HEADING_MOVES_DEG);
            self.unused = (Stamp::at(at), estimator.compass.is_none() && moved);
        }
    }

    pub(crate) fn take_vibration(&mut self, at: Instant, vehicle: &Vehicle, flight: &Flight) {
        let Some(vibration) = vehicle.vibration.get() else { return };
        let level = match vibration.scale {
            VibrationScale::PerAxis => vibration.levels.into_iter().flatten().reduce(f32::max),
            VibrationScale::Px4Metrics => vibration.levels[2],
        };
        let judged =
            vehicle.kind() == VehicleKind::Rotorcraft && flight.is_settled(at) && is_clear(at, vehicle);
        let (Some(level), true) = (level, judged) else { return };
        self.vibration_grain = match vibration.scale {
            VibrationScale::PerAxis => GRAIN_PER_AXIS,
            VibrationScale::Px4Metrics => GRAIN_PX4,
        };
        let step = self.vibration_at.age(at).filter(|step| *step > Span::ZERO && *step < VIBRATION_PAUSE);
        self.vibration_at = Stamp::at(at);
        // A shock is in one message: what is in two counts.
        let lasting = level.min(core::mem::replace(&mut self.vibration_before, level));
        if let Some(step) = step {
            self.vibration.take(lasting, step.as_secs_f32(), VIBRATION_SMOOTHING_S, self.vibration_grain);
        }
    }

    /// A flight begins: nothing is usual yet.
    pub(crate) fn begin(&mut self) {
        self.sensors.as_flattened_mut().iter_mut().for_each(|sensor| sensor.stuck = Stuck::NEW);
        *self = Self { sensors: self.sensors, ..Self::new() };
    }

    /// One step, at least every 50 ms.
    pub(crate) fn step(&mut self, now: Instant, vehicle: &Vehicle, flight: &Flight) {
        let step = self.stepped_at.age(now);
        if step.is_some_and(|step| step < EVERY) || !flight.airborne() {
            return;
        }
        let step_s = step.map_or(0.0, |step| step.min(FRESH).as_secs_f32());
        self.stepped_at = Stamp::at(now);
        self.imu_gnss.step(now, step_s, vehicle);
        // What stands does not move, whatever an estimator makes of the touch-down.
        let idles = throttle(now, vehicle).is_some_and(|throttle| throttle < IDLE_THROTTLE);
        if !(idles && vehicle.hovers(now) == Some(true) && vehicle.inertial.is_level(now)) {
            self.moved.step(now, step_s, vehicle);
        }
        let turns_little = vehicle.inertial.turns_little(now, TURNED);
        let calm = turns_little
            && matches!(vehicle.kind(), VehicleKind::Rotorcraft | VehicleKind::Plane)
            && flight.is_settled(now);
        let hovers = hovers(now, vehicle, flight);
        // On wings a vehicle is carried by more than its weight for as long as it turns, and a multicopter's legs are full of turns.
        let on_rotors = vehicle.kind() == VehicleKind::Rotorcraft;
        self.rough = [on_rotors, !vehicle.is_multicopter()].map(|compares| compares && calm && !hovers);
        let is_long_calm = vehicle.inertial.turns_little(now, CALM);
        let compares_inertial = self.rough.map(|rough| hovers || (rough && is_long_calm));
        for kind in Kind::ALL {
            let compares = match kind {
                Kind::Accelerometer => compares_inertial[0],
                Kind::Gyro => compares_inertial[1],
                Kind::Compass | Kind::Barometer => calm,
            };
            if compares {
                self.compare(now, kind);
            }
        }
    }

    fn compare(&mut self, now: Instant, kind: Kind) {
        let fresh = self.sensors[kind as usize].map(|sensor| sensor.fresh(now));
        for ((one, other), pair) in PAIRS.into_iter().zip(&mut self.pairs[kind as usize]) {
            if let (Some(one), Some(other)) = (fresh[one], fresh[other]) {
                pair.take(kind.apart(one, other), EVERY.as_secs_f32(), kind.smoothing_s(), kind.hold());
                self.compared_at[kind as usize] = Stamp::at(now);
            }
        }
    }

    /// Sensors up to the last one of any kind that has measured.
    pub(crate) fn sensors_known(&self) -> u8 {
        let measured = |instance: usize| self.sensors.iter().any(|of_kind| of_kind[instance].at.is_set());
        (0..SENSORS_MAX).rev().find(|instance| measured(*instance)).map_or(0, |last| last as u8 + 1)
    }

    /// Whether any two were compared in this flight.
    pub(crate) fn are_compared(&self) -> bool {
        self.compared_at.iter().any(|at| at.is_set())
    }

    /// How far a sensor is apart from all others of its kind, beyond what is usual; of two, for the second one.
    pub(crate) fn mismatch(&self, now: Instant, kind: Kind, sensor: u8) -> Option<Reading> {
        let at = self.compared_at[kind as usize].instant(now).filter(|at| now.since(*at) <= EVERY + EVERY)?;
        let pairs = || PAIRS.iter().zip(&self.pairs[kind as usize]);
        let three = pairs().all(|(_, pair)| pair.beyond().is_some());
        let sensor = usize::from(sensor);
        let mine = pairs().filter(|((one, other), _)| *other == sensor || (three && *one == sensor));
        let beyond = mine.filter_map(|(_, pair)| pair.beyond()).reduce(f32::min);
        Reading::new(Some(at), beyond)
    }

    /// For how long a sensor has repeated one value in flight, s; 0 where it does not.
    pub(crate) fn stuck(&self, now: Instant, kind: Kind, sensor: u8) -> Option<Reading> {
        let (moved, least) = match kind {
            Kind::Barometer => (self.moved.climbed_m, CLIMBED_M),
            Kind::Accelerometer | Kind::Gyro | Kind::Compass => (self.moved.turned_rad, TURNED_RAD),
        };
        let stuck = &self.sensors[kind as usize].get(usize::from(sensor))?.stuck;
        let least = if kind == Kind::Barometer && stuck.fell_silent() { 0.0 } else { least };
        let times =
            if kind == Kind::Compass && self.all_repeat(now, kind, sensor) { ALL_REPEAT_TIMES } else { 1.0 };
        stuck.lasts(now, moved, least * times)
    }

    /// Whether there are others of a sensor's kind, and none of them changed while it repeated its value.
    fn all_repeat(&self, now: Instant, kind: Kind, sensor: u8) -> bool {
        let sensors = &self.sensors[kind as usize];
        let is_other = |(place, other): &(usize, &Sensor)| {
            *place != usize::from(sensor) && other.fresh(now).is_some() && other.stuck.is_known()
        };
        let mut others = sensors.iter().enumerate().filter(is_other).peekable();
        let stuck = sensors.get(usize::from(sensor)).map(|sensor| &sensor.stuck);
        others.peek().is_some()
            && !others.any(|(_, other)| stuck.is_some_and(|stuck| other.stuck.changed_during(stuck)))
    }

    /// The same of a receiver.
    pub(crate) fn receiver_stuck(&self, now: Instant, receiver: u8) -> Option<Reading> {
        self.receivers.get(usize::from(receiver))?.lasts(now, self.moved.travelled_m, TRAVELLED_M)
    }

    /// How far the compass's heading is from the estimator's, beyond what is usual, degrees.
    pub(crate) fn heading_apart(&self, now: Instant) -> Option<Reading> {
        let beyond_deg = self.heading.beyond_either_way().map(|beyond_deg| beyond_deg.min(180.0));
        Reading::new(self.heading_at.instant(now), beyond_deg)
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

    /// Whether the estimator stopped using a compass that it used in this flight, and whose heading moved away from its own.
    pub(crate) fn compass_unused(&self, now: Instant) -> Option<Reading> {
        let (at, unused) = self.unused;
        Reading::new(at.instant(now), Some(f32::from(u8::from(unused))))
    }

    /// From which figure on vibration is more than so many times what is usual in this flight.
    pub(crate) fn vibration_limit(&self, times: f32) -> Option<f32> {
        self.vibration.limit(times, self.vibration_grain)
    }

    /// Vibration as a multiple of what is usual in this flight.
    pub(crate) fn vibration_rise(&self, now: Instant) -> Option<Reading> {
        Reading::new(self.vibration_at.instant(now), self.vibration.multiple(self.vibration_grain))
    }
}
