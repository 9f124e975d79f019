//! `cargo xtask`: the tasks of this repository, from nothing but Rust and git.
//!
//! Commands look for requirements ([`setup`]), install missing ones if they may, or print what to type.

mod bench;
mod browser;
mod budgets;
mod costs;
mod demo;
mod dfu;
mod dist;
mod firmware;
mod flash;
mod foreign;
mod fuzz;
mod grafana;
mod hums;
mod image;
mod lines;
mod oracle;
mod pc;
mod prove;
mod repo;
mod setup;
mod shell;
mod test;
mod update;
mod wine;

use std::fs;
use std::process::ExitCode;

use anyhow::{Context as _, Result};
use clap::Parser;

use crate::setup::Need;

/// The tasks of this repository
#[derive(Parser)]
#[command(bin_name = "cargo xtask", after_help = "Exit codes: 0 done, 1 failed, 2 usage.")]
enum Command {
    /// Fly a recording through the firmware's image on a model of its chip, and show what came of it
    Demo(demo::Options),
    /// Run all that CI checks, with a table of seconds at the end
    Test(test::Options),
    /// Run the campaigns: power cuts, damage, stalls, endurance, hostile ground station, noise
    ///
    /// All of them take an hour and make docs/proof.md. Seven names are no campaigns:
    ///
    /// `prove diagnosis [FOLDER]... [--unseen FOLDER]... [--write]` counts found faults and false alarms in labelled
    /// flights; --write makes docs/diagnosis.md.
    ///
    /// `prove fleet [--short] [--runs N]` makes 20,000 sessions of 10,000 vehicles, and measures ingest, size and queries.
    ///
    /// `prove storage` tries tables in object storage, on a server of its own.
    ///
    /// `prove chip [TEST]...` runs the long tests of the image on the model of its chip.
    ///
    /// `prove boards` runs the image of every board there, each with its own pins.
    ///
    /// `prove foreign [EMBASSY]` runs other people's programs on that model: examples of registry packages, and of a
    /// checkout of embassy's repository.
    ///
    /// `prove browser` measures time and memory of the check in Chromium and Firefox.
    Prove {
        /// [NAME]... [--short] [--seed N] [--runs N] [--list]
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Build the firmware and print the image's path
    Firmware {
        /// One of the files in boards/, by its name
        #[arg(long, value_parser = hums_boards::find, default_value = hums_boards::DEFAULT)]
        board: &'static firmware::Board,
    },
    /// Make docs/boards.md and the README's table from the files in boards/
    Boards,
    /// Measure what the record takes, and how fast logs are decoded and checked
    Bench {
        /// All, if none is named
        what: Vec<bench::Bench>,
    },
    /// Run the fuzz targets; needs nightly Rust and cargo-fuzz
    Fuzz {
        /// Seconds for each target
        #[arg(long, default_value_t = 300)]
        seconds: u32,
    },
    /// Make the files of a release in target/dist
    Dist {
        #[command(flatten)]
        options: dist::Options,
        /// Make only target/hums-check.html, of the files as they are
        #[arg(long, conflicts_with_all = ["check", "key"])]
        page: bool,
    },
    /// Build the firmware and program it; what the board has stored stays
    Flash(flash::Options),
    /// Build the firmware with a log, program it and show the log (probe-rs)
    Attach {
        /// One of the files in boards/, by its name
        #[arg(long, value_parser = hums_boards::find, default_value = hums_boards::DEFAULT)]
        board: &'static firmware::Board,
    },
    /// Compare flash and RAM of the default board with budgets.toml
    Size {
        /// Note what is taken there and in ARCHITECTURE.md
        #[arg(long)]
        write: bool,
    },
    /// Compare cycles, load and stack on the model of the chip with budgets.toml
    Costs,
    /// Install what demo and test need
    Setup {
        /// Only print what is missing
        #[arg(long)]
        dry_run: bool,
    },
    /// Make the dashboards of each database in host-tools/grafana
    Grafana,
}

fn main() -> ExitCode {
    match Command::parse().run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("\nerror: {error:#}");
            ExitCode::FAILURE
        }
    }
}

impl Command {
    fn run(self) -> Result<()> {
        match self {
            Self::Demo(options) => demo::run(&options),
            Self::Test(options) => test::run(&options),
            Self::Prove { arguments } => prove::run(&arguments),
            Self::Firmware { board } => {
                setup::require(&[Need::Linker, Need::FirmwareTarget])?;
                println!("{}", firmware::build(board)?.display());
                Ok(())
            }
            Self::Bench { what } => bench::run(&what),
            Self::Fuzz { seconds } => fuzz::run(seconds),
            Self::Dist { page: true, .. } => browser::page(),
            Self::Dist { options, .. } => dist::run(&options),
            Self::Flash(options) => flash::flash(&options),
            Self::Attach { board } => flash::attach(board),
            Self::Boards => write_boards(),
            Self::Size { write } => {
                setup::require(&[Need::Linker, Need::FirmwareTarget])?;
                budgets::check(&[firmware::default_board()], write)
            }
            Self::Costs => costs::check(),
            Self::Setup { dry_run } => {
                let outcome = setup::ensure(&Need::all(), dry_run);
                if !dry_run && outcome.has(Need::PythonVenv) {
                    oracle::prepare()?;
                }
                outcome.require_all()
            }
            Self::Grafana => grafana::write(),
        }
    }
}

/// The page, and the README's table: from its head to the next empty line.
fn write_boards() -> Result<()> {
    let table = hums_boards::page::table("docs/boards.md");
    let path = repo::root().join("README.md");
    let text = fs::read_to_string(&path)?;
    let head = table.lines().next().unwrap_or_default();
    let (before, old) = text.split_once(head).context("README.md has no table of boards")?;
    let (_, after) = old.split_once("\n\n").context("README.md: the table of boards has no end")?;
    fs::write(&path, format!("{before}{table}\n{after}"))?;
    Ok(fs::write(repo::root().join("docs/boards.md"), hums_boards::page::render())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mistyped_word_is_a_usage_error_and_not_ignored() {
        for line in [
            "tset",
            "size now",
            "setup --dry",
            "firmware --board f407",
            "flash --erase",
            "attach --dfu",
            "bench size",
            "fuzz --seconds x",
            "test --only",
            "test --only fmtt",
            "test --quick now",
            "test --quick --list",
            "demo --fligth x",
        ] {
            let words = ["cargo xtask"].into_iter().chain(line.split_whitespace());
            assert!(Command::try_parse_from(words).is_err_and(|error| error.exit_code() == 2), "{line}");
        }
    }

    #[test]
    fn the_campaigns_get_their_own_words() {
        let words = ["cargo xtask", "prove", "noise", "--runs", "7", "--short"];
        let Command::Prove { arguments } = Command::try_parse_from(words).unwrap() else { panic!() };
        assert_eq!(arguments, words[2..]);
    }
}
