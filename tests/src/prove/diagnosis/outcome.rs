//! One judged flight.

use std::path::PathBuf;

use anyhow::Result;
use hums::check::flights::Flight;
use hums::check::judge::{HeardAt, Limits};
use hums::check::judged::Judgement;
use hums::check::trends::Baselines;
use hums::names::{autopilot_name, counter_name, type_name};
use hums::source::recording::LogPlace;
use hums::source::told::Finding;
use hums_core::health::Level;

use super::causes;
use super::labels::Label;

/// It waits for its debounce, and belongs to the air.
const AFTER_LANDING_S: f64 = 3.0;

/// A rise to a warning or to critical, as a pilot gets it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Alarm {
    pub(super) check: String,
    pub(super) level: Level,
    /// Since the recording's first frame.
    pub(super) at_s: f64,
}

#[derive(Clone, Debug)]
pub(super) struct False {
    pub(super) alarm: Alarm,
    pub(super) in_air: bool,
}

#[derive(Clone, Debug)]
pub(super) struct Fault {
    /// Whether the messages show it at all.
    pub(super) visible: bool,
    pub(super) told: Option<Alarm>,
    pub(super) named: Option<Alarm>,
    /// Whether the first that a pilot hears names it.
    pub(super) right_first: bool,
    /// The autopilot's first report: seconds after the fault.
    pub(super) autopilot: Option<(f64, String)>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) flights: u64,
    pub(super) landings: u64,
    pub(super) mishaps: u64,
}

#[derive(Clone, Debug)]
pub(super) struct Outcome {
    pub(super) file: String,
    /// Autopilot and frame.
    pub(super) vehicle: String,
    pub(super) class: &'static str,
    pub(super) what: String,
    pub(super) air_s: f64,
    pub(super) alarms: Vec<False>,
    pub(super) fault: Option<Fault>,
    /// True and counted; none without a truth.
    pub(super) counts: Option<(Counts, Counts)>,
}

pub(super) fn count<'a>(alarms: impl IntoIterator<Item = &'a False>, level: Level, in_air: bool) -> u64 {
    alarms.into_iter().filter(|one| one.alarm.level == level && one.in_air == in_air).count() as u64
}

/// Judges one flight.
pub(super) fn judge(place: &LogPlace, label: Option<&Label>) -> Result<Outcome> {
    // Labelled flights come from a telemetry port.
    let heard = if label.is_some() { HeardAt::OnTheWire } else { HeardAt::Somewhere };
    let past = label.map_or(&[][..], |label| &label.past);
    let mut judged = hums::check::recording(place, &Limits::default(), heard)?.judged;
    if !past.is_empty() {
        judged.judge_trends(&mut learn(past)?);
    }
    Ok(of(&judged, &place.name, label))
}

fn learn(past: &[PathBuf]) -> Result<Baselines> {
    let places: Vec<_> = past.iter().map(|path| LogPlace::file(path)).collect();
    hums::check::past::learn(&Limits::default(), &places)
}

fn of(judged: &Judgement, name: &str, label: Option<&Label>) -> Outcome {
    let recorded_s = judged.span.map_or(0.0, |(_, last)| last.as_secs_f64());
    let alarms = alarms(judged);
    let heard = judged.told.iter();
    let heard = heard.map(|of| Alarm { check: of.check.clone(), level: of.level, at_s: of.at.as_secs_f64() });
    let heard: Vec<Alarm> = heard.collect();
    let quiet_s = label.and_then(|label| label.fault_s).unwrap_or(recorded_s);
    let air = match label.and_then(|label| label.flights.clone()) {
        Some(flights) => flights,
        None => judged.flights.iter().map(span_s).collect(),
    };
    let air_s =
        air.iter().map(|(from_s, to_s)| (to_s.min(quiet_s) - from_s).max(0.0)).fold(0.0, |sum, s| sum + s);
    let is_in_air =
        |at_s: f64| air.iter().any(|(from_s, to_s)| (*from_s..=to_s + AFTER_LANDING_S).contains(&at_s));
    let false_ones = alarms.iter().filter(|alarm| {
        alarm.at_s < quiet_s && !label.is_some_and(|label| label.explains(&alarm.check, alarm.at_s))
    });
    let class = label.and_then(|label| causes::of(&label.class));
    let heartbeat = judged.vehicle().heartbeat.get();
    let autopilot = heartbeat.map_or_else(|| "unknown".to_owned(), |it| autopilot_name(it.autopilot_number));
    let vehicle_type = heartbeat.map_or_else(String::new, |it| type_name(it.type_number));
    Outcome {
        file: label.map_or(name, |label| &label.file).to_owned(),
        vehicle: label.map_or_else(|| format!("{autopilot} {vehicle_type}"), Label::group),
        class: class.map_or("", |class| class.name),
        what: label.map_or_else(String::new, |label| label.what.clone()),
        air_s,
        alarms: false_ones
            .map(|alarm| False { alarm: alarm.clone(), in_air: is_in_air(alarm.at_s) })
            .collect(),
        fault: label.and_then(|label| fault(&alarms, &heard, label)),
        counts: label.and_then(|label| Some((truth(label)?, counted(judged)))),
    }
}

fn span_s(flight: &Flight) -> (f64, f64) {
    (flight.from.as_secs_f64(), flight.to.as_secs_f64())
}

/// A stale or good level is 0.
const fn rank(level: Level) -> u8 {
    match level {
        Level::Critical => 2,
        Level::Warning => 1,
        Level::Ok | Level::Advisory | Level::Stale => 0,
    }
}

fn rises(judged: &Judgement) -> impl Iterator<Item = &Finding> {
    judged.findings.iter().filter(|finding| rank(finding.level) > rank(finding.previous))
}

fn alarms(judged: &Judgement) -> Vec<Alarm> {
    let alarm = |of: &Finding| Alarm { check: of.check.clone(), level: of.level, at_s: of.at.as_secs_f64() };
    rises(judged).map(alarm).collect()
}

fn fault(alarms: &[Alarm], heard: &[Alarm], label: &Label) -> Option<Fault> {
    let fault_s = label.fault_s?;
    let names = causes::of(&label.class).map_or(&[][..], |class| class.checks);
    let is_of_fault = |alarm: &&Alarm| (fault_s..=label.end_s).contains(&alarm.at_s);
    let mut after = alarms.iter().filter(is_of_fault);
    let since = |alarm: &Alarm| Alarm { at_s: alarm.at_s - fault_s, ..alarm.clone() };
    Some(Fault {
        visible: label.visible,
        told: after.clone().next().map(since),
        named: after.find(|alarm| names.contains(&alarm.check.as_str())).map(since),
        right_first: heard
            .iter()
            .find(is_of_fault)
            .is_some_and(|first| names.contains(&first.check.as_str())),
        autopilot: label.autopilot_said().map(|(delay_s, text)| (delay_s, text.to_owned())),
    })
}

fn truth(label: &Label) -> Option<Counts> {
    let flights = label.flights.as_ref()?.len() as u64;
    Some(Counts { flights, landings: label.landings, mishaps: label.crashes_s.len() as u64 })
}

/// The odometer's counts.
fn counted(judged: &Judgement) -> Counts {
    let mut counts = Counts::default();
    judged.monitor.for_each_counter(|number, value| match counter_name(number).as_str() {
        "flights" => counts.flights = value as u64,
        "landings" => counts.landings = value as u64,
        "mishaps" => counts.mishaps = value as u64,
        _ => {}
    });
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alarm(check: &str, level: Level, at_s: f64) -> Alarm {
        Alarm { check: check.to_owned(), level, at_s }
    }

    fn label(class: &str) -> Label {
        let text = format!(
            r#"{{"file": "f", "vehicle": "PX4 quad", "what": "", "class": "{class}", "fault_s": 60, "end_s": 90, "visible": true}}"#
        );
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn a_fault_is_told_by_what_rises_while_it_lasts_and_named_by_a_check_of_its_class() {
        let alarms = [
            alarm("gps_hdop", Level::Warning, 59.0),
            alarm("ekf_alert", Level::Warning, 62.5),
            alarm("gps_fix", Level::Critical, 64.0),
            alarm("batt_remaining", Level::Critical, 91.0),
        ];
        let gnss = fault(&alarms, &alarms, &label("gnss")).unwrap();
        assert_eq!(gnss.told, Some(alarm("ekf_alert", Level::Warning, 2.5)));
        assert_eq!(gnss.named, Some(alarm("gps_fix", Level::Critical, 4.0)));
        let power = fault(&alarms, &alarms, &label("power")).unwrap();
        assert_eq!(
            (power.told.is_some(), power.named),
            (true, None),
            "what comes after the end is of nothing"
        );
        assert!(!gnss.right_first && fault(&alarms, &alarms[2..], &label("gnss")).unwrap().right_first);
        let missed = fault(&alarms[..1], &[], &label("gnss")).unwrap();
        assert_eq!((missed.told, missed.named), (None, None), "what was there before is no news");
    }

    #[test]
    fn only_what_gets_worse_is_an_alarm() {
        let order = [Level::Ok, Level::Stale, Level::Advisory, Level::Warning, Level::Critical].map(rank);
        assert_eq!(order, [0, 0, 0, 1, 2]);
    }
}
