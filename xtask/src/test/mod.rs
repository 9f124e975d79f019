//! Everything that CI checks, as named steps that can be run alone.
//!
//! First come the steps of the build; then the lints run beside the tests. A table at the end has the seconds of each step, and
//! the processor's time of all. A step whose tool is missing and cannot be installed is left out, and the run fails at its end.

mod quick;
mod steps;

use std::time::Instant;

use anyhow::{Context as _, Error, Result, bail};

use crate::setup::{self, Need, Outcome};
use steps::{STEPS, Stage, Step};

pub(crate) fn list() {
    for step in &STEPS {
        println!("{:<16} {}", step.name, step.about);
    }
}

pub(crate) fn check_names(names: &[String]) -> Result<()> {
    match names.iter().find(|name| find(name).is_none()) {
        Some(unknown) => bail!("there is no step {unknown}; cargo xtask test --list shows them"),
        None => Ok(()),
    }
}

fn find(name: &str) -> Option<&'static Step> {
    STEPS.iter().find(|step| step.name == name)
}

/// Those named, in the order of the table, with their requirements before them; all, if none is named.
fn chosen(only: &[String]) -> Vec<&'static Step> {
    let mut names: Vec<&str> = only.iter().map(String::as_str).collect();
    let mut index = 0;
    while let Some(step) = names.get(index).and_then(|name| find(name)) {
        names.extend(step.after);
        index += 1;
    }
    STEPS.iter().filter(|step| only.is_empty() || names.contains(&step.name)).collect()
}

/// Runs the steps named in `only`, or all; of those that run one after the other none follows one that failed.
pub(crate) fn run(only: &[String]) -> Result<()> {
    let chosen = chosen(only);
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
            let (lints, tests) = std::thread::scope(|scope| {
                let lints = scope.spawn(|| run(Stage::Lint));
                let tests = run(Stage::Test);
                (lints.join(), tests)
            });
            let Ok(lints) = lints else { bail!("the lints panicked") };
            rows.extend(lints.into_iter().chain(tests));
        }
        println!("\n{:<16} {:>8}", "step", "seconds");
        for row in &rows {
            let word = if row.failed.is_some() { "  FAILED" } else { "" };
            match row.seconds {
                Some(seconds) => println!("{:<16} {seconds:>8.1}{word}", row.step),
                None => println!("{:<16} {:>8}  a tool is missing", row.step, "-"),
            }
        }
        rows.into_iter().find_map(|row| row.failed).map_or_else(|| there.require_all(), Err)
    })
}

/// The format, the lints and the unit tests of the packages that changed.
pub(crate) fn run_quick() -> Result<()> {
    setup::ensure(&[Need::Linker, Need::Rustfmt, Need::Clippy], false).require_all()?;
    timed(quick::run)
}

/// Runs it and prints how long it took, and the processor's time of all programs that were started.
fn timed(run: impl FnOnce() -> Result<()>) -> Result<()> {
    let (start, done) = (Instant::now(), run());
    println!("{:<16} {:>8.1}", "in all", start.elapsed().as_secs_f64());
    if let Some(seconds) = processor_seconds() {
        println!("{:<16} {seconds:>8.1}", "processor");
    }
    done
}

/// What became of a step.
struct Row {
    step: &'static str,
    /// None if a tool is missing.
    seconds: Option<f64>,
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
        let begun = Instant::now();
        let alone = || format!("step {0}; alone: cargo xtask test --only {0}", step.name);
        let failed = (step.run)().with_context(alone).err();
        rows.push(Row { step: step.name, seconds: Some(begun.elapsed().as_secs_f64()), failed });
        if rows.iter().any(|row| row.failed.is_some()) {
            break;
        }
    }
    rows
}

/// The time that the processor gave to children that have ended, and to theirs (proc(5): fields 16 and 17, in ticks of 10 ms).
fn processor_seconds() -> Option<f64> {
    let stat = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The second field is the program's name in brackets.
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |field: usize| fields.get(field)?.parse::<f64>().ok();
    Some((ticks(13)? + ticks(14)?) / 100.0)
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
    fn what_a_step_needs_comes_before_it_in_the_table() {
        for (index, step) in STEPS.iter().enumerate() {
            for needed in step.after {
                assert!(STEPS[..index].iter().any(|other| other.name == *needed), "{}: {needed}", step.name);
            }
        }
    }

    #[test]
    fn a_step_that_is_chosen_brings_along_what_it_needs() {
        let names: Vec<&str> = chosen(&["costs".to_owned()]).iter().map(|step| step.name).collect();
        assert_eq!(names, ["build", "costs"]);
        assert_eq!(chosen(&[]).len(), STEPS.len());
    }

    #[test]
    fn the_processor_time_of_children_that_ended_counts() {
        let before = processor_seconds();
        std::process::Command::new("sh")
            .args(["-c", "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"])
            .status()
            .unwrap();
        assert!(processor_seconds() > before || !cfg!(target_os = "linux"));
    }

    #[test]
    fn a_step_that_does_not_exist_is_refused() {
        check_names(&["fmt".to_owned()]).unwrap();
        assert!(check_names(&["fmt".to_owned(), "format".to_owned()]).is_err());
    }
}
