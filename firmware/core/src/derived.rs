//! Quantities derived from several messages: cell voltage, recent clips, load factor.

use crate::battery_cells::Cells;
use crate::crosscheck::Crosschecks;
use crate::flight::{Flight, FlightEvent};
use crate::gates;
use crate::latest::{Latest, Reading};
use crate::motion::MOTION_AGE;
use crate::motors::Motors;
use crate::observation::{Battery, Imu, Observation, Vibration};
use crate::parameters::{Param, Params};
use crate::status::RecorderStatus;
use crate::time::{BootMs, Millis, Stamp};
use crate::trend::Resistance;
use crate::units::{GRAVITY, MetresPerSecond2, norm};
use crate::vehicle::{BATTERIES_MAX, RECEIVERS_MAX, Vehicle};

/// Vibration, m/s2 an axis, that is above all that a vehicle flies with: `ArduPilot`'s own limit for too much (wiki, "Measuring Vibration").
const SHAKES_MPS2: f32 = 60.0;
/// So much of a cell's voltage may be its sag under the load, V. A cell that sags further is near its end, whatever its charge.
const SAG_MAX_V: f32 = 0.3;
/// A plane with less throttle glides: autopilots let its motor idle from some percents on.
const OFF_THROTTLE: f32 = 0.03;
const LOSS_MEMORY: Millis = Millis::from_secs(10);

state! {
    /// The memory of derived quantities.
    pub struct Derived {
        pub(crate) cells: Cells,
        pub(crate) resistance: [Resistance; BATTERIES_MAX] = [Resistance::default(); BATTERIES_MAX],
        pub(crate) motors: Motors,
        pub(crate) crosschecks: Crosschecks,
        /// Of the last sample, and smoothed.
        load_factor: Latest<[f32; 2]>,
        /// Receivers that have had a 3D fix since power-on.
        pub(crate) had_fix: [bool; RECEIVERS_MAX],
        clips: RecentCount,
        clips_known: bool,
        /// Frames that our own recording lost, and block writes that the card refused.
        pub(crate) frames_lost: RecentCount,
        pub(crate) write_errors: RecentCount,
    }

    /// A count of the last ten seconds, of one that only rises.
    pub(crate) struct RecentCount {
        count: u32,
        before: u32,
        rose_at: Stamp,
    }
}

impl RecentCount {
    fn take(&mut self, now: BootMs, count: u64) {
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        if count > self.count {
            self.count = count;
            self.rose_at = Stamp::at(now);
        } else if self.rose_at.older_than(now, LOSS_MEMORY) {
            self.before = self.count;
            self.rose_at = Stamp::NONE;
        }
    }

    pub(crate) const fn lately(&self) -> f32 {
        self.count.saturating_sub(self.before) as f32
    }
}

impl Derived {
    /// Takes an observation that the vehicle took.
    pub fn observe(&mut self, at: BootMs, vehicle: &Vehicle, flight: &Flight, observation: &Observation) {
        self.motors.hear(at);
        self.crosschecks.observe(at, vehicle, observation);
        match observation {
            Observation::Imu(imu) | Observation::ImuAndAir(imu, _) => self.take_imu(at, imu, vehicle),
            Observation::Hud(hud) => {
                // On wings a motor is off without throttle, and its ESC may fall silent.
                let is_off = hud.throttle.is_some_and(|throttle| throttle.0 < OFF_THROTTLE);
                if is_off && vehicle.hovers(at) == Some(false) {
                    self.motors.resume(at);
                }
            }
            Observation::Outputs(outputs) => {
                let level = self
                    .crosschecks
                    .residuals
                    .gates
                    .are(gates::SETTLED | gates::CLEAR | gates::LEVEL | gates::CONTROLLED);
                self.motors.outputs.take(at, outputs, vehicle, flight, level);
            }
            Observation::Gnss(gnss) => {
                if let Some(had_fix) = self.had_fix.get_mut(usize::from(gnss.instance)) {
                    *had_fix |= gnss.fix >= 3;
                }
            }
            Observation::Battery(_) => self.take_supply(vehicle, flight, vehicle.told_battery),
            Observation::SystemStatus(_) => {
                self.take_supply(vehicle, flight, (!vehicle.has_batteries()).then_some(0));
            }
            Observation::Parameter(place, value) => self.cells.take_setting(*place, *value),
            Observation::Escs(group) => self.motors.take(at, group, vehicle, flight.airborne()),
            _ => {}
        }
    }

    fn take_imu(&mut self, at: BootMs, imu: &Imu, vehicle: &Vehicle) {
        // What shakes so has no load factor: its samples are of the vibration, and too few to average that out.
        let shakes =
            |vibration: &Vibration| vibration.levels.iter().flatten().any(|level| *level >= SHAKES_MPS2);
        if imu.instance == 0
            && !vehicle.vibration.within(at, MOTION_AGE).is_some_and(shakes)
            && let Some(sample_g) = imu.acceleration.and_then(load_factor_g)
        {
            self.load_factor.set(at, [sample_g, norm(vehicle.inertial.force) / GRAVITY]);
        }
    }

    /// A battery that was just told.
    fn take_supply(&mut self, vehicle: &Vehicle, flight: &Flight, told: Option<usize>) {
        if let Some((place, supply)) = told.and_then(|place| Some((place, vehicle.supply(place)?))) {
            self.resistance[place].take(supply.voltage, supply.current);
        }
        let armed = vehicle.armed();
        for battery in 0..BATTERIES_MAX {
            if let Some(pack_v) = pack_v(vehicle, battery) {
                let id = vehicle.batteries[battery].get().map_or(0, |known| known.id);
                self.cells.take_voltage(battery, id, pack_v, !armed || flight.stands(), armed);
            }
        }
    }

    /// One step, at least every 50 ms, after the flight's own.
    pub fn step(
        &mut self,
        now: BootMs,
        vehicle: &Vehicle,
        flight: &Flight,
        event: Option<FlightEvent>,
        recorder: &RecorderStatus,
    ) {
        if matches!(event, Some(FlightEvent::TakeOff | FlightEvent::Resumed)) {
            self.crosschecks.begin();
            self.motors.outputs.begin();
        }
        self.crosschecks.step(now, vehicle, flight);
        let clips = clips(vehicle).unwrap_or(0);
        // Clips before this flight, or before the autopilot's restart, are not of this flight.
        if event.is_some() || clips < self.clips.count || !self.clips_known {
            self.clips_known = vehicle.vibration.get().is_some();
            self.clips = RecentCount { count: clips, before: clips, ..RecentCount::default() };
        }
        self.clips.take(now, clips.into());
        self.motors.step();
        self.frames_lost.take(now, recorder.frames_lost);
        self.write_errors.take(now, recorder.write_errors);
    }

    /// Cells of a battery: set, reported, or found ([`crate::battery_cells`]). 0 where that is not known.
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

    /// The voltage of the lowest cell, or the pack's share for a cell if cells are not measured. The sag under the
    /// load is added, if it is known.
    pub(crate) fn cell_voltage(&self, vehicle: &Vehicle, params: &Params, battery: u8) -> Option<Reading> {
        let index = usize::from(battery);
        let slot = vehicle.batteries.get(index)?;
        if slot.get().is_some_and(|known| !known.lithium) {
            return None;
        }
        let lowest = slot
            .get()
            .filter(|known| known.cells_reported() > 1)
            .and_then(|known| known.cells.iter().flatten().map(|cell| cell.volts().0).reduce(f32::min));
        let share = || {
            let cells = self.cell_count(vehicle, index, params);
            pack_v(vehicle, index).filter(|_| cells > 0).map(|pack_v| pack_v / f32::from(cells))
        };
        let value = lowest.or_else(share)? + self.sag_v(vehicle, index, params);
        Some(Reading { at: vehicle.supply(index)?.at, value })
    }

    /// How far the load makes a cell's voltage sag; [`SAG_MAX_V`] at most.
    fn sag_v(&self, vehicle: &Vehicle, battery: usize, params: &Params) -> f32 {
        let current = vehicle.supply(battery).and_then(|supply| supply.current);
        let cells = f32::from(self.cell_count(vehicle, battery, params).max(1));
        let sag_v = self.resistance.get(battery).zip(current).map_or(0.0, |(of, current)| of.sag_v(current));
        (sag_v / cells).min(SAG_MAX_V)
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

    /// Load factor of the force smoothed by axis ([`crate::inertial`]): a load that counts.
    pub(crate) fn load_factor_g(&self) -> Option<f32> {
        self.load_factor.get().map(|[_, smooth_g]| *smooth_g)
    }
}

/// A sample in units of gravity; `None` where it was not measured.
pub(crate) fn load_factor_g(force: [MetresPerSecond2; 3]) -> Option<f32> {
    Some(norm(force.map(|axis| axis.0)))
        .filter(|force| *force <= MetresPerSecond2::MAX)
        .map(|force| force / GRAVITY)
}

pub(crate) fn pack_v(vehicle: &Vehicle, battery: usize) -> Option<f32> {
    Some(vehicle.supply(battery)?.voltage?.0)
}

fn clips(vehicle: &Vehicle) -> Option<u32> {
    vehicle.vibration.get().map(|vibration| vibration.clips.into_iter().max().unwrap_or(0))
}
