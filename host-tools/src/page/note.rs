//! What stands in the list of a page: findings, texts, events.

use hums_core::happening::Happening;
use hums_core::health::{Finding, vocabulary};
use hums_core::time::Instant;
use hums_link::encode::COMPONENT;
use serde::Serialize;

use crate::names::check_name;
use crate::states::{Shown, shown};
use crate::statustext::Text;
use crate::summary::FindingLine;

/// What a finding of a HUMS begins with.
const OURS: &str = "HUMS: ";

/// Something that was found, said, or happened.
#[derive(Clone, Debug, Serialize)]
pub struct Note {
    /// Seconds since the first byte.
    pub at_s: f64,
    /// `finding`, `text` or `event`.
    pub kind: &'static str,
    /// A level's name; of a text, by its severity.
    pub level: &'static str,
    /// Who says it: `here` (these checks), `on board` (a HUMS on the vehicle), `autopilot`, `component 42`.
    pub from: String,
    /// The subsystem, for findings.
    pub subsystem: &'static str,
    /// In words: text of the world, never markup.
    pub words: String,
    /// More of a finding of a check.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<Found>,
}

/// What a check found.
#[derive(Clone, Debug, Serialize)]
pub struct Found {
    /// The check's stable name.
    pub check: String,
    /// The level before.
    pub previous: &'static str,
    /// What decided; `null` where the input stopped, and where it is no quantity.
    pub value: Option<f32>,
    /// The state that the value is, where it is no quantity.
    pub state: Option<&'static str>,
    /// What it crossed.
    pub limit: Option<f32>,
    /// The unit of both, as people write it.
    pub unit: String,
    /// What is so, as a sentence.
    pub meaning: &'static str,
    /// What to do, as a sentence.
    pub action: &'static str,
    /// What explains it: another check; `null` where nothing does.
    pub because: Option<Cause>,
}

/// A check that explains a finding of another one.
#[derive(Clone, Debug, Serialize)]
pub struct Cause {
    /// Its stable name.
    check: String,
    /// Its name for people.
    words: String,
}

impl Cause {
    /// Of the check of this name.
    fn of(check: &str) -> Self {
        let words =
            vocabulary(check).map_or_else(|| check_name(check, 0), |known| known.said.name.to_owned());
        Self { check: check.to_owned(), words }
    }
}

/// A unit as people write it; logs and programs have it in ASCII.
fn written(unit: &str) -> &str {
    match unit {
        "degC" => "\u{b0}C",
        "deg" => "\u{b0}",
        "deg/s" => "\u{b0}/s",
        "m/s2" => "m/s\u{b2}",
        "1/min" => "rpm",
        other => other,
    }
}

impl Note {
    /// A finding of a check, and the check that explains it.
    pub fn found(finding: &FindingLine, because: Option<&str>) -> Self {
        let known = vocabulary(&finding.check);
        let mut words = check_name(&finding.check, finding.instance);
        if finding.is_unjudged() {
            words = format!("{words}: {}", FindingLine::UNJUDGED);
        }
        let is_worry = matches!(finding.level, "warning" | "critical");
        let (state, value, limit) = match shown(&finding.check, finding.value, finding.limit) {
            Shown::State(state) => (state, None, None),
            Shown::Quantity(value, limit) => (None, value, limit),
        };
        Self {
            at_s: finding.at.as_secs_f64(),
            kind: "finding",
            level: finding.level,
            from: "here".to_owned(),
            subsystem: finding.subsystem,
            words,
            found: Some(Found {
                check: finding.check.clone(),
                previous: finding.previous,
                value,
                state,
                limit,
                unit: written(&finding.unit).to_owned(),
                meaning: known.filter(|_| is_worry).map_or("", |known| known.meaning),
                action: known.filter(|_| is_worry).map_or("", |known| known.action),
                because: because.map(Cause::of),
            }),
        }
    }

    /// A finding of the checks here.
    pub fn finding(finding: &Finding) -> Self {
        let line = FindingLine {
            at: finding.at,
            subsystem: finding.subsystem.name(),
            check: finding.check.to_owned(),
            instance: finding.instance,
            level: finding.level.name(),
            previous: finding.previous.name(),
            value: finding.value,
            limit: finding.limit,
            unit: finding.unit.to_owned(),
        };
        Self::found(&line, Some(finding.because).filter(|because| !because.is_empty()))
    }

    /// What a component said; a HUMS on board says findings.
    pub fn text(text: Text) -> Self {
        let ours = text.source.component == COMPONENT && text.words.starts_with(OURS);
        let from = match text.source.component {
            COMPONENT if ours => "on board".to_owned(),
            1 => "autopilot".to_owned(),
            other => format!("component {other}"),
        };
        let level = text.level();
        let words = if ours { text.words.trim_start_matches(OURS).to_owned() } else { text.words };
        let kind = if ours { "finding" } else { "text" };
        Self { at_s: text.at.as_secs_f64(), kind, level, from, subsystem: "", words, found: None }
    }

    /// What a pilot wants to see on the time line; `None` for all else that happens.
    pub fn event(now: Instant, happening: Happening) -> Option<Self> {
        let words = match happening {
            Happening::Armed => "armed",
            Happening::Disarmed => "disarmed",
            Happening::TakeOff => "take-off",
            Happening::Landing => "landing",
            Happening::AutopilotReboot => "the autopilot has rebooted",
            _ => return None,
        };
        Some(Self {
            at_s: now.as_secs_f64(),
            kind: "event",
            level: "ok",
            from: "here".to_owned(),
            subsystem: "",
            words: words.to_owned(),
            found: None,
        })
    }
}
