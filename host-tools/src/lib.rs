//! The `hums` command: the firmware's pipeline on this PC, and all readers of its output.

#![deny(
    clippy::print_stderr,
    reason = "`eprintln!` panics where standard error lies on a full disk: `output::note`, `output::aside`"
)]

#[macro_use(note)]
extern crate hums_base;

pub use hums_analysis::{check, counters, params, part, reference, series, states, summary, track};
pub use hums_base::{
    archive, colour, duplex, endpoint, files, hex, interrupt, outcome, output, plural, printable, progress,
    rng, sink, table, utc,
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
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{CommandFactory as _, Parser as _};

use cli::{BoxAction, Cli, Command};
use decode::fleet::overview;
use decode::storage::{Address, LocalInputs};
use outcome::Outcome;

/// The first argument is the program's name.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> ExitCode {
    interrupt::no_end_by_file_size();
    let given: Vec<OsString> = arguments.into_iter().collect();
    let count = given.len();
    let arguments = with_command(given);
    let lacks_command = arguments.len() > count;
    let code = match Cli::try_parse_from(arguments) {
        Ok(mut cli) => outcome::exit_code(fetched(&mut cli.command)),
        Err(error) => {
            // Help and version succeed; so does output to a reader that has gone.
            let _ = error.print();
            ExitCode::from(if error.use_stderr() { 2 } else { 0 })
        }
    };
    // Dropped files.
    if lacks_command {
        hums_base::console::hold();
    }
    code
}

/// Adds `check` before files, standard input, `--`, and flags of `check`.
fn with_command(mut arguments: Vec<OsString>) -> Vec<OsString> {
    let is_of_check = |first: &OsString| {
        let words = first.to_string_lossy();
        let is_own = matches!(&*words, "-h" | "--help" | "-V" | "--version" | "help");
        let is_command = Cli::command().find_subcommand(first).is_some();
        // A path that is missing is an error of that path, not of a command.
        let is_path = words.contains(['.', '/', '\\']) || Path::new(first).exists();
        !is_command && !is_own && (words.starts_with('-') || is_path)
    };
    if arguments.get(1).is_some_and(is_of_check) {
        arguments.insert(1, "check".into());
    }
    arguments
}

/// Of recordings, or of the fleet in a folder of tables.
fn report_page(request: &report::Request<'_>) -> anyhow::Result<Outcome> {
    match request.inputs {
        [folder] if overview::is_fleet(folder) => report::fleet::page(request, &overview::read(folder)?),
        _ => report::run(request),
    }
}

/// With inputs of object storage on this computer.
fn fetched(given: &mut Command) -> anyhow::Result<Outcome> {
    let is_far = |input: &PathBuf| Address::of(input).is_ok_and(|address| address.is_some());
    if matches!(given, Command::Report(args) if args.output.is_none() && args.inputs.iter().any(is_far)) {
        return Err(outcome::usage(
            "-o: name the page; without it the page is beside its input, which is in object storage",
        ));
    }
    let inputs: Vec<&mut PathBuf> = match given {
        Command::Check(args) => args.inputs.iter_mut().chain(&mut args.past).collect(),
        Command::Report(args) => args.inputs.iter_mut().collect(),
        Command::Decode(args) => args.inputs.iter_mut().collect(),
        Command::Share(args) => vec![&mut args.input],
        Command::Info(args) => args.inputs.iter_mut().collect(),
        Command::Due(args) => args.inputs.iter_mut().collect(),
        Command::Logbook(args) => args.inputs.iter_mut().collect(),
        _ => Vec::new(),
    };
    // Until the end of the command.
    let _fetched = LocalInputs::inputs(inputs)?;
    command(given)
}

fn command(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::Check(args) => check::run(&args.request()),
        Command::Report(args) => report_page(&args.request()),
        Command::Live(args) => live::run(args),
        Command::Decode(args) => decode::run(args, cli::PROGRAM),
        Command::Share(args) => decode::share::run(args),
        Command::Info(args) => info::run(args),
        Command::Due(args) => info::due::run(args),
        Command::Logbook(args) => decode::logbook::run(args),
        Command::Compact(args) => decode::fleet::compact::run(args),
        Command::Sim(args) => run::sim::run(args),
        Command::Box(args) => match &args.action {
            BoxAction::Pull(args) => talk::pull::run(args),
            BoxAction::Params(args) => talk::params::run(args),
            BoxAction::Replaced(args) => talk::replaced::run(args),
            BoxAction::CardReader(args) => talk::card_reader::run(args),
            BoxAction::Update(args) => talk::update::run(args),
            BoxAction::FormatCard(args) => talk::format::run(args),
            BoxAction::Setup(args) => talk::setup::run(args),
            BoxAction::Report(args) => talk::report::run(args),
        },
        Command::Completions(args) => shell::completions(args),
        Command::Man(args) => shell::man(args),
    }
}
