//! The power drawn from the batteries, from the best fresh source.

use crate::time::{BootMs, PAUSE, SILENT};
use crate::units::{Amperes, Volts};
use crate::vehicle::{BATTERIES_MAX, Vehicle};

/// Voltage of the first battery (or the autopilot's figure if none reports itself), and discharge current and power
/// of all batteries. Without a battery current: the sum of all ESCs (PX4 in simulation).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PowerDraw {
    pub(crate) voltage_v: Option<f32>,
    pub(crate) current_a: Option<f32>,
    pub(crate) power_w: f32,
    /// Of each battery; all of it is the first one's while none reports itself.
    pub(crate) each_a: [f32; BATTERIES_MAX],
}

pub(crate) fn drawn(now: BootMs, vehicle: &Vehicle) -> PowerDraw {
    let mut drawn = PowerDraw::default();
    for battery in 0..BATTERIES_MAX {
        if let Some(supply) = vehicle.supply(battery).filter(|supply| now.since(supply.at) <= SILENT) {
            drawn.each_a[battery] = drawn.add(supply.voltage, supply.current);
        }
    }
    if drawn.current_a.is_none() {
        let fresh = |at: Option<BootMs>| at.is_some_and(|at| now.since(at) <= PAUSE);
        for motor in vehicle.motors.iter().filter(|motor| fresh(motor.moved_at)) {
            drawn.add(motor.esc.voltage, motor.esc.current);
        }
    }
    if !vehicle.has_batteries() {
        drawn.each_a[0] = drawn.current_a.unwrap_or(0.0);
    }
    drawn
}

impl PowerDraw {
    /// The discharge current, A. Garbage is left out: the sums are permanent.
    fn add(&mut self, voltage: Option<Volts>, current: Option<Amperes>) -> f32 {
        let voltage_v = voltage.and_then(Volts::sane).filter(|volts| *volts >= 0.0);
        self.voltage_v = self.voltage_v.or(voltage_v);
        let Some(current_a) = current.and_then(Amperes::sane) else { return 0.0 };
        let discharge_a = current_a.max(0.0);
        self.current_a = Some(self.current_a.unwrap_or(0.0) + discharge_a);
        self.power_w += voltage_v.unwrap_or(0.0) * discharge_a;
        discharge_a
    }
}
