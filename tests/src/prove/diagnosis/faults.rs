//! Faults: the share that was found, and the delays.

use hums_core::health::Level;

use super::causes::CLASSES;
use super::judged::{Judged, with_label};
use super::options::Known;
use super::outcome::{Alarm, Fault, Outcome, count};
use super::rates::{an_hour, hours, quantile_s, share};
use super::table::Form;

pub(super) const SETS: Form = Form {
    title: "Sets of flights",
    about: "Flights in simulators; the hours are simulated.",
    columns: &[
        "flights",
        "known",
        "recordings",
        "hours",
        "faults",
        "reported",
        "at least",
        "cause named",
        "at least",
        "median s",
        "9 of 10 within s",
        "false warnings",
        "an hour",
        "at most",
        "false criticals",
        "an hour",
        "at most",
    ],
};

pub(super) const BY_CLASS: Form = Form {
    title: "Faults by class",
    about: "Of all sets with labels. For comparison: the autopilot's own first text of severity warning or worse.",
    columns: &[
        "class",
        "parts",
        "faults",
        "reported",
        "cause named",
        "median s",
        "autopilot reported",
        "HUMS first",
        "autopilot first",
    ],
};

pub(super) const EACH: Form = Form {
    title: "Each fault",
    about: "Seconds after the fault: the first alarm, the first one that names the cause, and the autopilot's own first text of \
            severity warning or worse.",
    columns: &["flight", "vehicle", "class", "fault", "reported", "cause named", "autopilot's own text"],
};

fn shown(judged: &Judged) -> impl Iterator<Item = (&Outcome, &Fault)> {
    let faults = judged.outcomes.iter().filter_map(|one| Some((one, one.fault.as_ref()?)));
    faults.filter(|(_, fault)| fault.visible)
}

fn delays_s<'a>(faults: impl Iterator<Item = &'a Fault>) -> Vec<f64> {
    faults.filter_map(|fault| Some(fault.told.as_ref()?.at_s)).collect()
}

pub(super) fn sets(sets: &[Judged]) -> Vec<Vec<String>> {
    let row = |judged: &Judged| {
        let faults: Vec<&Fault> = shown(judged).map(|(_, fault)| fault).collect();
        let air_s = judged.outcomes.iter().map(|one| one.air_s).sum::<f64>();
        let known = match judged.known {
            Known::Yes => "yes",
            Known::No => "no",
            Known::Seen => "findings seen",
        };
        let counts = [judged.outcomes.len().to_string(), hours(air_s), faults.len().to_string()];
        let mut row = vec![judged.name.clone(), known.to_owned()];
        row.extend(counts);
        let is_so: [fn(&Fault) -> bool; 2] = [|fault| fault.told.is_some(), |fault| fault.named.is_some()];
        for is_so in is_so {
            let count = faults.iter().filter(|fault| is_so(fault)).count() as u64;
            let [_, least] = share(count, faults.len() as u64);
            row.extend([count.to_string(), least]);
        }
        let delays_s = delays_s(faults.into_iter());
        row.extend([quantile_s(&delays_s, 0.5), quantile_s(&delays_s, 0.9)]);
        for level in [Level::Warning, Level::Critical] {
            let events = count(judged.outcomes.iter().flat_map(|one| &one.alarms), level, true);
            row.push(events.to_string());
            row.extend(an_hour(events, air_s));
        }
        row
    };
    with_label(sets, true).map(row).collect()
}

pub(super) fn by_class(sets: &[Judged]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for class in CLASSES {
        let of_class = with_label(sets, true).flat_map(shown).filter(|(one, _)| one.class == class.name);
        let faults: Vec<&Fault> = of_class.map(|(_, fault)| fault).collect();
        if faults.is_empty() {
            continue;
        }
        let count = |is: &dyn Fn(&Fault) -> bool| faults.iter().filter(|fault| is(fault)).count().to_string();
        let both = |fault: &Fault| Some((fault.told.as_ref()?.at_s, fault.autopilot.as_ref()?.0));
        rows.push(vec![
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
    rows
}

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

fn alarm(alarm: &Alarm) -> String {
    format!("{:+.1} {} {}", alarm.at_s, alarm.check, alarm.level.name())
}

pub(super) fn stem(file: &str) -> &str {
    file.split_once(".tlog").map_or(file, |(stem, _)| stem)
}
