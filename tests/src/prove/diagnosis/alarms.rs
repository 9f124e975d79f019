//! The table of false alarms, and wrong counts.

use std::collections::BTreeMap;

use hums_core::health::Level;

use super::faults::stem;
use super::judged::{Judged, with_label};
use super::outcome::{False, count};
use super::table::Form;

pub(super) const BY_CHECK: Form = Form {
    title: "False alarms by check",
    about: "Of all sets with labels. An alarm counts as in the air until three seconds after a landing.",
    columns: &["check", "warnings", "criticals", "on the ground", "recordings with one"],
};

pub(super) fn by_check(sets: &[Judged]) -> Vec<Vec<String>> {
    let mut groups: BTreeMap<&str, (Vec<&False>, u64)> = BTreeMap::new();
    for one in with_label(sets, true).flat_map(|judged| &judged.outcomes) {
        let mut seen: Vec<&str> = Vec::new();
        for alarm in &one.alarms {
            let check = alarm.alarm.check.as_str();
            let group = groups.entry(check).or_default();
            group.0.push(alarm);
            group.1 += u64::from(!seen.contains(&check));
            seen.push(check);
        }
    }
    let mut groups: Vec<_> = groups.into_iter().collect();
    groups.sort_by_key(|(_, (alarms, _))| std::cmp::Reverse(alarms.len()));
    let row = |(check, (alarms, recordings)): (&str, (Vec<&False>, u64))| {
        let in_air = |level| count(alarms.iter().copied(), level, true).to_string();
        let ground = alarms.iter().filter(|one| !one.in_air).count();
        let [warnings, criticals] = [Level::Warning, Level::Critical].map(in_air);
        vec![check.to_owned(), warnings, criticals, ground.to_string(), recordings.to_string()]
    };
    groups.into_iter().map(row).collect()
}

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
