//! Worn parts: names, and the limit reached first.

use std::fmt;

use hums_core::Monitor;
use hums_core::component::{COMPONENTS_MAX, ComponentFigures, ComponentKind};
use hums_core::health::Subsystem;

/// Hours, flights, battery cycles, motor hours; 0 without a limit.
pub type ServiceLimits = [f64; 4];

const ENDS: [&str; 4] = ["_HOURS", "_FLIGHTS", "_CYCLES", "_MOT_HOURS"];

/// Place from 0, and limit: `CMP1_FLIGHTS` is 0 and 1.
pub fn limit_of(parameter: &str) -> Option<(usize, usize)> {
    let (number, end) = parameter.strip_prefix("CMP")?.split_at_checked(1)?;
    let place = number.parse::<usize>().ok()?.checked_sub(1).filter(|place| *place < COMPONENTS_MAX)?;
    Some((place, ENDS.iter().position(|known| *known == end)?))
}

/// `motor 3`, with its operator's name.
pub fn name(kind: &str, number: u8, given: &str) -> String {
    let number = if number == 0 { String::new() } else { format!(" {number}") };
    let given = if given.is_empty() { String::new() } else { format!(" \"{given}\"") };
    format!("{kind}{number}{given}")
}

/// The first limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// Use so far, in the limit's unit.
    pub run: f64,
    /// The limit.
    pub limit: f64,
    /// Of both: `h`, `flights`, `cycles`.
    pub unit: &'static str,
    /// `turning`; empty for other units.
    pub how: &'static str,
    /// How the name of its parameter ends.
    pub end: &'static str,
}

impl fmt::Display for Limit {
    /// `25 h turning`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let space = if self.how.is_empty() { "" } else { " " };
        // Single precision.
        write!(f, "{} {}{space}{}", self.limit as f32, self.unit, self.how)
    }
}

/// Limit, if any.
pub fn first_limit(kind: &str, figures: &ComponentFigures, limits: &ServiceLimits) -> Option<Limit> {
    let is_powered = [ComponentKind::Card, ComponentKind::Other].iter().any(|of| of.name() == kind);
    let (run_s, how) =
        if is_powered { (figures.powered_s, "powered") } else { (figures.flight_s, "in the air") };
    let run = [
        (run_s / 3_600.0, "h", how),
        (figures.flights, "flights", ""),
        (figures.cycles, "cycles", ""),
        (figures.motor_s / 3_600.0, "h", "turning"),
    ];
    let all = run.into_iter().zip(limits).zip(ENDS);
    let all = all.map(|(((run, unit, how), limit), end)| Limit { run, limit: *limit, unit, how, end });
    all.filter(|of| of.limit > 0.0)
        .max_by(|one, other| (one.run / one.limit).total_cmp(&(other.run / other.limit)))
}

/// The most used, as a check judges it, and its limit.
pub fn due(monitor: &Monitor, subsystem: Subsystem) -> Option<(String, Option<String>)> {
    let used = |place: &usize| monitor.component_used_percent(*place).unwrap_or(f32::NEG_INFINITY);
    let mine = |place: &usize| {
        monitor.components().get(*place).is_some_and(|part| part.kind.subsystem() == Some(subsystem))
    };
    of(monitor, (0..COMPONENTS_MAX).filter(mine).max_by(|one, other| used(one).total_cmp(&used(other)))?)
}

/// A part and its first limit, by place from 0.
pub fn of(monitor: &Monitor, place: usize) -> Option<(String, Option<String>)> {
    let part = monitor.components().get(place)?;
    let (figures, _) = monitor.component_figures(place)?;
    let mut limits = ServiceLimits::default();
    for (spec, value) in monitor.params().iter() {
        if let Some((of, which)) = limit_of(spec.name)
            && let Some(limit) = limits.get_mut(which).filter(|_| of == place)
        {
            *limit = f64::from(value);
        }
    }
    let kind = part.kind.name();
    let limit = first_limit(kind, &figures, &limits);
    Some((name(kind, part.number, part.name.as_str()), limit.map(|limit| limit.to_string())))
}

/// `motor 3 (limit 25 h turning)`.
pub fn due_words((name, limit): &(String, Option<String>)) -> String {
    limit.as_ref().map_or_else(|| name.clone(), |limit| format!("{name} (limit {limit})"))
}

/// Whether a check reports that a part is due.
pub fn is_due(check: &str) -> bool {
    check.ends_with("_due")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_named_with_the_limit_that_it_reaches_first() {
        let figures = ComponentFigures {
            flight_s: 3_600.0,
            motor_s: 7_200.0,
            flights: 3.0,
            ..ComponentFigures::default()
        };
        let limit = |kind, limits| first_limit(kind, &figures, &limits).map(|limit| limit.to_string());
        assert_eq!(limit("motor", [10.0, 50.0, 0.0, 4.0]).as_deref(), Some("4 h turning"));
        assert_eq!(limit("airframe", [1.5, 50.0, 0.0, 0.0]).as_deref(), Some("1.5 h in the air"));
        assert_eq!(limit("airframe", [100.0, 5.0, 0.0, 0.0]).as_deref(), Some("5 flights"));
        assert_eq!(limit("card", [0.0; 4]), None);
        assert_eq!(name("motor", 3, ""), "motor 3");
        assert_eq!(name("battery", 0, "blue"), "battery \"blue\"");
        assert_eq!(limit_of("CMP2_MOT_HOURS"), Some((1, 3)));
        assert_eq!((limit_of("CMP9_HOURS"), limit_of("CMP1_KIND"), limit_of("CMP")), (None, None, None));
    }
}
