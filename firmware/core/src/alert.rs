//! Alerts: problems that the autopilot itself reports, by a text, an event, a flag of health or of the estimator.
//!
//! Each way becomes a [`Cause`] in one place: texts and PX4's events in the link crate (`hums_link::alert`), flags of health in
//! [`crate::cause`], the estimator's here.
//!
//! A text or an event is a moment: it holds for [`HOLDS`]. A flag counts from the second message with it on: one
//! wrong message must not raise an alarm.

use crate::cause::{Alert, Cause, Causes, Urgency};
use crate::observation::{Estimator, EstimatorScale, Sensors};
use crate::time::{BootMs, Millis, SILENT, Stamp};

/// Time for which a text or an event holds. PX4 repeats its failing checks when they change, some 2 s apart.
pub const HOLDS: Millis = Millis::from_secs(10);
/// A crash or a critical alert counts up to this long after disarming: heartbeats are a second apart.
const DISARMED: Millis = Millis::from_secs(2);
/// `MAV_STATE_CRITICAL`; `MAV_STATE_EMERGENCY` and worse states have larger numbers.
const CRITICAL_STATE: u8 = 5;

/// In place of an [`Urgency`]: the alert is no longer reported, and no report says that all is well.
pub const ENDED: f32 = -1.0;

/// The causes of the estimator's flags (`ESTIMATOR_STATUS_FLAGS`, `EKF_STATUS_FLAGS`). A glitch counts if the
/// estimator had attitude and position before, and a receiver has a fix.
///
/// - Both autopilots: 0 attitude, 3 and 4 position, 8 and 9 a position as soon as it is needed. `ArduPilot` holds its position fixed
///   from a landing to the disarming, and says by these two that it has not lost it. In the air they are no position.
/// - PX4: 10 GPS glitch, 11 accelerometer error.
/// - ArduPilot: 15 GPS glitching. It also sets this one indoors without GPS.
pub fn of_estimator(estimator: &Estimator, had_both: bool, has_fix: bool, in_air: bool) -> Causes {
    let flags = estimator.flags;
    let (glitch, accelerometer) = match estimator.scale {
        EstimatorScale::TestRatio => (1 << 10, 1 << 11),
        EstimatorScale::Variance => (1 << 15, 0),
    };
    let glitch = if had_both && has_fix { glitch } else { 0 };
    let said =
        Causes::of_bits(u32::from(flags), &[(glitch, Cause::Gnss), (accelerometer, Cause::Accelerometer)]);
    let flags = if in_air { flags } else { flags | flags >> 5 & POSITION };
    if had_both && !has_both(flags) { said.with(Cause::Estimator) } else { said }
}

/// The predicted one is five bits above.
const POSITION: u16 = 1 << 3 | 1 << 4;

const fn has_both(flags: u16) -> bool {
    flags & 1 != 0 && flags & POSITION != 0
}

state! {
    /// Flags of one message.
    struct Flags {
        now: Causes,
        before: Causes,
        /// Those that it reports on, as failed or as good.
        covered: Causes,
        at: Stamp,
    }
}

impl Flags {
    const fn take(&mut self, at: BootMs, causes: Causes, covered: Causes) {
        *self = Self { now: causes, before: self.now, covered, at: Stamp::at(at) };
    }

    /// Whether a cause has failed; `None` if the message does not come or does not report on it.
    fn says(&self, now: BootMs, cause: Cause) -> Option<bool> {
        let has = self.now.both(self.before).has(cause);
        let comes = self.at.age(now).is_some_and(|age| age <= SILENT);
        (comes && (has || self.covered.has(cause))).then_some(has)
    }
}

state! {
    /// The standing alerts of the autopilot. Only those of the armed time count: earlier ones are about arming.
    pub struct Alerts {
        /// For each cause its urgency, and until when a single report holds.
        told: [Option<(Urgency, BootMs)>; Cause::COUNT] = [None; Cause::COUNT],
        /// Last time of a cause that was not reported just before, or of an emergency state.
        began_at: Stamp,
        emergency: bool,
        sensors: Flags,
        failures: Flags,
        estimator: Flags,
        armed: bool,
        armed_at: Stamp,
        /// Causes that a flag called healthy once. Parts that never were healthy are not fitted or not switched on.
        had: Causes,
        had_both: bool,
    }
}

impl Alerts {
    pub(crate) fn take_armed(&mut self, at: BootMs, armed: bool) {
        if armed && !self.armed {
            let Self { had, had_both, .. } = *self;
            *self = Self { had, had_both, ..Self::default() };
        }
        self.armed = armed;
        if armed {
            self.armed_at = Stamp::at(at);
        }
    }

    pub(crate) const fn take_state(&mut self, at: BootMs, state: u8) {
        let emergency = state >= CRITICAL_STATE;
        if emergency && !self.emergency {
            self.began_at = Stamp::at(at);
        }
        self.emergency = emergency;
    }

    pub(crate) fn have_begun_within(&self, now: BootMs, span: Millis) -> bool {
        self.began_at.age(now).is_some_and(|age| age <= span)
    }

    /// An autopilot that crashes disarms with that text, and reports the damage right behind it.
    pub(crate) fn tell(&mut self, at: BootMs, alert: Alert) {
        let is_last_word = (alert.cause == Cause::Crash || alert.urgency == Urgency::Critical)
            && self.armed_at.age(at).is_some_and(|age| age <= DISARMED);
        let counts = self.armed || is_last_word;
        let Some(told) = self.told.get_mut(alert.cause as usize).filter(|_| counts) else { return };
        let held = told.filter(|(_, until)| !at.is_after(*until)).map(|(urgency, _)| urgency);
        if held.is_none() && alert.urgency != Urgency::Over {
            self.began_at = Stamp::at(at);
        }
        *told = match alert.urgency {
            Urgency::Over => told.map(|_| (Urgency::Over, at)),
            urgency => Some((held.unwrap_or(urgency).max(urgency), at + HOLDS)),
        };
    }

    /// `SYS_STATUS`: sensors that are not healthy. PX4 calls a lost sensor no longer present.
    pub(crate) fn take_sensors(&mut self, at: BootMs, sensors: &Sensors) {
        let healthy = Causes::of_sensors(sensors.healthy);
        self.had = self.had.or(healthy);
        let wrong = Causes::of_sensors(sensors.unhealthy).or(Causes::of_sensors(sensors.lost)).both(self.had);
        self.sensors.take(at, wrong, healthy.or(wrong));
    }

    /// `HIGH_LATENCY2`
    pub(crate) fn take_failures(&mut self, at: BootMs, causes: Causes) {
        self.failures.take(at, causes, Causes::of_failure_flags(u16::MAX));
    }

    pub(crate) fn take_estimator(&mut self, at: BootMs, estimator: &Estimator, has_fix: bool, in_air: bool) {
        self.had_both |= has_both(estimator.flags);
        let covered = Causes::NONE.with(Cause::Estimator).with(Cause::Gnss).with(Cause::Accelerometer);
        self.estimator.take(at, of_estimator(estimator, self.had_both, has_fix, in_air), covered);
    }

    /// The level of a cause, as [`Urgency`] numbers it.
    ///
    /// - 0: the autopilot reports that it is over, or flags call it healthy.
    /// - [`ENDED`]: it is no longer reported.
    /// - `None`: it was never reported.
    pub fn level(&self, now: BootMs, cause: Cause, in_mishap: bool) -> Option<f32> {
        let told = self.told.get(cause as usize)?;
        let urgency = told.map(|(urgency, _)| urgency);
        let flags = [&self.sensors, &self.failures, &self.estimator];
        let said = flags.iter().filter_map(|flags| flags.says(now, cause)).reduce(|one, other| one | other);
        let said = said.filter(|_| self.armed && !in_mishap);
        let holds = told.is_some_and(|(_, until)| !now.is_after(until));
        let held = urgency.filter(|urgency| *urgency != Urgency::Over && holds);
        let wrong = held.max((said == Some(true)).then_some(Urgency::Warning));
        let is_over = urgency == Some(Urgency::Over) || said == Some(false);
        let good = if is_over { f32::from(Urgency::Over as u8) } else { ENDED };
        // Once flags were received each cause has a level.
        let was_said = told.is_some() || flags.iter().any(|flags| flags.at.is_set());
        wrong.map(|urgency| f32::from(urgency as u8)).or(was_said.then_some(good))
    }
}

#[cfg(test)]
mod tests;
