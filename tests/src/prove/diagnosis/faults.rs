//! The tables of faults: how many were found, how fast, and each of them.

use std::collections::BTreeMap;

use super::causes::CLASSES;
use super::judged::{Judged, with_label};
use super::outcome::{Alarm, Fault, Outcome};
use super::rates::{quantile_s, share};
use super::table::Form;

pub(super) const FOUND: Form = Form {
    title: "Faults found",
    about: "A fault is told when a check rises to a warning or to critical while the fault lasts. Its cause is named when one \
            of these checks is of the part that failed. Both shares stand with what they are at least (exact, 95 %). Delays \
            are in seconds after the fault began: half of the faults that were told were told within the first, nine in ten \
            within the second. Faults that the messages do not show at all are not counted.",
    columns: &[
        "flights",
        "autopilot",
        "faults",
        "told",
        "share",
        "at least",
        "cause named",
        "share",
        "at least",
        "median s",
        "9 of 10 within s",
    ],
};

pub(super) const BY_CLASS: Form = Form {
    title: "Faults by class",
    about: "The autopilot's own first text of severity warning or worse, for comparison: of how many faults it told, and how \
            often it or HUMS was first where both told.",
    columns: &[
        "flights",
        "class",
        "what it is",
        "faults",
        "told",
        "cause named",
        "median s",
        "autopilot told",
        "HUMS first",
        "autopilot first",
    ],
};

pub(super) const EACH: Form = Form {
    title: "Each fault",
    about: "Seconds after the fault: the first alarm, the first one that names the cause, and the autopilot's own first text of \
            severity warning or worse.",
    columns: &["flight", "vehicle", "class", "fault", "told", "cause named", "autopilot's own text"],
};

/// Faults that the messages show, with their flights.
fn shown(judged: &Judged) -> impl Iterator<Item = (&Outcome, &Fault)> {
    let faults = judged.outcomes.iter().filter_map(|one| Some((one, one.fault.as_ref()?)));
    faults.filter(|(_, fault)| fault.visible)
}

fn delays_s<'a>(faults: impl Iterator<Item = &'a Fault>) -> Vec<f64> {
    faults.filter_map(|fault| Some(fault.told.as_ref()?.at_s)).collect()
}

/// One row for each set and autopilot.
pub(super) fn found(sets: &[Judged]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for judged in with_label(sets, true) {
        let mut by_autopilot: BTreeMap<&str, Vec<&Fault>> = BTreeMap::new();
        for (one, fault) in shown(judged) {
            by_autopilot.entry(&one.autopilot).or_default().push(fault);
        }
        for (autopilot, faults) in by_autopilot {
            let all = faults.len() as u64;
            let told = faults.iter().filter(|fault| fault.told.is_some()).count() as u64;
            let named = faults.iter().filter(|fault| fault.named.is_some()).count() as u64;
            let delays_s = delays_s(faults.into_iter());
            let mut row = vec![judged.name.clone(), autopilot.to_owned(), all.to_string(), told.to_string()];
            row.extend(share(told, all));
            row.push(named.to_string());
            row.extend(share(named, all));
            row.extend([quantile_s(&delays_s, 0.5), quantile_s(&delays_s, 0.9)]);
            rows.push(row);
        }
    }
    rows
}

/// One row for each set and class.
pub(super) fn by_class(sets: &[Judged]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for judged in with_label(sets, true) {
        for class in CLASSES {
            let faults: Vec<&Fault> =
                shown(judged).filter(|(one, _)| one.class == class.name).map(|(_, fault)| fault).collect();
            if faults.is_empty() {
                continue;
            }
            let count =
                |is: &dyn Fn(&Fault) -> bool| faults.iter().filter(|fault| is(fault)).count().to_string();
            let both = |fault: &Fault| Some((fault.told.as_ref()?.at_s, fault.autopilot.as_ref()?.0));
            rows.push(vec![
                judged.name.clone(),
                class.name.to_owned(),
                class.about.to_owned(),
                faults.len().to_string(),
                count(&|fault| fault.told.is_some()),
                count(&|fault| fault.named.is_some()),
                quantile_s(&delays_s(faults.iter().copied()), 0.5),
                count(&|fault| fault.autopilot.is_some()),
                count(&|fault| both(fault).is_some_and(|(ours_s, theirs_s)| ours_s <= theirs_s)),
                count(&|fault| both(fault).is_some_and(|(ours_s, theirs_s)| ours_s > theirs_s)),
            ]);
        }
    }
    rows
}

/// One row for each fault.
pub(super) fn each(sets: &[Judged]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for one in with_label(sets, true).flat_map(|judged| &judged.outcomes) {
        let Some(fault) = &one.fault else { continue };
        let nothing = if fault.visible { "**nothing**" } else { "nothing (the messages do not show it)" };
        let said = fault.autopilot.as_ref();
        rows.push(vec![
            stem(&one.file).to_owned(),
            one.vehicle.clone(),
            one.class.to_owned(),
            one.what.clone(),
            fault.told.as_ref().map_or_else(|| nothing.to_owned(), alarm),
            fault.named.as_ref().map_or_else(|| "-".to_owned(), alarm),
            said.map_or_else(|| "-".to_owned(), |(delay_s, text)| format!("{delay_s:+.1} {}", text.trim())),
        ]);
    }
    rows
}

/// What no check told: the set, the class, and the faults.
pub(super) fn missed(sets: &[Judged]) -> Vec<String> {
    let mut missed: BTreeMap<(&str, &str), Vec<String>> = BTreeMap::new();
    for judged in with_label(sets, true) {
        for one in &judged.outcomes {
            if let Some(fault) = one.fault.as_ref().filter(|fault| fault.told.is_none()) {
                let why = if fault.visible { "" } else { ", the messages do not show it" };
                let fault = format!("{} ({}{why})", one.what, stem(&one.file));
                missed.entry((&judged.name, one.class)).or_default().push(fault);
            }
        }
    }
    missed
        .into_iter()
        .map(|((set, class), faults)| format!("* {set}, {class}: {}", faults.join("; ")))
        .collect()
}

fn alarm(alarm: &Alarm) -> String {
    format!("{:+.1} {} {}", alarm.at_s, alarm.check, alarm.level.name())
}

/// A file's name without its ending.
pub(super) fn stem(file: &str) -> &str {
    file.split_once(".tlog").map_or(file, |(stem, _)| stem)
}
