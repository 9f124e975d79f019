//! A pilot gets at most three texts about one event, critical ones at once.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use hums_core::health::{self, Level, Subsystem};
use hums_core::parameters::Params;
use hums_link::packet::Fields;
use hums_link::vocabulary;
use hums_tests::flights::{self, OWN, own, root};
use rayon::prelude::*;

use super::budget::power_on;

const EVENT_S: f64 = 10.0;
const TEXTS_MAX: usize = 3;
/// Three that are not critical, and the critical ones: in the worst flight vibration and the autopilot's failsafe.
const AT_A_TIME_MAX: usize = 5;

/// Waits only for the line: 80 bytes after 250 take 60 ms at 57,600 baud. The time of a text is known to [`LOOK_US`].
const LATE_MAX_S: f64 = 0.25;
const LOOK_US: u64 = 100_000;

#[derive(Debug)]
struct Said {
    at_s: f64,
    severity: u8,
    text: String,
}

fn listen(recording: &Path) -> (Vec<Said>, Vec<f64>) {
    let (outcome, sent) = power_on(recording, &Params::defaults(), LOOK_US, |_| Vec::new());
    let texts = sent.iter().filter(|sent| sent.frame().id() == 253 && sent.frame().component() == 191);
    let said = texts.map(|sent| {
        let frame = sent.frame();
        let fields = Fields(frame.payload());
        let text = fields.text(1, 50).unwrap().to_owned();
        Said { at_s: sent.at_us as f64 / 1e6, severity: fields.u8(0), text }
    });
    let critical = outcome.findings.into_iter().filter(|finding| finding.level == Level::Critical);
    (said.collect(), critical.map(|finding| finding.at.as_secs_f64()).collect())
}

/// Attitude belongs to the motors.
fn family(text: &str) -> Subsystem {
    let words = text.strip_prefix("HUMS: ").unwrap_or(text);
    let words = ["over: ", "cause: "].iter().find_map(|begin| words.strip_prefix(begin)).unwrap_or(words);
    if ["down at", "mishap over", "it flies again"].iter().any(|begin| words.starts_with(begin)) {
        return Subsystem::Mishap;
    }
    let fits = |name: &str| {
        let said = vocabulary::said(name).unwrap();
        if let Some(silent) = words.strip_prefix("no data: ") {
            return silent.starts_with(&said.name_of(0).to_string())
                || (1..9).any(|n| silent == said.name_of(n).to_string());
        }
        let alarm = said.alarm.split('|').next().unwrap();
        let (before, after) = alarm.split_once('#').unwrap_or((alarm, ""));
        words.starts_with(before) && words.contains(after)
    };
    let found = health::checks().filter(|check| fits(check.name));
    let longest = found.max_by_key(|check| vocabulary::said(check.name).unwrap().alarm.len());
    match longest.unwrap_or_else(|| panic!("of which check is {text}?")).subsystem {
        Subsystem::Attitude => Subsystem::Propulsion,
        part => part,
    }
}

fn events(said: &[Said]) -> Vec<Vec<&Said>> {
    let mut running: BTreeMap<u8, Vec<&Said>> = BTreeMap::new();
    let mut over = Vec::new();
    for one in said {
        let family = family(&one.text);
        let event = running.entry(family as u8).or_default();
        // Until its end, or until the vehicle is down.
        let ends = |one: &&Said| one.text.contains("mishap over") || one.text.starts_with("HUMS: down at");
        let goes_on = event.first().is_some_and(|first| {
            family == Subsystem::Mishap && !event.iter().any(ends) || one.at_s - first.at_s < EVENT_S
        });
        if !goes_on {
            over.push(std::mem::take(event));
        }
        event.push(one);
    }
    over.into_iter().chain(running.into_values()).filter(|event| !event.is_empty()).collect()
}

fn recordings() -> Vec<PathBuf> {
    let folders = ["tests/labelled", "tests/labelled/px4"].map(|folder| root().join(folder));
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).unwrap());
    let labelled = files
        .map(|file| file.unwrap().path())
        .filter(|path| path.to_str().is_some_and(|path| path.ends_with(".tlog.gz")));
    let mut all: Vec<_> = labelled.chain(OWN.map(own)).chain(flights::more()).collect();
    all.sort();
    all
}

#[test]
fn one_event_is_three_texts_at_most_and_what_is_critical_is_told_at_once() {
    let heard: Vec<_> = recordings().into_par_iter().map(|path| (listen(&path), path)).collect();
    let mut histogram: BTreeMap<usize, usize> = BTreeMap::new();
    let mut texts = 0;
    for ((said, critical), path) in &heard {
        let name = path.display();
        texts += said.len();
        for event in events(said) {
            *histogram.entry(event.len()).or_default() += 1;
            let causes = event.iter().filter(|one| one.text.starts_with("HUMS: cause: ")).count();
            assert!(event.len() <= TEXTS_MAX + causes, "{name}: {event:#?}");
        }
        for one in said {
            let span = one.at_s..one.at_s + EVENT_S;
            let together: Vec<_> = said.iter().filter(|other| span.contains(&other.at_s)).collect();
            assert!(together.len() <= AT_A_TIME_MAX, "{name}: {together:#?}");
        }
        // No check sends these two.
        let is_checks = |text: &str| {
            !["HUMS: down at", "HUMS: it flies again"].iter().any(|begin| text.starts_with(begin))
        };
        for one in said.iter().filter(|one| one.severity == 2 && is_checks(&one.text)) {
            let late = |found_s: &f64| (-0.01..LATE_MAX_S).contains(&(one.at_s - found_s));
            assert!(critical.iter().any(late), "{name}: {one:?} is late: {critical:?}");
        }
    }
    println!("{} recordings, {texts} texts; events by their texts: {histogram:?}", heard.len());
}
