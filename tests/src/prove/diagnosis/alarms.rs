//! The tables of false alarms and of counts.

use std::collections::BTreeMap;

use hums_core::health::Level;

use super::faults::stem;
use super::judged::{Judged, with_label};
use super::outcome::{Counts, False, Outcome, count};
use super::rates::{an_hour, hours};
use super::table::Form;

pub(super) const FALSE: Form = Form {
    title: "False alarms",
    about: "Alarms while nothing was wrong: in flights without a fault, in weather that the autopilot holds against, and before \
            the fault of the others. Each rise to a warning and each rise to critical is one alarm, as a pilot hears it. In the air \
            counts until three seconds after a landing. Rates are by the hour in the air, with what they are at most (exact \
            Poisson bound, 95 %).",
    columns: &[
        "flights",
        "vehicle",
        "hours in the air",
        "warnings",
        "an hour",
        "at most",
        "critical",
        "an hour",
        "at most",
        "hours on the ground",
        "warnings there",
        "critical there",
    ],
};

pub(super) const BY_CHECK: Form = Form {
    title: "False alarms by check",
    about: "The same alarms, by the check that gave them and the vehicle.",
    columns: &["flights", "check", "vehicle", "warnings", "critical", "on the ground", "recordings with one"],
};

pub(super) const COUNTS: Form = Form {
    title: "Flights, landings, mishaps",
    about: "What the odometer counted, against what is known from the recordings without it. A crash is a mishap and no landing. A \
            vehicle that is in the air at the end of its recording has not landed.",
    columns: &[
        "flights",
        "recordings",
        "flights: true",
        "counted",
        "landings: true",
        "counted",
        "mishaps: true",
        "counted",
    ],
};

pub(super) const UNLABELLED: Form = Form {
    title: "Recordings without labels",
    about: "Nobody knows what was wrong in these, so an alarm there may be true. They tell how often the box speaks up. Most are \
            logs of ground stations: what tells of the monitor's own wire is not judged in them.",
    columns: FALSE.columns,
};

pub(super) const UNLABELLED_BY_CHECK: Form = Form {
    title: "Recordings without labels, by check",
    about: "The same alarms, by the check that gave them and the vehicle.",
    columns: BY_CHECK.columns,
};

/// One row for each set and vehicle, and one for each autopilot of a set with several vehicles.
pub(super) fn by_vehicle(sets: &[Judged], labelled: bool) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for judged in with_label(sets, labelled) {
        let mut groups: BTreeMap<(String, String), Vec<&Outcome>> = BTreeMap::new();
        for one in &judged.outcomes {
            groups.entry((one.autopilot.clone(), one.vehicle.clone())).or_default().push(one);
            let all = format!("{}, all", one.autopilot);
            groups.entry((one.autopilot.clone(), all)).or_default().push(one);
        }
        for ((_, vehicle), outcomes) in groups {
            let alarms = || outcomes.iter().flat_map(|one| &one.alarms);
            let air_s = outcomes.iter().map(|one| one.air_s).sum::<f64>();
            let ground_s = outcomes.iter().map(|one| one.ground_s).sum::<f64>();
            let mut row = vec![judged.name.clone(), vehicle, hours(air_s)];
            for level in [Level::Warning, Level::Critical] {
                let events = count(alarms(), level, true);
                row.push(events.to_string());
                row.extend(an_hour(events, air_s));
            }
            row.push(hours(ground_s));
            row.extend(
                [Level::Warning, Level::Critical].map(|level| count(alarms(), level, false).to_string()),
            );
            rows.push(row);
        }
    }
    rows
}

/// One row for each set, check and vehicle, the most frequent first.
pub(super) fn by_check(sets: &[Judged], labelled: bool) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for judged in with_label(sets, labelled) {
        let mut groups: BTreeMap<(&str, &str), (Vec<&False>, u64)> = BTreeMap::new();
        for one in &judged.outcomes {
            let mut seen: Vec<&str> = Vec::new();
            for alarm in &one.alarms {
                let check = alarm.alarm.check.as_str();
                let group = groups.entry((check, &one.vehicle)).or_default();
                group.0.push(alarm);
                group.1 += u64::from(!seen.contains(&check));
                seen.push(check);
            }
        }
        let mut groups: Vec<_> = groups.into_iter().collect();
        groups.sort_by_key(|(_, (alarms, _))| std::cmp::Reverse(alarms.len()));
        for ((check, vehicle), (alarms, recordings)) in groups {
            let in_air = |level| count(alarms.iter().copied(), level, true).to_string();
            let ground = alarms.iter().filter(|one| !one.in_air).count();
            rows.push(vec![
                judged.name.clone(),
                check.to_owned(),
                vehicle.to_owned(),
                in_air(Level::Warning),
                in_air(Level::Critical),
                ground.to_string(),
                recordings.to_string(),
            ]);
        }
    }
    rows
}

/// One row for each set.
pub(super) fn counts(sets: &[Judged]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for judged in with_label(sets, true) {
        let known: Vec<_> = judged.outcomes.iter().filter_map(|one| one.counts).collect();
        let sum = |of: &dyn Fn(&Counts) -> u64, which: &dyn Fn(&(Counts, Counts)) -> Counts| {
            known.iter().map(|pair| of(&which(pair))).sum::<u64>().to_string()
        };
        let mut row = vec![judged.name.clone(), known.len().to_string()];
        let each: [&dyn Fn(&Counts) -> u64; 3] = [&|it| it.flights, &|it| it.landings, &|it| it.mishaps];
        for of in each {
            row.extend([sum(of, &|pair| pair.0), sum(of, &|pair| pair.1)]);
        }
        rows.push(row);
    }
    rows
}

/// The recordings whose counts are wrong, a line for each.
pub(super) fn wrong_counts(sets: &[Judged]) -> Vec<String> {
    let mut lines = Vec::new();
    for one in with_label(sets, true).flat_map(|judged| &judged.outcomes) {
        let Some((truth, counted)) = one.counts.filter(|(truth, counted)| truth != counted) else { continue };
        let differs = [
            ("flights", truth.flights, counted.flights),
            ("landings", truth.landings, counted.landings),
            ("mishaps", truth.mishaps, counted.mishaps),
        ];
        let differs = differs.iter().filter(|(_, truth, counted)| truth != counted);
        let words: Vec<String> =
            differs.map(|(what, truth, counted)| format!("{what} {counted} instead of {truth}")).collect();
        lines.push(format!("* {} ({}): {}", stem(&one.file), one.vehicle, words.join(", ")));
    }
    lines
}
