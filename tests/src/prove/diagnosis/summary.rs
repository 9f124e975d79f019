//! Main figures: of flights that were new when the limits were chosen, if any.

use std::fmt::Write as _;

use hums_core::health::Level;

use super::judged::Judged;
use super::options::Known;
use super::outcome::{Fault, Outcome, count};
use super::rates::{an_hour, hours, quantile_s, share};

/// The section's heading.
pub(super) const TITLE: &str = "## In short";

pub(super) fn section(sets: &[Judged]) -> String {
    let labelled = |known| {
        let of_it = sets.iter().filter(move |set| set.is_labelled && set.known == known);
        (of_it.flat_map(|set| &set.outcomes).collect::<Vec<&Outcome>>(), words(known))
    };
    let best = |is_enough: fn(&[&Outcome]) -> bool| {
        Some(labelled(Known::No))
            .filter(|(flights, _)| is_enough(flights))
            .unwrap_or_else(|| labelled(Known::Yes))
    };
    let (faulty, who) = best(|flights| flights.iter().any(|one| one.fault.is_some()));
    let (quiet, whose) = best(|flights| !flights.is_empty());
    let further: Vec<&Outcome> =
        sets.iter().filter(|set| !set.is_labelled).flat_map(|set| &set.outcomes).collect();
    let mut text = format!("{TITLE}\n\n* Simulator flights, {who}: {}", found(&faulty));
    let _ = write!(text, "* Simulator flights, {whose}, while nothing was wrong: {}", alarms(&quiet));
    if !further.is_empty() {
        let words =
            "Recordings without labels (some from simulators of other people), where an alarm may be true";
        let _ = write!(text, "* {words}: {}", alarms(&further));
    }
    text
}

const fn words(known: Known) -> &'static str {
    match known {
        Known::No => "not known",
        Known::Yes | Known::Seen => "known",
    }
}

fn found(flights: &[&Outcome]) -> String {
    let faults: Vec<&Fault> =
        flights.iter().filter_map(|one| one.fault.as_ref()).filter(|fault| fault.visible).collect();
    let delays_s: Vec<f64> =
        faults.iter().filter_map(|fault| fault.told.as_ref()).map(|alarm| alarm.at_s).collect();
    let named = faults.iter().filter(|fault| fault.named.is_some()).count() as u64;
    let (all, told) = (faults.len() as u64, delays_s.len() as u64);
    let [told_share, told_least] = share(told, all);
    let [named_share, named_least] = share(named, all);
    format!(
        "{told} of {all} faults were reported ({told_share}, at least {told_least}), half of these within {} s and nine in ten \
         within {} s. The cause of {named} was named ({named_share}, at least {named_least}).\n",
        quantile_s(&delays_s, 0.5),
        quantile_s(&delays_s, 0.9),
    )
}

fn alarms(flights: &[&Outcome]) -> String {
    let air_s = flights.iter().fold(0.0, |sum, one| sum + one.air_s);
    let words = |level, name: &str| {
        let events = count(flights.iter().flat_map(|one| &one.alarms), level, true);
        let [rate, most] = an_hour(events, air_s);
        format!("{events} {name} ({rate} an hour, at most {most})")
    };
    format!(
        "in {} hours in the air {} and {}.\n",
        hours(air_s),
        words(Level::Warning, "warnings"),
        words(Level::Critical, "criticals")
    )
}
