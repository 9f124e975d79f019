//! Selection of the findings that a pilot receives: at most three texts of one event, critical ones at once, and the cause of one
//! that was sent.
//!
//! An event is the set of findings of one family ([`family`]) within [`EVENT`] of its first text. A mishap is an
//! event until it is over.
//!
//! * A finding explained by another one ([`Finding::because`]) is recorded only.
//! * A critical finding is never delayed. It is sent if its order differs from those of the event's earlier texts. So
//!   a fourth lost motor, or the pitch beside the roll, does not repeat LAND NOW.
//! * A warning waits for [`HOLD`], that of an estimator for [`DERIVED_HOLD`]. If it becomes critical meanwhile, only the
//!   critical finding is sent. If its cause is found, only the cause is sent. Otherwise it
//!   is the first text of an event, or waits for the event's end, and is sent if it still holds. The same goes for
//!   missing data, and for the end of a finding. A check that no longer applies, as after landing, is not reported:
//!   its state is unknown.
//! * A critical finding whose cause waits as a warning is sent in the words of the cause, with its own order.
//! * A cause whose effect was sent before it is sent as `cause: ...`, and waits for no event.
//! * Of a mishap the first kind is sent. Another one is sent if its order differs and nothing led to it. The text
//!   that it is down, with the place, comes by itself. A kind whose order does not fit the vehicle is sent with the
//!   one that fits ([`order`]); if none fits, its cause does not count. A waiting mild finding that began with the
//!   mishap or after it is a consequence, and is dropped.
//! * A recovering finding waits until it is over or bad again, so a delayed text is true when sent. The text of some checks waits until
//!   they were bad for a while (`Check::told_after_s`). Of some checks only critical findings are sent (`Check::RECORDED`).
//! * The end of a finding is sent only if the finding was sent and its explanation has ended. Missing data are
//!   reported only while no alarm is open.
//! * Findings that are not critical wait during an event with a critical text. At most [`MILD_MAX`] of them are sent
//!   in any [`SPAN`], the worst first.

use core::iter;

use hums_core::clock::{Instant, Span};
use hums_core::health::{self, Alarm, Check, Finding, Health, Level, Subsystem, root_cause};

use crate::vocabulary::said;

const EVENT: Span = Span::from_secs(10);
/// Time that a warning waits in case it becomes critical.
const HOLD: Span = Span::from_secs(1);
/// The same of a value that is made of several sensors: its cause may be found. An estimator doubts at the first wrong sample; the check of a
/// sensor takes 2.5 s to smooth and to debounce.
const DERIVED_HOLD: Span = Span::from_secs(3);
/// Most texts that are not critical in any [`SPAN`].
const MILD_MAX: usize = 3;
/// See [`MILD_MAX`].
const SPAN: Span = Span::from_secs(30);
/// Texts of a mishap, one of its cause included; the text that it is down comes beside them.
const MISHAP_MAX: u8 = 2;
const OPEN_MAX: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SendTime {
    Now,
    Later,
    Never,
}

/// Subsystems that fail together: a motor failure disturbs the attitude.
const fn family(part: Subsystem) -> Subsystem {
    if matches!(part, Subsystem::Attitude) { Subsystem::Propulsion } else { part }
}

#[derive(Clone, Copy, Debug)]
struct Event {
    /// When its first text went, in milliseconds modulo 2^32.
    begun_ms: u32,
    /// Texts; 0: no event.
    told: u8,
    critical: [Option<u8>; 3],
}

impl Event {
    const NONE: Self = Self { begun_ms: 0, told: 0, critical: [None; 3] };

    const fn is_running(&self, now: Instant) -> bool {
        self.told > 0 && since(now, self.begun_ms) < EVENT.as_millis()
    }

    fn asked_for(&self, order: &str) -> bool {
        self.critical.iter().flatten().any(|number| advice(*number) == order)
    }
}

/// The sent findings.
#[derive(Clone, Debug)]
pub(crate) struct SentFindings {
    /// By family.
    events: [Event; Subsystem::ALL.len()],
    /// When the last texts went that were not critical, in milliseconds modulo 2^32.
    mild: heapless::Deque<u32, MILD_MAX>,
    open: heapless::Vec<(u8, u8), OPEN_MAX>,
}

impl SentFindings {
    pub(crate) const fn new() -> Self {
        Self {
            events: [Event::NONE; Subsystem::ALL.len()],
            mild: heapless::Deque::new(),
            open: heapless::Vec::new(),
        }
    }

    /// Now or later.
    pub(crate) fn is_news(&mut self, finding: &Finding) -> bool {
        let Some(key) = key(finding) else { return finding.because.is_empty() };
        match finding.level {
            Level::Warning if check_of(key.0).is_some_and(|check| check.told_after_s == Check::RECORDED) => {
                false
            }
            Level::Ok if finding.subsystem == Subsystem::Mishap => {
                // Its flying on has a text of its own, or a new event begins.
                self.events[Subsystem::Mishap as usize] = Event::NONE;
                false
            }
            Level::Ok if finding.is_unjudged() => {
                self.open.retain(|open| *open != key);
                false
            }
            Level::Ok => self.open.contains(&key) && !self.is_explained(finding),
            // It outlives its cause, and was sent before that was found. It may have been sent as a warning only.
            Level::Warning if finding.previous == Level::Warning && self.open.contains(&key) => false,
            Level::Stale => finding.because.is_empty() && self.open.is_empty(),
            _ => finding.because.is_empty(),
        }
    }

    fn is_explained(&self, finding: &Finding) -> bool {
        let Some(check) = health::check_named(finding.check) else { return false };
        let mut open = self.open.iter().filter_map(|(number, _)| check_of(*number));
        open.any(|cause| health::explains(cause, check))
    }

    /// `health` is not known at a change of level.
    pub(crate) fn fate(&mut self, now: Instant, finding: &Finding, health: Option<&Health>) -> SendTime {
        let event = &self.events[family(finding.subsystem) as usize];
        let is_mishap = finding.subsystem == Subsystem::Mishap;
        if finding.level == Level::Critical {
            let is_running = if is_mishap { event.told > 0 } else { event.is_running(now) };
            let order = order(finding);
            let is_asked_for = !order.is_empty() && event.asked_for(order);
            let is_told = is_running && (is_asked_for || (is_mishap && event.told >= MISHAP_MAX));
            return if is_told { SendTime::Never } else { SendTime::Now };
        }
        if is_mishap {
            return SendTime::Never;
        }
        let is_held =
            finding.level == Level::Warning && now.since(Instant::of(finding.at, now)) < hold(finding.check);
        let mut others = self.events.iter().filter(|event| event.critical[0].is_some());
        let is_busy = event.is_running(now) || others.any(|event| event.is_running(now));
        let is_busy = is_busy && !health.is_some_and(|health| self.has_effect(finding, health));
        if health.is_some_and(|health| self.leaves_effect(finding, health)) {
            return SendTime::Later;
        }
        while self.mild.front().is_some_and(|at_ms| since(now, *at_ms) >= SPAN.as_millis()) {
            self.mild.pop_front();
        }
        if is_held || is_busy || self.mild.is_full() { SendTime::Later } else { SendTime::Now }
    }

    /// Whether `told` makes a waiting finding obsolete: a mishap, and its consequences.
    pub(crate) fn is_consequence(told: &Finding, waits: &Finding) -> bool {
        told.subsystem == Subsystem::Mishap
            && waits.level != Level::Critical
            && health::is_of_mishap(waits.subsystem)
            && health::is_with_mishap(waits.at, told.at)
    }

    /// Notes a finding that was sent.
    pub(crate) fn told(&mut self, now: Instant, finding: &Finding) {
        let is_mishap = finding.subsystem == Subsystem::Mishap;
        let ordering = number(finding.ordering());
        let is_led_to =
            is_mishap && ordering.is_some() && self.events.iter().any(|event| event.is_running(now));
        let now_ms = now.as_millis() as u32;
        let event = &mut self.events[family(finding.subsystem) as usize];
        let goes_on = if is_mishap { event.told > 0 } else { event.is_running(now) };
        if !goes_on {
            *event = Event { begun_ms: now_ms, told: u8::from(is_led_to), ..Event::NONE };
        }
        event.told = event.told.saturating_add(1);
        if finding.level != Level::Critical {
            // There was room.
            let _ = self.mild.push_back(now_ms);
        } else if let Some(free) = event.critical.iter_mut().find(|number| number.is_none()) {
            *free = ordering;
        }
        self.names(finding);
        if is_mishap {
            self.open.retain(|(number, _)| !part(*number).is_some_and(health::is_of_mishap));
        }
    }

    pub(crate) fn names(&mut self, finding: &Finding) {
        let Some(key) = key(finding) else { return };
        self.open.retain(|open| *open != key);
        if is_alarm(finding) && finding.subsystem != Subsystem::Mishap {
            if self.open.is_full() {
                self.open.remove(0);
            }
            let _ = self.open.push(key);
        }
    }

    /// Whether an alarm that was sent has this cause. Each waiting finding asks it twice in a tick at most, and each of [`OPEN_MAX`]
    /// alarms is looked up by its name: in the worst case 512 times among all checks.
    pub(crate) fn has_effect(&self, cause: &Finding, health: &Health) -> bool {
        let Some((cause, _)) = health.alarm(cause.check, cause.instance) else { return false };
        let known = |(number, instance): &(u8, u8)| health.alarm(check_of(*number)?.name, *instance);
        let open = self.open.iter().filter_map(known);
        open.map(|(alarm, _)| mild(alarm)).any(|effect| root_cause(&effect, iter::once(cause)).is_some())
    }

    /// Whether a finding is over and its critical effect is not. The effect's text may have had the words of its cause, so `over:` would
    /// give the all-clear.
    fn leaves_effect(&self, cause: &Finding, health: &Health) -> bool {
        let Some(cause) = health::check_named(cause.check).filter(|_| cause.level == Level::Ok) else {
            return false;
        };
        self.open.iter().any(|(number, instance)| {
            check_of(*number).is_some_and(|effect| {
                let alarm = health.alarm(effect.name, *instance);
                health::explains(cause, effect)
                    && alarm.is_some_and(|(alarm, _)| alarm.level == Level::Critical)
            })
        })
    }
}

/// As a warning, which a milder one may explain.
const fn mild(mut alarm: Alarm) -> Alarm {
    alarm.level = Level::Warning;
    alarm
}

/// How long a check's warning waits before it is sent.
fn hold(check: &str) -> Span {
    let is_derived = health::check_named(check).is_some_and(|check| check.role.is_derived());
    if is_derived { DERIVED_HOLD } else { HOLD }
}

pub(crate) fn cause(finding: &Finding, waiting: &[Finding]) -> Option<Finding> {
    let alarm = |of: &Finding| Alarm::of(of.check, of.instance, Level::Warning, of.at);
    let alarms = waiting.iter().filter(|waits| waits.level == Level::Warning).filter_map(alarm);
    let cause = root_cause(&alarm(finding)?, alarms)?;
    let is_it = |waits: &&Finding| (waits.check, waits.instance) == (cause.check.name, cause.instance);
    waiting.iter().find(is_it).copied()
}

const fn is_alarm(finding: &Finding) -> bool {
    matches!(finding.level, Level::Warning | Level::Critical)
}

/// `at_ms`: modulo 2^32.
const fn since(now: Instant, at_ms: u32) -> u64 {
    (now.as_millis() as u32).wrapping_sub(at_ms) as u64
}

fn number(check: &str) -> Option<u8> {
    Some(health::checks().position(|known| known.name == check)? as u8)
}

fn key(finding: &Finding) -> Option<(u8, u8)> {
    Some((number(finding.check)?, finding.instance))
}

/// Empty if none.
pub(crate) fn order(finding: &Finding) -> &'static str {
    said(finding.ordering()).map_or("", |said| said.advice)
}

fn check_of(number: u8) -> Option<&'static Check> {
    health::checks().nth(usize::from(number))
}

fn part(number: u8) -> Option<Subsystem> {
    Some(check_of(number)?.subsystem)
}

fn advice(number: u8) -> &'static str {
    check_of(number).and_then(|check| said(check.name)).map_or("", |said| said.advice)
}
