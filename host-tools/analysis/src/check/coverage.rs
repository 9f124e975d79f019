//! Judged checks, and why the others were not.

use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::health::{Check, CheckPhase, Level, Side, checks};
use hums_core::observation::{Autopilot, Gnss, Heartbeat};
use hums_core::parameters::{Param, Params};
use hums_core::status::{LinkReading, RecorderStatus};
use hums_formats::trend_words::WORDS;
use hums_link::vocabulary::{Scope, VOCABULARY, vocabulary};

use super::judged::JudgedBy;
use super::problem::Problem;
use crate::counters::tells_flight;

/// Checks not judged until a receiver has had a fix.
const OF_A_FIX: [&str; 4] = ["gps_satellites", "gps_hdop", "gps_accuracy", "gps_fix"];
const CELL_VOLTAGE: &str = "cell_voltage";
/// Reason for checks of earlier flights and worn parts.
const UNTOLD: &str = "needs earlier flights or a box";
pub(super) const OFF: &str = "its limit is off";
const NOTE_EVERY: Span = Span::from_millis(500);

#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    value: bool,
    level: bool,
}

#[derive(Debug)]
pub(super) struct Coverage {
    seen: Vec<Seen>,
    next: Instant,
}

pub(super) type Lists = (Vec<&'static str>, Vec<(&'static str, String)>);

impl Coverage {
    /// Empty.
    pub(super) fn new() -> Self {
        Self { seen: vec![Seen::default(); VOCABULARY.len()], next: Instant::ZERO }
    }

    /// Values and levels, now and then; `steps`: monitor's time.
    pub(super) fn note(
        &mut self,
        now: Instant,
        steps: Instant,
        monitor: &Monitor,
        link: &LinkReading,
        recorder: &RecorderStatus,
    ) {
        if now < self.next {
            return;
        }
        self.next = now + NOTE_EVERY;
        if monitor.vehicle().source.is_none() {
            return;
        }
        let inputs = monitor.inputs(steps.into(), link, recorder);
        for (seen, check) in self.seen.iter_mut().zip(checks()).filter(|(seen, _)| !seen.value) {
            seen.value = (0..check.instances).any(|instance| {
                (check.read)(&inputs, instance).is_some_and(|reading| reading.value.is_finite())
            });
        }
        // In the order of the checks.
        let mut levels = monitor.health().levels().filter(|(.., level)| *level != Level::Stale).peekable();
        for (seen, check) in self.seen.iter_mut().zip(checks()) {
            while levels.next_if(|(of, ..)| of.name == check.name).is_some() {
                seen.level = true;
            }
        }
    }

    /// Checks for another autopilot are in neither list.
    pub(super) fn lists(&self, recording: &Recording<'_>) -> Lists {
        let (mut judged, mut not_judged) = (Vec::new(), Vec::new());
        let had_fix = checks().zip(&self.seen).any(|(check, seen)| check.name == "gps_fix" && seen.value);
        for (check, seen) in checks().zip(&self.seen) {
            match recording.why_not(check, *seen, had_fix) {
                Verdict::Judged => judged.push(check.name),
                Verdict::NotJudged(why) => not_judged.push((check.name, why)),
                Verdict::NotMeant => {}
            }
        }
        if recording.by == JudgedBy::Here {
            not_judged.extend(WORDS.iter().map(|words| (words.said.check, UNTOLD.to_owned())));
        }
        (judged, not_judged)
    }
}

#[expect(clippy::struct_excessive_bools, reason = "facts that have nothing to do with each other")]
pub(super) struct Recording<'a> {
    pub(super) by: JudgedBy,
    pub(super) monitor: &'a Monitor,
    pub(super) is_of_link: bool,
    pub(super) on_the_wire: bool,
    /// Time armed.
    pub(super) armed: Span,
    /// Reason, if arming is not reported.
    pub(super) arming: Option<&'a str>,
    /// It was in the air.
    pub(super) flew: bool,
    pub(super) cells_unknown: bool,
    /// The problems found.
    pub(super) problems: &'a [Problem],
}

enum Verdict {
    Judged,
    NotJudged(String),
    /// Another autopilot's, or of parts that are not registered.
    NotMeant,
}

impl Recording<'_> {
    fn why_not(&self, check: &Check, seen: Seen, had_fix: bool) -> Verdict {
        let Some(words) = vocabulary(check.name) else { return Verdict::NotMeant };
        let autopilot = self.monitor.vehicle().heartbeat.get().map(|Heartbeat { autopilot, .. }| *autopilot);
        let not = |why: &str| Verdict::NotJudged(why.to_owned());
        let is_found = self.problems.iter().any(|problem| problem.check == check.name);
        if self.by == JudgedBy::Board && matches!(words.scope, Scope::Wire | Scope::Recorder | Scope::Stored)
        {
            // The store is not in the log.
            return if words.scope == Scope::Stored && !seen.level {
                Verdict::NotMeant
            } else {
                Verdict::Judged
            };
        }
        match words.scope {
            // Without alerts neither good nor bad.
            Scope::Alerts if is_found => return Verdict::Judged,
            Scope::Alerts => return Verdict::NotMeant,
            Scope::ArduPilot if autopilot == Some(Autopilot::Px4) => return Verdict::NotMeant,
            Scope::Px4 if autopilot == Some(Autopilot::ArduPilot) => return Verdict::NotMeant,
            _ if autopilot.is_none() => return not("no heartbeat of an autopilot"),
            Scope::Recorder => return not("needs a log of the box"),
            Scope::Wire if !self.on_the_wire => {
                return not(if self.is_of_link {
                    "needs a box on the autopilot's wire"
                } else {
                    "the autopilot recorded this itself, without a link"
                });
            }
            _ => {}
        }
        if is_off(check, self.monitor.params()) {
            return not(OFF);
        }
        if words.scope == Scope::Stored {
            return not(UNTOLD);
        }
        if check.name == CELL_VOLTAGE && !is_found {
            if self.cells_unknown {
                return not("how many cells the battery has is not known");
            }
            // Stored by the box.
            if self.by == JudgedBy::Board && self.monitor.lacks_cells() {
                return Verdict::Judged;
            }
        }
        if seen.level || is_found {
            return Verdict::Judged;
        }
        match check.when {
            CheckPhase::Armed | CheckPhase::InFlight if self.armed == Span::ZERO => {
                not(self.arming.unwrap_or("never armed"))
            }
            CheckPhase::InFlight if !self.flew && !tells_flight(self.monitor.vehicle()) => {
                not("not known whether it was in the air")
            }
            CheckPhase::InFlight if !self.flew => not("never in the air"),
            _ if seen.value => not("only for a moment in this recording"),
            _ if !had_fix && OF_A_FIX.contains(&check.name) => {
                Verdict::NotJudged(self.why_no_fix(words.needs))
            }
            _ => Verdict::NotJudged(format!("no {}", words.needs)),
        }
    }

    /// Never had a fix: perhaps not in use, but named.
    fn why_no_fix(&self, needs: &str) -> String {
        let told = |gnss: &Gnss| gnss.satellites.is_some() || gnss.fix > 0;
        let receivers = self.monitor.vehicle().gnss.iter().zip(1_u8..);
        let told = receivers.filter(|(slot, _)| slot.get().is_some_and(told));
        let numbers: Vec<String> = told.map(|(_, number)| number.to_string()).collect();
        match numbers.as_slice() {
            [] => format!("no {needs}"),
            numbers => format!("GPS {} never had a fix", numbers.join(" and ")),
        }
    }
}

fn is_off(check: &Check, params: &Params) -> bool {
    let off = |param: Param| {
        let (limit, spec) = (params.get(param), param.spec());
        limit.is_nan()
            || match check.limits.side {
                Side::Above => limit >= spec.max,
                Side::Below => limit <= spec.min,
            }
    };
    [check.limits.warn, check.limits.critical].into_iter().flatten().all(off)
}

#[cfg(test)]
mod tests {
    use hums_core::observation::{Observation, Source, VehicleKind};

    use super::*;

    #[test]
    fn a_receiver_that_never_had_a_fix_is_named() {
        let why = |gnss: Option<Gnss>| {
            let mut monitor = Monitor::new(Params::default());
            let heartbeat = Heartbeat {
                autopilot: Autopilot::Px4,
                autopilot_number: 12,
                kind: VehicleKind::Rotorcraft,
                type_number: 2,
                armed: true,
                state: 4,
                mode: 0,
            };
            let source = Source { system: 1, component: 1 };
            monitor.observe(Instant::ZERO.into(), source, &Observation::Heartbeat(heartbeat));
            if let Some(gnss) = gnss {
                monitor.observe(Instant::ZERO.into(), source, &Observation::Gnss(gnss));
            }
            let recording = Recording {
                by: JudgedBy::Here,
                monitor: &monitor,
                is_of_link: false,
                on_the_wire: false,
                armed: Span::from_secs(60),
                arming: None,
                flew: true,
                cells_unknown: false,
                problems: &[],
            };
            let (_, not_judged) = Coverage::new().lists(&recording);
            not_judged.into_iter().find(|(check, _)| *check == "gps_satellites").map(|(_, why)| why)
        };
        let none = Gnss { satellites: Some(0), hdop: Some(99.99), ..Gnss::default() };
        assert_eq!(why(Some(none)).as_deref(), Some("GPS 1 never had a fix"));
        assert_eq!(why(None).as_deref(), Some("no GPS satellite count"));
        assert_eq!(why(Some(Gnss::default())).as_deref(), Some("no GPS satellite count"), "no receiver");
    }
}
