//! Texts of a parameter for documents, component information and Mission Planner's file.

use core::fmt;

use hums_core::health::{Check, Side, checks};
use hums_core::parameters::Param;
use hums_link::vocabulary::vocabulary;

/// Decimal places that a quantity is shown with.
pub const DECIMAL_PLACES: u8 = 3;

/// A parameter in a few words: `Battery cell voltage: warning below`.
pub fn short(param: Param) -> impl fmt::Display {
    fmt::from_fn(move |f| {
        let what = param.words().what;
        let Some((check, is_warning)) = limits(param).next().filter(|_| what.is_empty()) else {
            return f.write_str(what);
        };
        let name = vocabulary(check.name).map_or(check.name, |words| words.said.name);
        let level = if is_warning { "warning" } else { "critical" };
        let side = if check.limits.side == Side::Above { "above" } else { "below" };
        let state = if check.unit.is_flag() { " this state" } else { "" };
        write!(f, "{}: {level} {side}{state}", capital(name))
    })
}

/// Details as a sentence, with the source of the default.
pub fn long(param: Param) -> impl fmt::Display {
    fmt::from_fn(move |f| write!(f, "{}.", capital(param.words().source)))
}

/// The state beyond the limit, for the limit of one check.
pub fn meaning(param: Param) -> Option<&'static str> {
    let (check, _) = limits(param).next().filter(|_| param.words().what.is_empty())?;
    vocabulary(check.name).map(|words| words.meaning)
}

fn capital(text: &str) -> impl fmt::Display {
    let mut letters = text.chars();
    let first = letters.next().unwrap_or_default().to_ascii_uppercase();
    fmt::from_fn(move |f| write!(f, "{first}{}", letters.as_str()))
}

/// Its group in grouped lists.
pub fn group(param: Param) -> &'static str {
    let mut subsystems = limits(param).map(|(check, _)| check.subsystem);
    if let Some(subsystem) = subsystems.next().filter(|first| subsystems.all(|other| other == *first)) {
        return subsystem.name();
    }
    if matches!(param, Param::AlertWarn | Param::AlertCrit) {
        return "autopilot's alerts";
    }
    let name = param.spec().name;
    match name.split_once('_').map_or(name, |(prefix, _)| prefix) {
        "AP" => "autopilot's port",
        "BAT" => "power",
        "CMP" => "parts",
        "GS" => "ground station's port",
        "GPS" | "SENS" => "navigation",
        "HARD" => "structure",
        "HEALTH" => "health",
        "PROT" => "protective action",
        "REC" => "recorder",
        "SIGN" => "signing",
        "TRD" => "trends",
        part if part.starts_with("CMP") => "parts",
        _ => "",
    }
}

fn limits(param: Param) -> impl Iterator<Item = (&'static Check, bool)> {
    checks().filter_map(move |check| match param {
        _ if check.limits.warn == Some(param) => Some((check, true)),
        _ if check.limits.critical == Some(param) => Some((check, false)),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_of_one_check_is_told_by_the_checks_words() {
        let told = |param| short(param).to_string();
        assert_eq!(told(Param::CellVoltWarn), "Battery cell voltage: warning below");
        assert_eq!(told(Param::RecStallCrit), "Card stall: critical above");
        assert_eq!(told(Param::GsBaud), "Rate of the ground station's port");
        assert_eq!(told(Param::BatStateCrit), "Battery charge state: critical above this state");
        assert_eq!(long(Param::CellVoltWarn).to_string(), "Common LiPo practice.");
        let meaning = meaning(Param::CellVoltWarn);
        assert_eq!(meaning, Some("The weakest cell was close to empty, or sagged under the load."));
    }

    #[test]
    fn every_parameter_has_words_and_a_group() {
        let mut told = Vec::new();
        for param in Param::ALL {
            let (name, words) = (param.spec().name, param.words());
            let what = short(param).to_string();
            assert!(!what.is_empty() && !told.contains(&what), "{name}: say what it is, and no other one");
            told.push(what);
            assert!(!group(param).is_empty(), "{name}: say what it belongs to");
            let several = limits(param).nth(1).is_some();
            assert!(!words.what.is_empty() || !several, "{name} limits several checks: say what it is");
            let options = words.options.len();
            let max = param.spec().max;
            assert!(
                options == 0 || max.to_bits() == (options as f32 - 1.0).to_bits(),
                "{name}: what is {max}?"
            );
        }
    }
}
