//! Entries in the list of a page: findings, texts, events.

use hums_core::clock::Instant;
use hums_core::happening::Happening;
use hums_core::health::{Finding, instances};
use hums_core::observation::{Feeds, MOTORS_MAX};
use hums_formats::trend_words::WORDS;
use hums_link::encode::COMPONENT;
use hums_link::vocabulary::{RadioWords, VOCABULARY};
use serde::Serialize;

use crate::names::{check_name, unit_name, vocabulary};
use crate::part;
use crate::source::told;
use crate::states::{ShownValue, meaning, measured, shown};
use crate::statustext::StatusText;

const OURS: &str = "HUMS: ";

/// The note on a battery with an unknown cell count.
pub const CELLS_UNKNOWN: &str = "cells not known: the battery's voltage raises no alarm; set BAT_CELLS";

/// A finding, text or event.
#[derive(Clone, Debug, Serialize)]
pub struct Note {
    /// Seconds since the first byte.
    pub at_s: f64,
    /// `finding`, `text` or `event`.
    pub kind: &'static str,
    /// A level's name; of a text, by its severity.
    pub level: &'static str,
    /// Its source: `here` (these checks), `on board` (a HUMS on the vehicle), `autopilot`, `component 42`.
    pub from: String,
    /// The subsystem, for findings.
    pub subsystem: &'static str,
    /// In words: text of the world, never markup.
    pub words: String,
    /// More of a finding of a check.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub found: Option<FindingNote>,
}

/// A finding of a check.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FindingNote {
    /// The check's stable name.
    pub check: String,
    /// Which one of several, from 0.
    pub instance: u8,
    /// The level before.
    pub previous: &'static str,
    /// The check no longer applies; a return to normal is not known.
    pub ended: bool,
    /// The deciding value; `null` if the input stopped, and for a state.
    pub value: Option<f32>,
    /// The state in the value, if it is not a quantity.
    pub state: Option<&'static str>,
    /// The limit it crossed.
    pub limit: Option<f32>,
    /// The unit of both, as people write it.
    pub unit: String,
    /// State or values with their limit, and the level before, in words.
    pub measured: String,
    /// Its meaning, as a sentence.
    pub meaning: &'static str,
    /// The recommended action, as a sentence.
    pub action: &'static str,
    /// Its cause: another check; `null` without one.
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
    fn of(check: &str) -> Self {
        Self { check: check.to_owned(), words: check_name(check, &[]) }
    }
}

/// A box sends three texts in half a minute at most, and a warning at the end of its event.
const AGAIN_S: f64 = 45.0;
const OVER: &str = "over: ";
const CAUSE: &str = "cause: ";

fn told_check(words: &str) -> Option<(&'static str, u8)> {
    let silent = words.strip_prefix("no data: ");
    let words = words.strip_prefix(OVER).or_else(|| words.strip_prefix(CAUSE)).unwrap_or(words);
    let parts = |said: &RadioWords| match instances(said.check) {
        // A trend that a box judged itself.
        0 if said.part.is_empty() => 1,
        0 => MOTORS_MAX as u8,
        parts => parts,
    };
    let each = VOCABULARY
        .iter()
        .chain(&WORDS)
        .flat_map(|words| (0..parts(&words.said)).map(move |part| (words.said, part)));
    let told = each.filter_map(|(said, part)| {
        let rest = match silent {
            Some(silent) => silent.strip_prefix(said.name_of(part).to_string().as_str()),
            None => FEEDS
                .iter()
                .find_map(|feeds| words.strip_prefix(said.alarm_of(part, *feeds).to_string().as_str())),
        }?;
        (rest.is_empty() || rest.starts_with([':', ','])).then_some((rest.len(), (said.check, part)))
    });
    // The longest words that fit; of two scales of one fault the first.
    told.min_by_key(|(rest, _)| *rest).map(|(_, check)| check)
}

const FEEDS: [Feeds; 3] = [Feeds::Vehicle, Feeds::Avionics, Feeds::Payload];

impl Note {
    /// A finding of a check, and the check that explains it.
    pub fn found(finding: &told::Finding, because: Option<&str>) -> Self {
        let known = vocabulary(&finding.check);
        let is_worry = finding.is_bad();
        let (state, value, limit) = match shown(&finding.check, finding.value, finding.limit) {
            ShownValue::State(state) => (state, None, None),
            ShownValue::Quantity(value, limit) => (None, value, limit),
        };
        Self {
            at_s: finding.at.as_secs_f64(),
            kind: "finding",
            level: finding.level.name(),
            from: "here".to_owned(),
            subsystem: finding.subsystem.name(),
            words: finding.name(),
            found: Some(FindingNote {
                check: finding.check.clone(),
                instance: finding.instance,
                previous: finding.previous.name(),
                ended: finding.is_unjudged(),
                value,
                state,
                limit,
                unit: unit_name(&finding.unit).to_owned(),
                measured: format!("{}, was {}", measured(finding), finding.previous.name())
                    .trim_start_matches(", ")
                    .to_owned(),
                meaning: if is_worry { meaning(&finding.check) } else { "" },
                action: known.filter(|_| is_worry).map_or("", |known| known.action),
                because: because.map(Cause::of),
            }),
        }
    }

    /// With the part that is due, if it reports one.
    #[must_use]
    pub fn of_part(self, due: Option<&(String, Option<String>)>) -> Self {
        let Some(due) = due else { return self };
        Self { words: format!("{}: {}", self.words, part::due_words(due)), ..self }
    }

    /// A finding that a box recorded.
    pub fn told(finding: &told::Finding) -> Self {
        Self { from: "on board".to_owned(), ..Self::found(finding, None) }
    }

    /// A finding of the checks here, with the worst value of its check so far, if it ends an alarm.
    pub fn finding(now: Instant, finding: &Finding, worst: Option<f32>) -> Self {
        let mut line = told::Finding::new(now, finding);
        line.worst = worst.filter(|_| !line.is_bad());
        Self::found(&line, Some(finding.because).filter(|because| !because.is_empty()))
    }

    /// A text of a component. Texts of a HUMS on board are findings, with the names used here.
    pub fn text(text: StatusText) -> Self {
        let ours = text.source.component == COMPONENT && text.words.starts_with(OURS);
        if ours && let Some(note) = Self::on_board(&text) {
            return note;
        }
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

    fn on_board(text: &StatusText) -> Option<Self> {
        let words = text.words.trim_start_matches(OURS);
        let (check, instance) = told_check(words)?;
        let known = vocabulary(check)?;
        let level = if words.starts_with(OVER) { "ok" } else { text.level() };
        let is_worry = matches!(level, "warning" | "critical");
        Some(Self {
            at_s: text.at.as_secs_f64(),
            kind: "finding",
            level,
            from: "on board".to_owned(),
            subsystem: "",
            words: words.to_owned(),
            found: Some(FindingNote {
                check: check.to_owned(),
                instance,
                meaning: if is_worry { known.meaning } else { "" },
                action: if is_worry { known.action } else { "" },
                ..FindingNote::default()
            }),
        })
    }

    /// Whether it is the same finding as another one: same check, part and level, within the delay of a box's
    /// report and the radio.
    pub fn is_again(&self, other: &Self) -> bool {
        let (Some(one), Some(two)) = (&self.found, &other.found) else { return false };
        (&one.check, one.instance, self.level) == (&two.check, two.instance, other.level)
            && self.from != other.from
            && (self.at_s - other.at_s).abs() <= AGAIN_S
    }

    /// An event for the pilot's time line; `None` for other happenings. After `joined` the state is older
    /// than the first reception, so it is not an event.
    pub fn event(now: Instant, happening: Happening, joined: bool) -> Option<Self> {
        let words = match happening {
            Happening::Armed if joined => "armed when it was first heard",
            Happening::Armed => "armed",
            Happening::Disarmed => "disarmed",
            Happening::TakeOff => "take-off",
            Happening::FlightResumed => "in the air when it was first heard",
            Happening::Landing => "landing",
            Happening::AutopilotReboot => "the autopilot has restarted",
            Happening::CellsUnknown => CELLS_UNKNOWN,
            _ => return None,
        };
        let is_warning = happening == Happening::CellsUnknown;
        Some(Self {
            at_s: now.as_secs_f64(),
            kind: if is_warning { "text" } else { "event" },
            level: if is_warning { "warning" } else { "ok" },
            from: "here".to_owned(),
            subsystem: "",
            words: words.to_owned(),
            found: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use hums_core::health::{Level, Subsystem, checks};
    use hums_link::summary;

    use super::*;

    #[test]
    fn what_a_box_tells_has_the_name_that_it_has_here() {
        // The same fault on another autopilot's scale, and after another time.
        let twins = [("vibration_px4", "vibration"), ("cell_dev_lasting", "cell_deviation")];
        for check in checks() {
            for level in [Level::Warning, Level::Critical, Level::Ok, Level::Stale] {
                let instance = check.instances - 1;
                let feeds = if check.subsystem == Subsystem::Power { Feeds::Payload } else { Feeds::Unsaid };
                let finding = Finding {
                    at: Instant::ZERO.into(),
                    subsystem: check.subsystem,
                    check: check.name,
                    instance,
                    level,
                    previous: Level::Ok,
                    value: 12.0,
                    limit: 1.0,
                    unit: check.unit.name(),
                    feeds,
                    because: "",
                    orders: hums_core::health::Orders::Own,
                };
                let text = summary::text(&finding);
                let words = text.as_str().trim_start_matches(OURS);
                let known = told_check(words);
                let twin = twins.iter().find(|(twin, _)| *twin == check.name);
                let name = twin.filter(|_| level != Level::Stale).map_or(check.name, |(_, of)| of);
                let is_it = known.is_some_and(|(told, part)| {
                    part == instance && (told == name || check_name(told, &[]) == check_name(check.name, &[]))
                });
                assert!(is_it, "{words}: {known:?}");
            }
        }
        assert_eq!(told_check("cells not known, set BAT_CELLS"), None);
    }
}
