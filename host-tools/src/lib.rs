//! The `hums` command: the pipeline of the firmware on this PC, and everything that reads what it wrote.

#![deny(
    clippy::print_stderr,
    reason = "`eprintln!` panics where standard error lies on a full disk: `output::note`, `output::aside`"
)]

/// A message on standard error: what the world put into it obeys no terminal.
macro_rules! note {
    ($($words:tt)*) => {
        $crate::output::note(&format!($($words)*))
    };
}

pub mod archive;
pub mod card;
pub mod check;
pub mod cli;
pub mod colour;
pub mod counters;
pub mod decode;
pub mod duplex;
pub mod ending;
pub mod endpoint;
pub mod files;
pub mod followed;
pub mod hex;
pub mod info;
pub mod interrupt;
pub mod live;
pub mod logs;
pub mod loss;
pub mod mavlink;
pub mod names;
pub mod outcome;
pub mod output;
pub mod pack;
pub mod page;
pub mod part;
pub mod plural;
pub mod printable;
pub mod progress;
pub mod report;
pub mod rng;
pub mod run;
pub mod series;
pub mod shell;
pub mod sink;
pub mod source;
pub mod states;
pub mod statustext;
pub mod summary;
pub mod talk;
pub mod track;
pub mod utc;
pub mod verify;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

use cli::{BoxAction, Cli, Command};
use outcome::Outcome;

/// Runs the program with these arguments (the first is the program's own name).
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    interrupt::no_end_by_file_size();
    match Cli::try_parse_from(arguments) {
        Ok(cli) => outcome::exit_code(command(&cli.command)),
        Err(error) => {
            // Help and version go to standard output and are no failure; a reader that has gone is none either.
            let _ = error.print();
            ExitCode::from(if error.use_stderr() { 2 } else { 0 })
        }
    }
}

fn command(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Check(args) => check::run(args),
        Command::Report(args) => report::run(args),
        Command::Live(args) => live::run(args),
        Command::Decode(args) => decode::run(args),
        Command::Info(args) => info::run(args),
        Command::Sim(args) => run::sim::run(args),
        Command::Box(args) => match &args.action {
            BoxAction::Pull(args) => talk::pull::run(args),
            BoxAction::Params(args) => talk::params::run(args),
            BoxAction::FormatCard(args) => talk::format::run(args),
        },
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    }
}
