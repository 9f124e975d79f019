//! CI's checks as named steps.
//!
//! The build comes first; then lints, what computes and what waits run side by side. A table has each step's seconds,
//! and the processor's. A step without its tool is left out, and the run fails at its end.

mod quick;
mod steps;

use std::time::Instant;

use anyhow::{Context as _, Error, Result, bail};
use clap::builder::PossibleValuesParser;

use crate::setup::{self, Need, Outcome};
use crate::shell;
use steps::{STEPS, Stage, Step};

/// Arguments of `test`.
#[derive(Debug, clap::Args)]
#[group(multiple = false)]
pub(crate) struct Options {
    /// Only this step and those it needs; may be given several times
    #[arg(long, value_name = "STEP", hide_possible_values = true, value_parser = names())]
    only: Vec<String>,
    /// Show the steps
    #[arg(long)]
    list: bool,
    /// Format, lints and unit tests of the packages that changed
    #[arg(long)]
    quick: bool,
}

fn names() -> PossibleValuesParser {
    PossibleValuesParser::new(STEPS.iter().map(|step| step.name))
}

/// Named ones and those they follow, in order; all by default.
fn chosen(only: &[String]) -> Vec<&'static Step> {
    let named = |step: &Step| only.is_empty() || only.iter().any(|name| name == step.name);
    let followed = |step: &Step| STEPS.iter().any(|other| named(other) && other.follows(step.name));
    STEPS.iter().filter(|step| named(step) || followed(step)).collect()
}

/// A failed step stops those after it.
pub(crate) fn run(options: &Options) -> Result<()> {
    if options.list {
        for step in &STEPS {
            println!("{:<16} {}", step.name, step.about);
        }
        return Ok(());
    }
    if options.quick {
        setup::require(&[Need::Linker, Need::Rustfmt, Need::Clippy])?;
        return timed(quick::run);
    }
    let chosen = chosen(&options.only);
    let needed = chosen.iter().flat_map(|step| step.needs).copied();
    let mut needs: Vec<Need> = needed.chain([Need::Linker]).collect();
    needs.sort_unstable();
    needs.dedup();
    let there = setup::ensure(&needs, false);
    timed(|| {
        let run = |stage| {
            let steps = chosen.iter().copied().filter(move |step| step.stage == stage);
            one_after_the_other(steps, &there)
        };
        let mut rows = run(Stage::Build);
        if rows.iter().all(|row| row.failed.is_none()) {
            let results = std::thread::scope(|scope| {
                let run = &run;
                let threads = Stage::BESIDE.map(|stage| scope.spawn(move || run(stage)));
                threads.map(std::thread::ScopedJoinHandle::join)
            });
            for result in results {
                let Ok(others) = result else { bail!("a thread of the steps panicked") };
                rows.extend(others);
            }
        }
        println!("\n{:<16} {:>8} {:>10}", "step", "seconds", "processor");
        for row in &rows {
            let word = if row.failed.is_some() { "  FAILED" } else { "" };
            let seconds = row.seconds.map_or_else(
                || format!("{:>8} {:>10}  a tool is missing", "-", "-"),
                |[seconds, processor]| format!("{seconds:>8.1} {processor:>10.1}"),
            );
            println!("{:<16} {seconds}{word}", row.step);
        }
        rows.into_iter().find_map(|row| row.failed).map_or_else(|| there.require_all(), Err)
    })
}

fn timed(run: impl FnOnce() -> Result<()>) -> Result<()> {
    let (start, done) = (Instant::now(), run());
    let processor = shell::processor_seconds("self").unwrap_or_default();
    println!("{:<16} {:>8.1} {processor:>10.1} of the processor", "in all", start.elapsed().as_secs_f64());
    done
}

struct Row {
    step: &'static str,
    /// And the processor's, of its programs. None: a tool is missing.
    seconds: Option<[f64; 2]>,
    failed: Option<Error>,
}

fn one_after_the_other(steps: impl Iterator<Item = &'static Step>, there: &Outcome) -> Vec<Row> {
    let mut rows = Vec::new();
    for step in steps {
        if !step.needs.iter().all(|need| there.has(*need)) {
            rows.push(Row { step: step.name, seconds: None, failed: None });
            continue;
        }
        println!("\n=== {}: {}", step.name, step.about);
        let (begun, taken) = (Instant::now(), shell::TAKEN.get());
        let alone = || format!("step {0}; alone: cargo xtask test --only {0}", step.name);
        let failed = (step.run)().with_context(alone).err();
        let seconds = [begun.elapsed().as_secs_f64(), shell::TAKEN.get() - taken];
        rows.push(Row { step: step.name, seconds: Some(seconds), failed });
        if rows.iter().any(|row| row.failed.is_some()) {
            break;
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_names_are_words_that_can_be_typed_and_none_is_there_twice() {
        for (index, step) in STEPS.iter().enumerate() {
            assert!(step.name.chars().all(|c| c.is_ascii_lowercase() || c == '-'), "{}", step.name);
            assert!(STEPS[..index].iter().all(|other| other.name != step.name), "{}", step.name);
        }
    }

    #[test]
    fn a_chosen_step_brings_along_those_that_it_follows_and_that_stand_before_it() {
        for (index, step) in STEPS.iter().enumerate() {
            assert!(!STEPS[index..].iter().any(|other| step.follows(other.name)), "{}", step.name);
        }
        for (only, expected) in [
            ("costs", &["build", "costs"][..]),
            ("page", &["oracle", "page"]),
            ("answer", &["oracle", "build", "answer"]),
        ] {
            let names: Vec<&str> = chosen(&[only.to_owned()]).iter().map(|step| step.name).collect();
            assert_eq!(names, expected);
        }
        assert_eq!(chosen(&[]).len(), STEPS.len());
    }
}
