//! What the autopilot itself says is wrong: a text, an event, a flag of health or of the estimator.
//!
//! Autopilots say the same thing in many ways. Each way is turned into a [`Cause`] in one place: texts in `alert/texts.rs`, PX4's
//! events in `alert/events.rs`, flags of health in [`crate::cause`], the estimator's here. A way more is one row there. What stands in
//! no table and is severe is [`Cause::Other`].
//!
//! A text or an event is a moment: it holds for [`HOLDS`]. Flags hold as long as their message has them, and count from the second
//! message that has them, because one message of nonsense is no alarm.

mod events;
mod texts;

pub use events::name as event_name;

use crate::cause::{Alert, Cause, Causes, Meaning};
use crate::observation::{Estimator, EstimatorScale};
use crate::time::{Instant, Span};

/// How long a text or an event is said to be so. PX4 tells its failing checks again when they change, some 2 s apart.
pub const HOLDS: Span = Span::from_secs(10);
/// Flags come at 1 Hz or faster where they come at all.
const FLAGS_AGE: Span = Span::from_secs(5);

/// What a text of the autopilot says is wrong. `severity` is a `MAV_SEVERITY`: what is only a notice, or less, says nothing is
/// wrong. `None` where a log keeps none: then only
/// texts count that are known and tell by themselves that they are severe.
pub fn of_text(severity: Option<u8>, text: &[u8]) -> Option<Alert> {
    const NOTICE: u8 = 5;
    const WARNING: u8 = 4;
    if severity.is_some_and(|severity| severity >= NOTICE) {
        return None;
    }
    match texts::meaning(text, severity.is_some()) {
        Meaning::Wrong(alert) => Some(alert),
        Meaning::Fine => None,
        Meaning::Unknown => {
            severity.filter(|severity| *severity < WARNING).map(|_| Alert::warning(Cause::Other))
        }
    }
}

/// What an event of PX4 says is wrong. `severity` is that of its level outside, the low nibble of `log_levels`.
pub fn of_event(id: u32, severity: u8, arguments: &[u8]) -> Option<Alert> {
    const CRITICAL: u8 = 2;
    match events::meaning(id, arguments) {
        Meaning::Wrong(alert) => Some(alert),
        Meaning::Fine => None,
        Meaning::Unknown => (severity <= CRITICAL).then_some(Alert::warning(Cause::Other)),
    }
}

/// What the estimator's flags say (`ESTIMATOR_STATUS_FLAGS`, `EKF_STATUS_FLAGS`), where it had attitude and position before.
/// Bits that both have: 0 attitude, 3 and 4 position. PX4: 10 GPS glitch, 11 accelerometer error. ArduPilot: 15 GPS glitching.
fn of_estimator(estimator: &Estimator, had_both: bool) -> Causes {
    const PX4_GLITCH: u16 = 1 << 10;
    const PX4_ACCELEROMETER: u16 = 1 << 11;
    const ARDUPILOT_GLITCH: u16 = 1 << 15;
    let flags = estimator.flags;
    let (glitch, accelerometer) = match estimator.scale {
        EstimatorScale::TestRatio => (PX4_GLITCH, PX4_ACCELEROMETER),
        EstimatorScale::Variance => (ARDUPILOT_GLITCH, 0),
    };
    let lost = had_both && !has_both(flags);
    let said = [
        (flags & glitch != 0, Cause::Gnss),
        (flags & accelerometer != 0, Cause::Accelerometer),
        (lost, Cause::Estimator),
    ];
    said.into_iter().filter(|(is, _)| *is).fold(Causes::NONE, |causes, (_, cause)| causes.with(cause))
}

/// Whether an estimator has attitude and position.
const fn has_both(flags: u16) -> bool {
    const ATTITUDE: u16 = 1;
    const POSITION: u16 = 1 << 3 | 1 << 4;
    flags & ATTITUDE != 0 && flags & POSITION != 0
}

/// Flags of one message: the last two.
#[derive(Clone, Copy, Debug)]
struct Flags {
    now: Causes,
    before: Causes,
    at: Option<Instant>,
}

impl Flags {
    const NONE: Self = Self { now: Causes::NONE, before: Causes::NONE, at: None };

    const fn take(&mut self, at: Instant, causes: Causes) {
        *self = Self { now: causes, before: self.now, at: Some(at) };
    }

    fn has(&self, now: Instant, cause: Cause) -> bool {
        self.now.both(self.before).has(cause) && self.at.is_some_and(|at| now.since(at) <= FLAGS_AGE)
    }
}

/// What the autopilot says is wrong, now.
#[derive(Clone, Copy, Debug)]
pub struct Alerts {
    /// Of each cause, until when what was said once holds, milliseconds; and whether it is critical.
    told: [Option<(u32, bool)>; Cause::COUNT],
    sensors: Flags,
    failures: Flags,
    estimator: Flags,
    /// The receiver of the remote control was healthy once: one that never was is not fitted or not switched on.
    had_remote_control: bool,
    /// The estimator had attitude and position.
    had_both: bool,
}

impl Alerts {
    pub(crate) const fn new() -> Self {
        Self {
            told: [None; Cause::COUNT],
            sensors: Flags::NONE,
            failures: Flags::NONE,
            estimator: Flags::NONE,
            had_remote_control: false,
            had_both: false,
        }
    }

    /// A text or an event. What is said while nothing may turn is about arming.
    pub(crate) fn tell(&mut self, at: Instant, alert: Alert, armed: bool) {
        if !armed {
            return;
        }
        let Some(place) = self.told.get_mut(alert.cause as usize) else { return };
        let held = place.is_some_and(|(until, critical)| critical && !is_past(at, until));
        *place = Some(((at + HOLDS).as_millis() as u32, alert.critical || held));
    }

    /// `SYS_STATUS`: sensors that are present and enabled and not healthy.
    pub(crate) fn take_sensors(&mut self, at: Instant, unhealthy: u32) {
        let causes = Causes::of_sensors(unhealthy);
        self.had_remote_control |= !causes.has(Cause::RemoteControl);
        self.sensors.take(at, causes);
    }

    /// `HIGH_LATENCY2`
    pub(crate) const fn take_failures(&mut self, at: Instant, causes: Causes) {
        self.failures.take(at, causes);
    }

    /// The estimator's flags.
    pub(crate) fn take_estimator(&mut self, at: Instant, estimator: &Estimator) {
        self.had_both |= has_both(estimator.flags);
        self.estimator.take(at, of_estimator(estimator, self.had_both));
    }

    /// How bad the autopilot says it is: 0 not at all, 1 a warning, 2 critical; `None` where nothing was ever said.
    pub fn level(&self, now: Instant, cause: Cause) -> Option<f32> {
        let told = self.told.get(cause as usize).copied().flatten();
        let told = told.map(|(until, critical)| if is_past(now, until) { 0 } else { 1 + u8::from(critical) });
        let all = [&self.sensors, &self.failures, &self.estimator];
        let known = all.iter().any(|flags| flags.at.is_some());
        let flagged = all.iter().any(|flags| flags.has(now, cause))
            && (cause != Cause::RemoteControl || self.had_remote_control);
        let flagged = known.then_some(u8::from(flagged));
        told.max(flagged).map(f32::from)
    }
}

/// Whether a time in milliseconds modulo 2^32 is before this one.
const fn is_past(now: Instant, until_ms: u32) -> bool {
    (now.as_millis() as u32).wrapping_sub(until_ms).cast_signed() > 0
}

#[cfg(test)]
mod tests;
