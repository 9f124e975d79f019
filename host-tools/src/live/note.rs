//! What stands in the list of notes: findings, texts, events.

use hums_core::happening::Happening;
use hums_core::health::Finding;
use hums_core::time::Instant;
use hums_link::encode::COMPONENT;
use hums_link::summary;
use serde::Serialize;

use crate::statustext::Text;

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
}

impl Note {
    /// A finding of the checks here.
    pub fn finding(finding: &Finding) -> Self {
        Self {
            at_s: finding.at.as_secs_f64(),
            kind: "finding",
            level: finding.level.name(),
            from: "here".to_owned(),
            subsystem: finding.subsystem.name(),
            words: words(finding),
        }
    }

    /// What a component said; a HUMS on board says findings.
    pub fn text(text: Text) -> Self {
        let ours = text.source.component == COMPONENT && text.words.starts_with(OURS);
        let from = match text.source.component {
            COMPONENT if ours => "on board".to_owned(),
            1 => "autopilot".to_owned(),
            other => format!("component {other}"),
        };
        let words = if ours { text.words.trim_start_matches(OURS).to_owned() } else { text.words };
        let level = match text.severity {
            0..=2 => "critical",
            3 | 4 => "warning",
            5 => "advisory",
            _ => "ok",
        };
        let kind = if ours { "finding" } else { "text" };
        Self { at_s: text.at.as_secs_f64(), kind, level, from, subsystem: "", words }
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
        })
    }
}

/// A finding in words.
pub fn words(finding: &Finding) -> String {
    summary::text(finding).as_str().trim_start_matches(OURS).to_owned()
}
