//! Everything that CI checks, as named steps that can be run alone.
//!
//! Steps run one after the other, and a table at the end has the seconds of each. A step whose tool is missing and cannot be
//! installed is left out, and the run fails at its end.

mod steps;

use std::time::Instant;

use anyhow::{Result, bail};

use crate::setup::{self, Need};
use steps::{STEPS, Step};

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

/// Runs the steps named in `only`, or all; stops at the first that fails.
pub(crate) fn run(only: &[String]) -> Result<()> {
    let start = Instant::now();
    let chosen = chosen(only);
    let mut needs: Vec<Need> = chosen.iter().flat_map(|step| step.needs).copied().collect();
    needs.push(Need::Linker);
    needs.sort_unstable();
    needs.dedup();
    let there = setup::ensure(&needs, false);
    let mut rows = Vec::new();
    let mut failed = None;
    for step in chosen {
        if !step.needs.iter().all(|need| there.has(*need)) {
            rows.push(format!("{:<16} {:>8}  a tool is missing\n", step.name, "-"));
            continue;
        }
        println!("\n=== {}: {}", step.name, step.about);
        let begun = Instant::now();
        let ended = (step.run)();
        let word = if ended.is_ok() { "" } else { "  FAILED" };
        rows.push(format!("{:<16} {:>8.1}{word}\n", step.name, begun.elapsed().as_secs_f64()));
        if let Err(error) = ended {
            failed = Some(error.context(format!("step {0}; alone: cargo xtask test --only {0}", step.name)));
            break;
        }
    }
    println!(
        "\n{:<16} {:>8}\n{}{:<16} {:>8.1}",
        "step",
        "seconds",
        rows.concat(),
        "in all",
        start.elapsed().as_secs_f64()
    );
    failed.map_or_else(|| there.require_all(), Err)
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
        assert_eq!(names, ["build", "budgets", "costs"]);
        assert_eq!(chosen(&[]).len(), STEPS.len());
    }

    #[test]
    fn a_step_that_does_not_exist_is_refused() {
        check_names(&["fmt".to_owned()]).unwrap();
        assert!(check_names(&["fmt".to_owned(), "format".to_owned()]).is_err());
    }
}
