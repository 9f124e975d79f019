//! The power drawn from the batteries, from the best fresh source.

use crate::time::{BootMs, PAUSE, SILENT};
use crate::units::{Amperes, Volts};
use crate::vehicle::Vehicle;

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
    let batteries = vehicle.batteries.iter();
    for battery in batteries.clone().filter_map(|slot| slot.within(now, SILENT)) {
        drawn.add(battery.voltage, battery.current);
    }
    let none_reported = batteries.clone().all(|slot| slot.get().is_none());
    if let Some(system) = vehicle.system.within(now, SILENT).filter(|_| none_reported) {
        drawn.add(system.voltage, system.current);
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
    let Some(slot) = vehicle.batteries.get(battery) else { return 0.0 };
    let mut drawn = Drawn::default();
    if let Some(reported) = slot.within(now, SILENT) {
        drawn.add(reported.voltage, reported.current);
    } else if battery == 0 && vehicle.batteries.iter().all(|slot| slot.get().is_none()) {
        drawn = self::drawn(now, vehicle);
    }
    f64::from(drawn.current_a.unwrap_or(0.0))
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
