//! The command line, as clap reads it and `--help` teaches it.

mod check;
mod live;
mod read;
mod run;
mod shell;
mod talk;

use clap::{Parser, Subcommand};

pub use crate::decode::args::{Compact, Decode, Logbook, Share};
pub use check::Check;
pub use live::Live;
pub use read::{Due, Info, Report};
pub use run::{FaultFlags, Sim, Speed};
pub use shell::{Completions, Man};
pub use talk::{
    BoxAction, BoxArgs, BoxReport, CardReader, FormatCard, Link, LogMoment, Params, ParamsAction, Pull,
    Replaced, Setup, Update,
};

const ABOUT: &str = "HUMS: an on-board black box and health monitor for drones that speak MAVLink.

The firmware listens at the autopilot's UART, records every frame on an SD card, checks the vehicle's health and sends
a summary to the ground station. This program runs the same pipeline on this PC, and reads the cards.";

const AFTER: &str = "Where bytes come from and go to (SRC, SINK):
  FILE                  a tlog or raw MAVLink bytes, told apart by what is in it
  -                     standard input or output
  udpin:ADDR:PORT       a UDP port of this PC that others send to, e.g. udpin:0.0.0.0:14550
  udpout:ADDR:PORT      a UDP port of another machine
  tcp:ADDR:PORT         a TCP server
  serial:DEVICE:BAUD    a serial port, e.g. serial:/dev/ttyUSB0:921600

Examples:
  hums flight.tlog                                   the faults of a flight: the same as hums check flight.tlog
  hums sim flight.tlog --sd card.img                 record a flight onto an SD card image
  hums info --list card.img                          the flights on a card, a line each
  hums info card.img --session 00001                 all facts about one of them
  hums decode card.img -o out --format tlog,csv              a card's logs for other tools
  hums live udpin:0.0.0.0:14550 --open               a live page of the vehicle in the browser

Exit codes: 0 done; 1 failed; 2 usage; 3 done, but the log has losses or damage (all that could be read was read);
4 done, and `hums check` found something wrong with the vehicle, also in a damaged log.
Results go to standard output, everything else to standard error. Colours are for terminals only, and NO_COLOR=1 turns them off.";

const USAGE: &str = "hums FILE...\n       hums <COMMAND>";

pub(crate) const PROGRAM: &str = concat!("hums ", env!("HUMS_VERSION"));

/// The whole command line.
#[derive(Debug, Parser)]
#[command(name = "hums", version = env!("HUMS_VERSION"), about = ABOUT, after_help = AFTER, override_usage = USAGE, max_term_width = 110)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Find the faults of a flight in a log of an autopilot, a ground station or the box
    Check(Check),
    /// Write a page about a flight: plots, map, findings, usage, trend; one HTML file, no network
    Report(Report),
    /// Show a vehicle live in the browser, from a link, a recording or a log
    Live(Live),
    /// Turn logs into files for other tools: tlog, CSV, JSON lines, Parquet, MCAP, ULog, KML and others
    Decode(Decode),
    /// Copy a log for publication: places and times are moved, names, numbers and secrets removed
    Share(Share),
    /// Show the contents of a log: sessions, vehicle, frames, gaps, findings, usage, sizes
    Info(Info),
    /// List the parts that are due, with limit and remaining life, and the hours of each vehicle
    Due(Due),
    /// Write a logbook of flights, batteries and parts with their defects: a page, CSV, or JSON of GUTMA
    Logbook(Logbook),
    /// Merge a fleet's Parquet files into few large ones; may be stopped and started again at any time
    Compact(Compact),
    /// Run the firmware's pipeline on this PC: bytes in at the autopilot UART, an SD card image out
    Sim(Box<Sim>),
    /// Set up the box, and talk with it over MAVLink: its logs, its parameters, its card
    Box(BoxArgs),
    /// Print a script for a shell, which completes commands, flags and file names
    #[command(hide = true)]
    Completions(Completions),
    /// Print the manual page of the program or of one command
    #[command(hide = true)]
    Man(Man),
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    fn without_redirection(line: &str) -> &str {
        line.split(['|', '>']).next().unwrap_or_default().trim_end()
    }

    #[test]
    fn files_flags_and_standard_input_without_a_command_are_checked() {
        for words in ["-", "-- f", "-v f", "--json f", "a/b", "f.bin --json"] {
            let words = std::iter::once("hums").chain(words.split(' ')).map(Into::into);
            let cli = Cli::try_parse_from(crate::with_command(words.collect()));
            assert!(matches!(cli, Ok(Cli { command: Command::Check(_) })), "{cli:?}");
        }
    }

    #[test]
    fn every_example_of_every_help_is_a_command_line() {
        let mut examples = 0;
        let mut root = Cli::command();
        let helps: Vec<String> = std::iter::once(root.render_long_help().to_string())
            .chain(Cli::command().get_subcommands_mut().map(|command| command.render_long_help().to_string()))
            .collect();
        for help in &helps {
            assert!(help.contains("Examples:"), "{help}");
            for line in help.lines().filter_map(|line| line.strip_prefix("  hums ")) {
                // A remark stands after three spaces.
                let line = line.split("   ").next().unwrap_or_default();
                let line = without_redirection(line);
                let words = std::iter::once("hums").chain(line.split_whitespace()).map(Into::into);
                let words = crate::with_command(words.collect());
                assert!(Cli::try_parse_from(words).is_ok(), "hums {line}");
                examples += 1;
            }
        }
        assert!(examples >= 20, "{examples} examples");
    }

    #[test]
    fn every_command_of_the_documents_is_a_command_line() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let documents = std::fs::read_dir(root.join("docs")).expect("the documents");
        let mut paths: Vec<_> = documents.map(|entry| entry.expect("a document").path()).collect();
        paths.push(root.join("README.md"));
        let mut commands = 0;
        for path in paths.iter().filter(|path| path.extension().is_some_and(|extension| extension == "md")) {
            let text = std::fs::read_to_string(path).expect("a document");
            for line in text.lines().map(|line| line.trim_start_matches("target/release/")) {
                let Some(line) = line.strip_prefix("hums ") else { continue };
                // Commands stand in one column, remarks in the next.
                let (name, arguments) = line.split_once(' ').unwrap_or((line, ""));
                let arguments = arguments.trim_start().split("   ").next().unwrap_or_default();
                let line = format!("{name} {}", without_redirection(arguments));
                let words = std::iter::once("hums").chain(line.split_whitespace()).map(Into::into);
                let words = crate::with_command(words.collect());
                let parsed = Cli::try_parse_from(words);
                assert!(parsed.is_ok(), "{}: hums {line}: {parsed:?}", path.display());
                commands += 1;
            }
        }
        assert!(commands >= 20, "{commands} commands");
    }

    #[test]
    fn the_definition_of_the_command_line_is_sound() {
        Cli::command().debug_assert();
    }
}
