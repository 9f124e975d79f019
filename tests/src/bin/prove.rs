//! Runs campaigns: `cargo xtask prove` calls it.
#![allow(clippy::print_stdout, reason = "a program's results")]

use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};
use hums_tests::flights::root;
use hums_tests::prove::diagnosis::{self, DIAGNOSIS, Flights};
use hums_tests::prove::fleet::{self, FLEET, Fleet};
use hums_tests::prove::storage::{self, STORAGE};
use hums_tests::prove::{
    CAMPAIGNS, Campaign, Counting, Options, Part, Provenance, compare_report, write_report,
};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const USAGE: &str = "prove [NAME...] [--short] [--seed N] [--runs N] [--no-report] [--list]
prove diagnosis [FOLDER]... [--unseen FOLDER]... [--short] [--write]
prove fleet [--short] [--runs N]
prove storage";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let run = match words.split_first() {
        Some((first, rest)) if first == DIAGNOSIS => Flights::parse(rest).map(|flights| judge(&flights)),
        Some((first, rest)) if first == FLEET => {
            Fleet::parse(rest).map(|extent| timed(FLEET, || fleet::run(&extent)))
        }
        Some((first, [])) if first == STORAGE => Ok(timed(STORAGE, storage::run)),
        _ => Arguments::parse(words.into_iter()).map(|arguments| run(&arguments)),
    };
    match run {
        Ok(result) => ended(result),
        Err(error) => {
            eprintln!("{error}\n{USAGE}");
            ExitCode::from(2)
        }
    }
}

fn ended(result: Result<()>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

fn judge(flights: &Flights) -> Result<()> {
    let start = Instant::now();
    let text = diagnosis::run(flights, || commit("docs/diagnosis.md"))?;
    println!("{DIAGNOSIS} took {:.1} s\n{text}", start.elapsed().as_secs_f64());
    Ok(())
}

fn timed(name: &str, run: impl FnOnce() -> Result<String>) -> Result<()> {
    let start = Instant::now();
    let text = run()?;
    println!("{name} held in {:.1} s\n{text}", start.elapsed().as_secs_f64());
    Ok(())
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
    let chosen: Vec<&'static Campaign> =
        CAMPAIGNS.iter().filter(|one| all || arguments.names.iter().any(|name| name == one.name)).collect();
    if arguments.list {
        for campaign in chosen {
            println!("{:<12} {}", campaign.name, campaign.about);
        }
        if all {
            println!("{DIAGNOSIS:<12} {}", diagnosis::ABOUT);
            println!("{FLEET:<12} {}", fleet::ABOUT);
            println!("{STORAGE:<12} {}", storage::ABOUT);
        }
        return Ok(());
    }
    let options = &arguments.options;
    // Only a full long run writes the document.
    let is_whole = all && !options.short && options.runs.is_none() && arguments.report;
    let commit = if is_whole { Some(commit("docs/proof.md")?) } else { None };
    let parts = chosen.into_iter().map(|campaign| prove(campaign, options)).collect::<Result<Vec<_>>>()?;
    if all && options.short {
        compare_report(&root().join("docs/proof.md"), &parts)?;
        judge(&Flights::short())?;
    }
    if let Some(commit) = commit {
        let path: PathBuf = root().join("docs/proof.md");
        write_report(&path, &parts, &Provenance { commit, seed: options.seed })?;
        println!("{}", path.display());
    }
    Ok(())
}

fn prove(campaign: &'static Campaign, options: &Options) -> Result<Part> {
    let start = Instant::now();
    let figures =
        (campaign.run)(options).with_context(|| format!("{}: {}", campaign.name, campaign.about))?;
    let seconds = start.elapsed().as_secs_f64();
    println!("{} held in {seconds:.1} s, seed {}\n{}", campaign.name, options.seed, figures.text());
    Ok(Part { campaign, figures, seconds })
}

/// Changed files would make a document without a commit.
fn commit(document: &str) -> Result<String> {
    let git = |arguments: &[&str]| -> Result<String> {
        let output = Command::new("git").current_dir(root()).args(arguments).output().context("git")?;
        if !output.status.success() {
            bail!("git {}: {}", arguments.join(" "), String::from_utf8_lossy(&output.stderr).trim());
        }
        Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let changed = git(&["status", "--porcelain", "--untracked-files=no"])?;
    let changed: Vec<&str> = changed.lines().filter(|line| !line.ends_with(document)).collect();
    if !changed.is_empty() {
        bail!(
            "{document} names the commit that it is of, and these files differ from it: {}; commit them, or run without \
             writing it (--no-report; diagnosis writes it with --write only)",
            changed.join(", ")
        );
    }
    git(&["rev-parse", "--short=12", "HEAD"])
}
