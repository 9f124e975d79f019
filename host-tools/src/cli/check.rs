//! `hums check`: what is wrong with a flight.

use std::path::PathBuf;

use clap::Args;

use crate::check;
use crate::decode::args::input;

const EXAMPLES: &str = "Examples:
  hums flight.tlog
  hums check flight.tlog -v
  hums check --json flight.tlog
  hums check cards/
  hums check card.img --session 00001
  hums check --params hums.param flight.tlog card.img
  hums check --past flights/may flights/june.bin

Reads a ground station's tlog, raw MAVLink, ArduPilot's logs (.bin, .log), PX4's logs (.ulg), each also as .gz, logs of
HUMS, cards and their images; told apart by what is in them. The checks and their limits are those of the monitor on
board. A log of HUMS is shown with what the monitor on board found, unless --params or --past asks for another judgement.
`hums FILE...` is `hums check FILE...`.
Exit codes: 4 a finding (a warning or worse), also in a damaged log; 3 no finding, but the log has losses, damage or an end that is not
proved; 0 nothing wrong in the checks that had data, also if they were too few to judge; 1 failed; 2 usage.
Of several logs the first of 1, 4, 3, 0 that applies to one of them.";

/// `hums check`
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Check {
    /// Recordings, logs, cards, images, or directories with such; `-` is standard input
    #[arg(required = true, value_name = "LOG", value_parser = input())]
    pub inputs: Vec<PathBuf>,
    /// Limits in place of the defaults: a parameter file, as a ground station writes it
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// Earlier flights of the same vehicle without faults, three or more: the baseline of trends. May be given several times
    #[arg(long, value_name = "LOG", value_parser = input())]
    pub past: Vec<PathBuf>,
    /// Only this session of a card or folder, by the name that `hums info --list` prints
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// MAVLink system id of the vehicle, if a recording has several
    #[arg(long, value_name = "ID")]
    pub system: Option<u8>,
    /// Search every block of an image for deleted logs and remains of overwritten ones
    #[arg(long)]
    pub salvage: bool,
    /// List the checks that were not judged, each with the reason
    #[arg(long, short)]
    pub verbose: bool,
    /// Print a line with a JSON object for each log (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

impl Check {
    /// The request to the analysis.
    pub fn request(&self) -> check::Request<'_> {
        check::Request {
            inputs: &self.inputs,
            params: self.params.as_deref(),
            past: &self.past,
            session: self.session.as_deref(),
            system: self.system,
            salvage: self.salvage,
            verbose: self.verbose,
            json: self.json,
        }
    }
}
