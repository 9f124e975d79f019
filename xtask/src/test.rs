//! Everything that CI checks, as named steps that can be run alone.

use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};

use crate::budgets;
use crate::costs;
use crate::demo;
use crate::firmware::{self, Board};
use crate::hums;
use crate::oracle;
use crate::prove;
use crate::repo::FIRMWARE_TARGET;
use crate::setup::{self, Need};
use crate::shell::Shell;
use crate::structure;

/// One thing that is checked.
struct Step {
    name: &'static str,
    about: &'static str,
    needs: &'static [Need],
    run: fn() -> Result<()>,
}

/// In the order in which they fail soonest.
const STEPS: [Step; 17] = [
    Step { name: "fmt", about: "the formatting", needs: &[Need::Rustfmt], run: fmt },
    Step {
        name: "structure",
        about: "no import goes in a circle, and docs/modules.dot is of this code",
        needs: &[],
        run: structure::check,
    },
    Step {
        name: "clippy",
        about: "lints of what runs on this PC, warnings as errors",
        needs: &[Need::Clippy],
        run: clippy,
    },
    Step {
        name: "clippy-firmware",
        about: "lints of the firmware for each board, warnings as errors",
        needs: &[Need::Clippy, Need::FirmwareTarget],
        run: clippy_firmware,
    },
    Step { name: "doc", about: "the documentation builds without a warning", needs: &[], run: doc },
    Step {
        name: "no-std",
        about: "the core crates build where there is no std",
        needs: &[Need::FirmwareTarget],
        run: no_std,
    },
    Step {
        name: "budgets",
        about: "the firmware builds, within budgets.toml",
        needs: &[Need::FirmwareTarget],
        run: budgets::check_all,
    },
    Step { name: "unit", about: "tests of each crate on this PC", needs: &[], run: unit },
    Step {
        name: "sim",
        about: "end to end on this PC, against pymavlink",
        needs: &[Need::Mtools, Need::Dosfstools, Need::PythonVenv],
        run: sim,
    },
    Step {
        name: "prove",
        about: "the campaigns in their short form",
        needs: prove::NEEDS,
        run: prove::short,
    },
    Step {
        name: "answer",
        about: "every format against pymavlink, with pyarrow, DuckDB and InfluxDB as readers",
        needs: &[Need::PythonVenv, Need::Influx],
        run: answer,
    },
    Step {
        name: "browser",
        about: "the report and the live page in Chromium",
        needs: &[Need::PythonVenv, Need::Chromium],
        run: browser,
    },
    Step {
        name: "live",
        about: "live writing to InfluxDB and VictoriaMetrics, and the Grafana dashboards",
        needs: &[Need::PythonVenv, Need::Influx, Need::Victoria],
        run: live,
    },
    Step {
        name: "costs",
        about: "instructions and stack of the firmware against budgets.toml",
        needs: &[Need::Qemu, Need::FirmwareTarget],
        run: costs::check,
    },
    Step {
        name: "emulator",
        about: "end to end with the firmware in the emulator",
        needs: &[Need::Qemu, Need::PythonVenv, Need::FirmwareTarget, Need::Dosfstools],
        run: emulator,
    },
    Step {
        name: "demo",
        about: "cargo xtask demo",
        needs: &[Need::Qemu, Need::FirmwareTarget],
        run: demo::as_test,
    },
    Step { name: "deny", about: "licences, bans and sources of the dependencies", needs: &[], run: deny },
];

/// Crates of the firmware that must do without std, whatever builds them.
const NO_STD: [&str; 7] = [
    "hums-dialect",
    "hums-core",
    "hums-link",
    "hums-blackbox",
    "hums-recorder",
    "hums-store",
    "hums-onboard",
];

pub(crate) fn list() {
    for step in &STEPS {
        println!("{:<16} {}", step.name, step.about);
    }
}

pub(crate) fn check_names(names: &[String]) -> Result<()> {
    match names.iter().find(|name| STEPS.iter().all(|step| step.name != **name)) {
        Some(unknown) => bail!("there is no step {unknown}; cargo xtask test --list shows them"),
        None => Ok(()),
    }
}

/// Runs the steps named in `only`, or all; stops at the first that fails.
pub(crate) fn run(only: &[String]) -> Result<()> {
    let chosen: Vec<&Step> =
        STEPS.iter().filter(|step| only.is_empty() || only.iter().any(|name| name == step.name)).collect();
    let mut needs: Vec<Need> = chosen.iter().flat_map(|step| step.needs).copied().collect();
    needs.push(Need::Linker);
    needs.sort_unstable();
    needs.dedup();
    setup::ensure(&needs, false).require_all()?;

    let mut durations = Vec::new();
    let mut failure = None;
    for step in &chosen {
        eprintln!("\n=== {}: {}", step.name, step.about);
        let start = Instant::now();
        let outcome = (step.run)();
        let took = start.elapsed();
        eprintln!(
            "=== {} {} in {}",
            step.name,
            if outcome.is_ok() { "passed" } else { "FAILED" },
            seconds(took)
        );
        durations.push((step.name, took, outcome.is_ok()));
        if let Err(error) = outcome {
            failure = Some(
                error.context(format!("step {0} failed; alone: cargo xtask test --only {0}", step.name)),
            );
            break;
        }
    }
    eprintln!();
    for (name, took, passed) in &durations {
        eprintln!("{name:<16} {:>9}  {}", seconds(*took), if *passed { "passed" } else { "FAILED" });
    }
    if durations.len() < chosen.len() {
        eprintln!(
            "not run: {}",
            chosen[durations.len()..].iter().map(|s| s.name).collect::<Vec<_>>().join(", ")
        );
    }
    failure.map_or(Ok(()), Err)
}

fn seconds(duration: Duration) -> String {
    format!("{:.1} s", duration.as_secs_f64())
}

fn fmt() -> Result<()> {
    Shell::cargo().args(["fmt", "--all", "--", "--check"]).run()
}

fn clippy() -> Result<()> {
    Shell::cargo()
        .args(["clippy", "--workspace", "--exclude=hums-app", "--all-targets", "--features"])
        .arg(FEATURES.split(',').map(|name| format!("hums-tests/{name}")).collect::<Vec<_>>().join(","))
        .args(["--", "-D", "warnings"])
        .run()
}

fn clippy_firmware() -> Result<()> {
    for board in Board::ALL {
        Shell::cargo().arg("clippy").args(board.cargo_arguments()).args(["--", "-D", "warnings"]).run()?;
    }
    Ok(())
}

fn doc() -> Result<()> {
    Shell::cargo()
        .env("RUSTDOCFLAGS", "-D warnings")
        .args(["doc", "--quiet", "--workspace", "--exclude=hums-app", "--lib", "--no-deps"])
        .arg("--document-private-items")
        .run()
}

fn no_std() -> Result<()> {
    // One by one, so that no crate gets a feature that only another one turned on.
    for package in NO_STD {
        Shell::cargo().args(["check", "--quiet", "--target", FIRMWARE_TARGET, "--package", package]).run()?;
    }
    Ok(())
}

fn unit() -> Result<()> {
    // Without the firmware's binary: it turns on `defmt` in the crates that it shares with this PC.
    Shell::cargo().args(["test", "--workspace", "--exclude=hums-app", "--exclude=hums-tests"]).run()
}

/// All of the end-to-end tests, in every step, so that nothing is built again for the next one.
const FEATURES: &str = "emulator,browser,databases";

/// `cargo test` of one part of the end-to-end tests, with all that it may use; `options` are the test runner's.
fn end_to_end(target: &str, options: &[&str]) -> Result<()> {
    hums::build()?;
    oracle::prepare()?;
    Shell::cargo()
        .env("HUMS_BIN", hums::program())
        .env("HUMS_PYTHON", oracle::python())
        .env("HUMS_DIALECT", oracle::dialect())
        .env("HUMS_FIRMWARE", Board::Emulated.image())
        .args(["test", "--package=hums-tests", "--features", FEATURES, "--test", target, "--"])
        .args(options)
        .run()
}

fn sim() -> Result<()> {
    // Half of their time they wait: links are as slow as radios are.
    let threads = 2 * std::thread::available_parallelism().map_or(1, usize::from);
    end_to_end("sim", &["--test-threads", &threads.to_string()])
}

fn answer() -> Result<()> {
    end_to_end("answer", &[])
}

fn browser() -> Result<()> {
    end_to_end("browser", &[])
}

fn live() -> Result<()> {
    end_to_end("live", &[])
}

fn emulator() -> Result<()> {
    firmware::build(Board::Emulated)?;
    end_to_end("emulator", &[])
}

/// Advisories need a network, which may be missing, and appear on their own day: told, and never a failure.
fn deny() -> Result<()> {
    let deny = || Shell::cargo().args(["deny", "--log-level", "warn"]);
    if Shell::cargo().args(["deny", "--version"]).ask().is_none() {
        eprintln!("cargo-deny is not installed: building it, once (some minutes)");
        // It has little to do: building it without optimisation takes a third of the time.
        Shell::cargo().args(["install", "--quiet", "--locked", "--debug", "cargo-deny"]).run()?;
    }
    deny().args(["check", "bans", "licenses", "sources"]).run().context("dependencies against deny.toml")?;
    if deny().args(["fetch", "db"]).ask().is_none() {
        eprintln!("NOT CHECKED: advisories, because their database cannot be fetched here");
    } else if deny().args(["check", "--disable-fetch", "advisories"]).run().is_err() {
        eprintln!("warning: there are advisories about dependencies, see above");
    }
    Ok(())
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
    fn a_step_that_does_not_exist_is_refused() {
        check_names(&["fmt".to_owned()]).unwrap();
        assert!(check_names(&["fmt".to_owned(), "format".to_owned()]).is_err());
    }
}
