//! The `hums` command: the pipeline of the firmware on this PC, and everything that reads what it wrote.

#![deny(
    clippy::print_stderr,
    reason = "`eprintln!` panics where standard error lies on a full disk: `output::note`, `output::aside`"
)]

#[macro_use(note)]
extern crate hums_base;

pub use hums_analysis::{check, counters, params, part, reference, series, states, summary, track};
pub use hums_base::{
    archive, colour, duplex, endpoint, files, hex, interrupt, outcome, output, plural, printable, progress,
    rng, sink, utc,
};
pub use hums_export as decode;
pub use hums_formats::{card, ending, followed, logs, loss, mavlink, names, naming, source, statustext};
pub use hums_report::{page, report};

pub mod cli;
pub mod info;
pub mod live;
pub mod run;
pub mod shell;
pub mod talk;
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
        Command::Check(args) => check::run(&args.request()),
        Command::Report(args) => report::run(&args.request()),
        Command::Live(args) => live::run(args),
        Command::Decode(args) => decode::run(&args.request()),
        Command::Share(args) => decode::share::run(&args.request()),
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
