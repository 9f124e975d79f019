//! Exposure: how long each quantity that ages a part stood in which range, in this session and over the airframe's life.

use crate::time::{BootMs, SILENT};
use crate::units::Celsius;
use crate::vehicle::Vehicle;

/// Ranges of a quantity.
pub const BINS: usize = 8;

numbered! {
    /// A quantity that ages a part.
    pub enum ExposureQuantity {
        /// The hottest ESC.
        EscTemperature "esc_temperature",
        /// The hottest battery.
        BatteryTemperature "battery_temperature",
        /// The autopilot's processor.
        McuTemperature "mcu_temperature",
        /// Vibration while armed, on the autopilot's own scale.
        Vibration "vibration",
        /// The current of all batteries together while armed.
        Current "current",
    }
}

impl ExposureQuantity {
    /// The unit of its ranges, as names spell it.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::EscTemperature | Self::BatteryTemperature | Self::McuTemperature => "degc",
            Self::Vibration => "m_s2",
            Self::Current => "a",
        }
    }

    /// The limits between its ranges.
    pub const fn edges(self) -> [f32; BINS - 1] {
        match self {
            Self::EscTemperature => [30.0, 45.0, 60.0, 75.0, 90.0, 100.0, 110.0],
            Self::BatteryTemperature => [0.0, 15.0, 30.0, 40.0, 50.0, 60.0, 75.0],
            Self::McuTemperature => [0.0, 30.0, 45.0, 60.0, 75.0, 85.0, 100.0],
            Self::Vibration => [1.0, 2.5, 5.0, 10.0, 15.0, 30.0, 60.0],
            Self::Current => [1.0, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0],
        }
    }

    pub(crate) fn value(self, now: BootMs, vehicle: &Vehicle, current_a: Option<f32>) -> Option<f32> {
        fn hottest(temperatures: impl Iterator<Item = Option<Celsius>>) -> Option<f32> {
            temperatures.flatten().filter_map(Celsius::sane).reduce(f32::max)
        }
        match self {
            Self::EscTemperature => {
                let motors = vehicle.motors.iter();
                let fresh = motors.filter(|motor| motor.state_at.is_some_and(|at| now.since(at) <= SILENT));
                hottest(fresh.map(|motor| motor.esc.temperature))
            }
            Self::BatteryTemperature => {
                let batteries = vehicle.batteries.iter().filter_map(|slot| slot.within(now, SILENT));
                hottest(batteries.map(|battery| battery.temperature))
            }
            Self::McuTemperature => {
                hottest(vehicle.processor.within(now, SILENT).into_iter().map(|mcu| mcu.temperature))
            }
            Self::Vibration => vehicle.vibration.within(now, SILENT).filter(|_| vehicle.armed())?.highest(),
            Self::Current => current_a.filter(|_| vehicle.armed()),
        }
        .filter(|value| value.is_finite())
    }
}

/// Tenths of a second in each range of each quantity.
pub(crate) type Tenths = [[u32; BINS]; ExposureQuantity::ALL.len()];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{Heartbeat, Observation, Processor, Source};
    use crate::usage::{Usage, exposure_number};

    const AUTOPILOT: Source = Source { system: 1, component: 1 };

    fn heat(usage: &mut Usage, from_ms: u64, to_ms: u64, celsius: f32) {
        let mut vehicle = Vehicle::default();
        vehicle.observe(BootMs::ZERO, AUTOPILOT, &Observation::Heartbeat(Heartbeat::default()));
        for now_ms in (from_ms..to_ms).step_by(50) {
            let now = BootMs::from_millis(now_ms);
            let processor = Processor { temperature: Some(Celsius(celsius)) };
            vehicle.observe(now, AUTOPILOT, &Observation::Processor(processor));
            usage.expose(now, &vehicle);
        }
    }

    #[test]
    fn time_goes_to_the_range_of_the_value() {
        let mut usage = Usage::default();
        heat(&mut usage, 0, 10_050, -5.0);
        heat(&mut usage, 10_050, 20_050, 45.0);
        heat(&mut usage, 20_050, 21_050, f32::NAN);
        heat(&mut usage, 21_050, 22_050, 1e9);
        heat(&mut usage, 90_000, 90_500, 200.0);
        let bins = [100, 0, 0, 100, 0, 0, 0, 4];
        let [.., mcu, _, _] = usage.totals().ranges;
        assert_eq!(mcu, bins);
        let mut seen = Vec::new();
        usage.totals().for_each(|number, seconds| {
            if number >= exposure_number(ExposureQuantity::EscTemperature, 0) {
                seen.push((number - exposure_number(ExposureQuantity::McuTemperature, 0), seconds));
            }
        });
        assert_eq!(seen, [(0, 10.0), (3, 10.0), (7, 0.4)]);
    }

    #[test]
    fn ranges_ascend() {
        for quantity in ExposureQuantity::ALL {
            assert!(quantity.edges().is_sorted(), "{quantity:?}");
        }
    }
}
