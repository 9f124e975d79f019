//! `labels.json`: the truth about flights with deliberate faults.
//!
//! The file is a list with an object for each flight. Seconds count from the recording's first frame.
//!
//! | field | meaning |
//! |---|---|
//! | `file` | the recording, in the folder of `labels.json` |
//! | `vehicle` | autopilot first, frame last: `ArduCopter 4.6.3 quad` |
//! | `what` | what was done |
//! | `class` | the class of the fault: one of [`super::causes::CLASSES`] |
//! | `fault_s` | when the fault began; null where nothing was wrong in the whole flight |
//! | `end_s` | when the fault ended or the flight was over: nothing is counted after it |
//! | `visible` | whether the messages show the fault at all |
//! | `autopilot_texts` | what the autopilot said: second, `MAV_SEVERITY`, text |
//! | `flights` | from and to of each time in the air; with it, `landings` and `crashes_s` |
//! | `battery_low_s` | when the autopilot itself first called a battery low (null: never) |
//! | `past` | recordings, in the same folder, of the same vehicle's earlier flights: trends are judged against them |
//!
//! Without `flights`, the flight does not count for flights, landings and mishaps.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};
use hums_core::health::{Subsystem, checks};
use serde::Deserialize;

use super::causes;

/// A mishap within this time before and after a crash is that crash.
const CRASH_BEFORE_S: f64 = 3.0;
const CRASH_AFTER_S: f64 = 10.0;

pub(super) const FILE: &str = "labels.json";

#[derive(Clone, Debug, Deserialize)]
pub(super) struct Label {
    pub(super) file: String,
    pub(super) vehicle: String,
    pub(super) what: String,
    pub(super) class: String,
    pub(super) fault_s: Option<f64>,
    pub(super) end_s: f64,
    pub(super) visible: bool,
    #[serde(default)]
    pub(super) autopilot_texts: Vec<(f64, u8, String)>,
    pub(super) flights: Option<Vec<(f64, f64)>>,
    #[serde(default)]
    pub(super) landings: u64,
    #[serde(default)]
    pub(super) crashes_s: Vec<f64>,
    #[serde(default)]
    pub(super) battery_low_s: Option<f64>,
    #[serde(default)]
    pub(super) past: Vec<PathBuf>,
}

pub(super) fn read(folder: &Path) -> Result<Vec<Label>> {
    let path = folder.join(FILE);
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    let mut labels = parse(&text).with_context(|| path.display().to_string())?;
    for past in labels.iter_mut().flat_map(|label| &mut label.past) {
        *past = folder.join(&past);
    }
    Ok(labels)
}

fn parse(text: &str) -> Result<Vec<Label>> {
    let labels: Vec<Label> = serde_json::from_str(text)?;
    for label in &labels {
        label.check().with_context(|| format!("the entry of {}", label.file))?;
    }
    Ok(labels)
}

impl Label {
    fn check(&self) -> Result<()> {
        ensure!(!self.file.is_empty() && !self.file.contains(['/', '\\']), "file: a name without a folder");
        ensure!(causes::of(&self.class).is_some(), "class: {} is none of the known classes", self.class);
        ensure!(self.vehicle.contains(' '), "vehicle: the autopilot first and the frame last");
        ensure!(self.end_s > 0.0, "end_s: {} is not after the beginning", self.end_s);
        if let Some(fault_s) = self.fault_s {
            ensure!((0.0..self.end_s).contains(&fault_s), "fault_s: {fault_s} is not between 0 and end_s");
        }
        for (from_s, to_s) in self.flights.iter().flatten() {
            ensure!(*from_s >= 0.0 && to_s > from_s, "flights: {from_s} to {to_s} is no time");
        }
        Ok(())
    }

    /// A crash, or a low battery.
    pub(super) fn explains(&self, alarm: &str, at_s: f64) -> bool {
        let of =
            |subsystem: Subsystem| checks().any(|check| check.name == alarm && check.subsystem == subsystem);
        let crash = |crash_s: &f64| (crash_s - CRASH_BEFORE_S..crash_s + CRASH_AFTER_S).contains(&at_s);
        (self.crashes_s.iter().any(crash) && of(Subsystem::Mishap))
            || (self.battery_low_s.is_some_and(|low_s| at_s >= low_s) && of(Subsystem::Power))
    }

    /// The group without version and brackets: `ArduCopter quad`.
    pub(super) fn group(&self) -> String {
        let plain = self.vehicle.split('(').enumerate().map(|(place, part)| match part.split_once(')') {
            Some((_, rest)) if place > 0 => rest,
            _ => part,
        });
        let plain: String = plain.collect();
        let mut words = plain.split_whitespace();
        let first = words.next().unwrap_or_default();
        words.next_back().map_or_else(|| first.to_owned(), |last| format!("{first} {last}"))
    }

    /// `MAV_SEVERITY_WARNING` or worse: seconds after the fault, and the text.
    pub(super) fn autopilot_said(&self) -> Option<(f64, &str)> {
        const WARNING: u8 = 4;
        let fault_s = self.fault_s?;
        let after = |(at_s, severity, _): &&(f64, u8, String)| *severity <= WARNING && *at_s >= fault_s;
        let (at_s, _, text) = self.autopilot_texts.iter().find(after)?;
        Some((at_s - fault_s, text))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLIGHT: &str = r#"{"file": "f.tlog", "vehicle": "PX4 1.17 SIH quad", "what": "GPS dead", "class": "gnss",
        "armed_s": 3, "fault_s": 20.5, "end_s": 60, "visible": true,
        "autopilot_texts": [[10, 2, "before"], [21, 6, "for information"], [25.5, 4, "GPS lost"]]"#;

    #[test]
    fn a_flight_is_read_with_what_the_autopilot_said_of_its_fault() {
        let labels = parse(&format!("[{FLIGHT}}}]")).unwrap();
        let [label] = labels.as_slice() else { panic!("{labels:?}") };
        assert_eq!(label.group(), "PX4 quad");
        assert_eq!(label.autopilot_said(), Some((5.0, "GPS lost")));
        assert!(label.flights.is_none(), "no truth of its flights");
        let octa = FLIGHT.replace("PX4 1.17 SIH quad", "ArduCopter 4.7.0-dev (2025-10) octa (quad X8)");
        assert_eq!(parse(&format!("[{octa}}}]")).unwrap()[0].group(), "ArduCopter octa");
    }

    #[test]
    fn a_crash_and_a_battery_that_the_autopilot_calls_low_explain_their_alarms_and_no_others() {
        let text = FLIGHT.replace("20.5", "null");
        let known =
            format!("[{text}, \"flights\": [[5, 30]], \"crashes_s\": [30.0], \"battery_low_s\": 40.0}}]");
        let label = &parse(&known).unwrap()[0];
        for (check, at_s, explained) in [
            ("impact", 31.5, true),
            ("sinking", 28.0, true),
            ("impact", 20.0, false),
            ("impact", 45.0, false),
            ("roll", 31.0, false),
            ("batt_remaining", 41.0, true),
            ("batt_remaining", 39.0, false),
            ("baro_alert", 41.0, false),
        ] {
            assert_eq!(label.explains(check, at_s), explained, "{check} {at_s}");
        }
        assert!(!parse(&format!("[{text}}}]")).unwrap()[0].explains("impact", 31.5), "nothing is known");
    }

    #[test]
    fn what_cannot_be_is_refused_with_its_flight() {
        for (from, to) in [
            ("\"gnss\"", "\"gns\""),
            ("f.tlog", "../f.tlog"),
            ("20.5", "61"),
            ("\"armed_s\": 3", "\"flights\": [[9, 4]]"),
        ] {
            let text = format!("[{FLIGHT}}}]").replace(from, to);
            let error = format!("{:#}", parse(&text).unwrap_err());
            assert!(error.contains("f.tlog"), "{error}");
        }
    }
}
