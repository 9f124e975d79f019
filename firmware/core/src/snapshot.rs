//! Snapshots around critical findings.
//!
//! The key values of the vehicle are sampled five times a second and kept for five seconds. A critical finding takes
//! those of its subsystem, with attitude and climb: the seconds before at once, the seconds after when they have
//! passed.

use crate::half;
use crate::health::{Finding, Inputs, Level, Subsystem};
use crate::motion::MOTION_AGE;
use crate::observation::Estimator;
use crate::time::{BootMs, Millis};

/// Between two samples.
pub const INTERVAL: Millis = Millis::from_millis(200);
/// Samples before a finding, and after it.
pub const SAMPLES: usize = 25;
/// Columns of one snapshot at most.
pub const COLUMNS_MAX: usize = 8;
const PENDING_MAX: usize = 4;

const AFTER: Millis = Millis::from_millis(INTERVAL.as_millis() * SAMPLES as u64);

type Read = fn(&Inputs<'_>) -> Option<f32>;

struct Quantity(&'static str, Read);

/// Columns of each subsystem, in the order of [`KEPT`]. A later version may only append to a subsystem's.
const COLUMNS: [&[usize]; Subsystem::ALL.len()] = [
    &[0, 1, 2, 3, 20, 21, 22, 23],
    &[4, 5, 6, 7, 20, 21, 22, 23],
    &[8, 9, 20, 21, 22, 23],
    &[10, 11, 20, 21, 22, 23],
    &[12, 13, 14, 15, 20, 21, 22, 23],
    &[16, 17, 20, 21, 22, 23],
    &[18, 20, 21, 22, 23],
    &[20, 21, 22, 23, 4, 11],
    &[19, 20, 21, 22, 23],
    &[20, 21, 22, 23, 11, 4, 0, 10],
];

const KEPT: [Quantity; 24] = [
    Quantity("voltage_v", |it| Some(it.vehicle.supply(0)?.voltage?.0)),
    Quantity("current_a", |it| Some(it.vehicle.supply(0)?.current?.0)),
    Quantity("cell_lowest_v", |it| {
        it.derived.cell_voltage(it.vehicle, it.params, 0).map(|reading| reading.value)
    }),
    Quantity("remaining_percent", |it| Some(it.vehicle.supply(0)?.remaining?.0 * 100.0)),
    Quantity("throttle_percent", |it| Some(it.vehicle.hud.within(it.now, MOTION_AGE)?.throttle?.0 * 100.0)),
    Quantity("rpm_lowest", |it| speeds(it).reduce(f32::min)),
    Quantity("rpm_highest", |it| speeds(it).reduce(f32::max)),
    Quantity("esc_hottest_degc", |it| {
        let fresh = |at: BootMs| it.now.since(at) <= MOTION_AGE;
        let motors = it.vehicle.motors.iter().filter(|motor| motor.state_at.is_some_and(fresh));
        motors.filter_map(|motor| Some(motor.esc.temperature?.0)).reduce(f32::max)
    }),
    Quantity("engine_rpm", |it| Some(it.vehicle.engine.within(it.now, MOTION_AGE)?.rpm?.0)),
    Quantity("cylinder_degc", |it| Some(it.vehicle.engine.within(it.now, MOTION_AGE)?.cylinder_head?.0)),
    Quantity("vibration_m_s2", |it| it.vehicle.vibration.within(it.now, MOTION_AGE)?.highest()),
    Quantity("load_factor_g", |it| it.derived.load_factor_g()),
    Quantity("estimator_worst", |it| {
        let Estimator { velocity, position_horizontal, position_vertical, compass, .. } =
            *it.vehicle.estimator.within(it.now, MOTION_AGE)?;
        [velocity, position_horizontal, position_vertical, compass].into_iter().flatten().reduce(f32::max)
    }),
    Quantity("satellites", |it| Some(f32::from(it.vehicle.gnss[0].within(it.now, MOTION_AGE)?.satellites?))),
    Quantity("fix", |it| Some(f32::from(it.vehicle.gnss[0].within(it.now, MOTION_AGE)?.fix))),
    Quantity("hdop", |it| it.vehicle.gnss[0].within(it.now, MOTION_AGE)?.hdop),
    Quantity("heartbeat_age_s", |it| Some(it.now.since(it.vehicle.heartbeat.at()?).as_secs_f32())),
    Quantity("frames_lost_percent", |it| Some(it.link.frames_lost? * 100.0)),
    Quantity("load_percent", |it| Some(it.vehicle.system.within(it.now, MOTION_AGE)?.load?.0 * 100.0)),
    Quantity("queue_percent", |it| Some(it.recorder.queue * 100.0)),
    Quantity("roll_deg", |it| Some(it.vehicle.attitude.within(it.now, MOTION_AGE)?.roll.0.to_degrees())),
    Quantity("pitch_deg", |it| Some(it.vehicle.attitude.within(it.now, MOTION_AGE)?.pitch.0.to_degrees())),
    Quantity("climb_m_s", |it| crate::motion::climb_mps(it.now, it.vehicle)),
    Quantity("height_m", |it| Some(it.vehicle.global.within(it.now, MOTION_AGE)?.relative_altitude.0)),
];

fn speeds(inputs: &Inputs<'_>) -> impl Iterator<Item = f32> {
    let (now, motors) = (inputs.now, inputs.vehicle.motors.iter());
    let fresh = motors.filter(move |motor| motor.moved_at.is_some_and(|at| now.since(at) <= MOTION_AGE));
    fresh.filter_map(|motor| Some(motor.esc.rpm?.0.abs()))
}

/// The names of a subsystem's columns; each ends in its unit.
pub fn columns(subsystem: Subsystem) -> impl Iterator<Item = &'static str> {
    COLUMNS[subsystem as usize].iter().map(|column| KEPT[*column].0)
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Pending {
    at: BootMs,
    check: &'static str,
    instance: u8,
    subsystem: Subsystem,
    before_told: bool,
}

state! {
    /// The last seconds, and the snapshots that are being taken.
    pub struct Snapshots {
        /// The newest is before `next`.
        ring: [[u16; KEPT.len()]; SAMPLES] = [[0; KEPT.len()]; SAMPLES],
        next: u8,
        filled: u8,
        newest: BootMs,
        pending: [Option<Pending>; PENDING_MAX] = [None; PENDING_MAX],
    }
}

/// One half of a snapshot.
#[derive(Clone, Copy, Debug)]
pub struct Snapshot<'a> {
    /// When the finding was made.
    pub at: BootMs,
    /// The finding's check.
    pub check: &'static str,
    /// The finding's instance.
    pub instance: u8,
    /// Its subsystem, which says what the columns are.
    pub subsystem: Subsystem,
    /// `false`: before the finding; `true`: after it.
    pub after: bool,
    /// The time of the first sample; the others follow every [`INTERVAL`].
    pub first: BootMs,
    snapshots: &'a Snapshots,
}

impl Snapshot<'_> {
    /// Sample by sample, column by column, as half-precision numbers; NaN where a value was not known.
    pub fn values(&self) -> impl Iterator<Item = u16> {
        let columns = COLUMNS[self.subsystem as usize];
        self.snapshots.samples().flat_map(move |sample| columns.iter().map(move |column| sample[*column]))
    }

    /// How many columns a sample has.
    pub const fn width(&self) -> usize {
        COLUMNS[self.subsystem as usize].len()
    }
}

impl Snapshots {
    pub(crate) fn step(&mut self, inputs: &Inputs<'_>) {
        if self.filled > 0 && inputs.now.since(self.newest) < INTERVAL {
            return;
        }
        if inputs.now.since(self.newest) > INTERVAL + INTERVAL {
            // After a gap the earlier samples are not those just before.
            self.filled = 0;
        }
        self.newest = inputs.now;
        for (place, Quantity(_, read)) in self.ring[usize::from(self.next)].iter_mut().zip(&KEPT) {
            *place = half::to_bits(read(inputs).unwrap_or(f32::NAN));
        }
        self.next = (self.next + 1) % SAMPLES as u8;
        self.filled = (self.filled + 1).min(SAMPLES as u8);
    }

    fn samples(&self) -> impl Iterator<Item = &[u16; KEPT.len()]> {
        let first = usize::from(self.next) + SAMPLES - usize::from(self.filled);
        (0..usize::from(self.filled)).map(move |sample| &self.ring[(first + sample) % SAMPLES])
    }

    /// No snapshot of a subsystem begins while one of it is being taken, or while [`PENDING_MAX`] of others are.
    pub(crate) fn trigger(&mut self, finding: &Finding) {
        let same = |pending: &Pending| pending.subsystem == finding.subsystem;
        if finding.level != Level::Critical || self.pending.iter().flatten().any(same) {
            return;
        }
        if let Some(place) = self.pending.iter_mut().find(|place| place.is_none()) {
            let Finding { at, check, instance, subsystem, .. } = *finding;
            *place = Some(Pending { at, check, instance, subsystem, before_told: false });
        }
    }

    pub(crate) fn take(&mut self, now: BootMs) -> Option<Snapshot<'_>> {
        let ready = |pending: &Pending| !pending.before_told || now.since(pending.at) >= AFTER;
        let place = self.pending.iter_mut().find(|place| place.as_ref().is_some_and(ready))?;
        let Pending { at, check, instance, subsystem, before_told } = (*place)?;
        match place {
            Some(pending) if !before_told => pending.before_told = true,
            _ => *place = None,
        }
        let length = INTERVAL.as_millis() * u64::from(self.filled.saturating_sub(1));
        let first = self.newest - Millis::from_millis(length);
        Some(Snapshot { at, check, instance, subsystem, after: before_told, first, snapshots: self })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_subsystem_has_columns_that_there_are() {
        for subsystem in Subsystem::ALL {
            let names: Vec<_> = columns(subsystem).collect();
            assert!((4..=COLUMNS_MAX).contains(&names.len()), "{subsystem:?}: {names:?}");
        }
    }
}
