//! `cargo xtask`: the tasks of this repository, from nothing but Rust and git.
//!
//! Each command first looks for its requirements ([`setup`]). It installs missing ones if it may. Otherwise it prints the
//! commands to type, and does the rest of its work. Nothing here is needed to use `hums` itself.

mod bench;
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
mod wine;

use std::fs;
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};

use crate::setup::Need;

const HELP: &str = "\
cargo xtask COMMAND

  demo [--flight FILE] [--pc] [--no-dashboard]
                                 a recorded flight through the image that is flashed, on a model of its chip, and what came
                                 of it; with --pc through the same pipeline on this PC;
                                 on a terminal the dashboard plays it at the end, until Ctrl-C
  test [--only STEP]... [--list] everything that CI checks, or the steps named with what they need; a table at the end
  test --quick                   format, lints and unit tests of the packages that changed
  prove [NAME]... [--short] [--seed N] [--runs N] [--list]
                                 the campaigns: power cuts, damage, stalls, endurance, hostile ground station, noise;
                                 all of them (an hour) make docs/proof.md
  prove diagnosis [FOLDER]... [--unseen FOLDER]... [--write]
                                 faults found and false alarms, on the labelled flights of the repository and of folders;
                                 --write makes docs/diagnosis.md
  prove chip [TEST]...           the long tests of the image that is flashed, on the model of its chip
  prove boards                   the image of every board, each on that model with its own pins
  prove foreign [EMBASSY]        programs of others on that model, built from what their packages bring; and embassy's examples, from
                                 the folder of a checkout of its repository
  firmware [--board BOARD]       build the firmware of a board (boards/BOARD.toml; olimex-stm32-h405 if none is named)
  boards                         make docs/boards.md and the table of README.md from the files in boards/
  bench [sizes|speed|logs]...    what the record takes: bytes and decoding time; how fast logs are checked
  fuzz [--seconds N]             the fuzz targets, each for so long (300); needs nightly Rust and cargo-fuzz
  dist [--check]                 the files of a release, in target/dist; --check builds them twice, compares,
                                 and runs what is for Windows under Wine
  flash [--board BOARD] [--dfu]  build the firmware and program it: by a debug probe (probe-rs), or over USB by the chip's own
                                 boot loader (dfu-util); what the board has stored stays
  attach [--board BOARD]         build the firmware with a log, program it and show the log (probe-rs)
  size [--write]                 flash and RAM of the default board against budgets.toml; --write notes what is taken there and in
                                 ARCHITECTURE.md
  costs                          cycles, load and stack, on the model of the chip, against budgets.toml
  setup [--dry-run]              install what demo and test need, or only say what is missing
  grafana                        make the dashboards of each database in host-tools/grafana
  manifest                       make tests/flights/manifest.json anew with pymavlink
  help                           this text

Exit codes: 0 done, 1 failed, 2 usage.";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let command = match Command::parse(&arguments) {
        Ok(command) => command,
        Err(error) => {
            eprintln!("{error}\n\n{HELP}");
            return ExitCode::from(2);
        }
    };
    match command.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("\nerror: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// The requested command.
#[derive(Debug, PartialEq, Eq)]
enum Command {
    Demo(demo::Options),
    Test(Tests),
    Prove(Vec<String>),
    Firmware(String),
    Boards,
    Flash(flash::Options),
    Attach(flash::Options),
    Bench(Vec<bench::Bench>),
    Fuzz { seconds: u32 },
    Dist { check: bool },
    Size { write: bool },
    Costs,
    Setup { dry_run: bool },
    Grafana,
    Manifest,
    Help,
}

/// What of the tests.
#[derive(Debug, PartialEq, Eq)]
enum Tests {
    /// The steps named, or all.
    Steps(Vec<String>),
    List,
    Quick,
}

impl Command {
    fn parse(arguments: &[String]) -> Result<Self> {
        let mut words = arguments.iter().map(String::as_str);
        let Some(name) = words.next() else { return Ok(Self::Help) };
        let rest: Vec<&str> = words.collect();
        if rest.iter().any(|word| matches!(*word, "--help" | "-h")) {
            return Ok(Self::Help);
        }
        match name {
            "demo" => Ok(Self::Demo(demo::Options::parse(&rest)?)),
            "test" => parse_test(&rest),
            // The campaigns know their names and flags themselves.
            "prove" => Ok(Self::Prove(rest.iter().map(|word| (*word).to_owned()).collect())),
            "bench" => Ok(Self::Bench(bench::Bench::parse(&rest)?)),
            "fuzz" => Ok(Self::Fuzz { seconds: fuzz::parse(&rest)? }),
            "firmware" => match rest.as_slice() {
                [] => Ok(Self::Firmware(hums_boards::DEFAULT.to_owned())),
                ["--board", board] => Ok(Self::Firmware(firmware::board(board)?.name.clone())),
                _ => bail!("firmware takes --board BOARD"),
            },
            "dist" => match rest.as_slice() {
                [] => Ok(Self::Dist { check: false }),
                ["--check"] => Ok(Self::Dist { check: true }),
                _ => bail!("dist takes nothing or --check"),
            },
            "flash" => Ok(Self::Flash(flash::Options::parse(&rest, true)?)),
            "attach" => Ok(Self::Attach(flash::Options::parse(&rest, false)?)),
            "setup" => match rest.as_slice() {
                [] => Ok(Self::Setup { dry_run: false }),
                ["--dry-run"] => Ok(Self::Setup { dry_run: true }),
                _ => bail!("setup takes nothing or --dry-run"),
            },
            "size" => match rest.as_slice() {
                [] => Ok(Self::Size { write: false }),
                ["--write"] => Ok(Self::Size { write: true }),
                _ => bail!("size takes nothing or --write"),
            },
            "boards" | "costs" | "grafana" | "manifest" | "help" | "--help" | "-h" if !rest.is_empty() => {
                bail!("{name} takes nothing")
            }
            "boards" => Ok(Self::Boards),
            "costs" => Ok(Self::Costs),
            "grafana" => Ok(Self::Grafana),
            "manifest" => Ok(Self::Manifest),
            "help" | "--help" | "-h" => Ok(Self::Help),
            other => bail!("there is no command {other}"),
        }
    }

    fn run(self) -> Result<()> {
        match self {
            Self::Demo(options) => demo::run(&options),
            Self::Test(Tests::List) => {
                test::list();
                Ok(())
            }
            Self::Test(Tests::Quick) => test::run_quick(),
            Self::Test(Tests::Steps(only)) => test::run(&only),
            Self::Prove(arguments) => prove::run(&arguments),
            Self::Firmware(board) => {
                setup::ensure(&[Need::Linker, Need::FirmwareTarget], false).require_all()?;
                println!("{}", firmware::build(firmware::board(&board)?)?.display());
                Ok(())
            }
            Self::Flash(options) => flash::flash(options),
            Self::Attach(options) => flash::attach(options),
            Self::Boards => write_boards(),
            Self::Costs => costs::check(),
            Self::Bench(what) => bench::run(&what),
            Self::Fuzz { seconds } => fuzz::run(seconds),
            Self::Dist { check } => dist::run(check),
            Self::Size { write } => {
                setup::ensure(&[Need::Linker, Need::FirmwareTarget], false).require_all()?;
                budgets::check(&[firmware::default_board()], write)
            }
            Self::Setup { dry_run } => {
                let outcome = setup::ensure(&Need::all(), dry_run);
                if !dry_run && outcome.has(Need::PythonVenv) {
                    oracle::prepare()?;
                }
                outcome.require_all()
            }
            Self::Grafana => grafana::write(),
            Self::Manifest => {
                setup::ensure(&[Need::PythonVenv], false).require_all()?;
                oracle::write_manifest()
            }
            Self::Help => {
                println!("{HELP}");
                Ok(())
            }
        }
    }
}

/// Writes the page of the boards, and their table into the README: from its head up to the next empty line.
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

fn parse_test(rest: &[&str]) -> Result<Command> {
    if let [only @ ("--list" | "--quick")] = rest {
        return Ok(Command::Test(if *only == "--list" { Tests::List } else { Tests::Quick }));
    }
    let mut only = Vec::new();
    for words in rest.chunks(2) {
        let ["--only", step] = words else { bail!("test takes --only STEP, or --quick, or --list") };
        only.push((*step).to_owned());
    }
    test::check_names(&only)?;
    Ok(Command::Test(Tests::Steps(only)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Command> {
        Command::parse(&line.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    }

    #[test]
    fn nothing_and_help_show_the_help() {
        for line in ["", "help", "--help", "-h", "test --help"] {
            assert_eq!(parse(line).unwrap(), Command::Help, "{line}");
        }
    }

    #[test]
    fn a_mistyped_word_is_a_usage_error_and_not_ignored() {
        for line in [
            "tset",
            "size now",
            "setup --dry",
            "firmware --board f407",
            "test --only",
            "test --only fmtt",
            "test --quick now",
            "demo --fligth x",
        ] {
            assert!(parse(line).is_err(), "{line}");
        }
    }

    #[test]
    fn steps_are_chosen_by_name() {
        let expected = Command::Test(Tests::Steps(vec!["fmt".into(), "budgets".into()]));
        assert_eq!(parse("test --only fmt --only budgets").unwrap(), expected);
        assert_eq!(parse("test --quick").unwrap(), Command::Test(Tests::Quick));
    }
}
