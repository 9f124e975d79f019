//! The fields, parameters and words that a shared copy keeps. Anything else is removed, so that a message that nobody knows
//! gives nothing away.

use std::collections::{BTreeMap, BTreeSet};

use hums_dialect::{Kind, Message};

const FIELDS: &str = include_str!("fields.txt");
const PARAMETERS: &str = include_str!("parameters.txt");
const WORDS: &str = include_str!("words.txt");
const DIGITS_MAX: usize = 3;
const NUMBERS_MAX: usize = 2;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    Keep,
    Time,
    Latitude,
    Longitude,
    Altitude,
    Pressure,
}

impl Rule {
    fn of(word: &str) -> Option<Self> {
        Some(match word {
            "time" => Self::Time,
            "latitude" => Self::Latitude,
            "longitude" => Self::Longitude,
            "altitude" => Self::Altitude,
            "pressure" => Self::Pressure,
            _ => return None,
        })
    }
}

/// A field of a message: its name, type, place in the payload and size, and its treatment; `None` if it is removed.
#[derive(Clone, Copy, Debug)]
pub(super) struct FieldRule {
    pub(super) name: &'static str,
    pub(super) kind: Kind,
    pub(super) at: usize,
    pub(super) size: usize,
    pub(super) rule: Option<Rule>,
}

pub(super) struct Rules {
    messages: BTreeMap<u32, Vec<FieldRule>>,
    keep: Vec<&'static str>,
    drop: Vec<&'static str>,
    words: BTreeSet<&'static str>,
}

fn lines(text: &'static str) -> impl Iterator<Item = std::str::SplitWhitespace<'static>> {
    text.lines().filter(|line| !line.starts_with('#')).map(str::split_whitespace)
}

pub(super) fn places(message: &'static Message, kept: &BTreeMap<&str, Rule>) -> Vec<FieldRule> {
    let mut at = 0;
    let place = |field: &'static hums_dialect::Field| {
        let begin = at;
        at += field.size();
        FieldRule {
            name: field.name,
            kind: field.kind,
            at: begin,
            size: field.size(),
            rule: kept.get(field.name).copied(),
        }
    };
    message.fields.iter().map(place).collect()
}

impl Default for Rules {
    fn default() -> Self {
        let mut messages = BTreeMap::new();
        for mut words in lines(FIELDS) {
            let name = words.next().unwrap_or_default();
            let Some(message) = hums_dialect::messages().iter().find(|message| message.name == name) else {
                continue;
            };
            let rule = |word: &'static str| {
                let (field, rule) = word.split_once(':').unwrap_or((word, ""));
                // A word that is no rule removes the field.
                if rule.is_empty() { Some((field, Rule::Keep)) } else { Some((field, Rule::of(rule)?)) }
            };
            messages.insert(message.id, places(message, &words.filter_map(rule).collect()));
        }
        let parts = |list: &str| {
            let mut lists = lines(PARAMETERS).filter(|words| words.clone().next() == Some(list));
            lists.next().into_iter().flatten().skip(1).collect()
        };
        Self { messages, keep: parts("keep"), drop: parts("drop"), words: lines(WORDS).flatten().collect() }
    }
}

impl Rules {
    pub(super) fn fields(&self, id: u32) -> Option<&[FieldRule]> {
        self.messages.get(&id).map(Vec::as_slice)
    }

    pub(super) fn keeps_parameter(&self, name: &str) -> bool {
        self.keep.iter().any(|begin| name.starts_with(begin))
            && !self.drop.iter().any(|part| name.contains(part))
    }

    /// Decimals and more than two numbers may be a place.
    pub(super) fn keeps_text(&self, text: &str) -> bool {
        let has_decimals = text
            .as_bytes()
            .windows(3)
            .any(|three| three[1] == b'.' && three[0].is_ascii_digit() && three[2].is_ascii_digit());
        let numbers =
            text.split(|character: char| !character.is_ascii_digit()).filter(|part| !part.is_empty());
        if !text.is_ascii() || has_decimals || numbers.count() > NUMBERS_MAX {
            return false;
        }
        let mut parts =
            text.split(|character: char| !character.is_alphanumeric()).filter(|part| !part.is_empty());
        parts.all(|part| {
            let digits = part.len() <= DIGITS_MAX && part.bytes().all(|byte| byte.is_ascii_digit());
            // `EKF3`, `PX4`
            let word = part.trim_end_matches(|character: char| character.is_ascii_digit());
            let is_numbered = part.len() - word.len() <= 1;
            digits || (is_numbered && self.words.contains(word.to_ascii_lowercase().as_str()))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rule_names_a_field_of_a_message_and_none_that_says_who_or_where() {
        for mut words in lines(FIELDS) {
            let name = words.next().expect("a name");
            let message = hums_dialect::messages().iter().find(|message| message.name == name).expect(name);
            for word in words {
                let (field, rule) = word.split_once(':').unwrap_or((word, ""));
                assert!(message.fields.iter().any(|known| known.name == field), "{name}.{field}");
                assert_eq!(Rule::of(rule).is_some(), !rule.is_empty(), "{word}");
                let tells = ["lat", "lon", "lng", "uid", "serial", "home", "custom_version", "unix", "usec"];
                let tells = tells.iter().any(|part| field.contains(part)) && !field.contains("relative");
                assert!(!tells || !rule.is_empty(), "{name}.{field} has no rule");
            }
        }
    }

    #[test]
    fn parameters_and_texts_are_kept_by_their_words() {
        let rules = Rules::default();
        for (name, kept) in [
            ("ATC_RAT_RLL_P", true),
            ("BATT_LOW_VOLT", true),
            ("BATT_SERIAL_NUM", false),
            ("INS_ACC_ID", false),
            ("COMPASS_DEC", false),
            ("EKF2_MAG_DECL", false),
            ("MAV_SYS_ID", false),
            ("WIFI_PASSWORD", false),
            ("SOMETHING_NEW", false),
        ] {
            assert_eq!(rules.keeps_parameter(name), kept, "{name}");
        }
        for (text, kept) in [
            ("Battery 1 low voltage failsafe", true),
            ("EKF3 lane switch 1", true),
            ("Potential Thrust Loss (3)", true),
            ("ArduCopter V4.6.0 (3fc7011a)", false),
            ("Field Elevation Set: 516m at Zurich", false),
            ("home 47.3979 8.5455", false),
            ("Land at Smith", false),
        ] {
            assert_eq!(rules.keeps_text(text), kept, "{text}");
        }
    }
}
