//! `cargo xtask costs`: processor time and stack at the fastest line, against `budgets.toml`; modelled.

use std::path::Path;

use anyhow::{Context as _, Result, bail};
use serde_json::Value;

use crate::bench::{BYTES_PER_S, record_at_full_rate};
use crate::budgets::{Budgets, Row};
use crate::firmware;
use crate::hums;
use crate::repo;
use crate::setup::{self, Need};

/// PX4: compresses the least.
const FLIGHT: &str = "tests/flights/px4_hil_quad_low.tlog";
/// Stages in the budgets; others only count in total.
const STAGES: [(&str, &str); 5] = [
    ("framer", "framer"),
    ("encode", "encode"),
    ("observe", "observe"),
    ("checks", "tick"),
    ("summary", "summary"),
];

pub(crate) fn check() -> Result<()> {
    setup::require(&[Need::Linker, Need::FirmwareTarget])?;
    let image = firmware::build(firmware::default_board())?;
    check_built(&hums::build()?, &image)
}

pub(crate) fn check_built(program: &Path, image: &Path) -> Result<()> {
    let budgets = Budgets::read()?;
    let report = record_at_full_rate(program, image, &repo::root().join(FLIGHT))?;
    let rows = compare(&report, &budgets)?;
    println!("{FLIGHT} at 921,600 baud:");
    for row in &rows {
        println!("{}", row.text);
    }
    if rows.iter().any(|row| row.over) {
        bail!("the firmware is over its budget: see the table");
    }
    Ok(())
}

fn compare(report: &Value, budgets: &Budgets) -> Result<Vec<Row>> {
    let number = |key: &str| report[key].as_f64().filter(|&number| number > 0.0);
    let frames = number("frames_in").context("the run counted no frames; run hums sim --firmware by hand")?;
    let stages = report["cycles"]
        .as_object()
        .context("the firmware does not count cycles; build it from this version")?;
    let all: f64 = stages.values().filter_map(Value::as_f64).sum();
    let mut rows = Vec::new();
    for (name, budget) in &budgets.cycles {
        let count = match STAGES.iter().find(|(known, _)| known == name) {
            Some((_, stage)) => report["cycles"][stage].as_f64(),
            None if name == "total" => Some(all),
            None => None,
        };
        let count = count.with_context(|| {
            format!("budgets.toml: there is no stage {name}; add or remove [cycles.{name}]")
        })?;
        let what = format!("{name} a frame");
        let reason = format!("{} when it was set; {}", budget.taken, budget.reason);
        rows.push(row(&what, "cycles", count / frames, budget.per_frame_max, &reason));
    }
    if let Some((name, _)) = STAGES.iter().find(|(name, _)| !budgets.cycles.contains_key(*name)) {
        bail!("budgets.toml has no [cycles.{name}]");
    }
    let percent = number("busy_percent_max")
        .context("the run has no load of the processor; run hums sim --firmware by hand")?;
    let what = format!("worst second at {:.0} kB/s", BYTES_PER_S / 1e3);
    rows.push(row(&what, "% of 168 MHz", percent, budgets.load.percent_max, &budgets.load.reason));

    let measured = report["stack_by_urgency"]
        .as_object()
        .context("the firmware does not measure its stack; build it from this version")?;
    for (name, budget) in &budgets.stack {
        let deepest = measured.get(name).and_then(Value::as_f64);
        let deepest = deepest.with_context(|| {
            format!("budgets.toml: there is no urgency {name}; correct its [stack] section")
        })?;
        rows.push(row(&format!("stack {name}"), "bytes", deepest, budget.bytes_max as f64, &budget.reason));
    }
    let held = number("stack_bytes")
        .context("the firmware does not name the size of its stack; build it from this version")?;
    let reason = "the stack, which all urgencies one on top of the other must fit";
    rows.push(row("stack nested, by the limits", "bytes", budgets.stack_bytes() as f64, held, reason));
    let start = measured
        .get("start")
        .and_then(Value::as_f64)
        .context("the run has no time of the start; run hums sim --firmware by hand")?;
    rows.push(row("stack start", "bytes", start, held, "the stack: no task runs yet"));
    Ok(rows)
}

fn row(what: &str, unit: &str, measured: f64, limit: f64, reason: &str) -> Row {
    let over = measured > limit;
    let digits = usize::from(limit < 100.0);
    let text = format!(
        "{what:<28} {measured:>8.digits$} of {limit:>8.digits$} {unit:<12}  {}{reason}",
        if over { "OVER: " } else { "" }
    );
    Row { text, over }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REPORT: &str = r#"{"frames_in": 10, "bytes_in": 1000, "stack_bytes": 16384, "busy_percent_max": 35.5,
        "cycles": {"framer": 1000, "encode": 2000, "observe": 100, "tick": 10, "summary": 10, "tasks": 80},
        "stack_by_urgency": {"watch": 200, "ports": 150, "clock": 150, "reception": 900, "monitor": 5000, "downlink": 800, "storage": 4000,
        "start": 9000}}"#;

    fn over(report: &str) -> Vec<String> {
        let rows = compare(&serde_json::from_str(report).unwrap(), &Budgets::read().unwrap()).unwrap();
        rows.into_iter().filter(|row| row.over).map(|row| row.text).collect()
    }

    #[test]
    fn what_is_within_its_limits_passes() {
        assert_eq!(over(REPORT), [""; 0]);
    }

    #[test]
    fn a_stage_a_stack_and_the_whole_can_each_be_over() {
        assert!(
            over(&REPORT.replace("\"framer\": 1000", "\"framer\": 100000"))[0].starts_with("framer a frame")
        );
        assert_eq!(over(&REPORT.replace("\"tasks\": 80", "\"tasks\": 900000")).len(), 1, "the total");
        assert!(over(&REPORT.replace("35.5", "60.5"))[0].starts_with("worst second"));
        assert!(over(&REPORT.replace("\"monitor\": 5000", "\"monitor\": 50000"))[0].contains("OVER"));
    }

    #[test]
    fn an_urgency_that_is_not_measured_is_an_error() {
        let report = REPORT.replace("\"downlink\"", "\"uplink\"");
        assert!(compare(&serde_json::from_str(&report).unwrap(), &Budgets::read().unwrap()).is_err());
    }
}
