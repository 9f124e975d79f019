//! Foreign recordings: the share of true alarms, and each of them.

use std::collections::BTreeMap;

use hums_core::health::Level;

use super::judged::{Judged, with_label};
use super::outcome::{Outcome, count};
use super::rates::{an_hour, hours};
use super::table::Form;
use super::verdicts::{Flown, Verdict};

pub(super) const BY_HAND: Form = Form {
    title: "Recordings of other people, judged by hand",
    about: "Alarms in the air of recordings without labels, judged by those who chose the limits. An alarm is true if the vehicle \
            crashed or was about to, if the autopilot says the same, or if a value is beyond the limit of the autopilot's makers. \
            Rates are of false alarms.",
    columns: &[
        "flown by",
        "recordings",
        "hours in the air",
        "warnings: true",
        "false",
        "not known",
        "false an hour",
        "at most",
        "critical: true",
        "false",
        "not known",
        "false an hour",
        "at most",
    ],
};

pub(super) const EACH_BY_HAND: Form = Form {
    title: "Each of them",
    about: "By recording and check, in the air and on the ground: how often the level rose, since when (seconds after the \
            recording's first frame), and why that was true or false.",
    columns: &["recording", "check", "warnings", "critical", "first at s", "verdict", "why"],
};

fn recordings(sets: &[Judged]) -> impl Iterator<Item = &Outcome> {
    with_label(sets, false).flat_map(|judged| &judged.outcomes)
}

fn flown(outcome: &Outcome) -> &'static str {
    match outcome.by_hand.as_ref().map(|known| known.flown) {
        Some(Flown::Vehicle) => "a vehicle",
        Some(Flown::Simulator) => "somebody's simulator",
        None => "not judged by hand",
    }
}

pub(super) fn is_vehicle(outcome: &Outcome) -> bool {
    outcome.by_hand.as_ref().is_some_and(|known| known.flown == Flown::Vehicle)
}

fn judged_so(outcomes: &[&Outcome], level: Level, wanted: Verdict) -> u64 {
    let alarms = outcomes
        .iter()
        .flat_map(|one| one.alarms.iter().filter(move |alarm| verdict(one, &alarm.alarm.check) == wanted));
    count(alarms, level, true)
}

pub(super) fn alarms(outcomes: &[&Outcome]) -> String {
    let air_s = outcomes.iter().map(|one| one.air_s).sum::<f64>();
    let words = |level, name: &str| {
        let [was_true, was_false, unknown] = Verdict::ALL.map(|wanted| judged_so(outcomes, level, wanted));
        let [rate, most] = an_hour(was_false, air_s);
        format!(
            "{was_false} false {name} ({rate} an hour, at most {most}), {was_true} true and {unknown} not known"
        )
    };
    let (warnings, criticals) = (words(Level::Warning, "warnings"), words(Level::Critical, "criticals"));
    format!("in {} hours in the air {warnings}; {criticals}.\n", hours(air_s))
}

fn verdict(outcome: &Outcome, check: &str) -> Verdict {
    outcome.by_hand.as_ref().map_or(Verdict::Unknown, |known| known.of(check).0)
}

pub(super) fn rows(sets: &[Judged]) -> Vec<Vec<String>> {
    let mut groups: BTreeMap<&str, Vec<&Outcome>> = BTreeMap::new();
    for one in recordings(sets) {
        groups.entry(flown(one)).or_default().push(one);
    }
    let mut rows = Vec::new();
    for (flown, outcomes) in groups {
        let air_s = outcomes.iter().map(|one| one.air_s).sum::<f64>();
        let mut row = vec![flown.to_owned(), outcomes.len().to_string(), hours(air_s)];
        for level in [Level::Warning, Level::Critical] {
            let of = |wanted| judged_so(&outcomes, level, wanted);
            row.extend(Verdict::ALL.map(|wanted| of(wanted).to_string()));
            row.extend(an_hour(of(Verdict::False), air_s));
        }
        rows.push(row);
    }
    rows
}

pub(super) fn each(sets: &[Judged]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for one in recordings(sets) {
        let mut checks: Vec<&str> = one.alarms.iter().map(|alarm| alarm.alarm.check.as_str()).collect();
        checks.dedup();
        let mut seen = Vec::new();
        for check in checks {
            if seen.contains(&check) {
                continue;
            }
            seen.push(check);
            let mine = || one.alarms.iter().filter(|alarm| alarm.alarm.check == check);
            let times = |level| mine().filter(|alarm| alarm.alarm.level == level).count().to_string();
            let first_s = mine().map(|alarm| alarm.alarm.at_s).fold(f64::INFINITY, f64::min);
            let why = one.by_hand.as_ref().map_or("", |known| known.of(check).1);
            rows.push(vec![
                one.file.clone(),
                check.to_owned(),
                times(Level::Warning),
                times(Level::Critical),
                format!("{first_s:.1}"),
                verdict(one, check).name().to_owned(),
                why.to_owned(),
            ]);
        }
    }
    rows
}
