//! Usage: what a mechanic acts on. Counters since power-on, each a number that is stored, with a name that carries its
//! unit.

use crate::derived::Derived;
use crate::flight::{Flight, FlightEvent, Phase, climb_mps, ground_speed_mps};
use crate::observation::{MOTORS_MAX, Observation};
use crate::params::{Param, Params};
use crate::rainflow::Rainflow;
use crate::time::{Instant, Span};
use crate::units::{Amperes, Volts};
use crate::vehicle::Vehicle;

macro_rules! counters {
    ($($(#[$doc:meta])* $variant:ident = $number:literal $name:literal;)*) => {
        /// A usage counter. The numbers are stored in logs and never change meaning.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u8)]
        pub enum UsageCounter {
            $($(#[$doc])* $variant = $number,)*
        }

        impl UsageCounter {
            /// All counters that are not one a motor, by number.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The name, which ends in the unit.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }
        }
    };
}

counters! {
    /// Seconds since power-on.
    Powered = 0 "powered_time_s";
    /// Seconds armed.
    Armed = 1 "armed_time_s";
    /// Seconds in the air.
    Flight = 2 "flight_time_s";
    /// Take-offs.
    Flights = 3 "flights";
    /// Landings.
    Landings = 4 "landings";
    /// Metres over ground while in the air.
    Distance = 5 "distance_m";
    /// The greatest height above home, metres.
    HeightMax = 6 "height_max_m";
    /// The greatest speed over ground, m/s.
    SpeedMax = 7 "speed_max_m_s";
    /// The greatest load factor in the air, units of gravity.
    LoadFactorMax = 8 "load_factor_max_g";
    /// Charge taken from all batteries, ampere hours.
    Charge = 9 "charge_ah";
    /// Energy taken from all batteries, watt hours.
    Energy = 10 "energy_wh";
    /// The highest current of all batteries together, amperes.
    CurrentMax = 11 "current_max_a";
    /// The lowest battery voltage while armed, volts.
    VoltageMin = 12 "voltage_min_v";
    /// The highest vibration while armed, on the autopilot's own scale, m/s2.
    VibrationMax = 13 "vibration_max_m_s2";
    /// Reboots of the autopilot.
    AutopilotReboots = 14 "autopilot_reboots";
    /// Landings faster than the limit of a hard one.
    HardLandings = 15 "hard_landings";
    /// The fastest touchdown, m/s downwards.
    TouchdownMax = 16 "touchdown_max_m_s";
    /// Full discharges of all batteries together that the charge taken makes.
    BatteryCycles = 17 "battery_cycles";
    /// Seconds on the ground with an autopilot that is heard.
    Ground = 20 "ground_time_s";
    /// Seconds in the first metres up.
    TakeOff = 21 "take_off_time_s";
    /// Seconds standing in the air.
    Hover = 22 "hover_time_s";
    /// Seconds going up.
    Climb = 23 "climb_time_s";
    /// Seconds going somewhere.
    Cruise = 24 "cruise_time_s";
    /// Seconds going down.
    Descent = 25 "descent_time_s";
    /// Seconds in the last metres down.
    Landing = 26 "landing_time_s";
    /// Rainflow cycles of the load factor in the air, ranges from 0.25 g.
    LoadCycles0 = 30 "load_cycles_from_0_25_g";
    /// Ranges from 0.5 g.
    LoadCycles1 = 31 "load_cycles_from_0_5_g";
    /// Ranges from 1 g.
    LoadCycles2 = 32 "load_cycles_from_1_g";
    /// Ranges from 1.5 g.
    LoadCycles3 = 33 "load_cycles_from_1_5_g";
    /// Ranges from 2 g.
    LoadCycles4 = 34 "load_cycles_from_2_g";
    /// Ranges from 3 g.
    LoadCycles5 = 35 "load_cycles_from_3_g";
    /// Ranges from 4 g.
    LoadCycles6 = 36 "load_cycles_from_4_g";
}

/// Counters one a motor: run time in seconds from this number on, motor by motor.
pub const MOTOR_TIME_FIRST: u8 = 100;
/// Counters one a motor: revolutions from this number on, motor by motor.
pub const MOTOR_REVOLUTIONS_FIRST: u8 = 120;

/// What a stored counter number means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CounterName {
    /// A counter of the vehicle.
    Vehicle(&'static str),
    /// A counter of one motor, numbered from 0: name and motor.
    Motor(&'static str, u8),
}

/// The meaning of a stored counter number; `None` for one that a later version wrote.
pub fn counter_name(number: u8) -> Option<CounterName> {
    let motor = |first: u8| number.checked_sub(first).filter(|motor| usize::from(*motor) < MOTORS_MAX);
    if let Some(motor) = motor(MOTOR_TIME_FIRST) {
        return Some(CounterName::Motor("run_time_s", motor));
    }
    if let Some(motor) = motor(MOTOR_REVOLUTIONS_FIRST) {
        return Some(CounterName::Motor("revolutions", motor));
    }
    UsageCounter::ALL
        .iter()
        .find(|counter| **counter as u8 == number)
        .map(|counter| CounterName::Vehicle(counter.name()))
}

/// Integration steps longer than this are gaps: nothing is known of what happened in them.
const STEP_MAX: Span = Span::from_secs(2);
/// What no vehicle here has: beyond it a value is garbage.
const VOLTS_MAX: f32 = 1_000.0;
const AMPERES_MAX: f32 = 10_000.0;
const RPM_MAX: f32 = 1e6;
const HEIGHT_MAX_M: f32 = 100_000.0;
const ACCELERATION_MAX: f32 = 10_000.0;
/// A battery figure holds this long.
const BATTERY_AGE: Span = Span::from_secs(5);
/// A motor speed holds this long.
const MOTOR_AGE: Span = Span::from_secs(2);

#[derive(Clone, Copy, Debug, Default)]
struct MotorUsage {
    seconds: f64,
    revolutions: f64,
}

/// Usage since power-on.
#[derive(Clone, Copy, Debug)]
pub struct Usage {
    last: Option<Instant>,
    armed_s: f64,
    flight_s: f64,
    flights: u32,
    landings: u32,
    distance_m: f64,
    height_max_m: f32,
    speed_max_mps: f32,
    load_factor_max_g: f32,
    charge_ah: f64,
    energy_wh: f64,
    current_max_a: f32,
    voltage_min_v: Option<f32>,
    vibration_max: f32,
    reboots: u32,
    hard_landings: u32,
    touchdown_max_mps: f32,
    /// The fastest descent near the ground of this second and of the three before.
    sinks_mps: [f32; 4],
    sinks_second: u64,
    capacity_ah: f32,
    phases_s: [f64; 7],
    load_cycles: Rainflow<7>,
    motors: [MotorUsage; MOTORS_MAX],
}

/// Lowest ranges of the load factor's cycles, g.
const LOAD_RANGES_G: [f32; 7] = [0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0];
/// A load factor that turns back by less has not turned: that much is vibration and noise.
const LOAD_TURN_G: f32 = 0.1;
/// An autopilot that was not heard for so long is not known to be powered.
const HEARD: Span = Span::from_secs(5);

impl Default for Usage {
    fn default() -> Self {
        Self::new()
    }
}

impl Usage {
    /// All zero.
    pub const fn new() -> Self {
        Self {
            last: None,
            armed_s: 0.0,
            flight_s: 0.0,
            flights: 0,
            landings: 0,
            distance_m: 0.0,
            height_max_m: 0.0,
            speed_max_mps: 0.0,
            load_factor_max_g: 0.0,
            charge_ah: 0.0,
            energy_wh: 0.0,
            current_max_a: 0.0,
            voltage_min_v: None,
            vibration_max: 0.0,
            reboots: 0,
            hard_landings: 0,
            touchdown_max_mps: 0.0,
            sinks_mps: [0.0; 4],
            sinks_second: 0,
            capacity_ah: 0.0,
            phases_s: [0.0; 7],
            load_cycles: Rainflow::new(LOAD_RANGES_G, LOAD_TURN_G),
            motors: [MotorUsage { seconds: 0.0, revolutions: 0.0 }; MOTORS_MAX],
        }
    }

    /// Takes an observation's extremes, which a step could miss.
    pub fn observe(
        &mut self,
        at: Instant,
        vehicle: &Vehicle,
        flight: &Flight,
        derived: &Derived,
        observation: &Observation,
    ) {
        match observation {
            Observation::Vibration(vibration) if vehicle.armed() => {
                let highest = vibration.levels.into_iter().flatten().fold(0.0, f32::max);
                self.vibration_max = greater(self.vibration_max, highest, ACCELERATION_MAX);
            }
            Observation::Imu(_) | Observation::ImuAndAir(..) if flight.airborne() => {
                let load_factor_g = derived.load_factor_g().unwrap_or(0.0);
                self.load_factor_max_g = greater(self.load_factor_max_g, load_factor_g, ACCELERATION_MAX);
                if load_factor_g <= ACCELERATION_MAX {
                    self.load_cycles.take(load_factor_g);
                }
            }
            Observation::GlobalPosition(global) if flight.airborne() => {
                self.height_max_m = greater(self.height_max_m, global.relative_altitude.0, HEIGHT_MAX_M);
            }
            Observation::Battery(_) | Observation::SystemStatus(_) if vehicle.armed() => {
                self.take_battery(at, vehicle);
            }
            _ => {}
        }
    }

    fn take_battery(&mut self, at: Instant, vehicle: &Vehicle) {
        let Drawn { voltage_v, current_a, .. } = drawn(at, vehicle);
        if let Some(voltage_v) = voltage_v.filter(|voltage_v| *voltage_v > 0.0) {
            self.voltage_min_v = Some(self.voltage_min_v.map_or(voltage_v, |lowest| lowest.min(voltage_v)));
        }
        self.current_max_a = self.current_max_a.max(current_a.unwrap_or(0.0));
    }

    /// One step, at least every 50 ms, after the flight's own.
    pub fn step(
        &mut self,
        now: Instant,
        vehicle: &Vehicle,
        flight: &Flight,
        event: Option<FlightEvent>,
        params: &Params,
    ) {
        match event {
            Some(FlightEvent::TakeOff) => {
                self.flights += 1;
                // It was seen a moment after it happened.
                let late = flight.airborne_since().map_or(Span::ZERO, |since| now.since(since));
                self.flight_s += f64::from(late.as_secs_f32());
            }
            Some(FlightEvent::Landing) => self.land(params),
            None => {}
        }
        self.reboots = vehicle.reboots;
        self.capacity_ah = params.get(Param::BatCapacity);
        self.note_sink(now, vehicle, flight);
        let step = self.last.map_or(Span::ZERO, |last| now.since(last));
        self.last = Some(now);
        if step > STEP_MAX {
            return;
        }
        let step_s = f64::from(step.as_secs_f32());
        if vehicle.armed() {
            self.armed_s += step_s;
        }
        if vehicle.heartbeat.within(now, HEARD).is_some() {
            self.phases_s[flight.phase(now, vehicle) as usize] += step_s;
        }
        if flight.airborne() {
            self.flight_s += step_s;
            if let Some(speed_mps) = ground_speed_mps(now, vehicle) {
                self.distance_m += f64::from(speed_mps) * step_s;
                self.speed_max_mps = self.speed_max_mps.max(speed_mps);
            }
        }
        self.step_battery(now, vehicle, step_s);
        self.step_motors(now, vehicle, step_s);
    }

    fn step_battery(&mut self, now: Instant, vehicle: &Vehicle, step_s: f64) {
        let drawn = drawn(now, vehicle);
        self.charge_ah += f64::from(drawn.current_a.unwrap_or(0.0)) * step_s / 3_600.0;
        self.energy_wh += f64::from(drawn.power_w) * step_s / 3_600.0;
    }

    /// The autopilot says that it has landed a second or two after it touched down.
    fn land(&mut self, params: &Params) {
        self.landings += 1;
        let touchdown_mps = self.sinks_mps.into_iter().fold(0.0, f32::max);
        self.touchdown_max_mps = self.touchdown_max_mps.max(touchdown_mps);
        if touchdown_mps >= params.get(Param::HardLanding) {
            self.hard_landings += 1;
        }
    }

    fn note_sink(&mut self, now: Instant, vehicle: &Vehicle, flight: &Flight) {
        let second = now.as_millis() / 1_000;
        if second != self.sinks_second {
            self.sinks_second = second;
            self.sinks_mps = [0.0, self.sinks_mps[0], self.sinks_mps[1], self.sinks_mps[2]];
        }
        if flight.phase(now, vehicle) == Phase::Landing {
            let sink_mps = -climb_mps(now, vehicle).unwrap_or(0.0);
            self.sinks_mps[0] = self.sinks_mps[0].max(sink_mps);
        }
    }

    fn step_motors(&mut self, now: Instant, vehicle: &Vehicle, step_s: f64) {
        for (number, usage) in self.motors.iter_mut().enumerate() {
            let motor = &vehicle.motors[number];
            let fresh = motor.moved_at.is_some_and(|at| now.since(at) <= MOTOR_AGE);
            if fresh && Derived::turns(vehicle, number) {
                let rpm = motor.esc.rpm.map_or(0.0, |rpm| rpm.0.abs().min(RPM_MAX));
                usage.seconds += step_s;
                usage.revolutions += f64::from(rpm) * step_s / 60.0;
            }
        }
    }

    /// Every counter that has something to say: its stored number and its value.
    pub fn for_each(&self, mut each: impl FnMut(u8, f64)) {
        for counter in UsageCounter::ALL {
            if let Some(value) = self.value(*counter) {
                each(*counter as u8, value);
            }
        }
        for (motor, usage) in (0..).zip(&self.motors) {
            if usage.seconds > 0.0 {
                each(MOTOR_TIME_FIRST + motor, usage.seconds);
                each(MOTOR_REVOLUTIONS_FIRST + motor, usage.revolutions);
            }
        }
    }

    /// A counter's value; `None` for a minimum that was never measured.
    pub fn value(&self, counter: UsageCounter) -> Option<f64> {
        Some(match counter {
            UsageCounter::Powered => self.last.map_or(0.0, Instant::as_secs_f64),
            UsageCounter::Armed => self.armed_s,
            UsageCounter::Flight => self.flight_s,
            UsageCounter::Flights => f64::from(self.flights),
            UsageCounter::Landings => f64::from(self.landings),
            UsageCounter::Distance => self.distance_m,
            UsageCounter::HeightMax => f64::from(self.height_max_m),
            UsageCounter::SpeedMax => f64::from(self.speed_max_mps),
            UsageCounter::LoadFactorMax => f64::from(self.load_factor_max_g),
            UsageCounter::Charge => self.charge_ah,
            UsageCounter::Energy => self.energy_wh,
            UsageCounter::CurrentMax => f64::from(self.current_max_a),
            UsageCounter::VoltageMin => f64::from(self.voltage_min_v?),
            UsageCounter::VibrationMax => f64::from(self.vibration_max),
            UsageCounter::AutopilotReboots => f64::from(self.reboots),
            UsageCounter::HardLandings => f64::from(self.hard_landings),
            UsageCounter::TouchdownMax => f64::from(self.touchdown_max_mps),
            UsageCounter::BatteryCycles if self.capacity_ah > 0.0 => {
                self.charge_ah / f64::from(self.capacity_ah)
            }
            // Without a capacity nobody knows.
            UsageCounter::BatteryCycles => return None,
            UsageCounter::Ground
            | UsageCounter::TakeOff
            | UsageCounter::Hover
            | UsageCounter::Climb
            | UsageCounter::Cruise
            | UsageCounter::Descent
            | UsageCounter::Landing => self.phases_s[counter as usize - UsageCounter::Ground as usize],
            UsageCounter::LoadCycles0
            | UsageCounter::LoadCycles1
            | UsageCounter::LoadCycles2
            | UsageCounter::LoadCycles3
            | UsageCounter::LoadCycles4
            | UsageCounter::LoadCycles5
            | UsageCounter::LoadCycles6 => {
                self.load_cycles.cycles(counter as usize - UsageCounter::LoadCycles0 as usize)
            }
        })
    }
}

/// The larger one; what is no number, or beyond what there can be, is left out.
fn greater(highest: f32, value: f32, limit: f32) -> f32 {
    if value <= limit { highest.max(value) } else { highest }
}

/// The first battery's voltage, or the autopilot's figure where none reports itself; the discharge current and the power
/// of all batteries together, or of all ESCs where no battery knows its current (PX4 in simulation).
#[derive(Clone, Copy, Debug, Default)]
struct Drawn {
    voltage_v: Option<f32>,
    current_a: Option<f32>,
    power_w: f32,
}

fn drawn(now: Instant, vehicle: &Vehicle) -> Drawn {
    let mut drawn = Drawn::default();
    let batteries = vehicle.batteries.iter();
    for battery in batteries.clone().filter_map(|slot| slot.within(now, BATTERY_AGE)) {
        drawn.add(battery.voltage, battery.current);
    }
    let none_reported = batteries.clone().all(|slot| slot.get().is_none());
    if let Some(system) = vehicle.system.within(now, BATTERY_AGE).filter(|_| none_reported) {
        drawn.add(system.voltage, system.current);
    }
    if drawn.current_a.is_none() {
        let fresh = |at: Option<Instant>| at.is_some_and(|at| now.since(at) <= MOTOR_AGE);
        for motor in vehicle.motors.iter().filter(|motor| fresh(motor.moved_at)) {
            drawn.add(motor.esc.voltage, motor.esc.current);
        }
    }
    drawn
}

impl Drawn {
    /// Garbage is left out: it must not get into sums that are kept for good.
    fn add(&mut self, voltage: Option<Volts>, current: Option<Amperes>) {
        let voltage_v = voltage.map(|voltage| voltage.0).filter(|volts| (0.0..=VOLTS_MAX).contains(volts));
        let current_a = current.map(|current| current.0).filter(|amperes| amperes.abs() <= AMPERES_MAX);
        self.voltage_v = self.voltage_v.or(voltage_v);
        if let Some(current_a) = current_a {
            let discharge_a = current_a.max(0.0);
            self.current_a = Some(self.current_a.unwrap_or(0.0) + discharge_a);
            self.power_w += voltage_v.unwrap_or(0.0) * discharge_a;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_counter_has_a_number_of_its_own_and_a_name() {
        let mut count = 0;
        for number in 0..=255 {
            if let Some(name) = counter_name(number) {
                count += 1;
                assert!(!matches!(name, CounterName::Vehicle("")), "{number}");
            }
        }
        assert_eq!(count, UsageCounter::ALL.len() + 2 * MOTORS_MAX);
    }
}
