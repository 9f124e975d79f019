//! Names of parts: which failsafe, which sensor.

use std::collections::BTreeSet;

use hums_core::alert::{HOLDS, of_estimator};
use hums_core::cause::{Alert, Cause, Causes, Urgency};
use hums_core::clock::{Instant, Span};
use hums_core::health::{Check, Level, checks};
use hums_core::observation::{AutopilotIdentity, Estimator, Gnss, Heartbeat, Source, SystemStatus};
use hums_core::parameters::Params;
use hums_core::units::Position;
use hums_core::vehicle::BATTERIES_MAX;

use super::problem::Problems;
use crate::names::autopilot_name;
use crate::source::item::AUTOPILOT;
use crate::source::told::Finding;
use crate::states;
use crate::utc::moment;

pub(super) const FAILSAFE: &str = "autopilot_state";

const GPS_SPEED: &str = "gps_speed";
/// m from where the speed leads: more than a receiver strays.
const JUMP_M: f64 = 10.0;
/// Between compared fixes, and from a jump to its finding.
const NEAR: Span = Span::from_secs(20);

/// The present states.
#[derive(Debug, Default)]
pub(super) struct Details {
    failsafes: String,
    sensors: u32,
    doubted: Option<Causes>,
    /// Last text by cause, with its time.
    said: [Option<(Instant, String)>; Cause::COUNT],
    fix: Option<(Instant, Position)>,
    /// Metres, and when.
    jump: Option<(Instant, f64)>,
    /// Batteries in order of appearance: component and id.
    batteries: Vec<(u8, u8)>,
    /// Those beyond them, up to [`BEYOND_MAX`].
    beyond: BTreeSet<(u8, u8)>,
    autopilots: Vec<Heard>,
    /// Remarks on the recordings before a joint.
    earlier: Vec<String>,
    others: Vec<Heard>,
}

/// Distinguishable by these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Heard {
    system: u8,
    /// `MAV_AUTOPILOT`
    autopilot: u8,
    uid: u64,
}

/// `MAV_AUTOPILOT_INVALID`: the sender is not an autopilot.
const NO_AUTOPILOT: u8 = 8;

/// Distinguished autopilots.
const TOLD_APART_MAX: usize = 32;
/// Batteries beyond the followed ones: `ArduPilot` has 16.
const BEYOND_MAX: usize = 1_024;

impl Details {
    /// `judged`: the system of the one before.
    pub(super) fn begin_another(&mut self, judged: Option<u8>) {
        /// Kept sentences.
        const KEPT_MAX: usize = 8;
        let mut earlier = self.of_parts(judged);
        earlier.truncate(KEPT_MAX);
        let others = self.all_autopilots();
        *self = Self { earlier, others, ..Self::default() };
    }

    fn all_autopilots(&self) -> Vec<Heard> {
        let mut all = self.others.clone();
        for heard in &self.autopilots {
            let known = all.iter().position(|known| {
                (known.system, known.autopilot) == (heard.system, heard.autopilot)
                    && (known.uid == heard.uid || known.uid == 0 || heard.uid == 0)
            });
            if let Some(known) = known.and_then(|at| all.get_mut(at)) {
                known.uid = known.uid.max(heard.uid);
            } else if all.len() < TOLD_APART_MAX {
                all.push(*heard);
            }
        }
        all
    }

    pub(super) fn failsafes(&mut self, words: &str) {
        words.clone_into(&mut self.failsafes);
    }

    /// Reported as unhealthy.
    pub(super) fn sensors(&mut self, status: &SystemStatus) -> bool {
        let unhealthy = status.sensors.map(|sensors| sensors.unhealthy | sensors.lost);
        let is_new = unhealthy.filter(|unhealthy| *unhealthy != self.sensors);
        self.sensors = is_new.unwrap_or(self.sensors);
        is_new.is_some()
    }

    pub(super) fn estimator(&mut self, estimator: &Estimator) -> bool {
        let doubted = Some(of_estimator(estimator, true, true, false));
        core::mem::replace(&mut self.doubted, doubted) != doubted
    }

    /// `false` for an alert's end.
    pub(super) fn said(&mut self, at: Instant, alert: Alert, words: String) -> bool {
        let is_wrong = alert.urgency > Urgency::Over;
        if let Some(said) = self.said.get_mut(alert.cause as usize).filter(|_| is_wrong) {
            *said = Some((at, words));
        }
        is_wrong
    }

    pub(super) fn gnss(&mut self, at: Instant, gnss: &Gnss) {
        let Some(position) = gnss.position.filter(|_| gnss.instance == 0 && gnss.fix >= 3) else { return };
        let before = self.fix.replace((at, position)).filter(|(then, _)| at.since(*then) <= NEAR);
        let Some((then, from)) = before else { return };
        let flown_m =
            f64::from(gnss.speed.map_or(0.0, |speed| speed.0)) * at.since(then).as_micros() as f64 / 1e6;
        let jump_m = distance_m(from, position) - flown_m;
        let is_worse = self.jump.is_none_or(|(then, known_m)| at.since(then) > NEAR || jump_m > known_m);
        if jump_m > JUMP_M && is_worse {
            self.jump = Some((at, jump_m));
        }
    }

    pub(super) fn heartbeat(&mut self, source: Source, heartbeat: &Heartbeat) {
        let (system, autopilot) = (source.system, heartbeat.autopilot_number);
        let is_new =
            !self.autopilots.iter().any(|known| (known.system, known.autopilot) == (system, autopilot));
        if is_new && source.component == AUTOPILOT && autopilot != NO_AUTOPILOT {
            self.autopilot(Heard { system, autopilot, uid: 0 });
        }
    }

    pub(super) fn identity(&mut self, source: Source, identity: &AutopilotIdentity) {
        let uid = identity.uid;
        let mut same = self.autopilots.iter_mut().filter(|known| known.system == source.system).rev();
        let Some(latest) = same.next().filter(|_| source.component == AUTOPILOT && uid != 0) else { return };
        if latest.uid == 0 {
            latest.uid = uid;
        } else if latest.uid != uid && !same.any(|known| known.uid == uid) {
            let other = Heard { uid, ..*latest };
            self.autopilot(other);
        }
    }

    fn autopilot(&mut self, heard: Heard) {
        if self.autopilots.len() < TOLD_APART_MAX {
            self.autopilots.push(heard);
        }
    }

    /// The systems whose autopilot sent heartbeats, each once.
    pub(super) fn systems(&self) -> Vec<u8> {
        let systems: BTreeSet<u8> = self.autopilots.iter().map(|heard| heard.system).collect();
        systems.into_iter().collect()
    }

    fn vehicles(&self, judged: Option<u8>) -> Option<String> {
        let first = self.autopilots.first()?;
        let how = match judged.filter(|_| self.autopilots.iter().any(|heard| heard.system != first.system)) {
            Some(system) => format!("system {system} is judged"),
            None => {
                "one system id is judged, as if it were one vehicle: give each vehicle's recording by itself"
                    .to_owned()
            }
        };
        (self.autopilots.len() > 1)
            .then(|| format!("more than one vehicle is in it: {}; {how}", named(&self.autopilots)))
    }

    fn vehicles_of_parts(&self) -> Option<String> {
        let all = self.all_autopilots();
        let is_new = self.autopilots.len() < 2 && !self.others.is_empty() && all.len() > 1;
        is_new.then(|| {
            let named = named(&all);
            format!("more than one vehicle is in it: {named}; what it says of the vehicle is of the last one")
        })
    }

    pub(super) fn battery(&mut self, source: Source, id: u8) {
        let battery = (source.component, id);
        if self.batteries.contains(&battery) {
            return;
        }
        if self.batteries.len() < BATTERIES_MAX {
            self.batteries.push(battery);
        } else if self.beyond.len() < BEYOND_MAX {
            self.beyond.insert(battery);
        }
    }

    /// Remarks on vehicles, and parts beyond the monitor's room.
    pub(super) fn remarks(&self, judged: Option<u8>) -> Vec<String> {
        self.of_parts(judged).into_iter().chain(self.vehicles_of_parts()).collect()
    }

    fn of_parts(&self, judged: Option<u8>) -> Vec<String> {
        let mut remarks = self.earlier.clone();
        let new = self.vehicles(judged).into_iter().chain(not_followed(&self.beyond));
        new.for_each(|new| {
            if !remarks.contains(&new) {
                remarks.push(new);
            }
        });
        remarks
    }

    fn tell_alert(&self, check: &str, problems: &mut Problems) {
        let Some(cause) = Cause::ALL.into_iter().find(|cause| cause.name() == check) else { return };
        let of = |bit: &u32| self.sensors & bit != 0 && Causes::of_sensors(*bit).has(cause);
        for bit in (0..u32::BITS).map(|bit| 1 << bit).filter(of) {
            states::sensors(bit)
                .for_each(|name| problems.detail(check, &format!("{name} unhealthy, by its flags")));
        }
        let flag = match cause {
            Cause::Gnss => "a glitch, by the estimator's flags",
            Cause::Accelerometer => "in error, by the estimator's flags",
            _ => "",
        };
        if !flag.is_empty() && self.doubted.is_some_and(|doubted| doubted.has(cause)) {
            problems.detail(check, flag);
        }
        let said = self.said.get(cause as usize).and_then(Option::as_ref);
        if let Some((at, words)) = said
            && problems.open_since(check).is_some_and(|since| since.since(*at) <= HOLDS.into())
        {
            problems.detail(check, words);
        }
    }

    pub(super) fn tell(&self, check: &str, problems: &mut Problems) {
        if !problems.is_open(check) {
            return;
        }
        match check {
            FAILSAFE => {
                let names = self.failsafes.split(", ").filter(|name| !name.is_empty());
                names.for_each(|name| problems.detail(check, name));
            }
            GPS_SPEED => {
                let since = problems.open_since(check);
                if let Some((at, jump_m)) =
                    self.jump.filter(|(at, _)| since.is_some_and(|since| since.since(*at) <= NEAR))
                {
                    let words = format!("GPS 1 position jumped {jump_m:.0} m at {}", moment(at));
                    problems.event(check, &words);
                }
            }
            _ => self.tell_alert(check, problems),
        }
    }
}

/// m on a sphere.
fn distance_m(one: Position, other: Position) -> f64 {
    const METRES_A_DEGREE: f64 = 111_195.0;
    let north = other.latitude_deg - one.latitude_deg;
    let east = (other.longitude_deg - one.longitude_deg + 540.0).rem_euclid(360.0) - 180.0;
    north.hypot(east * one.latitude_deg.to_radians().cos()) * METRES_A_DEGREE
}

/// `batteries 5 to 256 are not judged`.
fn not_followed(beyond: &BTreeSet<(u8, u8)>) -> Option<String> {
    /// Named ranges.
    const NAMED_MAX: usize = 8;
    let mut ranges: Vec<(u8, u16, u16)> = Vec::new();
    for (component, id) in beyond {
        let number = u16::from(*id) + 1;
        match ranges.last_mut() {
            Some((of, _, last)) if of == component && *last + 1 == number => *last = number,
            _ => ranges.push((*component, number, number)),
        }
    }
    let words = |&(component, first, last): &(u8, u16, u16)| {
        let of = if component == 1 { String::new() } else { format!(" of component {component}") };
        if first == last { format!("{first}{of}") } else { format!("{first} to {last}{of}") }
    };
    let named: Vec<String> = ranges.iter().take(NAMED_MAX).map(words).collect();
    let more = if ranges.len() > NAMED_MAX { " and others" } else { "" };
    let (one, are) = if beyond.len() == 1 { ("battery", "is") } else { ("batteries", "are") };
    (!beyond.is_empty()).then(|| {
        format!(
            "{one} {}{more} {are} not judged: the monitor follows {BATTERIES_MAX} batteries",
            named.join(", ")
        )
    })
}

/// Autopilots as words.
fn named(autopilots: &[Heard]) -> String {
    let words = |heard: &Heard| {
        let uid = if heard.uid == 0 { String::new() } else { format!(", uid {:016x}", heard.uid) };
        format!("system {} ({}{uid})", heard.system, autopilot_name(heard.autopilot))
    };
    autopilots.iter().map(words).collect::<Vec<_>>().join(", ")
}

/// The check, and the report's value.
pub(super) const EMERGENCY: (&str, f32) = (FAILSAFE, 6.0); // MAV_STATE_EMERGENCY
pub(super) const PROCESSOR_FAULT: (&str, f32) = ("processor_alert", Urgency::Critical as u8 as f32);

/// Begin and end of a report that is over at once; `None` below the limit. The debounce would miss it.
pub(super) fn reported(at: Instant, (name, value): (&str, f32), params: &Params) -> Vec<Finding> {
    let limited = |check: &'static Check| Some((check, params.get(check.limits.critical?)));
    let found = checks().find(|check| check.name == name).and_then(limited);
    let Some((check, limit)) = found.filter(|(_, limit)| value > *limit) else { return Vec::new() };
    let change = |change| Finding::of(check, at, change, value, limit);
    vec![change((Level::Ok, Level::Critical)), change((Level::Critical, Level::Ok))]
}

#[cfg(test)]
mod tests {
    use hums_core::observation::EstimatorScale;

    use super::super::problem::tests::change;
    use super::*;

    #[test]
    fn batteries_beyond_those_that_are_judged_are_named() {
        let mut details = Details::default();
        for id in [0, 1, 2, 3, 1, 8, 8] {
            details.battery(Source { system: 1, component: 1 }, id);
        }
        assert_eq!(details.remarks(None), ["battery 9 is not judged: the monitor follows 4 batteries"]);
        (0..=255).for_each(|id| details.battery(Source { system: 1, component: 1 }, id));
        details.battery(Source { system: 1, component: 180 }, 0);
        let words = "batteries 5 to 256, 1 of component 180 are not judged: the monitor follows 4 batteries";
        assert_eq!(details.remarks(None), [words]);
    }

    #[test]
    fn of_two_vehicles_the_one_that_is_judged_is_named() {
        let mut details = Details::default();
        for system in [1, 1, 7] {
            details.heartbeat(Source { system, component: 1 }, &heartbeat());
        }
        let words =
            "more than one vehicle is in it: system 1 (ArduPilot), system 7 (ArduPilot); system 7 is judged";
        assert_eq!(details.remarks(Some(7)), [words]);
    }

    #[test]
    fn an_alert_that_the_estimator_raised_by_a_flag_says_so() {
        let (mut details, mut problems) = (Details::default(), Problems::default());
        let check = Cause::Gnss.name();
        let subsystem = hums_core::health::Subsystem::Navigation;
        let finding = Finding { subsystem, check: check.to_owned(), ..change(0, Level::Warning, 1.0) };
        problems.take(&finding, hums_core::clock::Span::ZERO);
        // With PX4's glitch bit.
        let estimator = |flags| Estimator { scale: EstimatorScale::TestRatio, flags, ..Estimator::default() };
        assert!(details.estimator(&estimator(0b1_1001)));
        details.tell(check, &mut problems);
        assert!(details.estimator(&estimator(0b1_1001 | 1 << 10)));
        assert!(!details.estimator(&estimator(0b1_1001 | 1 << 10)), "no news");
        details.tell(check, &mut problems);
        let found = problems.worst_first();
        assert_eq!(found[0].details, ["a glitch, by the estimator's flags"]);
    }

    fn heartbeat() -> Heartbeat {
        Heartbeat {
            autopilot: hums_core::observation::Autopilot::ArduPilot,
            autopilot_number: 3,
            kind: hums_core::observation::VehicleKind::Rotorcraft,
            type_number: 2,
            armed: false,
            state: 3,
            mode: 0,
        }
    }
}
