//! What the raw messages do not say by themselves: cell voltage, silence of an ESC against its own rhythm,
//! imbalance of motors in steady flight, clips of late, load factor.

use crate::cells::Cells;
use crate::crosscheck::Crosschecks;
use crate::currents::Currents;
use crate::flight::{Flight, FlightEvent};
use crate::gates;
use crate::inertial::FORCE_MAX;
use crate::latest::{Latest, Reading};
use crate::motion::IDLE_THROTTLE;
use crate::observation::{Battery, EscGroup, Imu, MOTORS_MAX, Observation, Vibration};
use crate::outputs::MotorOutputs;
use crate::params::{Param, Params};
use crate::status::RecorderStatus;
use crate::time::{Instant, Span, Stamp};
use crate::trend::{Rate, Resistance};
use crate::units::{GRAVITY, MetresPerSecond2, norm};
use crate::vehicle::{BATTERIES_MAX, RECEIVERS_MAX, Vehicle};

/// Vibration, m/s2 an axis, that is above all that a vehicle flies with: `ArduPilot`'s own limit for too much (wiki, "Measuring Vibration").
const SHAKES_MPS2: f32 = 60.0;
const SHAKEN: Span = Span::from_secs(3);
/// So much of a cell's voltage may be its sag under the load, V. A cell that sags further is near its end, whatever its charge.
const SAG_MAX_V: f32 = 0.3;
/// A motor that never turned faster is not fitted.
const TURNING_RPM: f32 = 100.0;
/// An ESC is silent when it misses this many of its own intervals; of those that are longer than [`SLOW_S`], as on a thin link, more: where a
/// fifth of the messages is lost, three in a row are every two minutes, and five in a row every hour.
const INTERVALS_MISSED: f32 = 3.0;
const INTERVALS_MISSED_SLOW: f32 = 5.0;
const SLOW_S: f32 = 0.7;
/// Motors that are compared have all been told of within this.
const MOTORS_TOLD: Span = Span::from_secs(1);
/// Below this part of their highest speed motors do not carry a vehicle (thrust goes by the square).
const FLYING_PART: f32 = 0.2;
/// Below this part of the middle speed a motor is lost; no control in steady flight drives it there.
const LOST_PART: f32 = 0.4;
/// A plane with less throttle glides: autopilots let its motor idle from some percents on.
const OFF_THROTTLE: f32 = 0.03;
/// What turns fast, or did of late, drives each motor as it needs to.
const TURNED: Span = Span::from_secs(2);
/// Time constant of the motor speeds that are compared.
const MOTOR_SMOOTHING_S: f32 = 1.0;
/// A link on which nothing at all came for so long was silent, unless it often is: streams of one a second have such pauses.
const SILENCE_S: f32 = 0.3;
/// So many times the longest pause of late are no pause as usual.
const SILENCE_PAUSES: f32 = 3.0;
/// A pause counts as this at most, s; with each observation the longest one is this part shorter, so that after some hundred
/// it is forgotten.
const PAUSE_MAX_S: f32 = 1.0;
const PAUSE_FADES: f32 = 1.0 / 64.0;
/// How long a loss of frames stays a warning.
const LOSS_MEMORY: Span = Span::from_secs(10);

#[derive(Clone, Copy, Debug, Default)]
struct MotorTrack {
    /// Errors that its ESC counted lately.
    errors: Option<Rate>,
    /// Smoothed interval between messages that carry speed or current, seconds; 0 before there are two.
    interval_s: f32,
    last: Stamp,
    highest_rpm: f32,
    smooth_rpm: f32,
}

/// The memory of derived quantities.
#[derive(Clone, Copy, Debug)]
pub struct Derived {
    cells: Cells,
    resistance: [Resistance; BATTERIES_MAX],
    motors: [MotorTrack; MOTORS_MAX],
    currents: Currents,
    crosschecks: Crosschecks,
    outputs: MotorOutputs,
    /// Of the last sample, and smoothed.
    load_factor: Latest<[f32; 2]>,
    /// When anything at all was heard of the vehicle.
    heard: Option<Instant>,
    /// When it was heard again after a silence, or a plane had no throttle last.
    resumed: Instant,
    /// The longest pause of late between two observations, s.
    pause_s: f32,
    /// The motor whose speed is furthest from the others'.
    furthest: u8,
    had_fix: [bool; RECEIVERS_MAX],
    clips: Lately,
    clips_known: bool,
    frames_lost: Lately,
    write_errors: Lately,
}

/// A count of the last ten seconds, of one that only rises.
#[derive(Clone, Copy, Debug, Default)]
struct Lately {
    count: u32,
    before: u32,
    rose_at: Stamp,
}

impl Lately {
    const NONE: Self = Self { count: 0, before: 0, rose_at: Stamp::NONE };

    fn take(&mut self, now: Instant, count: u64) {
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        if count > self.count {
            self.count = count;
            self.rose_at = Stamp::at(now);
        } else if self.rose_at.older_than(now, LOSS_MEMORY) {
            self.before = self.count;
            self.rose_at = Stamp::NONE;
        }
    }

    const fn lately(&self) -> f32 {
        self.count.saturating_sub(self.before) as f32
    }
}

impl Default for Derived {
    fn default() -> Self {
        Self::new()
    }
}

impl Derived {
    /// Nothing seen yet.
    pub const fn new() -> Self {
        const MOTOR: MotorTrack = MotorTrack {
            errors: None,
            interval_s: 0.0,
            last: Stamp::NONE,
            highest_rpm: 0.0,
            smooth_rpm: 0.0,
        };
        Self {
            cells: Cells::new(),
            resistance: [Resistance::new(); BATTERIES_MAX],
            motors: [MOTOR; MOTORS_MAX],
            currents: Currents::new(),
            crosschecks: Crosschecks::NEW,
            outputs: MotorOutputs::new(),
            load_factor: Latest::nothing(),
            heard: None,
            resumed: Instant::ZERO,
            pause_s: 0.0,
            furthest: 0,
            had_fix: [false; RECEIVERS_MAX],
            clips: Lately::NONE,
            clips_known: false,
            frames_lost: Lately::NONE,
            write_errors: Lately::NONE,
        }
    }

    /// Something was heard: after a silence of the link, or as usual.
    fn hear(&mut self, at: Instant) {
        let pause_s = self.heard.map(|heard| at.since(heard).as_secs_f32());
        if pause_s.is_none_or(|pause_s| pause_s > SILENCE_S.max(SILENCE_PAUSES * self.pause_s)) {
            self.resumed = at;
        }
        let pause_s = pause_s.unwrap_or(0.0).min(PAUSE_MAX_S);
        self.pause_s = pause_s.max(self.pause_s * (1.0 - PAUSE_FADES));
        self.heard = Some(at);
    }

    /// Takes an observation that the vehicle took.
    pub fn observe(&mut self, at: Instant, vehicle: &Vehicle, flight: &Flight, observation: &Observation) {
        self.hear(at);
        match observation {
            Observation::Imu(imu) => self.take_imu(at, imu, vehicle),
            Observation::Air(air) => self.crosschecks.take_air(at, air, vehicle),
            Observation::ImuAndAir(imu, air) => {
                self.crosschecks.select(vehicle);
                self.take_imu(at, imu, vehicle);
                self.crosschecks.take_air(at, air, vehicle);
            }
            Observation::Attitude(attitude) => self.crosschecks.take_attitude(at, attitude),
            Observation::Wanted(wanted) => self.crosschecks.take_rate_setpoint(at, wanted.rates, vehicle),
            Observation::SecondEstimate(second) => self.crosschecks.take_second(at, second, vehicle),
            Observation::Hud(hud) => {
                // On wings a motor is off without throttle, and its ESC may fall silent.
                let is_off = hud.throttle.is_some_and(|throttle| throttle.0 < OFF_THROTTLE);
                if is_off && vehicle.hovers(at) == Some(false) {
                    self.resumed = at;
                }
                self.crosschecks.take_hud(at, hud, vehicle);
            }
            Observation::Estimator(estimator) => self.crosschecks.take_estimator(at, estimator),
            // On the scale that the vehicle knows.
            Observation::Vibration(_) => self.crosschecks.take_vibration(at, vehicle),
            Observation::Outputs(outputs) => {
                let level = self.crosschecks.gates().are(gates::SETTLED | gates::CLEAR | gates::LEVEL);
                self.outputs.take(at, outputs, vehicle, flight, level);
            }
            Observation::Gnss(gnss) => {
                self.crosschecks.take_gnss(at, gnss, vehicle);
                if let Some(had_fix) = self.had_fix.get_mut(usize::from(gnss.instance)) {
                    *had_fix |= gnss.fix >= 3;
                }
            }
            Observation::Battery(battery) => {
                self.take_voltages(vehicle, flight);
                if let Some(index) = vehicle.told_battery {
                    self.resistance[index].take(battery.voltage, battery.current);
                }
            }
            Observation::SystemStatus(system) => {
                self.take_voltages(vehicle, flight);
                if vehicle.batteries[0].get().is_none() {
                    self.resistance[0].take(system.voltage, system.current);
                }
            }
            Observation::Parameter(place, value) => self.cells.take_setting(*place, *value),
            Observation::Escs(group) => {
                let first = usize::from(group.first).min(MOTORS_MAX);
                let motors = first..first.saturating_add(group.escs.len()).min(MOTORS_MAX);
                self.take_errors(at, group);
                for number in motors.clone() {
                    self.take_motor(at, vehicle, number);
                }
                self.currents.take(at, vehicle, flight.airborne(), motors);
            }
            _ => {}
        }
    }

    fn take_imu(&mut self, at: Instant, imu: &Imu, vehicle: &Vehicle) {
        self.crosschecks.take_imu(at, imu, vehicle);
        // What shakes so has no load factor: its samples are of the vibration, and too few to average that out.
        let shakes =
            |vibration: &Vibration| vibration.levels.iter().flatten().any(|level| *level >= SHAKES_MPS2);
        if imu.instance == 0
            && !vehicle.vibration.within(at, SHAKEN).is_some_and(shakes)
            && let Some(sample_g) = imu.acceleration.and_then(load_factor_g)
        {
            self.load_factor.set(at, [sample_g, norm(vehicle.inertial.force()) / GRAVITY]);
        }
    }

    fn take_voltages(&mut self, vehicle: &Vehicle, flight: &Flight) {
        let armed = vehicle.armed();
        for battery in 0..BATTERIES_MAX {
            if let Some(pack_v) = pack_v(vehicle, battery) {
                let id = vehicle.batteries[battery].get().map_or(0, |known| known.id);
                self.cells.take_voltage(battery, id, pack_v, !armed || flight.stands(), armed);
            }
        }
    }

    /// Cells of the batteries.
    pub(crate) const fn cells(&self) -> &Cells {
        &self.cells
    }

    /// Cells of the batteries, to be told more.
    pub(crate) const fn cells_mut(&mut self) -> &mut Cells {
        &mut self.cells
    }

    fn take_errors(&mut self, at: Instant, group: &EscGroup) {
        for (offset, esc) in group.escs.iter().enumerate() {
            let errors = esc.and_then(|esc| esc.errors);
            let track = self.motors.get_mut(usize::from(group.first) + offset);
            if let (Some(errors), Some(track)) = (errors, track) {
                track.errors.get_or_insert(Rate::new(at, errors)).take(at, errors);
            }
        }
    }

    fn take_motor(&mut self, at: Instant, vehicle: &Vehicle, number: usize) {
        let (motor, track) = (&vehicle.motors[number], &mut self.motors[number]);
        if motor.moved_at != Some(at) || track.last == Stamp::at(at) {
            return;
        }
        let interval_s = track.last.age(at).map(Span::as_secs_f32);
        track.last = Stamp::at(at);
        // A pause is not a rhythm: it must not make the next pause look normal.
        if let Some(interval_s) = interval_s.filter(|interval_s| *interval_s < 5.0) {
            let weight = if track.interval_s == 0.0 { 1.0 } else { 0.1 };
            track.interval_s += weight * (interval_s - track.interval_s);
        }
        if let Some(rpm) = motor.esc.rpm.and_then(crate::units::Rpm::finite) {
            let speed = rpm.0.abs();
            track.highest_rpm = track.highest_rpm.max(speed);
            let step_s = interval_s.unwrap_or(MOTOR_SMOOTHING_S);
            let weight = (step_s / (MOTOR_SMOOTHING_S + step_s)).clamp(0.0, 1.0);
            track.smooth_rpm += weight * (speed - track.smooth_rpm);
        }
    }

    /// One step, at least every 50 ms, after the flight's own.
    pub fn step(
        &mut self,
        now: Instant,
        vehicle: &Vehicle,
        flight: &Flight,
        event: Option<FlightEvent>,
        recorder: &RecorderStatus,
    ) {
        if matches!(event, Some(FlightEvent::TakeOff | FlightEvent::Resumed)) {
            self.crosschecks.begin();
            self.outputs.begin();
        }
        self.crosschecks.step(now, vehicle, flight);
        let clips = clips(vehicle).unwrap_or(0);
        // What was clipped before this flight, or before the autopilot's restart, is not of this flight.
        if event.is_some() || clips < self.clips.count || !self.clips_known {
            self.clips_known = vehicle.vibration.get().is_some();
            self.clips = Lately { count: clips, before: clips, ..Lately::NONE };
        }
        self.clips.take(now, clips.into());
        self.find_furthest();
        self.frames_lost.take(now, recorder.frames_lost);
        self.write_errors.take(now, recorder.write_errors);
    }

    /// Sensors against each other.
    pub(crate) const fn crosschecks(&self) -> &Crosschecks {
        &self.crosschecks
    }

    /// What the motors are given.
    pub(crate) const fn outputs(&self) -> &MotorOutputs {
        &self.outputs
    }

    /// What the motors take.
    pub(crate) const fn currents(&self) -> &Currents {
        &self.currents
    }

    /// What earlier flights found of a battery's internal resistance.
    pub(crate) fn set_resistance_baseline(&mut self, battery: usize, ohm: f32) {
        if let Some(resistance) = self.resistance.get_mut(battery) {
            resistance.set_baseline(ohm);
        }
    }

    /// The battery is another one.
    pub(crate) fn forget_resistance(&mut self, battery: usize) {
        if let Some(resistance) = self.resistance.get_mut(battery) {
            *resistance = Resistance::new();
        }
    }

    /// What is known of a battery's internal resistance.
    pub(crate) fn resistance(&self, battery: usize) -> Option<&Resistance> {
        self.resistance.get(battery)
    }

    /// Errors a minute that a motor's ESC counts.
    pub(crate) fn esc_errors(&self, motor: u8) -> Option<f32> {
        let errors = self.motors.get(usize::from(motor))?.errors?;
        Some(errors.per_minute() as f32)
    }

    /// Cells of a battery: set, reported, or found ([`crate::cells`]). 0 where that is not known.
    pub(crate) fn cell_count(&self, vehicle: &Vehicle, battery: usize, params: &Params) -> u8 {
        let set = params.get(Param::BatCells) as u8;
        if set > 0 && self.cells.fits(battery, set) {
            return set;
        }
        let reported =
            vehicle.batteries.get(battery).and_then(Latest::get).map_or(0, Battery::cells_reported);
        match reported {
            2.. => reported as u8,
            // What contradicts the setting is not known: the setting may be wrong, or the pack empty.
            _ if set > 0 => 0,
            _ => self.cells.of(battery),
        }
    }

    /// The lowest cell's voltage where cells are measured, the pack's share of it otherwise; what it would be without its sag
    /// under the load, as far as that is known.
    pub(crate) fn cell_voltage(&self, vehicle: &Vehicle, params: &Params, battery: u8) -> Option<Reading> {
        let index = usize::from(battery);
        let slot = vehicle.batteries.get(index)?;
        if slot.get().is_some_and(|known| !known.lithium) {
            return None;
        }
        let at = if slot.get().is_some() { slot.at() } else { vehicle.system.at() };
        let lowest = slot
            .get()
            .filter(|known| known.cells_reported() > 1)
            .and_then(|known| known.cells.iter().flatten().map(|cell| cell.volts().0).reduce(f32::min));
        let share = || {
            let cells = self.cell_count(vehicle, index, params);
            pack_v(vehicle, index).filter(|_| cells > 0).map(|pack_v| pack_v / f32::from(cells))
        };
        Reading::new(at, lowest.or_else(share).map(|cell_v| cell_v + self.sag_v(vehicle, index, params)))
    }

    /// How far the load makes a cell's voltage sag; [`SAG_MAX_V`] at most.
    fn sag_v(&self, vehicle: &Vehicle, battery: usize, params: &Params) -> f32 {
        let known = vehicle.batteries.get(battery).and_then(Latest::get);
        let system = || vehicle.system.get().and_then(|system| system.current);
        let current = known.map_or_else(system, |known| known.current);
        let cells = f32::from(self.cell_count(vehicle, battery, params).max(1));
        let sag_v = self.resistance.get(battery).zip(current).map_or(0.0, |(of, current)| of.sag_v(current));
        (sag_v / cells).min(SAG_MAX_V)
    }

    /// Seconds since an ESC last told speed or current, once it has missed some of its own intervals; 0 before. Up to when the
    /// vehicle was heard last: a link that is silent says nothing about an ESC.
    pub(crate) fn esc_silence(&self, now: Instant, motor: u8) -> Option<Reading> {
        let track = self.motors.get(usize::from(motor))?;
        let heard = self.heard?;
        let silence_s = heard.since(track.last.instant(heard)?.later(self.resumed)).as_secs_f32();
        let intervals = if track.interval_s > SLOW_S { INTERVALS_MISSED_SLOW } else { INTERVALS_MISSED };
        let missed = track.interval_s > 0.0 && silence_s > intervals * track.interval_s;
        Some(Reading { at: heard.earlier(now), value: if missed { silence_s } else { 0.0 } })
    }

    /// 0 % of a motor that turned and stands while it is given all there is: control asks it for thrust, and nothing comes. Its ESC's speed
    /// alone may be wrong. `None` of any other.
    pub(crate) fn stopped(&self, vehicle: &Vehicle, motor: u8) -> Option<Reading> {
        if !self.outputs.is_full(motor) {
            return None;
        }
        let place = usize::from(motor);
        // One that stood before it was heard never turned.
        let turned = self.outputs.was_found_at_end(motor)
            || self.motors.get(place).is_some_and(|track| track.highest_rpm > TURNING_RPM);
        let told = vehicle.motors.get(place).filter(|told| turned && told.esc.rpm.is_some())?;
        let stands = !Self::turns(vehicle, place) && (0..MOTORS_MAX).any(|other| Self::turns(vehicle, other));
        Reading::new(told.moved_at.filter(|_| stands), Some(0.0))
    }

    /// Whether all ESCs that told anything, of several, are silent at once: motors that carry the vehicle do not fail so, and the wire of
    /// their telemetry does.
    pub(crate) fn are_escs_silent(&self, now: Instant) -> bool {
        let told = (0_u8..).zip(&self.motors).filter(|(_, track)| track.interval_s > 0.0);
        let (count, silent) = told.fold((0_u8, true), |(count, silent), (motor, _)| {
            (count + 1, silent && self.esc_silence(now, motor).is_some_and(|silence| silence.value > 0.0))
        });
        count > 1 && silent
    }

    /// How far a motor's speed is from the middle one of all and from that of each other motor, in percent of the middle one, in
    /// steady flight; 0 for all but the motor that is furthest from the middle one: where one is lost the others turn as they must
    /// to make up for it.
    ///
    /// What turns, leans or carries its load on one side drives motors in twos, threes and fours: those of one sense of rotation,
    /// the front ones, the upper ones of coaxial pairs. So a motor is off where no other one is near it, whatever the layout.
    pub(crate) fn motor_imbalance(
        &self,
        now: Instant,
        vehicle: &Vehicle,
        flight: &Flight,
        motor: u8,
    ) -> Option<Reading> {
        let track = self.motors.get(usize::from(motor)).filter(|track| track.highest_rpm > TURNING_RPM)?;
        let middle = self.middle_speed()?;
        let compares = vehicle.is_multicopter() && self.motors_told(now, middle);
        // On the ground, still armed, each motor idles as it likes.
        let idles = vehicle
            .hud
            .within(now, MOTORS_TOLD)
            .and_then(|hud| hud.throttle)
            .is_some_and(|throttle| throttle.0 < IDLE_THROTTLE);
        // Where one is lost, the one opposite may stop too, and the vehicle may turn.
        let lost = track.smooth_rpm < LOST_PART * middle;
        if !compares
            || idles
            || !(lost || vehicle.inertial.turns_little(now, TURNED))
            || !flight.is_steady(now, vehicle)
        {
            return None;
        }
        let named = usize::from(self.furthest) == usize::from(motor);
        let alone = if lost { f32::INFINITY } else { self.apart(motor) };
        let off = (track.smooth_rpm - middle).abs().min(alone) / middle * 100.0;
        Reading::new(track.last.instant(now), Some(if named { off } else { 0.0 }))
    }

    /// How far a motor's speed is from the nearest one of the others.
    fn apart(&self, motor: u8) -> f32 {
        let Some(own) = self.motors.get(usize::from(motor)) else { return 0.0 };
        let others = (0..)
            .zip(&self.motors)
            .filter(|(other, track)| *other != motor && track.highest_rpm > TURNING_RPM);
        others.map(|(_, track)| (track.smooth_rpm - own.smooth_rpm).abs()).reduce(f32::min).unwrap_or(0.0)
    }

    /// Which motor is furthest from the middle one. It stays the one that was found first until another is twice as far: where one
    /// is lost, others follow.
    fn find_furthest(&mut self) {
        let Some(middle) = self.middle_speed() else { return };
        let departure = |track: &MotorTrack| {
            if track.highest_rpm > TURNING_RPM { (track.smooth_rpm - middle).abs() } else { 0.0 }
        };
        let mut least = 2.0 * self.motors.get(usize::from(self.furthest)).map_or(0.0, departure);
        for (number, track) in (0..).zip(&self.motors) {
            if departure(track) > least {
                (self.furthest, least) = (number, departure(track));
            }
        }
    }

    /// The middle one of the speeds of all motors that are fitted (of an even number the lower one of the two); `None` while they
    /// do not turn.
    fn middle_speed(&self) -> Option<f32> {
        let speeds = || {
            self.motors.iter().filter(|track| track.highest_rpm > TURNING_RPM).map(|track| track.smooth_rpm)
        };
        let half = speeds().count() / 2;
        let is_middle = |speed: &f32| {
            speeds().filter(|other| other < speed).count() <= half.saturating_sub(1)
                && speeds().filter(|other| other > speed).count() <= half
        };
        speeds().find(is_middle).filter(|speed| *speed >= TURNING_RPM)
    }

    /// Whether all motors that are fitted were told of just now, and turn as in flight: speeds that are held, or zeros of ESCs
    /// that lost their telemetry, say nothing about a motor.
    fn motors_told(&self, now: Instant, mean_rpm: f32) -> bool {
        let mut fitted = self.motors.iter().filter(|track| track.highest_rpm > TURNING_RPM);
        let flying = |track: &MotorTrack| {
            track.last.age(now).is_some_and(|age| age <= MOTORS_TOLD)
                && mean_rpm >= FLYING_PART * track.highest_rpm
        };
        fitted.all(flying)
    }

    /// The same with its sign, wherever it flies; `None` for a motor that is not fitted.
    pub(crate) fn motor_departure(&self, motor: u8) -> Option<f32> {
        let track = self.motors.get(usize::from(motor)).filter(|track| track.highest_rpm > TURNING_RPM)?;
        let mean = self.mean_of_others(motor)?;
        Some((track.smooth_rpm - mean) / mean * 100.0)
    }

    /// The mean speed of the motors that are fitted, but for one; `None` while they do not turn.
    fn mean_of_others(&self, motor: u8) -> Option<f32> {
        let others = self.motors.iter().enumerate();
        let others =
            others.filter(|(other, track)| *other != usize::from(motor) && track.highest_rpm > TURNING_RPM);
        let (sum, count) =
            others.fold((0.0, 0_u8), |(sum, count), (_, other)| (sum + other.smooth_rpm, count + 1));
        let mean = sum / f32::from(count);
        (count > 0 && mean >= TURNING_RPM).then_some(mean)
    }

    /// Clipped samples of the worst accelerometer in this flight, since ten seconds went by without any.
    pub(crate) fn clips(&self, vehicle: &Vehicle) -> Option<Reading> {
        clips(vehicle)?;
        Reading::new(vehicle.vibration.at(), Some(self.clips.lately()))
    }

    /// Magnitude of the specific force in units of gravity: 1 at rest and in steady flight.
    pub(crate) fn load_factor(&self) -> Option<Reading> {
        Reading::new(self.load_factor.at(), self.load_factor.get().map(|[sample_g, _]| *sample_g))
    }

    /// The same of the force as it is smoothed by axis ([`crate::inertial`]): a load that counts.
    pub(crate) fn load_factor_g(&self) -> Option<f32> {
        self.load_factor.get().map(|[_, smooth_g]| *smooth_g)
    }

    /// Whether a receiver has had a 3D fix since power-on.
    pub(crate) fn had_fix(&self, receiver: u8) -> bool {
        self.had_fix.get(usize::from(receiver)).copied().unwrap_or(false)
    }

    /// Frames that our own recording lost in the last ten seconds.
    pub(crate) fn frames_lost_lately(&self) -> f32 {
        self.frames_lost.lately()
    }

    /// Block writes that the card refused in the last ten seconds.
    pub(crate) const fn write_errors_lately(&self) -> f32 {
        self.write_errors.lately()
    }

    /// Whether a motor turns now.
    pub fn turns(vehicle: &Vehicle, motor: usize) -> bool {
        vehicle.motors.get(motor).and_then(|motor| motor.esc.rpm).is_some_and(|rpm| rpm.0.abs() > TURNING_RPM)
    }
}

/// A sample of the specific force in units of gravity; `None` where it was not measured.
pub(crate) fn load_factor_g(force: [MetresPerSecond2; 3]) -> Option<f32> {
    Some(norm(force.map(|axis| axis.0))).filter(|force| *force <= FORCE_MAX).map(|force| force / GRAVITY)
}

/// A battery's voltage; the autopilot's figure for the first one where no battery reports itself.
pub(crate) fn pack_v(vehicle: &Vehicle, battery: usize) -> Option<f32> {
    let known = vehicle.batteries.get(battery)?.get();
    let system = || vehicle.system.get().filter(|_| battery == 0).and_then(|system| system.voltage);
    known.map_or_else(system, |known| known.voltage).map(|voltage| voltage.0)
}

fn clips(vehicle: &Vehicle) -> Option<u32> {
    vehicle.vibration.get().map(|vibration| vibration.clips.into_iter().max().unwrap_or(0))
}
