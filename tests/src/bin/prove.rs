//! Runs campaigns: `cargo xtask prove` calls it.
#![allow(clippy::print_stdout, reason = "a program's results")]

use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use hums_tests::flights::root;
use hums_tests::prove::{CAMPAIGNS, Campaign, Counting, Options, Provenance, write_report};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const USAGE: &str = "prove [NAME...] [--short] [--seed N] [--runs N] [--no-report] [--list]";

fn main() -> ExitCode {
    match Arguments::parse(std::env::args().skip(1)) {
        Ok(arguments) => match run(&arguments) {
            Ok(()) => ExitCode::SUCCESS,
            Err(error) => {
                eprintln!("error: {error:#}");
                ExitCode::FAILURE
            }
        },
        Err(error) => {
            eprintln!("{error}\n{USAGE}");
            ExitCode::from(2)
        }
    }
}

struct Arguments {
    names: Vec<String>,
    options: Options,
    list: bool,
    report: bool,
}

impl Arguments {
    fn parse(words: impl Iterator<Item = String>) -> Result<Self> {
        let mut words = words.peekable();
        let options = Options { short: false, seed: 1, runs: None };
        let mut arguments = Self { names: Vec::new(), options, list: false, report: true };
        while let Some(word) = words.next() {
            let mut number = || -> Result<u64> {
                let word = words.next().context("a number is missing")?;
                word.parse().with_context(|| format!("{word} is no number"))
            };
            match word.as_str() {
                "--short" => arguments.options.short = true,
                "--list" => arguments.list = true,
                "--no-report" => arguments.report = false,
                "--seed" => arguments.options.seed = number()?,
                "--runs" => arguments.options.runs = Some(number()?),
                name if CAMPAIGNS.iter().any(|campaign| campaign.name == name) => {
                    arguments.names.push(name.to_owned());
                }
                other => bail!("there is no campaign {other}"),
            }
        }
        Ok(arguments)
    }
}

fn run(arguments: &Arguments) -> Result<()> {
    let all = arguments.names.is_empty();
    let chosen = CAMPAIGNS.iter().filter(|one| all || arguments.names.iter().any(|name| name == one.name));
    for campaign in chosen {
        if arguments.list {
            println!("{:<12} {}", campaign.name, campaign.about);
        } else {
            prove(campaign, arguments)?;
        }
    }
    Ok(())
}

fn prove(campaign: &Campaign, arguments: &Arguments) -> Result<()> {
    let options = &arguments.options;
    let commit = commit();
    let start = Instant::now();
    let figures =
        (campaign.run)(options).with_context(|| format!("{}: {}", campaign.name, campaign.about))?;
    let seconds = start.elapsed().as_secs_f64();
    println!("{} held in {seconds:.1} s, seed {}\n{}", campaign.name, options.seed, figures.text());
    // Only the long form with its own number of cases is a proof.
    if arguments.report && !options.short && options.runs.is_none() {
        let path: PathBuf = root().join("docs/proof.md");
        write_report(&path, campaign, &figures, &Provenance { commit, seed: options.seed, seconds })?;
    }
    Ok(())
}

/// The commit that was built, as far as git knows.
fn commit() -> String {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").current_dir(root()).args(arguments).output().ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let Some(commit) = git(&["rev-parse", "--short=12", "HEAD"]) else { return "unknown".to_owned() };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"]).unwrap_or_default();
    let code = changed.lines().filter(|line| !line.ends_with("docs/proof.md")).count();
    if code == 0 { commit } else { format!("{commit} with changes") }
}
