//! Exposure: how long each quantity that ages a part stood in which range, in this session and over the airframe's life.

use crate::bytes::{Fields, Item, Unreadable, fields};
use crate::time::{BootMs, Millis, PAUSE, SILENT};
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

    pub(crate) const fn edges(self) -> [f32; BINS - 1] {
        match self {
            Self::EscTemperature => [30.0, 45.0, 60.0, 75.0, 90.0, 100.0, 110.0],
            Self::BatteryTemperature => [0.0, 15.0, 30.0, 40.0, 50.0, 60.0, 75.0],
            Self::McuTemperature => [0.0, 30.0, 45.0, 60.0, 75.0, 85.0, 100.0],
            Self::Vibration => [1.0, 2.5, 5.0, 10.0, 15.0, 30.0, 60.0],
            Self::Current => [1.0, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0],
        }
    }

    fn value(self, now: BootMs, vehicle: &Vehicle, current_a: Option<f32>) -> Option<f32> {
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

state! {
    /// Time in ranges.
    pub struct Exposure {
        last: Option<BootMs>,
        pub(crate) session: Tenths,
        before: Tenths,
        /// The power-on before which `before` counts.
        as_of: u32,
    }
}

const EVERY: Millis = Millis::from_millis(100);

impl Exposure {
    pub(crate) fn step(&mut self, now: BootMs, vehicle: &Vehicle, current_a: Option<f32>) {
        let step = self.last.map_or(Millis::ZERO, |last| now.since(last));
        if self.last.is_some() && step < EVERY {
            return;
        }
        // Whole tenths are counted; the rest goes into the next step.
        let tenths = (step.as_millis() / 100) as u32;
        let rest = Millis::from_millis(step.as_millis() % 100);
        self.last = Some(now - rest);
        if step > PAUSE {
            return;
        }
        for (quantity, bins) in ExposureQuantity::ALL.into_iter().zip(&mut self.session) {
            if let Some(value) = quantity.value(now, vehicle, current_a) {
                let bin = quantity.edges().iter().take_while(|edge| value >= **edge).count();
                bins[bin] = bins[bin].saturating_add(tenths);
            }
        }
    }

    /// Every range that the session was in: quantity, range, seconds.
    pub fn for_each(&self, each: impl FnMut(ExposureQuantity, usize, f64)) {
        visit(&self.session, each);
    }

    /// Every range that the airframe was in, this session included.
    pub fn for_each_of_life(&self, each: impl FnMut(ExposureQuantity, usize, f64)) {
        let mut both = self.before;
        add(&mut both, &self.session);
        visit(&both, each);
    }

    pub(crate) fn forget_life(&mut self) {
        self.before = Tenths::default();
    }

    /// Adds the session of power-on `boots`, unless it is counted already.
    pub(crate) fn add(&mut self, boots: u32, session: &Tenths) {
        if boots == self.as_of {
            add(&mut self.before, session);
        }
    }

    /// The stored form: as of the beginning of this power-on.
    pub(crate) const fn as_of(self, boots: u32) -> Self {
        Self { as_of: boots, ..self }
    }
}

/// Version; tenths of a second in each range of each quantity; since version 2 the power-on.
impl Item for Exposure {
    const VERSION: u8 = 2;
    const BYTES: usize = 165;

    fn fields(&mut self, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        fields!(fields: self.before, self.as_of);
        Ok(())
    }
}

fn add(sums: &mut Tenths, more: &Tenths) {
    for (sum, more) in sums.iter_mut().flatten().zip(more.iter().flatten()) {
        *sum = sum.saturating_add(*more);
    }
}

fn visit(tenths: &Tenths, mut each: impl FnMut(ExposureQuantity, usize, f64)) {
    for (quantity, bins) in ExposureQuantity::ALL.into_iter().zip(tenths) {
        for (bin, tenths) in bins.iter().enumerate().filter(|(_, tenths)| **tenths > 0) {
            each(quantity, bin, f64::from(*tenths) / 10.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::{Heartbeat, Observation, Processor, Source};

    const AUTOPILOT: Source = Source { system: 1, component: 1 };

    fn heat(exposure: &mut Exposure, from_ms: u64, to_ms: u64, celsius: f32) {
        let mut vehicle = Vehicle::default();
        vehicle.observe(BootMs::ZERO, AUTOPILOT, &Observation::Heartbeat(Heartbeat::default()));
        for now_ms in (from_ms..to_ms).step_by(50) {
            let now = BootMs::from_millis(now_ms);
            let processor = Processor { temperature: Some(Celsius(celsius)) };
            vehicle.observe(now, AUTOPILOT, &Observation::Processor(processor));
            exposure.step(now, &vehicle, None);
        }
    }

    fn seen(exposure: &Exposure) -> Vec<(usize, f64)> {
        let mut seen = Vec::new();
        exposure.for_each_of_life(|quantity, bin, seconds| {
            assert_eq!(quantity, ExposureQuantity::McuTemperature);
            seen.push((bin, seconds));
        });
        seen
    }

    #[test]
    fn time_goes_to_the_range_of_the_value_and_adds_up_over_sessions() {
        let mut exposure = Exposure::default();
        heat(&mut exposure, 0, 10_050, -5.0);
        heat(&mut exposure, 10_050, 20_050, 45.0);
        heat(&mut exposure, 20_050, 21_050, f32::NAN);
        heat(&mut exposure, 21_050, 22_050, 1e9);
        heat(&mut exposure, 90_000, 90_500, 200.0);
        assert_eq!(seen(&exposure), [(0, 10.0), (3, 10.0), (7, 0.4)]);
        let session = exposure.session;
        let mut stored = [0; Exposure::BYTES];
        exposure.as_of(8).encode(&mut stored);
        let mut exposure = Exposure::decode(&stored).expect("readable");
        exposure.add(7, &session);
        assert_eq!(seen(&exposure), [], "it is in it");
        exposure.as_of = 7;
        exposure.add(7, &session);
        heat(&mut exposure, 0, 1_050, 45.0);
        assert_eq!(seen(&exposure), [(0, 10.0), (3, 11.0), (7, 0.4)]);
        let mut session = 0.0;
        exposure.for_each(|_, _, seconds| session += seconds);
        assert_eq!(session.to_bits(), 1.0_f64.to_bits());
    }

    #[test]
    fn ranges_ascend() {
        for quantity in ExposureQuantity::ALL {
            assert!(quantity.edges().is_sorted(), "{quantity:?}");
        }
    }
}
