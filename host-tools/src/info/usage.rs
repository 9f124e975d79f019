//! Usage counters for people.

use std::fmt::Write as _;

use hums_core::clock::Span;

use super::number::short;
use crate::counters::{self, Band, Counter, Motor};
use crate::plural::count;
use crate::summary::Overview;
use crate::table::{Table, left, right};
use crate::utc::clock;

pub(super) fn text(text: &mut String, log: &Overview) {
    let (session, life) = (&log.contents.usage, &log.contents.lifetime);
    let counters = counters::of(session, life);
    let mut lines: Vec<[String; 3]> = counters.plain.iter().filter_map(plain).collect();
    // Only in a board's life.
    for (name, title) in [("boots", "Power-ons"), ("sessions", "Sessions")] {
        let life = life.get(name).filter(|life| **life > 0.0);
        lines.extend(life.map(|&life| [title.to_owned(), String::new(), short(life)]));
    }
    lines.extend(counters.motors.iter().flat_map(motor));
    if !lines.is_empty() {
        let life = if log.contents.is_life_before() { "life before" } else { "life" };
        let _ = writeln!(text, "  usage                                     session {life:>14}");
        if let Some(words) = log.counted_words() {
            let _ = writeln!(text, "    ({words})");
        }
    }
    if let Some(remark) = counters.remark {
        let _ = writeln!(text, "    ({remark})");
    }
    let mut table = Table::new(4, [left(33), right(14), right(13)]);
    for line in lines {
        table.row(line);
    }
    let _ = write!(text, "{table}");
    for ranges in counters.ranges {
        let bands: Vec<String> =
            ranges.bands.iter().filter_map(|band| self::band(band, ranges.unit)).collect();
        if !bands.is_empty() {
            let _ = writeln!(
                text,
                "    Time by {}: {}",
                ranges.title.replace('_', " ").replace("esc ", "ESC "),
                bands.join(", ")
            );
        }
    }
}

fn plain(counter: &Counter) -> Option<[String; 3]> {
    let Counter { title, unit, session, life, .. } = counter;
    let said = |value: f64| match *unit {
        "s" => seconds(value),
        "" => short(value),
        unit => format!("{} {unit}", short(value)),
    };
    (*session != 0.0 || life.is_some_and(|life| life != 0.0))
        .then(|| [title.clone(), said(*session), life.map_or_else(String::new, said)])
}

fn motor(motor: &Motor) -> Vec<[String; 3]> {
    let number = u16::from(motor.number) + 1;
    let line = |what: &str, session: Option<f64>, life: Option<f64>, said: fn(f64) -> String| {
        (session.unwrap_or(0.0) != 0.0 || life.unwrap_or(0.0) != 0.0).then(|| {
            let said = |value: Option<f64>| value.map_or_else(String::new, said);
            [format!("Motor {number}, {what}"), said(session), said(life)]
        })
    };
    let turns = |value| count(value as u64, "turn");
    let time = line("time", motor.run_time_s, motor.life_run_time_s, seconds);
    time.into_iter().chain(line("turns", motor.revolutions, motor.life_revolutions, turns)).collect()
}

fn band((from, to, time_s): &Band, unit: &str) -> Option<String> {
    let range = match (from, to) {
        (None, None) => "anywhere".to_owned(),
        (None, Some(to)) => format!("below {to} {unit}"),
        (Some(from), None) => format!("from {from} {unit}"),
        (Some(from), Some(to)) => format!("{from} to {to} {unit}"),
    };
    (*time_s > 0.0).then(|| format!("{range} for {}", seconds(*time_s)))
}

fn seconds(value: f64) -> String {
    // Saturates: a damaged log may hold any number.
    clock(Span::from_micros((value * 1e6) as u64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_hours_and_what_is_not_zero() {
        let mut log = Overview::default();
        for (name, value) in [
            ("flight_time_s", 3_861.0),
            ("flights", 2.0),
            ("landings", 0.0),
            ("motor0_run_time_s", 61.0),
            ("vibration_below_1_m_s2_s", 30.0),
        ] {
            log.contents.usage.insert(name.to_owned(), value);
        }
        log.contents.lifetime.insert("flight_time_s".to_owned(), 36_000.0);
        log.contents.lifetime.insert("boots".to_owned(), 7.0);
        let mut said = String::new();
        text(&mut said, &log);
        for line in [
            "    In the air                                1:04:21       10:00:00\n",
            "    Flights                                         2\n",
            "    Power-ons                                                      7\n",
            "    Motor 1, time                                1:01\n",
            "    Time by vibration: below 1 m/s\u{b2} for 0:30\n",
        ] {
            assert!(said.contains(line), "{line}\n{said}");
        }
        assert!(!said.contains("Landings"), "{said}");
    }
}
