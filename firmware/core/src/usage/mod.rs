//! Usage: counters since power-on for a mechanic, each with a stored number and a name that ends in its unit.

mod counters;
mod totals;

pub use counters::{
    EXPOSURE_FIRST, FIGURE_FIRST, Form, MOTOR_REVOLUTIONS_FIRST, MOTOR_TIME_FIRST, UsageCounter,
    exposure_number, figure_number,
};
pub use totals::{MotorTotals, Totals};

use crate::derived::Derived;
use crate::exposure::ExposureQuantity;
use crate::flight::{Flight, FlightEvent, Phase};
use crate::health::Inputs;
use crate::motion::ground_speed_mps;
use crate::motors::turns;
use crate::observation::Observation;
use crate::parameters::{Param, Params};
use crate::power_draw::{PowerDraw, drawn};
use crate::rainflow::Rainflow;
use crate::time::{BootMs, Millis, PAUSE, SILENT};
use crate::units::{Metres, Rpm};
use crate::vehicle::Vehicle;

/// Greater accelerations, m/s2 or g, are garbage: no vehicle here reaches them.
const ACCELERATION_MAX: f32 = 10_000.0;

state! {
    /// Usage since power-on.
    pub struct Usage {
        last: Option<BootMs>,
        current_a: Option<f32>,
        /// All counters but the cycles of the load factor, which are computed when asked for.
        pub(crate) counted: Totals,
        /// When time in ranges was counted last.
        exposed_at: Option<BootMs>,
        /// Batteries share it equally.
        capacity_ah: f32,
        load_cycles: Rainflow<7> = Rainflow::new(LOAD_RANGES_G, LOAD_TURN_G),
        /// Seconds armed and in the air that wait for the vehicle to report again.
        held_s: [f64; 2],
        /// Seconds of a possible landing, not yet of a phase.
        landing_s: f64,
    }
}

/// Between two steps of the time in ranges.
const EXPOSED_EVERY: Millis = Millis::from_millis(100);
const LOAD_RANGES_G: [f32; 7] = [0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0];
/// A load factor that turns back by less is vibration and noise.
const LOAD_TURN_G: f32 = 0.1;
const _: () =
    assert!(UsageCounter::Landing as usize - UsageCounter::Ground as usize == Phase::Landing as usize);

impl Usage {
    /// Takes an observation's extremes, which a step could miss.
    pub fn observe(
        &mut self,
        at: BootMs,
        vehicle: &Vehicle,
        flight: &Flight,
        derived: &Derived,
        observation: &Observation,
    ) {
        match observation {
            Observation::Vibration(vibration) if vehicle.armed() => {
                let highest = vibration.highest().unwrap_or(0.0);
                self.extend(UsageCounter::VibrationMax, highest, ACCELERATION_MAX);
            }
            Observation::Imu(_) | Observation::ImuAndAir(..) if flight.airborne() => {
                let load_factor_g = derived.load_factor_g().unwrap_or(0.0);
                self.extend(UsageCounter::LoadFactorMax, load_factor_g, ACCELERATION_MAX);
                if load_factor_g <= ACCELERATION_MAX {
                    self.load_cycles.take(load_factor_g);
                }
            }
            Observation::GlobalPosition(global) if flight.airborne() => {
                self.extend(UsageCounter::HeightMax, global.relative_altitude.0, Metres::MAX);
            }
            Observation::Battery(_) | Observation::SystemStatus(_) if vehicle.armed() => {
                self.take_battery(at, vehicle);
            }
            _ => {}
        }
    }

    fn take_battery(&mut self, at: BootMs, vehicle: &Vehicle) {
        let PowerDraw { voltage_v, current_a, .. } = drawn(at, vehicle);
        if let Some(voltage_v) = voltage_v.filter(|voltage_v| *voltage_v > 0.0) {
            self.counted.extend(UsageCounter::VoltageMin, f64::from(voltage_v));
        }
        self.counted.extend(UsageCounter::CurrentMax, f64::from(current_a.unwrap_or(0.0)));
    }

    fn extend(&mut self, counter: UsageCounter, value: f32, limit: f32) {
        if value <= limit {
            self.counted.extend(counter, f64::from(value));
        }
    }

    /// One step, at least every 50 ms, after the flight's own.
    pub(crate) fn step(&mut self, inputs: &Inputs<'_>, event: Option<FlightEvent>) {
        let Inputs { now, vehicle, flight, derived, params, .. } = *inputs;
        if event == Some(FlightEvent::TakeOff) {
            self.counted.add(UsageCounter::Flights, 1.0);
        }
        if event.is_some_and(|event| event != FlightEvent::Landing) {
            // The event is found some time after it happened.
            let late = flight.airborne_since().map_or(Millis::ZERO, |since| now.since(since));
            self.counted.add(UsageCounter::Flight, f64::from(late.as_secs_f32()));
        }
        if event == Some(FlightEvent::Landing) {
            self.land(flight, params);
        }
        self.counted.set(UsageCounter::AutopilotReboots, f64::from(vehicle.reboots));
        let set_ah = params.get(Param::BatCapacity);
        self.capacity_ah = if set_ah > 0.0 { set_ah } else { derived.cells.capacity_ah() };
        let before = self.last.replace(now);
        let step = before.map_or(Millis::ZERO, |last| now.since(last));
        let powered = now.since(before.unwrap_or(BootMs::ZERO));
        self.counted.add(UsageCounter::Powered, f64::from(powered.as_secs_f32()));
        if step > PAUSE {
            return;
        }
        let step_s = f64::from(step.as_secs_f32());
        self.step_times(now, vehicle, flight, step_s);
        if let Some(speed_mps) = ground_speed_mps(now, vehicle).filter(|_| flight.airborne()) {
            self.counted.add(UsageCounter::Distance, f64::from(speed_mps) * step_s);
            self.counted.extend(UsageCounter::SpeedMax, f64::from(speed_mps));
        }
        self.step_battery(now, vehicle, step_s);
        self.step_motors(now, vehicle, step_s);
    }

    /// A silence counts once the vehicle reports again and is still armed or in the air. So does the time of a
    /// possible landing.
    fn step_times(&mut self, now: BootMs, vehicle: &Vehicle, flight: &Flight, step_s: f64) {
        let reports = vehicle.heartbeat.within(now, SILENT).is_some();
        let is_known = reports && !flight.may_have_landed();
        let states = [
            (UsageCounter::Armed, vehicle.armed(), reports),
            (UsageCounter::Flight, flight.phase(now, vehicle) != Phase::Ground, is_known),
        ];
        if !vehicle.armed() {
            self.held_s = [0.0; 2];
        }
        for ((counter, is_so, is_known), held_s) in states.into_iter().zip(&mut self.held_s) {
            let passed_s = if is_so { step_s + *held_s } else { 0.0 };
            *held_s = 0.0;
            if is_known { self.counted.add(counter, passed_s) } else { *held_s = passed_s }
        }
        if is_known {
            let landing_s = core::mem::take(&mut self.landing_s);
            // The regimes follow each other as the phases do.
            let regime = UsageCounter::Ground as usize + flight.phase(now, vehicle) as usize;
            self.counted.add(UsageCounter::ALL[regime], step_s + landing_s);
        } else if reports {
            self.landing_s += step_s;
        }
    }

    fn step_battery(&mut self, now: BootMs, vehicle: &Vehicle, step_s: f64) {
        let drawn = drawn(now, vehicle);
        self.current_a = drawn.current_a;
        // Dividing is dear.
        let hours = step_s / 3_600.0;
        let charge_ah = f64::from(drawn.current_a.unwrap_or(0.0)) * hours;
        self.counted.add(UsageCounter::Charge, charge_ah);
        self.counted.add(UsageCounter::Energy, f64::from(drawn.power_w) * hours);
        if self.capacity_ah > 0.0 {
            self.counted.add(UsageCounter::BatteryCycles, charge_ah / f64::from(self.capacity_ah));
            let batteries = vehicle.batteries.iter().filter(|slot| slot.get().is_some()).count().max(1);
            let capacity_ah = f64::from(self.capacity_ah) / batteries as f64;
            for (cycles, discharge_a) in self.counted.battery_cycles.iter_mut().zip(drawn.each_a) {
                *cycles += f64::from(discharge_a) * hours / capacity_ah;
            }
        }
    }

    fn land(&mut self, flight: &Flight, params: &Params) {
        let ended = if flight.is_down() { UsageCounter::Mishaps } else { UsageCounter::Landings };
        self.counted.add(ended, 1.0);
        self.counted.extend(UsageCounter::TouchdownMax, f64::from(flight.touch_mps));
        if flight.touch_mps >= params.get(Param::HardLanding) {
            self.counted.add(UsageCounter::HardLandings, 1.0);
        }
    }

    pub(crate) fn break_off(&mut self) {
        (self.held_s, self.landing_s) = ([0.0; 2], 0.0);
    }

    fn step_motors(&mut self, now: BootMs, vehicle: &Vehicle, step_s: f64) {
        let minutes = step_s / 60.0;
        for (number, usage) in self.counted.motors.iter_mut().enumerate() {
            let motor = &vehicle.motors[number];
            let fresh = motor.moved_at.is_some_and(|at| now.since(at) <= PAUSE);
            if fresh && turns(vehicle, number) {
                let rpm = motor.esc.rpm.map_or(0.0, |rpm| rpm.0.abs().min(Rpm::MAX));
                usage.seconds += step_s;
                usage.revolutions += f64::from(rpm) * minutes;
            }
        }
    }

    /// Counts the time in ranges in whole tenths of a second; the rest goes into the next step.
    pub(crate) fn expose(&mut self, now: BootMs, vehicle: &Vehicle) {
        let step = self.exposed_at.map_or(Millis::ZERO, |last| now.since(last));
        if self.exposed_at.is_some() && step < EXPOSED_EVERY {
            return;
        }
        let tenths = (step.as_millis() / 100) as u32;
        self.exposed_at = Some(now - Millis::from_millis(step.as_millis() % 100));
        if step > PAUSE {
            return;
        }
        for (quantity, bins) in ExposureQuantity::ALL.into_iter().zip(&mut self.counted.ranges) {
            if let Some(value) = quantity.value(now, vehicle, self.current_a) {
                let bin = quantity.edges().iter().take_while(|edge| value >= **edge).count();
                bins[bin] = bins[bin].saturating_add(tenths);
            }
        }
    }

    /// Every counter as it stands now.
    pub fn totals(&self) -> Totals {
        let mut totals = self.counted;
        let cycles = UsageCounter::ALL.iter().skip(UsageCounter::LoadCycles0 as usize);
        for (bin, counter) in cycles.take(LOAD_RANGES_G.len()).enumerate() {
            totals.set(*counter, self.load_cycles.cycles(bin));
        }
        totals
    }

    /// A counter's value; `None` for a minimum that was never measured, and for battery cycles without a known
    /// capacity.
    pub fn value(&self, counter: UsageCounter) -> Option<f64> {
        self.totals().value(counter)
    }

    pub(crate) fn until(&self) -> BootMs {
        self.last.unwrap_or_default()
    }
}
