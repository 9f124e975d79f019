//! The commands that read logs: `hums info`, `hums due`, `hums report`.

use std::path::PathBuf;

use clap::Args;

use crate::decode::args::input;
use crate::report;
use crate::report::tiles::Tiles;

const INFO_EXAMPLES: &str = "Examples:
  hums info card.img
  hums info card.img --session 00001
  hums info flight.tlog
  hums info --json 00001_00.HUM
  hums info --list cards/ flight.tlog
  hums info --verify card.img
  hums info --verify -v card.img
  hums info --verify --manifest card.txt card.img

--list: a line a log, in the order in which they began: date, length, time in the air, size, worst finding.
--verify: the file system's structures, each sector's checksum and number, each group's decoding, each frame's checksum, the order
of times, and where each log ends.
Exit code 3: a log has losses or damage.";

/// `hums info`
#[derive(Args, Clone, Debug)]
#[command(after_help = INFO_EXAMPLES)]
#[expect(clippy::struct_excessive_bools, reason = "flags of a command line")]
pub struct Info {
    /// Logs, card images, recordings of any kind that `hums check` reads, or directories with such
    #[arg(required = true, value_name = "LOG|IMAGE|DIR", value_parser = input())]
    pub inputs: Vec<PathBuf>,
    /// Print a line a log: date, length, time in the air, size, worst finding
    #[arg(long)]
    pub list: bool,
    /// Verify HUMS logs and cards: checksums, order, ends; a line for each log, and its failed checks
    #[arg(long, conflicts_with_all = ["list", "session", "system"])]
    pub verify: bool,
    /// With --verify: print all checks of each log, not only failed ones
    #[arg(long, short)]
    pub verbose: bool,
    /// As --verify, and write a manifest of the files read: SHA-256, repairs, losses; as JSON if FILE ends in .json
    #[arg(long, value_name = "FILE")]
    pub manifest: Option<PathBuf>,
    /// Only this session, by the name that `hums info --list` prints
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// MAVLink system id of the vehicle, if a recording has several
    #[arg(long, value_name = "ID")]
    pub system: Option<u8>,
    /// Search every block of an image for deleted logs and remains of overwritten ones
    #[arg(long)]
    pub salvage: bool,
    /// Print the result as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

const DUE_EXAMPLES: &str = "Examples:
  hums due card.img
  hums due cards/ --json
  hums due flights/ --vehicle quad-7

A box counts what each of its parts runs (docs/usage.md). From logs without a box come the hours and flights of each vehicle.
Logs belong to one vehicle if the autopilot's unique id is the same. Logs without an id belong to the vehicle of their folder.
Exit code 4: a part is due.";

/// `hums due`
#[derive(Args, Clone, Debug)]
#[command(after_help = DUE_EXAMPLES)]
pub struct Due {
    /// Cards, card images, logs, recordings, or directories with such
    #[arg(required = true, value_name = "CARD|LOG|DIR", value_parser = input())]
    pub inputs: Vec<PathBuf>,
    /// Name of the vehicle for logs without a unique id of the autopilot
    #[arg(long, value_name = "NAME")]
    pub vehicle: Option<String>,
    /// Print the result as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

const REPORT_EXAMPLES: &str = "Examples:
  hums report flight.tlog
  hums report card.img -o report.html
  hums report card.img -o pages/
  hums report card.img --session 00001 -o report.html
  hums report before.tlog after.tlog --compare -o both.html
  hums report fleet

Without -o the page of flight.tlog is flight.html, beside it. With a directory for -o each session gets a page, named after log, box and session, and index.html is a table of them; otherwise only the
newest session gets a page. The folder of hums decode --format parquet gets one page about its vehicles, fleet.html beside it. A page compares with the sessions before on the same card, and the parameters with those of the airframe's last flight.";

/// `hums report`
#[derive(Args, Clone, Debug)]
#[command(after_help = REPORT_EXAMPLES, override_usage = "hums report [OPTIONS] <LOG|IMAGE|DIR>... [-o <OUT>]")]
pub struct Report {
    /// Logs, card images, recordings of any kind that `hums check` reads, or directories with such
    #[arg(required = true, value_name = "LOG|IMAGE|DIR", value_parser = input())]
    pub inputs: Vec<PathBuf>,
    /// The page to write, or a directory for a page a session; without it a page beside the input
    #[arg(short, long, value_name = "OUT")]
    pub output: Option<PathBuf>,
    /// Only this session, by the name that `hums info --list` prints
    #[arg(long, value_name = "NAME")]
    pub session: Option<String>,
    /// Show the newest flight and up to ten before it side by side on one page; with a directory such a page for each airframe too
    #[arg(long)]
    pub compare: bool,
    /// MAVLink system id of the vehicle, if a recording has several
    #[arg(long, value_name = "ID")]
    pub system: Option<u8>,
    /// Show map tiles of this server under the track: an address with {z}, {x} and {y}; without it a page asks no server
    #[arg(long, value_name = "URL")]
    pub map: Option<Tiles>,
    /// Overwrite outputs that exist
    #[arg(long)]
    pub force: bool,
    /// Print the result as one JSON object (docs/json.md)
    #[arg(long)]
    pub json: bool,
}

impl Report {
    /// The request to the report.
    pub fn request(&self) -> report::Request<'_> {
        report::Request {
            inputs: &self.inputs,
            output: self.output.as_deref(),
            session: self.session.as_deref(),
            compare: self.compare,
            system: self.system,
            map: self.map.as_ref(),
            force: self.force,
            json: self.json,
        }
    }
}
