//! A sensor that repeats one value, bit for bit, while the vehicle flies.
//!
//! In flight the noise of a sensor is far above the last digit of its messages, so that the same value seldom comes
//! twice. The usual time depends on the sensor, the message and its rate, and is learnt in each flight: it is the
//! longest time for which a value was repeated. A sensor that repeats for [`TIMES`] as long is stuck. It is reported
//! from [`REPEATS_MIN`] repeats on, once the vehicle has moved: a simulator without noise, and a vehicle on a string,
//! may hold still. Whether it moved is an estimator's word, which drifts; others of the sensor's kind are better
//! witnesses ([`Stuck::changed_during`]).
//!
//! A barometer's value trembles where nothing moves too. One that did so, and then repeats one value for so long as
//! [`SILENT_MS`], is stuck whether the vehicle moves or not ([`Stuck::fell_silent`]).
//!
//! Two messages may report the same sensor with different digits, so a value counts as repeated if it is one of the
//! last two.

use crate::latest::Reading;
use crate::motion::{HANGS_MPS, climb_mps, ground_speed_mps};
use crate::observation::Gnss;
use crate::pairs::{Kind, SENSORS_MAX};
use crate::residual::KNOWN_SAMPLES;
use crate::time::{BootMs, PAUSE};
use crate::vehicle::{RECEIVERS_MAX, Vehicle};

const REPEATS_MIN: u8 = 3;
/// What lasts so many times what is usual is none of it.
const TIMES: u32 = 4;

/// A value that trembled is stuck after one repeated value for this time, ms, and for [`SILENT_TIMES`] its usual time.
const SILENT_MS: u32 = 10_000;
/// Longer is not counted, ms: what repeats for so long is stuck, whatever it did before.
const LASTS_MAX_MS: u32 = 60_000;
const SILENT_TIMES: u32 = 20;
/// Time in which a moving vehicle must move again, ms.
const MOVES_MS: f32 = 3_000.0;

/// A vehicle that moves by so much changes the values of its sensors: m up or down and over ground, rad about any axis.
const CLIMBED_M: f32 = 0.3;
const TRAVELLED_M: f32 = 0.5;
const TURNED_RAD: f32 = 0.02;
/// If all compasses repeat their values at once, the vehicle must have turned this many times as far. An estimator's
/// yaw drifts by 0.02 rad in 3 s while a vehicle holds still, and a compass's digit of a milligauss may hide its
/// noise.
const ALL_REPEAT_TIMES: f32 = 10.0;
/// A smaller turn does not count, rad. A simulator without noise hangs still and repeats its sensors' last
/// digits, while its estimator trembles and has offsets.
const TREMBLES_RAD: f32 = 0.01;

state! {
    /// One sensor.
    struct Stuck {
        values: [u16; 2],
        /// When the last one came first: milliseconds modulo 2^32.
        since_ms: u32,
        /// For how long it has come, and the longest that one did before: up to 65.5 s.
        lasts_ms: u16,
        usual_ms: u16,
        moved: f32,
        repeats: u8,
        changes: u8,
        trembles: u8,
    }
}

impl Stuck {
    /// Takes a value, as the bits of all it consists of; and how far it has moved in this flight.
    fn take(&mut self, at: BootMs, bits: impl IntoIterator<Item = u32>, moved: f32) {
        // FNV-1a, of words.
        let sum = bits.into_iter().fold(0x811C_9DC5_u32, |sum, word| (sum ^ word).wrapping_mul(0x0100_0193));
        let value = (sum ^ sum >> 16) as u16;
        let at_ms = at.as_millis() as u32;
        let unheard_ms = at_ms.wrapping_sub(self.since_ms).saturating_sub(u32::from(self.lasts_ms));
        if u64::from(unheard_ms) > PAUSE.as_millis() {
            self.since_ms = self.since_ms.wrapping_add(unheard_ms);
        }
        if self.values.contains(&value) {
            self.repeats = self.repeats.saturating_add(1);
            self.lasts_ms = at_ms.wrapping_sub(self.since_ms).min(u16::MAX.into()) as u16;
        } else {
            self.usual_ms = self.usual_ms.max(self.lasts_ms);
            self.trembles = self.trembles.saturating_add(u8::from(moved.to_bits() == self.moved.to_bits()));
            self.values = [value, self.values[0]];
            (self.since_ms, self.moved, self.repeats, self.lasts_ms) = (at_ms, moved, 0, 0);
            self.changes = self.changes.saturating_add(1);
        }
    }

    const fn begun(self) -> Self {
        Self { moved: 0.0, usual_ms: 0, ..self }
    }

    const fn is_known(&self) -> bool {
        self.changes >= KNOWN_SAMPLES
    }

    fn changed_during(&self, other: &Self) -> bool {
        self.since_ms.wrapping_sub(other.since_ms) as i32 > i32::from(other.lasts_ms / 2)
    }

    fn fell_silent(&self) -> bool {
        self.trembles >= KNOWN_SAMPLES
            && u32::from(self.lasts_ms)
                > (u32::from(self.usual_ms) * SILENT_TIMES).clamp(SILENT_MS, LASTS_MAX_MS)
    }

    /// For how long it has been stuck, s; 0 while it is not. The vehicle has moved so far, and must have moved by `least`
    /// meanwhile, and again by as much each [`MOVES_MS`].
    fn lasts(&self, now: BootMs, moved: f32, least: f32) -> Option<Reading> {
        let stuck = self.repeats >= REPEATS_MIN
            && u32::from(self.lasts_ms) > (u32::from(self.usual_ms) * TIMES).min(LASTS_MAX_MS)
            && moved - self.moved >= least * (f32::from(self.lasts_ms) / MOVES_MS).max(1.0);
        let value = if stuck { f32::from(self.lasts_ms) / 1_000.0 } else { 0.0 };
        self.is_known().then_some(Reading { at: now, value })
    }
}

state! {
    pub(crate) struct Moved {
        climbed_m: f32,
        travelled_m: f32,
        turned_rad: f32,
        /// The attitude when a turn was counted last, rad; none since a hole.
        attitude: Option<[f32; 3]>,
    }
}

impl Moved {
    pub(crate) fn step(&mut self, now: BootMs, step_s: f32, vehicle: &Vehicle) {
        let climb_mps = climb_mps(now, vehicle).map_or(0.0, libm::fabsf);
        self.climbed_m += if climb_mps > HANGS_MPS { climb_mps * step_s } else { 0.0 };
        self.travelled_m += ground_speed_mps(now, vehicle).map_or(0.0, |speed| speed * step_s);
        let attitude = vehicle.attitude.within(now, PAUSE);
        let attitude = attitude.map(|told| [told.roll.0, told.pitch.0, told.yaw.0]);
        let (Some(now), Some(before)) = (attitude, self.attitude) else {
            // How it turned meanwhile, its sensors did not see either.
            self.attitude = attitude;
            return;
        };
        // Round north it jumps once a turn, which is a turn anyway.
        let apart = |(axis, before): (f32, f32)| {
            let apart = libm::fabsf(axis - before);
            libm::fminf(apart, libm::fabsf(core::f32::consts::TAU - apart))
        };
        let turned_rad: f32 = now.into_iter().zip(before).map(apart).sum();
        if turned_rad >= TREMBLES_RAD {
            (self.turned_rad, self.attitude) = (self.turned_rad + turned_rad, Some(now));
        }
    }
}

state! {
    pub(crate) struct Repeats {
        pub(crate) moved: Moved,
        sensors: [[Stuck; SENSORS_MAX]; Kind::COUNT] = [[Stuck::default(); SENSORS_MAX]; Kind::COUNT],
        receivers: [Stuck; RECEIVERS_MAX],
    }
}

impl Repeats {
    pub(crate) fn begun(&self) -> Self {
        let mut begun = Self::default();
        begun.sensors[Kind::Barometer as usize] = self.sensors[Kind::Barometer as usize].map(Stuck::begun);
        begun
    }

    const fn moved(&self, kind: Kind) -> (f32, f32) {
        match kind {
            Kind::Barometer => (self.moved.climbed_m, CLIMBED_M),
            Kind::Accelerometer | Kind::Gyro | Kind::Compass => (self.moved.turned_rad, TURNED_RAD),
        }
    }

    /// Takes a sample of a sensor: of a barometer always, of others in flight.
    pub(crate) fn take(&mut self, at: BootMs, kind: Kind, sensor: u8, sample: [f32; 3]) {
        let (moved, _) = self.moved(kind);
        if let Some(stuck) = self.sensors[kind as usize].get_mut(usize::from(sensor)) {
            stuck.take(at, sample.map(f32::to_bits), moved);
        }
    }

    pub(crate) fn take_gnss(&mut self, at: BootMs, gnss: &Gnss) {
        let place = gnss.position.filter(|_| gnss.fix >= 3);
        let altitude = gnss.altitude.map_or(0.0, |altitude| altitude.0).to_bits();
        let speed = gnss.speed.map_or(0.0, |speed| speed.0).to_bits();
        if let (Some(place), Some(stuck)) = (place, self.receivers.get_mut(usize::from(gnss.instance))) {
            let words = |degrees: f64| [degrees.to_bits() as u32, (degrees.to_bits() >> 32) as u32];
            let place = words(place.latitude_deg).into_iter().chain(words(place.longitude_deg));
            stuck.take(at, place.chain([altitude, speed]), self.moved.travelled_m);
        }
    }

    pub(crate) fn repeats_place(&self, receiver: usize) -> bool {
        self.receivers.get(receiver).is_some_and(|stuck| stuck.repeats > 0)
    }

    /// For how long a sensor has repeated one value in flight, s; 0 if it does not. `measures`: whether another one of its kind does.
    pub(crate) fn stuck(
        &self,
        now: BootMs,
        kind: Kind,
        sensor: u8,
        measures: impl Fn(usize) -> bool,
    ) -> Option<Reading> {
        let (moved, least) = self.moved(kind);
        let all = &self.sensors[kind as usize];
        let stuck = all.get(usize::from(sensor))?;
        let is_witness = |(place, other): &(usize, &Stuck)| {
            *place != usize::from(sensor) && measures(*place) && other.is_known()
        };
        let mut witnesses = all.iter().enumerate().filter(is_witness).peekable();
        let times = match kind {
            // A hovering simulator without noise repeats the accelerometer's values too.
            Kind::Barometer if stuck.fell_silent() && self.sensors[0][0].repeats == 0 => 0.0,
            // All of them repeat their values.
            Kind::Compass
                if witnesses.peek().is_some() && !witnesses.any(|(_, other)| other.changed_during(stuck)) =>
            {
                ALL_REPEAT_TIMES
            }
            _ => 1.0,
        };
        stuck.lasts(now, moved, least * times)
    }

    pub(crate) fn receiver_stuck(&self, now: BootMs, receiver: u8) -> Option<Reading> {
        self.receivers.get(usize::from(receiver))?.lasts(now, self.moved.travelled_m, TRAVELLED_M)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(values: impl IntoIterator<Item = u32>) -> Option<f32> {
        let mut stuck = Stuck::default();
        for (tenth, value) in (0_u64..).zip(values) {
            stuck.take(BootMs::from_millis(tenth * 100), [value, 7], 0.0);
        }
        stuck.lasts(BootMs::from_millis(999_999), 100.0, 0.5).map(|reading| reading.value)
    }

    #[test]
    fn a_value_that_is_repeated_is_stuck_and_one_that_always_was_is_not() {
        assert_eq!(taken((0..15).chain([1; 30])), None, "not seen for long enough");
        assert_eq!(taken(0..60), Some(0.0));
        assert!(taken((0..60).chain([99; 21])).is_some_and(|lasts_s| (lasts_s - 2.0).abs() < 0.01));
        assert_eq!(taken([5; 600]), None);
    }

    #[test]
    fn what_trembled_where_nothing_moved_is_silent_after_a_while() {
        let silent = |moves: f32, repeats: u64| {
            let mut stuck = Stuck::default();
            for tenth in 0_u64..100 + repeats {
                let moved = moves * tenth as f32;
                stuck.take(BootMs::from_millis(tenth * 100), [tenth.min(100) as u32], moved);
            }
            stuck.fell_silent()
        };
        assert!(silent(0.0, 103));
        assert!(!silent(0.0, 95), "not for long enough");
        assert!(!silent(0.1, 300), "it changed because it moved");
    }

    #[test]
    fn a_hole_is_no_repetition() {
        let after = |repeats: u64| {
            let mut stuck = Stuck::default();
            for tenth in 0..60 + repeats {
                let hole_ms = if tenth > 60 { 8_000 } else { 0 };
                stuck.take(BootMs::from_millis(tenth * 100 + hole_ms), [tenth.min(60) as u32], 0.0);
            }
            stuck.lasts(BootMs::from_millis(999_999), 100.0, 0.5).map(|reading| reading.value)
        };
        assert!(after(10).is_some_and(|lasts_s| lasts_s < 1.1), "{:?}", after(10));
        assert!(after(40).is_some_and(|lasts_s| lasts_s > 3.5), "it is stuck after it too");
    }

    #[test]
    fn a_slow_sensor_in_a_fast_message_is_not_stuck() {
        let slow = || (0..300).map(|tenth| tenth / 10);
        assert_eq!(taken(slow()), Some(0.0));
        assert!(taken(slow().chain([99; 61])).is_some_and(|lasts_s| (lasts_s - 6.0).abs() < 0.01));
    }

    #[test]
    fn a_witness_changes_while_another_repeats_and_not_at_its_last_change() {
        let taken = |values: &mut dyn Iterator<Item = u32>| {
            let mut stuck = Stuck::default();
            for (tenth, value) in (0_u64..).zip(values) {
                stuck.take(BootMs::from_millis(u64::from(u32::MAX) - 3_000 + tenth * 100), [value], 0.0);
            }
            stuck
        };
        let stuck = taken(&mut (0..30).chain([99; 20]));
        assert!(taken(&mut (0..50)).changed_during(&stuck));
        assert!(!taken(&mut (0..33).chain([99; 17])).changed_during(&stuck), "a message later");
        assert!(!taken(&mut (0..20).chain([99; 30])).changed_during(&stuck), "stuck before it");
    }

    #[test]
    fn two_messages_of_one_sensor_do_not_hide_each_other() {
        let both = (0..120).chain((0..60).map(|tenth| 500 + tenth % 2));
        assert!(taken(both).is_some_and(|lasts_s| lasts_s > 5.0));
    }
}
