//! The power drawn from the batteries, from the best fresh source.

use crate::time::{BootMs, PAUSE, SILENT};
use crate::units::{Amperes, Volts};
use crate::vehicle::{BATTERIES_MAX, Supply, Vehicle};

/// Voltage of the first battery (or the autopilot's figure if none reports itself), and discharge current and power
/// of all batteries. Without a battery current: the sum of all ESCs (PX4 in simulation).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Drawn {
    pub(crate) voltage_v: Option<f32>,
    pub(crate) current_a: Option<f32>,
    pub(crate) power_w: f32,
}

pub(crate) fn drawn(now: BootMs, vehicle: &Vehicle) -> Drawn {
    let mut drawn = Drawn::default();
    for supply in (0..BATTERIES_MAX).filter_map(|battery| supply(now, vehicle, battery)) {
        drawn.add(supply.voltage, supply.current);
    }
    if drawn.current_a.is_none() {
        let fresh = |at: Option<BootMs>| at.is_some_and(|at| now.since(at) <= PAUSE);
        for motor in vehicle.motors.iter().filter(|motor| fresh(motor.moved_at)) {
            drawn.add(motor.esc.voltage, motor.esc.current);
        }
    }
    drawn
}

pub(crate) fn discharge_a(now: BootMs, vehicle: &Vehicle, battery: usize) -> f64 {
    let mut drawn = Drawn::default();
    if battery == 0 && vehicle.batteries_known() == 0 {
        drawn = self::drawn(now, vehicle);
    } else if let Some(supply) = supply(now, vehicle, battery) {
        drawn.add(supply.voltage, supply.current);
    }
    f64::from(drawn.current_a.unwrap_or(0.0))
}

fn supply(now: BootMs, vehicle: &Vehicle, battery: usize) -> Option<Supply> {
    vehicle.supply(battery).filter(|supply| now.since(supply.at) <= SILENT)
}

impl Drawn {
    /// Garbage is left out: the sums are permanent.
    fn add(&mut self, voltage: Option<Volts>, current: Option<Amperes>) {
        let voltage_v = voltage.and_then(Volts::sane).filter(|volts| *volts >= 0.0);
        let current_a = current.and_then(Amperes::sane);
        self.voltage_v = self.voltage_v.or(voltage_v);
        if let Some(current_a) = current_a {
            let discharge_a = current_a.max(0.0);
            self.current_a = Some(self.current_a.unwrap_or(0.0) + discharge_a);
            self.power_w += voltage_v.unwrap_or(0.0) * discharge_a;
        }
    }
}
